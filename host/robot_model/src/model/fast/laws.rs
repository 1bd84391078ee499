//! The drives of four samples with laws of effects, asked one sample and one joint at a time by the generic walk's own code; what they say is
//! put into lanes.

use super::{Dynamics, Fast, JOINTS};
use crate::model::Input;
use crate::model::drive::Action;
use crate::model::drive::lanes::{MOST_VARIABLES, Output};
use solve::simd::{LANES, Quad};

/// What the drives do, and the space to work it out: one a thread.
#[derive(Debug, Clone, Default)]
pub(super) struct Drives {
    /// Torques on the links and accelerations of the motors, a quad a joint.
    pub torque: [Quad; JOINTS],
    pub thetadd: [Quad; JOINTS],
    /// Rates of the laws' own states.
    pub rates: Vec<Quad>,
    /// Derivatives by state and coordinates: rows of the torques, then of the accelerations, then of the rates.
    pub rows: Vec<Quad>,
    x: Vec<f64>,
    u: Vec<f64>,
    supply: Vec<f64>,
}

impl Drives {
    /// At the states `x` (a quad a component) under the inputs `u`, at these times.
    pub(super) fn act(
        &mut self,
        (fast, dynamics): (&Fast, &Dynamics<'_>),
        x: &[Quad],
        (u, time_s): (&[Quad], &Quad),
        with_slopes: bool,
    ) {
        let columns = dynamics.columns();
        self.rates.resize(fast.own.len(), Quad::default());
        if with_slopes {
            self.rows.clear();
            self.rows.resize((2 * JOINTS + fast.own.len()) * columns, Quad::default());
        }
        for lane in 0..LANES {
            self.x.clear();
            self.x.extend(x.iter().map(|quad| quad.0[lane]));
            self.u.clear();
            self.u.extend(u.iter().map(|quad| quad.0[lane]));
            let input = Input { u: &self.u, by_delay: &[], time_s: time_s.0[lane] };
            let mut volts = dynamics.model.drives[0].input_scale;
            if let Some(supply) = dynamics.supply(&self.x, &input) {
                volts = supply.re;
                if with_slopes {
                    dynamics.supply_slopes(&self.x, &input, &supply, &mut self.supply);
                }
            }
            let mut first = 2 * JOINTS;
            for i in 0..JOINTS {
                let own = dynamics.model.laws.own_states(i).len();
                let rates = &mut self.rates[first - 2 * JOINTS..][..own];
                let plain = if with_slopes {
                    let rows = &mut self.rows;
                    dynamics.act_with_slopes(i, (&self.x, &input, volts), &self.supply, |result, value, scatter| {
                        let row = match result {
                            Output::Torque => i,
                            Output::Motor => JOINTS + i,
                            Output::Rate(state) => {
                                rates[state].0[lane] = value;
                                first + state
                            }
                        };
                        let row = &mut rows[row * columns..(row + 1) * columns];
                        scatter(&mut |column, slope| row[column].0[lane] += slope);
                    })
                } else {
                    let mut plain = [0.0; MOST_VARIABLES];
                    let action = dynamics.act(i, &self.x, &input, volts, &mut plain);
                    for (rate, plain) in rates.iter_mut().zip(plain) {
                        rate.0[lane] = plain;
                    }
                    action
                };
                let Action { link_torque, motor } = plain;
                (self.torque[i].0[lane], self.thetadd[i].0[lane]) = (link_torque, motor);
                first += own;
            }
        }
    }
}
