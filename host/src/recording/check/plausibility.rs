//! Units, signs, axes and zero positions: does what one sensor says agree with what another says?

use super::stats::{full_input, mean_rate, position, range, spread, window_mean};
use super::{About, Findings};
use crate::recording::{Recording, Severity};
use crate::robot::{ChannelKind, Gyro, JointKind};

const DEGREES: f64 = 180.0 / std::f64::consts::PI;
/// Positions may pass the limits of the robot file by this factor.
const LIMIT_FACTOR: f64 = 1.2;
/// Up to this share of the full input a motion is slow, and the transmission hardly bends: the gyros see the motors' speeds.
const SLOW_INPUT: f64 = 0.2;
/// A ratio of measured to predicted rates within this factor of 1 is the right unit.
const UNIT_FACTOR: f64 = 1.5;
/// A correlation that a gyro in its place surely has in slow motion.
const FOLLOWS: f64 = 0.5;
/// Predicted rates below this many sigmas of the gyro prove nothing.
const VISIBLE_SIGMAS: f64 = 3.0;
/// Fewest samples that prove something.
const LEAST_SAMPLES: usize = 200;

pub(super) fn look(recording: &Recording, findings: &mut Findings) {
    let before = findings.0.len();
    for joint in 0..recording.robot.joints.len() {
        positions(recording, joint, findings);
        direction(recording, joint, findings);
    }
    // Gyros are held against the encoders: only once these are right.
    if findings.0.len() == before {
        gyros(recording, findings);
    }
}

fn positions(recording: &Recording, joint: usize, findings: &mut Findings) {
    let description = &recording.robot.joints[joint];
    let Some(channel) = position(recording, joint) else { return };
    let Some((low, high)) = range(&channel.values) else { return };
    let allowed = LIMIT_FACTOR * description.limits[0].abs().max(description.limits[1].abs());
    let largest = low.abs().max(high.abs());
    if largest <= allowed {
        return;
    }
    let span = high - low;
    let allowed_span = LIMIT_FACTOR * (description.limits[1] - description.limits[0]);
    let (severity, what, advice) = if span <= allowed_span {
        (
            Severity::Error,
            "but its span fits",
            "set the zero position: hold the robot in its marked pose, command \"set zero\", record again",
        )
    } else if description.kind == JointKind::Revolute
        && span / DEGREES <= allowed_span
        && span > 0.2 * DEGREES * (description.limits[1] - description.limits[0])
    {
        (Severity::Error, "and looks like degrees", "give angles in rad: divide by 57.29578")
    } else if span / description.gear <= allowed_span {
        (
            Severity::Error,
            "and looks like the motor's side of the gear",
            "give angles on the link side: divide by the gear ratio of the robot file",
        )
    } else {
        (Severity::Warning, "and the robot file's limits are not kept", "check unit, gear and limits in the robot file")
    };
    findings.add(
        severity,
        About::Units,
        Some(&channel.spec.name),
        format!("positions of {} from {low:.4} to {high:.4} exceed the robot's {allowed:.2} {what}", description.name),
        advice,
    );
}

/// A positive input drives a joint to positive speeds, on the whole.
fn direction(recording: &Recording, joint: usize, findings: &mut Findings) {
    let Some(channel) = position(recording, joint) else { return };
    let speeds = mean_rate(recording, &channel.values);
    let mut sums = Correlation::default();
    for (&speed, &input) in speeds.iter().zip(&recording.duty[joint]) {
        if !speed.is_nan() && input != 0.0 {
            sums.add(input, speed);
        }
    }
    let correlation = sums.coefficient();
    if sums.count >= LEAST_SAMPLES && correlation < -FOLLOWS {
        findings.add(
            Severity::Error,
            About::Units,
            Some(&channel.spec.name),
            format!(
                "{} runs against its input (correlation of speed and input {correlation:.2})",
                recording.robot.joints[joint].name
            ),
            "swap the motor's wires or the encoder's channels, or change the sign of one column",
        );
    }
}

fn gyros(recording: &Recording, findings: &mut Findings) {
    let robot = &recording.robot;
    let joints = robot.joints.len();
    let columns: Option<Vec<&[f64]>> =
        (0..joints).map(|joint| Some(position(recording, joint)?.values.as_slice())).collect();
    let Some(columns) = columns else { return }; // a joint without an encoder: no prediction
    let speeds: Vec<Vec<f64>> = columns.iter().map(|values| mean_rate(recording, values)).collect();
    let slow: Vec<usize> = {
        let most = SLOW_INPUT * full_input(recording);
        (0..recording.len())
            .filter(|&k| recording.duty.iter().all(|u| u[k].abs() <= most) && speeds.iter().all(|v| !v[k].is_nan()))
            .collect()
    };
    // Predicted rate of every body in slow motion, in body axes.
    let chain = robot.chain();
    let (mut q, mut qd) = (vec![0.0; joints], vec![0.0; joints]);
    let bodies: Vec<Vec<[f64; 3]>> = slow
        .iter()
        .map(|&k| {
            for joint in 0..joints {
                q[joint] = columns[joint][k];
                qd[joint] = speeds[joint][k];
            }
            let mut rates = vec![[0.0; 3]; joints];
            chain.body_rates(&q, &qd, &mut rates);
            rates
        })
        .collect();
    for (index, gyro) in robot.gyros().enumerate() {
        gyro_follows(recording, index, gyro, &slow, &bodies, findings);
    }
}

