//! Readings at the end of a sensor's range, and readings that are not there.

use protocol::Flags;

use super::stats::range;
use super::{About, Findings};
use crate::recording::{Channel, Recording, Severity};
use crate::robot::ChannelKind;

/// From this share of its range on, a gyro counts as saturated.
const RANGE_SHARE: f64 = 0.995;
/// Share of samples whose loss in one channel costs accuracy.
const INVALID_WARNING: f64 = 0.01;
/// Share of samples whose loss in one channel makes it useless.
const INVALID_ERROR: f64 = 0.5;
/// Many times its range are no readings of a gyro, in any unit but one that the encoders betray.
const IMPOSSIBLE_RANGES: f64 = 100.0;
/// No link or gyro turns so fast, rad/s (or m/s).
const FASTEST_RAD_S: f64 = 1e5;
/// As many equal readings in a row at the very end of what was read are no coincidence in a gyro's noise.
const CLIPPED_RUN: usize = 5;

pub(super) fn look(recording: &Recording, findings: &mut Findings) {
    for channel in &recording.channels {
        let name = channel.spec.name.as_str();
        let mut add = |severity, message, advice: &str| {
            findings.add(severity, About::Saturation, Some(name), message, advice);
        };
        invalid(channel, &mut add);
        impossible(recording, channel, &mut add);
        if recording.len() > 1 && range(&channel.values).is_some_and(|(low, high)| low == high) {
            let reading = range(&channel.values).map_or(f64::NAN, |(low, _)| low);
            // The encoder of a joint that nothing drives may well stand still.
            let severity = if undriven(recording, channel) { Severity::Warning } else { Severity::Error };
            add(
                severity,
                format!("the reading is {reading} {} in every sample", channel.spec.unit),
                "is the sensor connected? In a table, is this the right column?",
            );
        } else if let ChannelKind::GyroAxis { gyro, .. } = channel.spec.kind {
            let range_rad_s = recording.robot.gyros().nth(gyro).and_then(|gyro| gyro.range_rad_s);
            clipped(channel, range_rad_s, &mut add);
        }
    }
    limited(recording, findings);
}

/// Whether the channel is one of a joint whose input is zero throughout.
fn undriven(recording: &Recording, channel: &Channel) -> bool {
    match channel.spec.kind {
        ChannelKind::MotorPosition { joint }
        | ChannelKind::LinkPosition { joint }
        | ChannelKind::MotorSpeed { joint }
        | ChannelKind::LinkSpeed { joint } => recording.duty[joint].iter().all(|&input| input == 0.0),
        ChannelKind::GyroAxis { .. } => false,
    }
}

/// Readings beyond anything that such a sensor gives. Positions are held against the joint's limits elsewhere.
fn impossible(recording: &Recording, channel: &Channel, add: &mut impl FnMut(Severity, String, &str)) {
    let most = match channel.spec.kind {
        ChannelKind::GyroAxis { gyro, .. } => {
            let range_rad_s = recording.robot.gyros().nth(gyro).and_then(|gyro| gyro.range_rad_s);
            range_rad_s.map_or(FASTEST_RAD_S, |full| IMPOSSIBLE_RANGES * full)
        }
        ChannelKind::MotorSpeed { .. } | ChannelKind::LinkSpeed { .. } => FASTEST_RAD_S,
        ChannelKind::MotorPosition { .. } | ChannelKind::LinkPosition { .. } => return,
    };
    let count = channel.values.iter().filter(|value| value.abs() > most).count();
    let worst = range(&channel.values).map_or(0.0, |(low, high)| low.abs().max(high.abs()));
    // Many of them are another unit, which is told by the encoders.
    if count > 0 && (count as f64) < INVALID_WARNING * channel.values.len() as f64 {
        add(
            Severity::Error,
            format!("{count} readings are no rates (up to {worst:.3e} {})", channel.spec.unit),
            "leave these fields empty in the table (the sensor had no valid reading), and look for what made them",
        );
    }
}

fn invalid(channel: &Channel, add: &mut impl FnMut(Severity, String, &str)) {
    let invalid = channel.values.iter().filter(|value| value.is_nan()).count();
    if invalid == 0 {
        return;
    }
    let share = invalid as f64 / channel.values.len() as f64;
    let severity = match share {
        share if share > INVALID_ERROR => Severity::Error,
        share if share > INVALID_WARNING => Severity::Warning,
        _ => Severity::Note,
    };
    add(
        severity,
        format!("{invalid} samples ({:.2} %) have no valid reading (stale or saturated)", 100.0 * share),
        "check the sensor's bus and data rate; if it saturates, choose a larger range or a slower fast stage",
    );
}

fn clipped(channel: &Channel, range_rad_s: Option<f64>, add: &mut impl FnMut(Severity, String, &str)) {
    let larger = "choose a larger range of the gyro, or a slower fast stage";
    if let Some(full) = range_rad_s {
        let at_end = channel.values.iter().filter(|value| value.abs() >= RANGE_SHARE * full).count();
        if at_end > 0 {
            add(
                Severity::Warning,
                format!("{at_end} samples stand at the end of the gyro's range of {full:.3} rad/s"),
                larger,
            );
            return;
        }
    }
    let Some((low, high)) = range(&channel.values) else { return };
    let runs = [low, high].map(|end| match end.abs() > 100.0 * channel.spec.sigma {
        true => longest_run(&channel.values, end),
        false => 0,
    });
    if runs.iter().any(|&run| run >= CLIPPED_RUN) {
        let run = runs[0].max(runs[1]);
        add(
            Severity::Warning,
            format!("{run} samples in a row stand at the end of all readings ({low} … {high}): it looks clipped"),
            larger,
        );
    }
}

fn longest_run(values: &[f64], wanted: f64) -> usize {
    let mut longest = 0;
    let mut run = 0;
    for &value in values {
        run = if value == wanted { run + 1 } else { 0 };
        longest = longest.max(run);
    }
    longest
}

/// Ticks in which the safety of the device took part in the motion.
fn limited(recording: &Recording, findings: &mut Findings) {
    let limited = recording
        .ticks
        .iter()
        .filter(|tick| Flags::from_bits_truncate(tick.flags).contains(Flags::POSITION_LIMITED))
        .count();
    if limited > 0 {
        findings.add(
            Severity::Note,
            About::Saturation,
            None,
            format!("in {limited} ticks the device lowered the duty because a joint came near its end"),
            "nothing is wrong with these samples; a smaller amplitude leaves the joints more room",
        );
    }
}
