//! Tooth skip: the belt jumps over its pulley.
//!
//! ```text
//! τ_c = k_s (q − θ − s) + …      s jumps by `step` at time t, s after the start of the motion
//! ```
//!
//! The jump is an event between two steps of the plant: link and motor stand where they stood, and the belt is wound by
//! another angle. The belt stays where it jumped to; every further motion in the same session has its own jump.

use rand::{Rng, RngExt};

use super::surrogate::{Arc, At, Clues, Hook, JointClues, Law, Laws, Of, Parameters, Quantity, acts_on_joints, each};
use super::{Effect, EffectError, EffectParameter, Hidden, Moment, Physics, Row, Scale, Size, draw};
use crate::robot::Robot;

pub(super) const EFFECT: Effect = Effect {
    id: "belt_tooth_skip",
    row: Row::Link,
    title: "the belt jumps a tooth",
    equation: "q − θ steps at one time",
    parameters: &[
        EffectParameter::size("step[i]", "rad")
            .typically(0.04, 0.45, Scale::Radian)
            .sizes("15, 45, 125 mrad (10 to 150 met), either sign, on one joint"),
        EffectParameter::own_to_recording("t[i]", "s").sizes("5 to 18 s after the start of the motion"),
    ],
    nuisances: &[EffectParameter::nuisance("width", "s").sizes("how long the law's jump takes")],
    confounded_with: &["encoder_lag", "encoder_eccentricity"],
    about: "An old or loose belt climbs over a tooth of its pulley under load. From then on the link stands beside where \
            its encoder says; a fault of that encoder would look the same if there were no gyro on the link.",
    make,
    laws,
};

const STEP_RAD: [f64; 3] = [0.015, 0.045, 0.125];
/// When, whole milliseconds after the start of the motion.
const TIME_MS: std::ops::Range<u32> = 5000..18_000;
/// How long the law's jump takes: so long that its time can be fitted, s, and once it is known to a sample, periods of sampling.
const WIDTH_S: f64 = 2e-3;
const SHARP_PERIODS: f64 = 0.1;
/// Share of the missing torque's squares that a jump has to explain to be followed.
const LEAST_SHARE: f64 = 0.05;
/// Joints that are followed.
const MOST_JOINTS: usize = 2;
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
pub fn skip(joint: usize, step_rad: f64, time_s: f64) -> Hidden {
    let name = |symbol| format!("{symbol}[{}]", joint + 1);
    let values =
        vec![draw::single(EFFECT.id, &name("step"), "rad", step_rad), draw::single(EFFECT.id, &name("t"), "s", time_s)];
    Hidden { id: EFFECT.id, values, physics: Box::new(BeltToothSkip { joint, step_rad, time_s }) }
}

/// One jump on one joint.
#[derive(Debug)]
struct SkipLaw {
    parameters: Parameters,
    joint: usize,
    /// How long the jump takes, s, and once its time is known.
    width_s: f64,
    sharp_s: f64,
}

impl Law for SkipLaw {
    fn parameters(&self) -> &Parameters {
        &self.parameters
    }

    fn is_event(&self) -> bool {
        true
    }

    /// At the largest jump of the missing torque, k_s `step`.
    fn starts(&self, clues: &Clues) -> Vec<Arc<dyn Law>> {
        let jumps = clues.joints.iter().enumerate().filter_map(|(joint, of)| Some((joint, of.k_s?, jump(of)?)));
        let mut jumps: Vec<_> = jumps.filter(|(.., jump)| jump.share > LEAST_SHARE).collect();
        jumps.sort_by(|(.., a), (.., b)| b.share.total_cmp(&a.share));
        let law = |(joint, k_s, jump): (usize, f64, Jump)| -> Arc<dyn Law> {
            // Between the last sample without and the first with it.
            let time_s = 0.5 * (clues.time_s[jump.at - 1] + clues.time_s[jump.at]);
            tracing::debug!(joint = joint + 1, time_s, step = jump.height / k_s, share = jump.share, "tooth skip?");
            let width_s = self.sharp_s;
            let parameters = parameters(self.parameters.cleared(), joint, [jump.height / k_s, time_s], width_s);
            Arc::new(SkipLaw { parameters, joint, width_s, sharp_s: width_s })
        };
        jumps.into_iter().take(MOST_JOINTS).map(law).collect()
    }

    fn event_s(&self) -> Option<f64> {
        self.parameters.coordinates.get(1).map(|time| time.start)
    }

