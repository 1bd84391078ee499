//! Inputs against the speeds that follow: a joint goes where it is driven, on the whole.
//!
//! Of six recordings of real machines (a ball screw, six axes of an industrial robot) and eight simulated ones, the least
//! correlation of a joint's own input and speed is 0.49; foreign ones reach 0.9 where axes move in step.

use super::correlation::Correlation;
use super::stats::{mean_rate, position, range};
use crate::recording::check::{About, Findings};
use crate::recording::{Recording, Severity};

/// Below this, an input surely drives its joint the other way.
const AGAINST: f64 = -0.35;
/// Below this, an input hardly drives the joint.
const HARDLY: f64 = 0.25;
/// Above this, an input may be the one that drives the joint.
const DRIVES: f64 = 0.45;
/// A joint that nothing drives is not moved by others through more than this share of its range.
const PASSIVE_SHARE: f64 = 0.25;
/// An input so many times larger than nearly all others was never commanded.
const LONE_FACTOR: f64 = 100.0;
/// Fewest samples that prove something.
const LEAST_SAMPLES: usize = 200;

pub(super) fn look(recording: &Recording, findings: &mut Findings) {
    let joints = recording.robot.joints.len();
    for joint in 0..joints {
        constant(recording, joint, findings);
        lone(recording, joint, findings);
    }
    let speeds: Vec<Option<Vec<f64>>> =
        (0..joints).map(|joint| Some(mean_rate(recording, &position(recording, joint)?.values))).collect();
    let correlation = |input: usize, joint: usize| {
        let sums = Correlation::of(&recording.duty[input], speeds[joint].as_deref()?);
        (sums.count >= LEAST_SAMPLES).then(|| sums.coefficient())
    };
    let own: Vec<Option<f64>> = (0..joints).map(|joint| correlation(joint, joint)).collect();
    let weak: Vec<usize> = (0..joints).filter(|&j| own[j].is_some_and(|own| own < HARDLY)).collect();
    let mut swapped = Vec::new();
    for &joint in &weak {
        let foreign = weak.iter().filter(|&&input| input != joint);
        let best = foreign
            .filter_map(|&input| Some((input, correlation(input, joint)?)))
            .max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()));
        match best {
            Some((input, value)) if value.abs() > DRIVES => swapped.push((joint, input, value)),
            _ => {}
        }
    }
    // Each of the inputs must have found its joint.
    let each_once = (1..swapped.len()).all(|i| swapped[..i].iter().all(|earlier| earlier.1 != swapped[i].1));
    if swapped.len() >= 2 && each_once {
        let name = |joint: usize| &recording.robot.joints[joint].name;
        for &(joint, input, value) in &swapped {
            findings.add(
                Severity::Error,
                About::Units,
                Some(&format!("u{}", joint + 1)),
                format!(
                    "{} follows u{} (correlation of its speed {value:.2}), not u{} ({:.2}): the columns look swapped",
                    name(joint),
                    input + 1,
                    joint + 1,
                    own[joint].unwrap_or(0.0)
                ),
                "check the order of the inputs u1… and of the encoders theta1…, in the table or under import.columns in the robot file",
            );
        }
        return;
    }
    for (joint, own) in own.iter().enumerate() {
        if let Some(own) = own.filter(|own| *own < AGAINST) {
            findings.add(
                Severity::Error,
                About::Units,
                Some(&format!("u{}", joint + 1)),
                format!(
                    "{} runs against its input (correlation of speed and input {own:.2})",
                    recording.robot.joints[joint].name
                ),
                "swap the motor's wires or the encoder's channels, or change the sign of one column (sign = -1 under import.columns in the robot file)",
            );
        }
    }
}

/// An input that is the same in every sample is not what moved the robot; a joint that rests needs none.
fn constant(recording: &Recording, joint: usize, findings: &mut Findings) {
    let input = &recording.duty[joint];
    let same = input.len() > 1 && input.windows(2).all(|pair| pair[0] == pair[1]);
    if same && input[0] != 0.0 {
        findings.add(
            Severity::Error,
            About::Units,
            Some(&format!("u{}", joint + 1)),
            format!("the input is {} in every sample", input[0]),
            "is this the column of the input that was commanded?",
        );
    }
    let limits = recording.robot.joints[joint].limits;
    let moved =
        position(recording, joint).and_then(|channel| range(&channel.values)).map_or(0.0, |(low, high)| high - low);
    let driven = recording.rest_window().len() < recording.len();
    if same && input[0] == 0.0 && driven && moved > PASSIVE_SHARE * (limits[1] - limits[0]) {
        findings.add(
            Severity::Error,
            About::Units,
            Some(&format!("u{}", joint + 1)),
            format!("{} moves by {moved:.3} without any input", recording.robot.joints[joint].name),
            "is this the column of the input that was commanded, and the joint's own?",
        );
    }
}

/// A few inputs that are far from all others. Duties cannot be.
fn lone(recording: &Recording, joint: usize, findings: &mut Findings) {
    let mut sizes: Vec<f64> =
        recording.duty[joint].iter().map(|input| input.abs()).filter(|size| *size > 0.0).collect();
    if sizes.len() < LEAST_SAMPLES {
        return;
    }
    let most = sizes.len() - 1 - sizes.len() / 200;
    let usual = *sizes.select_nth_unstable_by(most, f64::total_cmp).1;
    let far = sizes.iter().filter(|size| **size > LONE_FACTOR * usual).count();
    if far > 0 {
        let worst = sizes.iter().copied().fold(0.0, f64::max);
        findings.add(
            Severity::Error,
            About::Units,
            Some(&format!("u{}", joint + 1)),
            format!("{far} inputs are far beyond all others (up to {worst:.3e}, the others up to {usual:.3e})"),
            "leave these rows out of the table (the ticks are then missing), and look for what made them",
        );
    }
}
