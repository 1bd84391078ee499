//! The motions of the paper, for a robot with any joints: one to calibrate, one to validate.
//!
//! ```text
//!   calibration   rest │ slow: each joint, then all │ fast: per joint steps and a chirp │ all: steps and a chirp
//!       duty ≤     0   │ 0.15                       │ 0.90                              │ 0.90
//!       why      biases│ friction, motor            │ belts, motor                      │ couplings through M(q)
//!
//!   validation    rest │ medium steps │ slow sines │ fast steps                              no chirp
//! ```
//!
//! Positions are fractions of each joint's half range about its middle, so a motion fits the robot's limits whatever
//! they are. A move ends when it arrives; how long a motion lasts therefore depends on the robot, Doggy's calibration
//! about 75 s and its validation about 30 s (the tests hold both).

use protocol::motion::{Limits, MAX_SEGMENTS};
use protocol::units::text;
use protocol::{Action, Duty, JointSet, MAX_JOINTS, Motion, Segment};

/// Duty of the slow stage (paper, 5.1).
const SLOW: Duty = Duty(1500);
/// Duty of the fast stage (paper, 5.1).
const FAST: Duty = Duty(9000);
/// Duty of the medium steps of the validation.
const MEDIUM: Duty = Duty(5000);
/// Gain of the position controller times the half range: Doggy's pitch gets 3 full duties a radian, at which motor and
/// belt together are damped by 0.4, and a move of the fast stage leaves its duty ceiling 0.3 rad before its target.
const GAIN_TIMES_HALF_RANGE: f32 = 1.8;
/// How near a move must come, part of the half range: 0.03 rad on Doggy's pitch. Friction alone holds its roll off by
/// μ / (k_pwm U) / gain = 0.011 rad.
const TOLERANCE: f32 = 0.05;
/// Longest time of a slow move, ms: twice the way at half of Doggy's 0.57 rad/s.
const SLOW_TIMEOUT_MS: u32 = 9000;
/// Longest time of a medium or fast move, ms.
const FAST_TIMEOUT_MS: u32 = 2500;
/// The chirp of the paper's Figure 3.
const CHIRP_FROM_HZ: f32 = 1.4;
/// Its end: twice Doggy's belt resonance of 4.9 Hz.
const CHIRP_TO_HZ: f32 = 10.0;
/// Its duration, ms (53 s to 56 s in Figure 3).
const CHIRP_MS: u32 = 3000;
/// Joints that chirp together differ by this part in frequency, so that their answers can be told apart.
const SPREAD: f32 = 0.07;

/// Way of a slow move, part of the half range.
const LARGE: f32 = 0.8;
/// Steps of the fast stage, parts of the half range: asymmetric, so that forth and back are not the same way.
const STEPS: [f32; 6] = [0.65, -0.75, 0.65, -0.75, 0.65, 0.0];

/// The calibration motion for joints with these ranges, from one to [`MAX_JOINTS`].
///
/// Up to three joints have a pause behind every move and last 60 to 100 s; with more joints only the pauses between
/// the parts remain, and fewer steps.
pub fn calibration(joints: &[Limits]) -> Motion {
    let mut b = Builder::new("calibration", joints);
    b.stage("rest");
    b.push(Action::Zero { duration_ms: 3400 });

    b.stage("slow");
    let few = b.joints <= 3;
    // One joint alone, or two, repeat their part, so that there is as much to see as with three.
    let slow_rounds = [4, 4, 2].get(b.joints).copied().unwrap_or(1);
    let fast_rounds = if b.joints == 1 { 4 } else { 1 };
    for joint in 0..b.joints {
        for _ in 0..slow_rounds {
            for part in [LARGE, -LARGE, 0.0] {
                b.move_to(JointSet::only(joint), |_| part, SLOW);
                b.pause_if(few, SLOW, 800);
            }
        }
        b.pause_if(!few, SLOW, 500);
    }
    let all = JointSet::first(b.joints);
    if b.joints > 1 {
        for part in [0.8, -0.7, 0.5, 0.0] {
            b.move_to(all, |joint| alternate(joint) * part, SLOW);
            b.pause_if(few, SLOW, 900);
        }
    }

    let steps = if few { &STEPS[..] } else { &STEPS[2..] };
    for joint in 0..b.joints {
        b.fast_stage(joint);
        let set = JointSet::only(joint);
        for _ in 0..fast_rounds {
            for part in steps {
                b.move_to(set, |_| *part, FAST);
                b.pause_if(few, FAST, 700);
            }
            b.chirp(set);
            b.home(set);
        }
    }
    if b.joints > 1 {
        b.stage("fast all");
        for (index, part) in [0.5, -0.6, 0.6, -0.5, 0.4, 0.0].into_iter().enumerate() {
            // Every other step turns the even joints against the odd ones.
            b.move_to(all, |joint| if index % 2 == 0 { part } else { alternate(joint) * part }, FAST);
            b.pause_if(few, FAST, 700);
        }
        b.chirp(all);
        b.home(all);
    }
    b.motion
}

