//! ẋ = f(x, u), equation (9), and its derivatives.
//!
//! The links' accelerations a solve `A a = −(c + g) + τ` with A = M(q) + b of the rigid joints and τ the torques of drives, laws and passive
//! joints. Their derivatives follow from the implicit function: `A ∂a = −∂(M a + c + g) + ∂τ` at fixed a, so only the cheap right side is
//! differentiated, never the solution of the linear system.
//!
//! One drive with its laws depends on a dozen local variables ([`lanes`](super::drive::lanes)); their derivatives are scattered to state components and
//! coordinates.

use super::drive::lanes::{BASE, COEFFICIENTS, Drives, FEW_VARIABLES, MOST_VARIABLES, OWN, SOME_VARIABLES, VOLTS};
use super::drive::{Action, Coefficients, JointLaw};
use super::inertia::Inertia;
use super::law::{FEW, MANY, SOME};
use super::laws::OfJoint;
use super::links::WeightedLinks;
use super::relaxation::Relaxation;
use super::sensor::SensorFrame;
use super::{Input, Model};
use crate::robot::chain::{Lanes, MAX_JOINTS};
use crate::robot::{Friction, Side, Transmission};

/// Derivatives of coefficients by coordinates are taken this many at a time.
const LANES: usize = 8;
type Duals = Lanes<LANES>;

/// Parts of a step at most, each as dear as a whole one; friction that is steeper still is smeared.
pub const MOST_PARTS: usize = 16;

/// Friction whose rate near rest comes to no more over a step leaves steps whole, and fast kernels at work. What it does in a step changes the argument of its
/// smoothed sign by no more than that; of a step that a drive forces across a reversal, which is the worst, a Runge-Kutta step has it to a third.
pub const WHOLE: f64 = 0.5;

/// A model at given parameters.
#[derive(Debug, Clone)]
pub struct Dynamics<'m> {
    pub(super) model: &'m Model,
    pub(super) coefficients: Vec<Coefficients<f64>>,
    /// For each joint: (coefficient, coordinate, ∂coefficient/∂coordinate).
    pub(super) slopes: Vec<Vec<(usize, usize, f64)>>,
    pub(super) speed_of: Vec<Option<usize>>,
    pub(super) z: Vec<f64>,
    pub(super) passive: Vec<Passive>,
    links: WeightedLinks<'m>,
    /// Of the joints that rub.
    rubbing: Vec<Rubbing>,
    pub(super) laws: Vec<Vec<JointLaw<'m>>>,
}

/// The spring and the damper of a passive joint: τ = −k φ − d φ̇.
#[derive(Debug, Clone, Copy)]
pub(super) struct Passive {
    /// Joint of the chain.
    pub joint: usize,
    pub stiffness: f64,
    pub damping: f64,
    /// The coordinates that are ln k and ln d.
    pub coordinates: [usize; 2],
}

/// A joint whose speed friction's smoothed sign slows down.
#[derive(Debug, Clone, Copy)]
struct Rubbing {
    /// Component of the state.
    speed: usize,
    /// κ/2 of tanh(κ v/2), s/rad.
    half_slope_s: f64,
    /// The rate at which it takes a speed near rest, κ μ / 2 over the inertia, 1/s.
    per_s: f64,
}

/// f and its derivatives at one point.
#[derive(Debug, Clone, Default)]
pub struct Linear {
    /// f, one value a state component.
    pub xdot: Vec<f64>,
    /// `[∂f/∂x | ∂f/∂z]`, size × (size + coordinates), row-major.
    pub slopes: Vec<f64>,
    /// ∂U/∂(x, z) of the supply voltage, where a law changes it.
    supply: Vec<f64>,
    frame: SensorFrame,
}

/// What the links are at one state, whatever drives and laws do.
#[derive(Debug, Clone, PartialEq)]
pub struct LinksAt {
    /// M, m × m by rows.
    mass: [f64; MAX_JOINTS * MAX_JOINTS],
    /// c + g.
    bias: [f64; MAX_JOINTS],
}