    fn later(&self, by_s: f64) -> Option<Arc<dyn Law>> {
        let SkipLaw { joint, width_s, sharp_s, .. } = *self;
        let [step, time] = &self.parameters.coordinates[..] else { return None };
        let at = [step.start, time.start + by_s];
        let parameters = parameters(self.parameters.cleared(), joint, at, width_s);
        Some(Arc::new(SkipLaw { parameters, joint, width_s, sharp_s }))
    }

    fn other_shape(&self) -> Option<Arc<dyn Law>> {
        let SkipLaw { joint, sharp_s, .. } = *self;
        let law = || -> Arc<dyn Law> {
            let parameters = parameters(self.parameters.cleared(), joint, [0.0; 2], sharp_s);
            Arc::new(SkipLaw { parameters, joint, width_s: sharp_s, sharp_s })
        };
        (self.width_s > sharp_s).then(law)
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
    #[inline(always)]
    fn act<T: Quantity>(&self, _hook: Hook, at: &At<'_, T>, torque: T) -> T {
        let [step, time] = *at.parameters else { return torque };
        torque - at.k_s * step * (at.time_s - time).step(self.width_s)
    }
}

/// A time to start from every second of the first half minute, on each joint.
fn laws(robot: &Robot) -> Laws {
    let joints = draw::some(EFFECT.id, draw::elastic(robot), draw::NO_BELT)?;
    let starts = joints.iter().flat_map(|&joint| (1..30).map(move |second| (joint, f64::from(second))));
    each(starts.map(|(joint, start_s)| {
        let parameters = parameters(Parameters::on(EFFECT.id, robot), joint, [0.0, start_s], WIDTH_S);
        SkipLaw { parameters, joint, width_s: WIDTH_S, sharp_s: SHARP_PERIODS * robot.sample_period_s }
    }))
}

fn parameters(mut parameters: Parameters, joint: usize, [step_rad, time_s]: [f64; 2], width_s: f64) -> Parameters {
    parameters.plain("step", "rad", Of::Joint(joint), step_rad);
    parameters.plain("t", "s", Of::Joint(joint), time_s);
    parameters.chosen("width", "s", width_s);
    parameters
}

/// A jump of the torque that a joint misses.
#[derive(Debug, Clone, Copy)]
struct Jump {
    /// The first sample behind it.
    at: usize,
    /// Mean behind it less that before, N m.
    height: f64,
    /// Share of the squares that it explains.
    share: f64,
}

/// The jump that explains most, by cumulative sums: with means before and behind it, n b / (n + b) · height² of the squares.
fn jump(joint: &JointClues) -> Option<Jump> {
    let (count, sum) = (joint.missing.len() as f64, joint.missing.iter().sum::<f64>());
    let squares = joint.missing.iter().map(|torque| torque * torque).sum::<f64>();
    let mut before = 0.0;
    let jumps = joint.missing.iter().enumerate().map(|(at, torque)| {
        let passed = at as f64;
        let height = (sum - before) / (count - passed) - before / passed.max(1.0);
        before += torque;
        Jump { at, height, share: passed * (count - passed) / count * height * height / squares }
    });
    jumps.filter(|jump| jump.share.is_finite()).max_by(|a, b| a.share.total_cmp(&b.share)).filter(|jump| jump.at > 0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_jump_of_the_missing_torque_is_found_to_the_sample() {
        let robot = Robot::builtin("doggy").unwrap();
        let samples = 4000;
        let ripple = |k: usize| 0.5 * (k as f64 * 1.3).sin();
        let joint = |from: usize, torque: f64| JointClues {
            missing: (0..samples).map(|k| ripple(k) + if k >= from { torque } else { 0.0 }).collect(),
            k_s: Some(400.0),
            ..JointClues::default()
        };
        let time_s = (0..samples).map(|k| 1e-3 * k as f64).collect();
        let clues = Clues { time_s, joints: vec![joint(0, 0.0), joint(2500, -6.0), joint(0, 0.0)] };
        let starts = laws(&robot).unwrap()[0].starts(&clues);
        assert_eq!(starts.len(), 1, "{starts:?}");
        let parameters = starts[0].parameters();
        let values: Vec<f64> = parameters.coordinates.iter().map(|coordinate| coordinate.start).collect();
        assert_eq!(parameters.results[0].name, "belt_tooth_skip.step[2]");
        // The ripple's means over a thousand samples and more are below a thousandth of a newton metre.
        assert!((values[0] + 6.0 / 400.0).abs() < 1e-5 && (values[1] - 2.4995).abs() < 1e-9, "{values:?}");
    }
}