/// The validation motion for joints with these ranges: another path, other frequencies, no chirp.
pub fn validation(joints: &[Limits]) -> Motion {
    let mut b = Builder::new("validation", joints);
    let all = JointSet::first(b.joints);
    b.stage("rest");
    b.push(Action::Zero { duration_ms: 3200 });

    b.stage("medium");
    for pose in [[-0.45, -0.55, -0.1], [0.1, 0.55, -0.7], [-0.4, -0.35, 0.5], [-0.75, 0.7, -0.6], [0.55, 0.3, 0.7]] {
        b.move_to(all, |joint| pose[joint % 3], MEDIUM);
        b.push(Action::Hold { ceiling: MEDIUM, duration_ms: 1100 });
    }
    b.move_to(all, |_| 0.0, MEDIUM);
    b.push(Action::Hold { ceiling: MEDIUM, duration_ms: 900 });

    b.stage("sines");
    for (part, frequency_hz) in [(0.5, 0.35), (0.3, 0.8)] {
        let amplitude = part * b.smallest_half_range();
        let ceiling = Duty(7000);
        b.push(Action::Sine { joints: all, amplitude, frequency_hz, spread: 0.23, ceiling, duration_ms: 4400 });
    }

    b.stage("fast");
    for pose in [[-0.5, -0.45, 0.35], [-0.4, -0.6, -0.6], [-0.7, 0.6, 0.4], [-0.5, 0.65, -0.2], [0.4, -0.5, 0.6]] {
        b.move_to(all, |joint| pose[joint % 3], Duty(8500));
        b.push(Action::Hold { ceiling: Duty(8500), duration_ms: 900 });
    }
    b.home(all);
    b.motion
}

/// +1, −1, −1, +1, … : yaw against pitch and roll, as in the recordings.
fn alternate(joint: usize) -> f32 {
    if joint.is_multiple_of(3) { 1.0 } else { -1.0 }
}

/// Puts segments behind each other.
struct Builder<'a> {
    motion: Motion,
    limits: &'a [Limits],
    joints: usize,
}

impl<'a> Builder<'a> {
    fn new(name: &str, limits: &'a [Limits]) -> Self {
        let limits = &limits[..limits.len().min(MAX_JOINTS)];
        let gain = limits.iter().map(|limits| GAIN_TIMES_HALF_RANGE / half_range(limits)).collect();
        let header = protocol::motion::Header { name: text(name), stages: heapless::Vec::new(), gain };
        Builder { motion: Motion::new(header), limits, joints: limits.len() }
    }

    fn stage(&mut self, name: &str) {
        // At most eight stages are opened: rest, slow, five joints or one for all of them, fast all.
        let _ = self.motion.stages.push(text(name));
    }

    /// A stage of its own for every joint while there are stages for it, otherwise one for all.
    fn fast_stage(&mut self, joint: usize) {
        const NAMES: [&str; 5] = ["fast 1", "fast 2", "fast 3", "fast 4", "fast 5"];
        match NAMES.get(joint) {
            Some(name) if self.joints <= NAMES.len() => self.stage(name),
            _ if joint == 0 => self.stage("fast each"),
            _ => {}
        }
    }

    fn push(&mut self, action: Action) {
        let stage = self.motion.stages.len().saturating_sub(1) as u8;
        // The longest preset, for seven joints, has fewer than MAX_SEGMENTS segments; a test counts them.
        debug_assert!(self.motion.segments.len() < MAX_SEGMENTS);
        let _ = self.motion.segments.push(Segment { stage, action });
    }