impl Default for LinksAt {
    fn default() -> Self {
        LinksAt { mass: [0.0; MAX_JOINTS * MAX_JOINTS], bias: [0.0; MAX_JOINTS] }
    }
}

/// The torques on the links besides gravity and speeds, and what rigid joints add to the inertia.
struct Torques {
    right: [f64; MAX_JOINTS],
    rigid_inertia: [f64; MAX_JOINTS],
}

impl<'m> Dynamics<'m> {
    pub(super) fn new(model: &'m Model, z: &[f64]) -> Self {
        let drives = || model.drives.iter().zip(&model.transmissions);
        let coefficients: Vec<_> = drives().map(|(drive, &t)| drive.coefficients(z, t)).collect();
        let mut slopes = vec![Vec::new(); model.drives.len()];
        for first in (0..z.len()).step_by(LANES) {
            let duals: Vec<Duals> = z.iter().enumerate().map(|(i, &z)| seeded(z, i.wrapping_sub(first))).collect();
            for ((drive, &t), slopes) in drives().zip(&mut slopes) {
                for (c, value) in drive.coefficients(&duals, t).to_array().into_iter().enumerate() {
                    for (lane, slope) in value.slope.into_iter().enumerate() {
                        if slope != 0.0 {
                            slopes.push((c, first + lane, slope));
                        }
                    }
                }
            }
        }
        let passive = model.laws.passive.iter().map(|&(joint, k, d)| Passive {
            joint,
            stiffness: z[k].exp(),
            damping: z[d].exp(),
            coordinates: [k, d],
        });
        let links = model.links.at(z);
        let rubbing = rubbing(model, z, &coefficients, &links);
        Dynamics {
            model,
            coefficients,
            slopes,
            speed_of: model.layout.speed_of(),
            z: z.to_vec(),
            passive: passive.collect(),
            links,
            rubbing,
            laws: model.laws.ready(),
        }
    }

    /// Number of state components.
    pub fn size(&self) -> usize {
        self.model.layout.size()
    }

