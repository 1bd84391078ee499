//! The right-hand side ẋ = f(x, u) written down: the laws, drives and chains of the model run on [`Expression`]s in place of numbers.
//!
//! What stands here is how the parts go together, as in `dynamics`; a test holds both equal. The accelerations a solve `A a = τ − (c + g)` by the same
//! factorisation. They are [held](Expression::held), and with them goes `A a + c + g − τ` at these accelerations, so that derivatives follow from the implicit
//! function as the estimator's do: `A ∂a = −∂(A a + c + g − τ)` at fixed a.

use super::Model;
use super::drive::lanes::MOST_VARIABLES;
use super::drive::{JointLaws, Sides};
use super::number::expression::Expression;
use super::number::quantity::Quantity;
use crate::robot::Transmission;
use crate::robot::chain::MAX_JOINTS;

/// f(x, u) written down.
#[derive(Debug, Clone)]
pub struct TracedRates {
    /// One a state component.
    pub xdot: Vec<Expression>,
    /// q̈ of the chain, held: those in `xdot`.
    pub accelerations: Vec<Expression>,
    /// What the links' torques miss of what these accelerations need.
    pub missing: Vec<Expression>,
    /// Of the accelerations, from what is missing.
    pub inertia: TracedInertia,
}

/// The factor of A = M + b of the rigid joints.
#[derive(Debug, Clone)]
pub struct TracedInertia {
    m: usize,
    /// Lower triangle by rows, reciprocals on the diagonal.
    factor: Vec<Expression>,
}

impl TracedInertia {
    fn factorise(m: usize, mut a: Vec<Expression>) -> Self {
        for i in 0..m {
            for j in 0..=i {
                let mut sum = a[i * m + j];
                for k in 0..j {
                    sum -= a[i * m + k] * a[j * m + k];
                }
                a[i * m + j] = if i == j { sum.sqrt().recip() } else { sum * a[j * m + j] };
            }
        }
        TracedInertia { m, factor: a }
    }

    /// Solves A x = x in place.
    pub fn solve(&self, x: &mut [Expression]) {
        let (m, l) = (self.m, &self.factor);
        for i in 0..m {
            for k in 0..i {
                x[i] -= l[i * m + k] * x[k];
            }
            x[i] = x[i] * l[i * m + i];
        }
        for i in (0..m).rev() {
            for k in i + 1..m {
                x[i] -= l[k * m + i] * x[k];
            }
            x[i] = x[i] * l[i * m + i];
        }
    }
}

