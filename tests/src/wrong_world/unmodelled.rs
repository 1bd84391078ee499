//! Unmodelled torque, coloured noise plus a random smooth function of position, and input noise.

use host::robot::Robot;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::chain::MOST;
use super::dynamics::{Acting, JointView};
use super::family::Family;
use super::noise::{Coloured, Smooth, normal};
use super::outsider::Usage;

/// RMS of the unmodelled torque as a share of the motor torque's RMS.
const SHARE: std::ops::Range<f64> = 0.01..0.05;
/// Share of its variance that is a function of position.
const OF_POSITION: std::ops::Range<f64> = 0.1..0.5;
/// Correlation times of the AR(1) part, s; log-uniform.
const CORRELATED_S: std::ops::Range<f64> = 0.05..0.5;

/// The disturbances of a machine.
#[derive(Debug, Clone)]
pub struct Unmodelled {
    joints: Vec<Shaking>,
    /// RMS of the noise of each input.
    input_sigma: Vec<f64>,
}

#[derive(Debug, Clone)]
struct Shaking {
    acts_on_link: bool,
    coloured: Coloured,
    smooth: Smooth,
}

impl Unmodelled {
    /// Nothing.
    pub fn none() -> Self {
        Self { joints: Vec::new(), input_sigma: Vec::new() }
    }

    /// For a machine of a family that is used so, with a plant's step.
    pub fn draw(family: Family, robot: &Robot, usage: &[Usage], step_s: f64, rng: &mut ChaCha8Rng) -> Self {
        let joints = robot.joints.iter().zip(usage).map(|(joint, usage)| {
            let rms = usage.torque * rng.random_range(SHARE);
            let of_position = rng.random_range(OF_POSITION);
            let time_s = rng.random_range(CORRELATED_S.start.ln()..CORRELATED_S.end.ln()).exp();
            Shaking {
                acts_on_link: rng.random(),
                coloured: Coloured::new(rms * (1.0 - of_position).sqrt(), time_s, step_s, rng),
                smooth: Smooth::new(rms * of_position.sqrt(), joint.limits[1] - joint.limits[0], rng),
            }
        });
        let joints = joints.collect();
        let share =
            family.input_noise().map_or(0.0, |shares| rng.random_range(shares.start.ln()..shares.end.ln()).exp());
        Self { joints, input_sigma: usage.iter().map(|usage| share * usage.input).collect() }
    }

    /// Adds the input noise to recorded inputs.
    pub fn spoil_inputs(&self, inputs: &mut [f64], rng: &mut ChaCha8Rng) {
        for (input, sigma) in inputs.iter_mut().zip(&self.input_sigma) {
            *input += sigma * normal(rng);
        }
    }

    /// Sets the torques of a step.
    pub fn act(&mut self, views: &[JointView; MOST], acting: &mut Acting, rng: &mut ChaCha8Rng) {
        for (joint, shaking) in self.joints.iter_mut().enumerate() {
            let view = &views[joint];
            let position = if shaking.acts_on_link { view.q } else { view.theta };
            let torque = shaking.coloured.next(rng) + shaking.smooth.at(position);
            let on = if shaking.acts_on_link { &mut acting.link } else { &mut acting.motor };
            on[joint] = torque;
        }
    }
}