    /// The joints that rub: component of their speed, κ/2 in s/rad, and the rate at which friction takes a speed near rest, 1/s.
    pub fn rubbing(&self) -> impl Iterator<Item = (usize, f64, f64)> + '_ {
        self.rubbing.iter().map(|joint| (joint.speed, joint.half_slope_s, joint.per_s))
    }

    /// Parts of a step of this length in which a joint that rubs comes to rest; one where no step is divided.
    pub(super) fn parts_near_rest(&self, duration_s: f64) -> usize {
        let rate = self.rubbing.iter().map(|joint| joint.per_s).fold(0.0, f64::max) * duration_s;
        if rate <= WHOLE { 1 } else { parts(rate).max(2) }
    }

    /// Parts in which a step from `x`, whose speeds change as ẋ says, is integrated. No part is longer than the time in which friction's smoothed sign, as steep
    /// as it is at the least speed of the step, would stop a joint; nor does the argument of that sign change by more than one in a part, where the step
    /// comes near a reversal. Under both a Runge-Kutta part has friction's impulse to 0.2 % of μ T, and another number of parts changes the state by no
    /// more: with too few, a search meets a jump of the cost where the number changes, and no step of it gets across. A power of two, so that it meets few changes.
    pub(super) fn parts_of_step(&self, x: &[f64], xdot: &[f64], duration_s: f64) -> usize {
        let needed = |joint: &Rubbing| {
            let change = duration_s * xdot[joint.speed];
            let (begin, end) = (x[joint.speed], x[joint.speed] + change);
            let least = if begin * end > 0.0 { begin.abs().min(end.abs()) } else { 0.0 };
            let sech = (joint.half_slope_s * least).cosh().recip();
            (joint.per_s * duration_s * sech * sech).max(joint.half_slope_s * change.abs() * sech)
        };
        parts(self.rubbing.iter().map(needed).fold(0.0, f64::max))
    }

    /// Columns of [`Linear::slopes`]: state components, then coordinates.
    pub fn columns(&self) -> usize {
        self.size() + self.model.coordinates.len()
    }

    /// f(x, u).
    pub fn derivative<'i>(&self, x: &[f64], input: impl Into<Input<'i>>, xdot: &mut [f64]) {
        self.derivative_with(x, input, &self.links_at(x), xdot);
    }

    /// The links at a state.
    #[inline(always)]
    pub fn links_at(&self, x: &[f64]) -> LinksAt {
        let m = self.model.layout.chain();
        let (q, qd) = (&x[..m], &x[m..2 * m]);
        let mut links = LinksAt::default();
        self.links.mass_matrix(q, &mut links.mass[..m * m]);
        self.links.bias_torque(q, qd, &mut links.bias[..m]);
        links
    }

    /// Whether the links are those of other dynamics, whatever drives and laws do: then so is [`Self::links_at`].
    pub fn has_links_of(&self, other: &Dynamics<'_>) -> bool {
        self.links.equal(&other.links)
    }

    /// [`Self::derivative`] where the links at the state are known.
    pub fn derivative_with<'i>(&self, x: &[f64], input: impl Into<Input<'i>>, links: &LinksAt, xdot: &mut [f64]) {
        let input = input.into();
        let m = self.model.layout.chain();
        let (q, qd) = (&x[..m], &x[m..2 * m]);
        let mut torques = self.torques(x, &input, &links.bias, xdot);
        links.inertia(m, &torques.rigid_inertia).solve(m, &mut torques.right);
        xdot[..m].copy_from_slice(qd);
        xdot[m..2 * m].copy_from_slice(&torques.right[..m]);
        if !self.model.laws.lags.is_empty() {
            let mut rates = [[0.0; 3]; MAX_JOINTS];
            self.model.chain().body_rates(q, qd, &mut rates[..m]);
            for lag in &self.model.laws.lags {
                let per_s = (-self.z[lag.coordinate]).exp();
                for axis in 0..3 {
                    xdot[lag.state + axis] = per_s * (rates[lag.body][axis] - x[lag.state + axis]);
                }
            }
        }
    }

    /// What the links' torques miss of what these accelerations of the chain need, `A a + c + g − τ`: zero along the model's own motion.
    pub fn missing_torque<'i>(&self, x: &[f64], input: impl Into<Input<'i>>, acceleration: &[f64], out: &mut [f64]) {
        let mut needed = [0.0; MAX_JOINTS];
        let needed = &mut needed[..self.model.layout.chain()];
        self.needed_torque(x, acceleration, needed);
        self.missing_of(needed, (x, input.into()), acceleration, out);
    }

    /// The torques that the links need for these accelerations of the chain, `M a + c + g`, whatever drives and laws do.
    pub fn needed_torque(&self, x: &[f64], acceleration: &[f64], out: &mut [f64]) {
        let m = self.model.layout.chain();
        let links = self.links_at(x);
        for (i, out) in out[..m].iter_mut().enumerate() {
            let by_mass: f64 = links.mass[i * m..(i + 1) * m].iter().zip(acceleration).map(|(mass, a)| mass * a).sum();
            *out = by_mass + links.bias[i];
        }
    }

    /// [`Self::missing_torque`] where [`Self::needed_torque`] is known.
    pub fn missing_of(&self, needed: &[f64], (x, input): (&[f64], Input<'_>), acceleration: &[f64], out: &mut [f64]) {
        let mut xdot = vec![0.0; x.len()];
        let torques = self.torques(x, &input, needed, &mut xdot);
        for (i, out) in out[..needed.len()].iter_mut().enumerate() {
            *out = torques.rigid_inertia[i] * acceleration[i] - torques.right[i];
        }
    }

    /// The torques on the links besides `bias`; θ̇, θ̈ and the rates of the laws' own states go into `xdot`.
    fn torques(&self, x: &[f64], input: &Input<'_>, bias: &[f64], xdot: &mut [f64]) -> Torques {
        let layout = &self.model.layout;
        let (n, m) = (layout.joints(), layout.chain());
        let mut torques = self.passive(&x[..m], &x[m..2 * m], bias);
        let volts = self.supply(x, input).map_or(self.model.drives[0].input_scale, |volts| volts.re);
        for i in 0..n {
            let mut rates = [0.0; MOST_VARIABLES];
            let action = self.act(i, x, input, volts, &mut rates);
            for (state, rate) in self.model.laws.own_states(i).iter().zip(rates) {
                xdot[*state] = rate;
            }
            torques.take(self, i, &action, xdot);
            if layout.is_elastic(i) {
                xdot[layout.theta(i)] = x[layout.thetad(i)];
            }
        }
        torques
    }

    /// f and its derivatives by state and coordinates.
    pub fn linearise<'i>(&self, x: &[f64], input: impl Into<Input<'i>>, out: &mut Linear) {
        let input = input.into();
        match self.model.laws.most_variables() {
            0 if self.model.laws.is_empty() => self.linearise_by::<BASE, 0>(x, &input, out),
            0..=FEW_VARIABLES => self.linearise_by::<FEW, FEW_VARIABLES>(x, &input, out),
            n if n <= SOME_VARIABLES => self.linearise_by::<SOME, SOME_VARIABLES>(x, &input, out),
            _ => self.linearise_by::<MANY, MOST_VARIABLES>(x, &input, out),
        }
    }

    /// By N lanes, of which V are the laws' own.
    fn linearise_by<const N: usize, const V: usize>(&self, x: &[f64], input: &Input<'_>, out: &mut Linear)
    where
        Self: Drives<N, V>,
    {
        let layout = &self.model.layout;
        let (n, m, size, columns) = (layout.joints(), layout.chain(), self.size(), self.columns());
        out.xdot.resize(size, 0.0);
        out.slopes.clear();
        out.slopes.resize(size * columns, 0.0);
        let (q, qd) = (&x[..m], &x[m..2 * m]);
        let links = self.links_at(x);
        let mut torques = self.passive(q, qd, &links.bias);
        let mut volts = self.model.drives[0].input_scale;
        if let Some(supply) = self.supply(x, input) {
            volts = supply.re;
            self.supply_slopes(x, input, &supply, &mut out.supply);
        }
        let mut local = [[0.0; N]; MAX_JOINTS];
        let mut rigid = [[0.0; N]; MAX_JOINTS];
        for i in 0..n {
            let mut rates = [Lanes::from(0.0); V];
            let action = self.drive(i, x, input, volts, &mut rates);
            let plain = Action { link_torque: action.link_torque.re, motor: action.motor.re };
            torques.take(self, i, &plain, &mut out.xdot);
            local[i] = action.link_torque.slope;
            if layout.is_elastic(i) {
                out.xdot[layout.theta(i)] = x[layout.thetad(i)];
                out.slopes[layout.theta(i) * columns + layout.thetad(i)] = 1.0;
                let row = &mut out.slopes[layout.thetad(i) * columns..][..columns];
                self.scatter(i, &action.motor.slope, &out.supply, |column, slope| row[column] += slope);
            } else {
                rigid[i] = action.motor.slope;
            }
            for (state, rate) in self.model.laws.own_states(i).iter().zip(rates) {
                out.xdot[*state] = rate.re;
                let row = &mut out.slopes[state * columns..][..columns];
                self.scatter(i, &rate.slope, &out.supply, |column, slope| row[column] += slope);
            }
        }
        let inertia = links.inertia(m, &torques.rigid_inertia);
        inertia.solve(m, &mut torques.right);
        let acceleration = &torques.right[..m];
        out.xdot[..m].copy_from_slice(qd);
        out.xdot[m..2 * m].copy_from_slice(acceleration);

        // −∂(M a + c + g) + ∂τ at fixed a, then A⁻¹ of it, in place of the q̈ rows.
        let mut by_q = [0.0; MAX_JOINTS * MAX_JOINTS];
        let mut by_qd = [0.0; MAX_JOINTS * MAX_JOINTS];
        let (by_q, by_qd) = (&mut by_q[..m * m], &mut by_qd[..m * m]);
        let block = &mut out.slopes[m * columns..2 * m * columns];
        self.links.derivatives([q, qd, acceleration], by_q, by_qd, |joint, coordinate, slope| {
            block[joint * columns + size + coordinate] -= slope;
        });
        for (i, row) in block.chunks_exact_mut(columns).enumerate() {
            for j in 0..m {
                row[j] -= by_q[i * m + j];
                row[m + j] -= by_qd[i * m + j];
            }
        }
        for i in 0..n {
            let link = layout.q(i);
            let mut torque = local[i];
            if !layout.is_elastic(i) {
                for (t, inertia) in torque.iter_mut().zip(rigid[i]) {
                    *t -= inertia * acceleration[link];
                }
            }
            let row = &mut block[link * columns..(link + 1) * columns];
            self.scatter(i, &torque, &out.supply, |column, slope| row[column] += slope);
        }
        for &Passive { joint: i, stiffness, damping, coordinates: [k, d] } in &self.passive {
            let row = &mut block[i * columns..(i + 1) * columns];
            row[i] -= stiffness;
            row[m + i] -= damping;
            row[size + k] -= stiffness * q[i];
            row[size + d] -= damping * qd[i];
        }
        inertia.solve_rows(m, block, columns);
        for i in 0..m {
            out.slopes[i * columns + m + i] = 1.0;
        }
        self.lag_slopes(x, out);
    }

    /// The states of gyros that lag behind their bodies, at the begin of a step from `x` by a method of so many stages.
    pub(super) fn relaxing(&self, x: &[f64], duration_s: f64, stages: usize, out: &mut Vec<Relaxation>) {
        out.clear();
        for lag in &self.model.laws.lags {
            let (column, time_constant_s) = (self.size() + lag.coordinate, self.z[lag.coordinate].exp());
            let states = lag.state..lag.state + 3;
            out.extend(states.map(|i| Relaxation::begin((i, column), time_constant_s, x[i], duration_s, stages)));
        }
    }

    /// The rates of these states.
    fn lag_slopes(&self, x: &[f64], out: &mut Linear) {
        let lags = &self.model.laws.lags;
        if lags.is_empty() {
            return;
        }
        let (m, size, columns) = (self.model.layout.chain(), self.size(), self.columns());
        out.frame.linearise(self.model.chain(), &x[..m], &x[m..2 * m]);
        for lag in lags {
            let per_s = (-self.z[lag.coordinate]).exp();
            for axis in 0..3 {
                let state = lag.state + axis;
                let rate = per_s * (out.frame.rate(lag.body)[axis] - x[state]);
                out.xdot[state] = rate;
                let row = &mut out.slopes[state * columns..][..columns];
                for (column, to) in row[..2 * m].iter_mut().enumerate() {
                    *to = per_s * out.frame.slope(lag.body, column)[axis];
                }
                row[state] = -per_s;
                row[size + lag.coordinate] = -rate;
            }
        }
    }

    /// Gives the derivatives of joint i's law, by its lanes, to `add`, each with its column among state and coordinates.
    #[inline(always)]
    pub(super) fn scatter<const N: usize>(
        &self,
        i: usize,
        gradient: &[f64; N],
        supply: &[f64],
        mut add: impl FnMut(usize, f64),
    ) {
        let layout = &self.model.layout;
        let size = self.size();
        let places = [layout.q(i), layout.qd(i), layout.theta(i), layout.thetad(i)];
        for (place, slope) in places.into_iter().zip(gradient) {
            add(place, *slope);
        }
        for &(coefficient, coordinate, slope) in &self.slopes[i] {
            add(size + coordinate, gradient[COEFFICIENTS + coefficient] * slope);
        }
        if N == BASE {
            return;
        }
        if self.model.laws.supply.is_some() {
            for (column, by) in supply.iter().enumerate() {
                add(column, gradient[VOLTS] * by);
            }
        }
        let OfJoint { parameters, states, .. } = self.model.laws.at(i);
        for (coordinate, slope) in parameters.iter().zip(&gradient[OWN..]) {
            add(size + coordinate, *slope);
        }
        for (state, slope) in states.iter().zip(&gradient[OWN + parameters.len()..]) {
            add(*state, *slope);
        }
    }

    /// −(c + g) and the passive joints' springs and dampers.
    fn passive(&self, q: &[f64], qd: &[f64], bias: &[f64]) -> Torques {
        let mut right = [0.0; MAX_JOINTS];
        right.iter_mut().zip(bias).for_each(|(right, bias)| *right = -bias);
        for &Passive { joint: i, stiffness, damping, .. } in &self.passive {
            right[i] -= stiffness * q[i] + damping * qd[i];
        }
        Torques { right, rigid_inertia: [0.0; MAX_JOINTS] }
    }

    pub(super) fn sides(&self, x: &[f64], i: usize) -> [f64; 4] {
        let layout = &self.model.layout;
        [x[layout.q(i)], x[layout.qd(i)], x[layout.theta(i)], x[layout.thetad(i)]]
    }
}