impl Model {
    /// f at the state `x`, inputs `u` as they act, time and coordinates `z`.
    pub fn traced_rates(
        &self,
        x: &[Expression],
        u: &[Expression],
        time_s: Expression,
        z: &[Expression],
    ) -> TracedRates {
        let (layout, zero) = (&self.layout, Expression::from(0.0));
        let (n, m) = (layout.joints(), layout.chain());
        let (q, qd) = (&x[..m], &x[m..2 * m]);
        let mut xdot = vec![zero; layout.size()];
        // What pushes the links besides the torques of the speeds and of gravity.
        let mut torques = vec![zero; m];
        for &(joint, stiffness, damping) in &self.laws.passive {
            torques[joint] = -(z[stiffness].exp() * q[joint] + z[damping].exp() * qd[joint]);
        }
        let mut rigid_inertia = vec![zero; m];
        let volts = self.traced_supply(x, u, z);
        let laws = self.laws.ready();
        for i in 0..n {
            let (drive, transmission) = (&self.drives[i], self.transmissions[i]);
            let coefficients = drive.coefficients(z, transmission);
            let [q, qd, theta, thetad] =
                [layout.q(i), layout.qd(i), layout.theta(i), layout.thetad(i)].map(|place| x[place]);
            let error = layout.input(i).map_or(zero, |error| x[error]);
            let sides = Sides { q, qd, theta, thetad, u: u[i] + error };
            let action = if self.laws.is_empty() {
                match transmission {
                    Transmission::Elastic => drive.elastic(&coefficients, &sides),
                    Transmission::Rigid => drive.rigid(&coefficients, &sides),
                }
            } else {
                let of = self.laws.at(i);
                let parameters: Vec<_> = of.parameters.iter().map(|coordinate| z[*coordinate]).collect();
                let states: Vec<_> = of.states.iter().map(|state| x[*state]).collect();
                let mut rates = [zero; MOST_VARIABLES];
                let joint = JointLaws { joint: i, time_s, laws: &laws[i], parameters: &parameters, states: &states };
                let action = drive.with_laws(transmission, &coefficients, &sides, volts, &joint, &mut rates);
                for (state, rate) in of.states.iter().zip(rates) {
                    xdot[*state] = rate;
                }
                action
            };
            torques[layout.q(i)] += action.link_torque;
            if layout.is_elastic(i) {
                xdot[layout.theta(i)] = thetad;
                xdot[layout.thetad(i)] = action.motor;
            } else {
                rigid_inertia[layout.q(i)] = action.motor;
            }
        }
        let weights = self.links.traced_weights(z);
        let mut mass = self.links.traced_sum(&weights, m * m, |chain, out| chain.mass_matrix(q, out));
        let bias = self.links.traced_sum(&weights, m, |chain, out| chain.bias_torque(q, qd, out));
        for (i, inertia) in rigid_inertia.iter().enumerate() {
            mass[i * m + i] += *inertia;
        }
        let inertia = TracedInertia::factorise(m, mass);
        let mut accelerations: Vec<_> = torques.iter().zip(&bias).map(|(torque, bias)| *torque - *bias).collect();
        inertia.solve(&mut accelerations);
        let accelerations: Vec<_> = accelerations.into_iter().map(Expression::held).collect();
        let mut missing =
            self.links.traced_sum(&weights, m, |chain, out| chain.link_torque(q, qd, &accelerations, out));
        for (i, missing) in missing.iter_mut().enumerate() {
            *missing = *missing + rigid_inertia[i] * accelerations[i] - torques[i];
        }
        xdot[..m].copy_from_slice(qd);
        xdot[m..2 * m].copy_from_slice(&accelerations);
        self.traced_lags(x, z, &mut xdot);
        TracedRates { xdot, accelerations, missing, inertia }
    }

    /// Angular rates of the links that carry the robot's bodies, in the bodies' axes.
    pub fn traced_body_rates(&self, x: &[Expression]) -> Vec<[Expression; 3]> {
        let m = self.layout.chain();
        let mut rates = [[Expression::from(0.0); 3]; MAX_JOINTS];
        self.chain().body_rates(&x[..m], &x[m..2 * m], &mut rates[..m]);
        self.bodies.iter().map(|link| rates[*link]).collect()
    }

    /// The states of gyros that lag behind their bodies: the first state, and the coordinate that is ln T.
    pub fn lags(&self) -> impl Iterator<Item = (usize, usize)> + '_ {
        self.laws.lags.iter().map(|lag| (lag.state, lag.coordinate))
    }

    fn traced_lags(&self, x: &[Expression], z: &[Expression], xdot: &mut [Expression]) {
        if self.laws.lags.is_empty() {
            return;
        }
        let m = self.layout.chain();
        let mut rates = [[Expression::from(0.0); 3]; MAX_JOINTS];
        self.chain().body_rates(&x[..m], &x[m..2 * m], &mut rates[..m]);
        for lag in &self.laws.lags {
            let per_s = (-z[lag.coordinate]).exp();
            for axis in 0..3 {
                xdot[lag.state + axis] = per_s * (rates[lag.body][axis] - x[lag.state + axis]);
            }
        }
    }

    /// What one unit of input is worth: the supply voltage where a law changes it.
    fn traced_supply(&self, x: &[Expression], u: &[Expression], z: &[Expression]) -> Expression {
        let full = self.drives[0].input_scale;
        let Some((law, coordinate)) = self.laws.supply else { return Expression::from(full) };
        let (mut a, mut e) = (Expression::from(0.0), Expression::from(0.0));
        for (i, u) in u.iter().enumerate() {
            let c = self.drives[i].coefficients(z, self.transmissions[i]);
            let physical = |value: Expression| match self.transmissions[i] {
                Transmission::Elastic => value.over(c.inertia),
                Transmission::Rigid => value,
            };
            a += physical(c.torque_constant) * *u * *u;
            e += physical(c.back_emf) * *u * x[self.layout.thetad(i)];
        }
        self.laws()[law].supply_traced(full, a, e, z[coordinate]).unwrap_or_else(Expression::unknown)
    }
}
