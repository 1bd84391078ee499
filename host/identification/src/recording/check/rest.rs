//! The window before the first input: the robot rests, gyros show bias and noise.

use serde::{Deserialize, Serialize};

use super::stats::spread;
use super::{About, Findings};
use crate::recording::{Recording, Severity};
use crate::robot::ChannelKind;

/// Shorter than this, the window shows no bias worth the name, s.
const LEAST_S: f64 = 0.2;
/// What the calibration motion is meant to have, s.
const WANTED_S: f64 = 3.0;
/// Noise may differ from the robot file's by this factor without a word.
const NOISE_FACTOR: f64 = 2.0;
/// Block means may scatter by this many times what white noise does; a robot that moves is far beyond.
const MOTION_FACTOR: f64 = 5.0;
/// Readings that span at most so many steps of their sensor are those of a joint that rests between two counts.
const RESTING_STEPS: f64 = 2.0;
/// Blocks into which the window is cut to see motion.
const BLOCKS: usize = 10;
/// Fewest samples of which a noise is told.
const LEAST_SAMPLES: usize = 100;

/// A channel while the robot rests.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ChannelAtRest {
    /// Name as in results.
    pub channel: String,
    /// Unit of the numbers.
    pub unit: String,
    /// Mean: a gyro's bias, an encoder's position.
    pub mean: f64,
    /// Standard deviation.
    pub sigma: f64,
    /// What the robot file says of it.
    pub sigma_described: f64,
    /// Scatter of the means of ten blocks, against what white noise of that sigma gives (1); 0 for no noise at all.
    pub unrest: f64,
}

pub(super) fn look(recording: &Recording, findings: &mut Findings) -> Vec<ChannelAtRest> {
    let window = recording.rest_window();
    let length_s = window.end.checked_sub(1).map_or(0.0, |last| recording.time_s(last));
    length(length_s, recording, findings);
    let channels: Vec<ChannelAtRest> =
        recording.channels.iter().filter_map(|channel| at_rest(channel, &channel.values[window.clone()])).collect();
    // Without any input, the window is the whole recording, and whether it rests does not matter.
    if window.len() >= LEAST_SAMPLES && window.len() < recording.len() {
        for (channel, rest) in recording.channels.iter().filter_map(|c| Some((c, find(&channels, &c.spec.name)?))) {
            noise(rest, matches!(channel.spec.kind, ChannelKind::GyroAxis { .. }), findings);
        }
        motion(&channels, recording, findings);
    }
    channels
}

fn find<'a>(channels: &'a [ChannelAtRest], name: &str) -> Option<&'a ChannelAtRest> {
    channels.iter().find(|channel| channel.channel == name)
}

fn length(length_s: f64, recording: &Recording, findings: &mut Findings) {
    if recording.rest_window().len() == recording.len() {
        findings.add(
            Severity::Error,
            About::Excitation,
            None,
            "the input is zero in the whole recording".to_owned(),
            "play a motion while recording; in a table, check that u1… are the inputs that were commanded",
        );
    } else if length_s < WANTED_S && recording.robot.gyros().next().is_some() {
        let severity = if length_s < LEAST_S { Severity::Warning } else { Severity::Note };
        findings.add(
            severity,
            About::BiasWindow,
            None,
            format!("the robot rests for {length_s:.2} s before the first input"),
            "begin the motion with a hold of 3 s at zero input: gyro biases and noise are read there",
        );
    }
}

fn at_rest(channel: &crate::recording::Channel, values: &[f64]) -> Option<ChannelAtRest> {
    let all = spread(values)?;
    let block = values.len().div_ceil(BLOCKS);
    let means: Vec<f64> = values.chunks_exact(block).filter_map(|block| Some(spread(block)?.mean)).collect();
    // Quantised readings may scatter less than a step; half a sigma of the robot file is the least noise assumed.
    let white = all.deviation.max(0.5 * channel.spec.sigma) / (block as f64).sqrt();
    Some(ChannelAtRest {
        channel: channel.spec.name.clone(),
        unit: channel.spec.unit.to_owned(),
        mean: all.mean,
        sigma: all.deviation,
        sigma_described: channel.spec.sigma,
        unrest: match stands_between_counts(values) {
            true => 0.0,
            false => spread(&means).map_or(0.0, |spread| spread.deviation) / white,
        },
    })
}

/// Whether all readings are a few neighbouring counts: a count that comes and goes is not noise, and no motion either.
fn stands_between_counts(values: &[f64]) -> bool {
    let mut counts: Vec<f64> = values.iter().copied().filter(|value| !value.is_nan()).collect();
    counts.sort_by(f64::total_cmp);
    counts.dedup();
    let step = counts.windows(2).map(|pair| pair[1] - pair[0]).fold(f64::INFINITY, f64::min);
    match (counts.first(), counts.last()) {
        // Counts that were rounded to decimals differ in their last one.
        (Some(low), Some(high)) if counts.len() > 1 => high - low <= (RESTING_STEPS + 0.1) * step,
        _ => true,
    }
}

/// An encoder at rest may give one and the same count: only a gyro's noise can be too small.
fn noise(rest: &ChannelAtRest, is_gyro: bool, findings: &mut Findings) {
    let mut add = |severity, message: String, advice| {
        findings.add(severity, About::BiasWindow, Some(&rest.channel), message, advice);
    };
    let ChannelAtRest { sigma, sigma_described, unit, .. } = rest;
    if is_gyro && *sigma < 1e-6 * sigma_described {
        add(
            Severity::Warning,
            format!("the reading never changes at rest ({} {unit})", rest.mean),
            "is the gyro connected and updated every tick? Or is its step coarser than its noise?",
        );
    } else if *sigma > NOISE_FACTOR * sigma_described || (is_gyro && *sigma * NOISE_FACTOR < *sigma_described) {
        let advice = match sigma > sigma_described {
            true => "shield the sensor, let the robot come to rest first, or write this sigma into the robot file",
            false => "write this sigma into the robot file; or does the sensor filter, which delays it?",
        };
        let message = format!("noise at rest is {sigma:.3e} {unit}, the robot file says {sigma_described:.3e}");
        add(Severity::Warning, message, advice);
    }
}

fn motion(channels: &[ChannelAtRest], recording: &Recording, findings: &mut Findings) {
    let worst = channels.iter().filter(|c| c.unrest > MOTION_FACTOR).max_by(|a, b| a.unrest.total_cmp(&b.unrest));
    if let Some(worst) = worst {
        let unit = recording.channel(&worst.channel).map_or("", |channel| channel.spec.unit);
        findings.add(
            Severity::Warning,
            About::BiasWindow,
            Some(&worst.channel),
            format!(
                "the robot does not rest before the motion: means wander {:.1} times as far as noise does (sigma {:.2e} {unit})",
                worst.unrest, worst.sigma
            ),
            match worst.channel.starts_with("gyro") {
                true => "wait until the robot is still and nobody touches it, then start the motion; a warm-up drift of a gyro looks the same",
                false => "wait until the robot is still and nobody touches it, then start the motion",
            },
        );
    }
}