impl LinksAt {
    /// A = M + b of the rigid joints, factorised.
    #[inline(always)]
    fn inertia(&self, m: usize, rigid_inertia: &[f64; MAX_JOINTS]) -> Inertia {
        let mut matrix = [0.0; MAX_JOINTS * MAX_JOINTS];
        matrix[..m * m].copy_from_slice(&self.mass[..m * m]);
        for i in 0..m {
            matrix[i * m + i] += rigid_inertia[i];
        }
        Inertia::factorise(m, matrix)
    }
}

impl Torques {
    /// Adds what drive i does.
    fn take(&mut self, dynamics: &Dynamics<'_>, i: usize, action: &Action<f64>, xdot: &mut [f64]) {
        let layout = &dynamics.model.layout;
        let link = layout.q(i);
        self.right[link] += action.link_torque;
        if layout.is_elastic(i) {
            xdot[layout.thetad(i)] = action.motor;
        } else {
            self.rigid_inertia[link] = action.motor;
        }
    }
}

/// Parts of a step over which friction's rate comes to so much, up to [`MOST_PARTS`].
fn parts(rate_times_duration: f64) -> usize {
    let parts = rate_times_duration.min(MOST_PARTS as f64).ceil().max(1.0) as usize;
    parts.next_power_of_two()
}