fn gyro_follows(
    recording: &Recording,
    index: usize,
    gyro: &Gyro,
    slow: &[usize],
    bodies: &[Vec<[f64; 3]>],
    findings: &mut Findings,
) {
    let mut whole = Correlation::default();
    let mut axes = [Correlation::default(); 3];
    for axis in 0..3 {
        let kind = ChannelKind::GyroAxis { gyro: index, body: gyro.body, axis };
        let Some(channel) = recording.channels.iter().find(|channel| channel.spec.kind == kind) else { return };
        let bias = spread(&channel.values[recording.rest_window()]).map_or(gyro.bias_rad_s[axis], |rest| rest.mean);
        let measured = window_mean(recording, &channel.values);
        for (&k, rates) in slow.iter().zip(bodies) {
            if !measured[k].is_nan() {
                let rate = rates[gyro.body];
                let predicted: f64 = gyro.rotation[axis].iter().zip(rate).map(|(r, w)| r * w).sum();
                axes[axis].add(predicted, measured[k] - bias);
                whole.add(predicted, measured[k] - bias);
            }
        }
    }
    if whole.count < LEAST_SAMPLES || whole.predicted_rms() < VISIBLE_SIGMAS * gyro.sigma_rad_s {
        return;
    }
    let name = format!("gyro{}", index + 1);
    let (gain, correlation) = (whole.gain(), whole.coefficient());
    if correlation < FOLLOWS {
        let visible = VISIBLE_SIGMAS * gyro.sigma_rad_s;
        let told: Vec<String> = ["x", "y", "z"]
            .into_iter()
            .zip(&axes)
            .filter_map(|(letter, axis)| match (axis.predicted_rms() >= visible, axis.measured_rms() >= visible) {
                (true, _) => Some(format!("{letter} {:.2}", axis.coefficient())),
                (false, true) => Some(format!("{letter} turns and should not")),
                (false, false) => None,
            })
            .collect();
        findings.add(
            Severity::Warning,
            About::Units,
            Some(&name),
            format!("does not turn as the encoders say (correlation by axis: {})", told.join(", ")),
            "check the order and signs of its axes, the nominal rotation in the robot file, and the body that it sits on",
        );
        return;
    }
    if (1.0 / UNIT_FACTOR..UNIT_FACTOR).contains(&gain) {
        return;
    }
    let near = |unit: f64| (1.0 / UNIT_FACTOR..UNIT_FACTOR).contains(&(gain / unit));
    let (severity, advice) = if near(DEGREES) {
        (Severity::Error, "it looks like degrees per second: divide by 57.29578")
    } else if near(1.0 / DEGREES) {
        (Severity::Error, "it looks converted to rad/s twice: multiply by 57.29578")
    } else {
        (Severity::Error, "check the gyro's scale (range setting) and the encoders' counts per turn and gear")
    };
    let message = format!("reads {gain:.3} times the rates that the encoders give");
    findings.add(severity, About::Units, Some(&name), message, advice);
}

/// Sums of a predicted and a measured quantity whose means are meant to be zero.
#[derive(Debug, Default, Clone, Copy)]
struct Correlation {
    count: usize,
    predicted: f64,
    measured: f64,
    both: f64,
}

impl Correlation {
    fn add(&mut self, predicted: f64, measured: f64) {
        self.count += 1;
        self.predicted += predicted * predicted;
        self.measured += measured * measured;
        self.both += predicted * measured;
    }

    /// Measured over predicted, least squares.
    fn gain(&self) -> f64 {
        self.both / self.predicted
    }

    /// 1 if one is a positive multiple of the other, 0 if one of them is zero throughout.
    fn coefficient(&self) -> f64 {
        let scale = (self.predicted * self.measured).sqrt();
        if scale > 0.0 { self.both / scale } else { 0.0 }
    }

    fn predicted_rms(&self) -> f64 {
        (self.predicted / self.count.max(1) as f64).sqrt()
    }

    fn measured_rms(&self) -> f64 {
        (self.measured / self.count.max(1) as f64).sqrt()
    }
}
