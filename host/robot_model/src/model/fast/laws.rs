//! The drives of four samples with laws of effects, asked one sample and one joint at a time by the generic walk's own code; what they say is
//! put into lanes.

use super::{Dynamics, JOINTS};
use crate::model::Input;
use crate::model::drive::Action;
use solve::simd::{LANES, Quad};

/// What the drives do, and the space to work it out: one a thread.
#[derive(Debug, Clone, Default)]
pub(super) struct Drives {
    /// Torques on the links and accelerations of the motors, a quad a joint.
    pub torque: [Quad; JOINTS],
    pub thetadd: [Quad; JOINTS],
    /// Their derivatives by state and coordinates: rows of the torques, then of the accelerations.
    pub rows: Vec<Quad>,
    x: Vec<f64>,
    u: Vec<f64>,
    row: Vec<f64>,
    supply: Vec<f64>,
}

impl Drives {
    /// At the states `x` (a quad a component) under the inputs `u`, at these times.
    pub(super) fn act(
        &mut self,
        dynamics: &Dynamics<'_>,
        x: &[Quad],
        (u, time_s): (&[Quad], &Quad),
        with_slopes: bool,
    ) {
        let columns = dynamics.columns();
        if with_slopes {
            self.rows.resize(2 * JOINTS * columns, Quad::default());
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
            for i in 0..JOINTS {
                let plain = if with_slopes {
                    let (torques, motors) = self.rows.split_at_mut(JOINTS * columns);
                    let row = &mut self.row;
                    let mut put = |to: &mut [Quad], fill: &dyn Fn(&mut [f64])| {
                        row.clear();
                        row.resize(columns, 0.0);
                        fill(row);
                        for (to, slope) in to[i * columns..(i + 1) * columns].iter_mut().zip(&*row) {
                            to.0[lane] = *slope;
                        }
                    };
                    dynamics.act_with_rows(i, (&self.x, &input, volts), &self.supply, |of_link, of_motor| {
                        put(torques, of_link);
                        put(motors, of_motor);
                    })
                } else {
                    dynamics.act(i, &self.x, &input, volts, &mut [])
                };
                let Action { link_torque, motor } = plain;
                (self.torque[i].0[lane], self.thetadd[i].0[lane]) = (link_torque, motor);
            }
        }
    }
}
