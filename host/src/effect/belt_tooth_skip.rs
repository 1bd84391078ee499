//! Tooth skip: the belt jumps over its pulley.
//!
//! ```text
//! τ_c = k_s (q − θ − s) + …      s jumps by `step` at time t, s after the start of the motion
//! ```
//!
//! The jump is an event between two steps of the plant: link and motor stand where they stood, and the belt is wound by
//! another angle. The belt stays where it jumped to; every further motion in the same session has its own jump.

use rand::{Rng, RngExt};

use super::surrogate::{At, Hook, Law, Laws, Of, Parameters, Quantity, acts_on_joints, each};
use super::{Effect, EffectError, EffectParameter, Hidden, Moment, Physics, Row, Size, draw};
use crate::robot::Robot;

pub(super) const EFFECT: Effect = Effect {
    id: "belt_tooth_skip",
    row: Row::Link,
    title: "the belt jumps a tooth",
    equation: "q − θ steps at one time",
    parameters: &[
        EffectParameter {
            name: "step[i]",
            unit: "rad",
            sizes: "15, 45, 125 mrad (10 to 150 met), either sign, on one joint",
        },
        EffectParameter { name: "t[i]", unit: "s", sizes: "5 to 18 s after the start of the motion" },
    ],
    confounded_with: &["encoder_lag", "encoder_eccentricity"],
    about: "An old or loose belt climbs over a tooth of its pulley under load. From then on the link stands beside where \
            its encoder says; a fault of that encoder would look the same if there were no gyro on the link.",
    make,
    laws,
};

const STEP_RAD: [f64; 3] = [0.015, 0.045, 0.125];
/// When, whole milliseconds after the start of the motion.
const TIME_MS: std::ops::Range<u32> = 5000..18_000;
/// How long the law's jump takes, s.
const WIDTH_S: f64 = 2e-3;
/// Steps of the plant end on whole milliseconds but for rounding, s.
const ROUNDING_S: f64 = 1e-9;

/// One state: by how much the belt has jumped, rad.
#[derive(Debug)]
struct BeltToothSkip {
    joint: usize,
    step_rad: f64,
    time_s: f64,
}

impl Physics for BeltToothSkip {
    fn states(&self) -> usize {
        1
    }

    fn state_rates(&self, _own: &[f64], _line: &super::Line<'_>, out: &mut [f64]) {
        out[0] = 0.0;
    }

    fn jump(&self, own: &mut [f64], from_s: f64, to_s: f64) {
        let time_s = self.time_s - ROUNDING_S;
        if from_s < time_s && time_s <= to_s {
            own[0] += self.step_rad;
        }
    }

    fn transmission_torque(&self, at: &Moment<'_>, torque: f64) -> f64 {
        if at.joint == self.joint { torque - at.k_s * at.own[0] } else { torque }
    }
}

fn make(robot: &Robot, size: Size, rng: &mut dyn Rng) -> Result<Hidden, EffectError> {
    let joints = draw::some(EFFECT.id, draw::elastic(robot), draw::NO_BELT)?;
    let joint = joints[rng.random_range(0..joints.len())];
    let mut step_rad = [size.draw(STEP_RAD, rng)];
    draw::either_sign(&mut step_rad, size, rng);
    let time_s = f64::from(rng.random_range(TIME_MS)) * 1e-3;
    Ok(skip(joint, step_rad[0], time_s))
}

/// A belt at `joint` (0-based) that jumps by `step_rad` at `time_s`.
pub(crate) fn skip(joint: usize, step_rad: f64, time_s: f64) -> Hidden {
    let name = |symbol| format!("{symbol}[{}]", joint + 1);
    let values =
        vec![draw::single(EFFECT.id, &name("step"), "rad", step_rad), draw::single(EFFECT.id, &name("t"), "s", time_s)];
    Hidden { id: EFFECT.id, values, physics: Box::new(BeltToothSkip { joint, step_rad, time_s }) }
}

/// The jump takes some milliseconds, so that its time can be fitted; one jump on one joint.
#[derive(Debug)]
struct SkipLaw {
    parameters: Parameters,
    joint: usize,
    /// How long the jump takes, s.
    width_s: f64,
}

impl Law for SkipLaw {
    fn parameters(&self) -> &Parameters {
        &self.parameters
    }

    fn hooks(&self) -> &'static [Hook] {
        &[Hook::Transmission]
    }

    fn local(&self, joint: usize) -> Vec<usize> {
        if joint == self.joint { vec![0, 1] } else { Vec::new() }
    }

    acts_on_joints!();
}

impl SkipLaw {
    fn act<T: Quantity>(&self, _hook: Hook, at: &At<'_, T>, torque: T) -> T {
        let [step, time] = *at.parameters else { return torque };
        torque - at.k_s * step * (T::from(at.time_s) - time).step(self.width_s)
    }
}

/// A time to start from every second of the first half minute, on each joint.
fn laws(robot: &Robot) -> Laws {
    let joints = draw::some(EFFECT.id, draw::elastic(robot), draw::NO_BELT)?;
    let starts = joints.iter().flat_map(|&joint| (1..30).map(move |second| (joint, f64::from(second))));
    each(starts.map(|(joint, start_s)| {
        let mut parameters = Parameters::on(EFFECT.id, robot);
        parameters.plain("step", "rad", Of::Joint(joint), 0.0);
        parameters.plain("t", "s", Of::Joint(joint), start_s);
        SkipLaw { parameters, joint, width_s: WIDTH_S }
    }))
}
