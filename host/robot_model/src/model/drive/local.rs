//! The derivatives of one drive with its laws by its local variables, see [`lanes`](super::lanes).

use super::lanes::{BASE, COEFFICIENTS, Drives, FEW_VARIABLES, MOST_VARIABLES, OWN, Output, SOME_VARIABLES, VOLTS};
use super::{Action, Coefficients, JointLaws, Sides};
use crate::model::Input;
use crate::model::dynamics::Dynamics;
use crate::model::law::{Asked, FEW, MANY, SOME};
use crate::model::number::quantity::variable;
use crate::robot::Transmission;
use crate::robot::chain::Lanes;
use solve::simd::compiled_for_this_machine;

impl Drives<BASE, 0> for Dynamics<'_> {
    fn drive(
        &self,
        i: usize,
        x: &[f64],
        input: &Input<'_>,
        _volts: f64,
        _rates: &mut [Lanes<BASE>; 0],
    ) -> Action<Lanes<BASE>> {
        let (sides, coefficients) = self.variables(x, Lanes::from(input.u[i]), i);
        match self.model.transmissions[i] {
            Transmission::Elastic => self.model.drives[i].elastic(&coefficients, &sides),
            Transmission::Rigid => self.model.drives[i].rigid(&coefficients, &sides),
        }
    }
}

/// Of drives with laws, by so many lanes for so many variables of theirs.
macro_rules! drives_with_laws {
    ($($lanes:ident for $variables:ident),*) => {$(
        impl Drives<$lanes, $variables> for Dynamics<'_> {
            fn drive(
                &self,
                i: usize,
                x: &[f64],
                input: &Input<'_>,
                volts: f64,
                rates: &mut [Lanes<$lanes>; $variables],
            ) -> Action<Lanes<$lanes>> {
                compiled_for_this_machine(
                    #[inline(always)]
                    || self.with_laws(i, x, input, volts, rates),
                )
            }
        }
    )*};
}
drives_with_laws!(FEW for FEW_VARIABLES, SOME for SOME_VARIABLES, MANY for MOST_VARIABLES);