    /// To a part of the half range of each joint, about its middle.
    fn move_to(&mut self, joints: JointSet, part: impl Fn(usize) -> f32, ceiling: Duty) {
        let mut targets = heapless::Vec::new();
        let mut tolerance = f32::INFINITY;
        for joint in joints.iter() {
            let Some(limits) = self.limits.get(joint) else { continue };
            let half = half_range(limits);
            // One target a joint of the set, which has at most MAX_JOINTS.
            let _ = targets.push(limits.min + half * (1.0 + part(joint)));
            tolerance = tolerance.min(TOLERANCE * half);
        }
        let timeout_ms = if ceiling == SLOW { SLOW_TIMEOUT_MS } else { FAST_TIMEOUT_MS };
        self.push(Action::MoveTo { joints, targets, ceiling, tolerance, timeout_ms });
    }

    fn pause_if(&mut self, wanted: bool, ceiling: Duty, duration_ms: u32) {
        if wanted {
            self.push(Action::Hold { ceiling, duration_ms });
        }
    }

    fn chirp(&mut self, joints: JointSet) {
        self.push(Action::Chirp {
            joints,
            amplitude: FAST,
            from_hz: CHIRP_FROM_HZ,
            to_hz: CHIRP_TO_HZ,
            spread: SPREAD,
            centring: 0.5 * GAIN_TIMES_HALF_RANGE / self.smallest_half_range(),
            duration_ms: CHIRP_MS,
        });
    }

    /// Back to the middle at medium duty, and the belts come to rest.
    fn home(&mut self, joints: JointSet) {
        self.move_to(joints, |_| 0.0, MEDIUM);
        self.push(Action::Hold { ceiling: MEDIUM, duration_ms: 1400 });
    }

    fn smallest_half_range(&self) -> f32 {
        self.limits.iter().map(half_range).fold(f32::INFINITY, f32::min)
    }
}

fn half_range(limits: &Limits) -> f32 {
    (limits.max - limits.min) / 2.0
}

#[cfg(test)]
mod tests {
    use super::*;

    const HALF_RANGES: [f32; MAX_JOINTS] = [1.0, 0.6, 0.6, 2.5, 0.3, 3.0, 1.5];

    fn robots() -> impl Iterator<Item = Vec<Limits>> {
        (1..=MAX_JOINTS).map(|n| HALF_RANGES[..n].iter().map(|half| Limits { min: -half, max: half * 1.2 }).collect())
    }

    #[test]
    fn both_motions_keep_every_rule_whatever_the_number_of_joints() {
        for limits in robots() {
            for motion in [calibration(&limits), validation(&limits)] {
                let n = limits.len();
                assert_eq!(motion.validate(&limits), Ok(()), "{} of {n} joints", motion.name);
                assert!(motion.segments.len() < MAX_SEGMENTS, "{} segments", motion.segments.len());
                assert!(matches!(motion.segments.last().unwrap().action, Action::Hold { .. }), "cut off with {n}");
                assert_eq!(motion.segments.last().unwrap().stage as usize, motion.stages.len() - 1);
            }
        }
    }

    /// Model.md: rest of 3 s at least; duties of at most 0.15 and 0.90; a chirp a joint and one on all, none in the
    /// validation.
    #[test]
    fn the_motions_have_the_papers_parts() {
        for limits in robots() {
            let n = limits.len();
            let motion = calibration(&limits);
            assert!(matches!(motion.segments[0].action, Action::Zero { duration_ms: 3000.. }));
            let chirps = motion.segments.iter().filter(|s| matches!(s.action, Action::Chirp { .. })).count();
            assert_eq!(chirps, [4, 3, 4, 5, 6, 7, 8][n - 1], "{n} joints");
            for segment in &motion.segments {
                let slow = motion.stages[usize::from(segment.stage)].starts_with("slow");
                if let Action::MoveTo { ceiling, .. } | Action::Hold { ceiling, .. } = &segment.action {
                    assert!(ceiling.0 <= if slow { 1500 } else { 9000 });
                }
            }
            let chirping = |s: &Segment| matches!(s.action, Action::Chirp { .. });
            assert!(!validation(&limits).segments.iter().any(chirping));
        }
    }
}
