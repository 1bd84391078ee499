//! What the motion does with each joint: parameters that nothing moves cannot be found.

use serde::{Deserialize, Serialize};

use super::stats::{full_input, half_window, mean_rate, position, range, reversals};
use super::{About, Findings};
use crate::recording::{Channel, Recording, Severity};
use crate::robot::{InputUnit, JointKind, Transmission};

/// A joint that moves less than this many sigmas of its encoder has not moved.
const MOVED_SIGMAS: f64 = 50.0;
/// Share of a joint's allowed range that the motion should use: M(q) and the gyros' rotations show in large angles.
const RANGE_SHARE: f64 = 0.25;
/// Reversals of the speed: Coulomb friction shows where the speed changes sign.
const REVERSALS: usize = 10;
/// Share of the full input that counts as fast.
const FAST_INPUT: f64 = 0.5;
/// Share of the full input up to which a motion is slow: friction against back-EMF shows there.
const SLOW_INPUT: f64 = 0.2;
/// Reversals of the input within this time bend an elastic transmission: half a period of 1.4 Hz, where the chirps of
/// the calibration motion begin, s.
const FAST_REVERSAL_S: f64 = 0.36;
/// As many of them show stiffness and damping; a chirp of 3 s has some thirty.
const FAST_REVERSALS: usize = 10;

/// What one joint did.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct JointExcitation {
    /// Name of the joint in the robot file.
    pub joint: String,
    /// Unit of positions: rad or m.
    pub unit: String,
    /// Largest minus least position.
    pub range: f64,
    /// Share of the allowed range.
    pub range_share: f64,
    /// Largest speed, unit/s, over windows of 20 ms.
    pub max_speed: f64,
    /// Changes of the speed's sign.
    pub reversals: usize,
    /// Largest input, share of full.
    pub max_input: f64,
    /// Time in slow motion (moving, input at most 0.2 of full), s.
    pub slow_s: f64,
    /// Reversals of a large input within 0.36 s.
    pub fast_reversals: usize,
}

pub(super) fn look(recording: &Recording, findings: &mut Findings) -> Vec<JointExcitation> {
    if recording.rest_window().len() == recording.len() {
        return Vec::new(); // told as such already
    }
    let mut joints = Vec::new();
    for joint in 0..recording.robot.joints.len() {
        if let Some(positions) = position(recording, joint) {
            let excitation = excitation(recording, joint, positions);
            judge(recording, joint, positions.spec.sigma, &excitation, findings);
            joints.push(excitation);
        }
    }
    joints
}

fn excitation(recording: &Recording, joint: usize, positions: &Channel) -> JointExcitation {
    let description = &recording.robot.joints[joint];
    let full = full_input(recording);
    let (low, high) = range(&positions.values).unwrap_or((0.0, 0.0));
    let speeds = mean_rate(recording, &positions.values);
    let max_speed = speeds.iter().filter(|speed| !speed.is_nan()).fold(0.0, |max: f64, speed| max.max(speed.abs()));
    let span_s = 2.0 * half_window(recording) as f64 * recording.period_s;
    let noise = std::f64::consts::SQRT_2 * positions.spec.sigma / span_s;
    let moving = (5.0 * noise).max(0.01 * max_speed);
    let input = &recording.duty[joint];
    let slow = (0..recording.len())
        .filter(|&k| input[k] != 0.0 && input[k].abs() <= SLOW_INPUT * full && speeds[k].abs() > moving);
    let large = reversals(input, 0.5 * FAST_INPUT * full);
    let fast = large.windows(2).filter(|pair| recording.time_s(pair[1]) - recording.time_s(pair[0]) < FAST_REVERSAL_S);
    JointExcitation {
        joint: description.name.clone(),
        unit: match description.kind {
            JointKind::Revolute => "rad",
            JointKind::Prismatic => "m",
        }
        .to_owned(),
        range: high - low,
        range_share: (high - low) / (description.limits[1] - description.limits[0]),
        max_speed,
        reversals: reversals(&speeds, moving).len(),
        max_input: input.iter().fold(0.0, |max: f64, u| max.max(u.abs())) / full,
        slow_s: slow.count() as f64 * recording.period_s,
        fast_reversals: fast.count(),
    }
}

/// `sigma`: of the joint's position, rad or m.
fn judge(recording: &Recording, joint: usize, sigma: f64, found: &JointExcitation, findings: &mut Findings) {
    let input = format!("u{}", joint + 1);
    let name = &found.joint;
    let has_back_emf = matches!(recording.robot.input.unit, InputUnit::Duty | InputUnit::Volt);
    let mut add = |severity, message: String, advice: &str| {
        findings.add(severity, About::Excitation, Some(&input), message, advice);
    };
    if found.range < MOVED_SIGMAS * sigma {
        add(
            Severity::Error,
            format!("{name} does not move (its positions span {:.2e} {})", found.range, found.unit),
            "give this joint a slow and a fast stage in the motion; is its motor connected?",
        );
        return;
    }
    if found.range_share < RANGE_SHARE {
        add(
            Severity::Warning,
            format!("{name} uses {:.0} % of its range ({:.3} {})", 100.0 * found.range_share, found.range, found.unit),
            match recording.robot.gyros().next() {
                Some(_) => "move it further in the slow stage: inertia and the gyros' rotations show in large angles",
                None => "move it further in the slow stage: inertia and weight show in large motions",
            },
        );
    }
    if found.reversals < REVERSALS {
        add(
            Severity::Warning,
            format!("{name} reverses its speed {} times", found.reversals),
            "let it go to and fro at least ten times: friction shows where the speed changes sign",
        );
    }
    if found.slow_s < 1.0 {
        add(
            Severity::Warning,
            format!("{name} moves slowly for {:.2} s only", found.slow_s),
            match has_back_emf {
                true => {
                    "add a slow stage (at most 0.15 of the full input): friction and back-EMF are told apart between slow and fast"
                }
                false => {
                    "add a slow stage (at most 0.15 of the full input): Coulomb and viscous friction are told apart between slow and fast"
                }
            },
        );
    }
    if found.max_input < FAST_INPUT {
        add(
            Severity::Warning,
            format!("the input of {name} reaches {:.0} % of full", 100.0 * found.max_input),
            match has_back_emf {
                true => "add a fast stage with up to 0.9 of the full input: back-EMF and motor inertia show there",
                false => {
                    "add a fast stage with up to 0.9 of the full input: motor inertia and viscous friction show there"
                }
            },
        );
    }
    if recording.robot.joints[joint].transmission == Transmission::Elastic && found.fast_reversals < FAST_REVERSALS {
        add(
            Severity::Warning,
            format!("the input of {name} reverses quickly {} times", found.fast_reversals),
            "add a chirp (1.4 to 10 Hz, 3 s) on this joint: stiffness and damping show where the transmission bends",
        );
    }
}