impl Dynamics<'_> {
    /// The action of drive i at a state, its laws' own states' rates into `rates`.
    pub(in crate::model) fn act(
        &self,
        i: usize,
        x: &[f64],
        input: &Input<'_>,
        volts: f64,
        rates: &mut [f64],
    ) -> Action<f64> {
        let ([q, qd, theta, thetad], c) = (self.sides(x, i), &self.coefficients[i]);
        let error = self.model.layout.input(i).map_or(0.0, |error| x[error]);
        let sides = Sides { q, qd, theta, thetad, u: input.u[i] + error };
        let (drive, transmission) = (&self.model.drives[i], self.model.transmissions[i]);
        if self.model.laws.is_empty() {
            return match transmission {
                Transmission::Elastic => drive.elastic(c, &sides),
                Transmission::Rigid => drive.rigid(c, &sides),
            };
        }
        let of = self.model.laws.at(i);
        let mut own = [0.0; MOST_VARIABLES];
        let (parameters, states) = own.split_at_mut(of.parameters.len());
        gather(parameters, &of.parameters, &self.z);
        gather(states, &of.states, x);
        let laws = JointLaws { joint: i, time_s: input.time_s, laws: &self.laws[i], parameters, states };
        drive.with_laws(transmission, c, &sides, volts, &laws, rates)
    }

    /// The same with derivatives: `take` is given every result, its value, and what adds its derivatives, each with its column among state and
    /// coordinates. `supply` has those of the supply voltage.
    pub(in crate::model) fn act_with_slopes(
        &self,
        i: usize,
        (x, input, volts): (&[f64], &Input<'_>, f64),
        supply: &[f64],
        take: impl FnMut(Output, f64, &dyn Fn(&mut dyn FnMut(usize, f64))),
    ) -> Action<f64> {
        match self.model.laws.most_variables() {
            0..=FEW_VARIABLES => self.act_by::<FEW, FEW_VARIABLES>(i, (x, input, volts), supply, take),
            n if n <= SOME_VARIABLES => self.act_by::<SOME, SOME_VARIABLES>(i, (x, input, volts), supply, take),
            _ => self.act_by::<MANY, MOST_VARIABLES>(i, (x, input, volts), supply, take),
        }
    }

    fn act_by<const N: usize, const V: usize>(
        &self,
        i: usize,
        (x, input, volts): (&[f64], &Input<'_>, f64),
        supply: &[f64],
        mut take: impl FnMut(Output, f64, &dyn Fn(&mut dyn FnMut(usize, f64))),
    ) -> Action<f64>
    where
        Self: Drives<N, V>,
    {
        let mut rates = [Lanes::from(0.0); V];
        let Action { link_torque, motor } = Drives::<N, V>::drive(self, i, x, input, volts, &mut rates);
        let mut give = |result, value: &Lanes<N>| {
            take(result, value.re, &|add| self.scatter(i, &value.slope, supply, add));
        };
        give(Output::Torque, &link_torque);
        give(Output::Motor, &motor);
        for (state, rate) in rates[..self.model.laws.own_states(i).len()].iter().enumerate() {
            give(Output::Rate(state), rate);
        }
        Action { link_torque: link_torque.re, motor: motor.re }
    }

    /// Sides and coefficients as variables of their lanes.
    #[inline(always)]
    fn variables<const N: usize>(&self, x: &[f64], u: Lanes<N>, i: usize) -> (Sides<Lanes<N>>, Coefficients<Lanes<N>>) {
        let [q, qd, theta, thetad] = self.sides(x, i);
        let sides =
            Sides { q: variable(q, 0), qd: variable(qd, 1), theta: variable(theta, 2), thetad: variable(thetad, 3), u };
        let mut coefficients = [Lanes::from(0.0); Coefficients::<f64>::COUNT];
        for (k, c) in self.coefficients[i].to_array().into_iter().enumerate() {
            coefficients[k] = variable(c, COEFFICIENTS + k);
        }
        let coefficients = Coefficients::from_array(coefficients);
        (sides, coefficients)
    }

    #[inline(always)]
    fn with_laws<const N: usize, const V: usize>(
        &self,
        i: usize,
        x: &[f64],
        input: &Input<'_>,
        volts: f64,
        rates: &mut [Lanes<N>; V],
    ) -> Action<Lanes<N>>
    where
        Lanes<N>: Asked,
    {
        let of = self.model.laws.at(i);
        let mut own = [Lanes::from(0.0); V];
        let mut u = Lanes::from(input.u[i]);
        for (local, coordinate) in of.parameters.iter().enumerate() {
            own[local] = variable(self.z[*coordinate], OWN + local);
            if Some(*coordinate) == self.model.input_delay() {
                u.slope[OWN + local] = input.by_delay.get(i).copied().unwrap_or(0.0);
            }
        }
        let count = of.parameters.len();
        for (local, state) in of.states.iter().enumerate() {
            own[count + local] = variable(x[*state], OWN + count + local);
        }
        if of.has_input_error {
            u += own[count + of.states.len() - 1];
        }
        let (sides, coefficients) = self.variables(x, u, i);
        let (parameters, states) = own.split_at(count);
        let time_s = Lanes::from(input.time_s);
        let laws = JointLaws { joint: i, time_s, laws: &self.laws[i], parameters, states };
        let transmission = self.model.transmissions[i];
        self.model.drives[i].with_laws(transmission, &coefficients, &sides, variable(volts, VOLTS), &laws, rates)
    }
}

fn gather(to: &mut [f64], places: &[usize], from: &[f64]) {
    for (to, place) in to.iter_mut().zip(places) {
        *to = from[*place];
    }
}