/// The joints that rub.
fn rubbing(model: &Model, z: &[f64], coefficients: &[Coefficients<f64>], links: &WeightedLinks<'_>) -> Vec<Rubbing> {
    let (layout, m) = (&model.layout, model.layout.chain());
    let mut mass = [0.0; MAX_JOINTS * MAX_JOINTS];
    links.mass_matrix(&[0.0; MAX_JOINTS][..m], &mut mass[..m * m]);
    let of = |(i, c): (usize, &Coefficients<f64>)| {
        let Friction::Coulomb { slope_s, acts, .. } = model.drives[i].friction else { return None };
        let link = layout.q(i);
        let link_inertia = mass[link * m + link];
        let (inertia, speed) = match (model.transmissions[i], acts) {
            // An elastic drive's coefficients are divided by b.
            (Transmission::Elastic, Side::Motor) => (1.0, layout.thetad(i)),
            (Transmission::Elastic, Side::Link) => (link_inertia * c.inertia, layout.qd(i)),
            (Transmission::Rigid, _) => (link_inertia + c.inertia, layout.qd(i)),
        };
        let of_law = model.laws.friction_slope.get(i).copied().flatten();
        let half_slope_s = 0.5 * of_law.map_or(slope_s, |ln_slope| z[ln_slope].exp());
        Some(Rubbing { speed, half_slope_s, per_s: half_slope_s * c.coulomb / inertia })
    };
    // A negative inertia or friction on the way of a search has no rate that means anything.
    coefficients.iter().enumerate().filter_map(of).filter(|joint| joint.per_s.is_finite()).collect()
}

/// A dual number with a one in `lane` (none where the lane is out of range).
fn seeded(value: f64, lane: usize) -> Duals {
    let mut dual = Duals::from(value);
    if lane < LANES {
        dual.slope[lane] = 1.0;
    }
    dual
}
