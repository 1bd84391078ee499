//! Sums that several subjects need. NaN (no valid reading) is left out everywhere.

use crate::recording::{Channel, Recording};
use crate::robot::{ChannelKind, InputUnit};

/// Half the window over which an encoder's speed is taken, s: long against its steps, short against the motion.
const HALF_WINDOW_S: f64 = 0.010;

/// Number, mean and standard deviation of the valid values.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Spread {
    pub count: usize,
    pub mean: f64,
    pub deviation: f64,
}

pub(super) fn spread(values: &[f64]) -> Option<Spread> {
    let valid = || values.iter().copied().filter(|value| !value.is_nan());
    let count = valid().count();
    if count == 0 {
        return None;
    }
    let mean = valid().sum::<f64>() / count as f64;
    let squares = valid().map(|value| (value - mean).powi(2)).sum::<f64>();
    Some(Spread { count, mean, deviation: (squares / (count.max(2) - 1) as f64).sqrt() })
}

/// Least and greatest valid value.
pub(super) fn range(values: &[f64]) -> Option<(f64, f64)> {
    values.iter().copied().filter(|value| !value.is_nan()).fold(None, |range, value| match range {
        None => Some((value, value)),
        Some((low, high)) => Some((low.min(value), high.max(value))),
    })
}

/// Samples on each side of the window over which speeds are taken.
pub(super) fn half_window(recording: &Recording) -> usize {
    ((HALF_WINDOW_S / recording.period_s).round() as usize).max(1)
}

/// Where a joint's position is read: its motor encoder, else its link encoder.
pub(super) fn position(recording: &Recording, joint: usize) -> Option<&Channel> {
    let of = |kind| recording.channels.iter().find(|channel| channel.spec.kind == kind);
    of(ChannelKind::MotorPosition { joint }).or_else(|| of(ChannelKind::LinkPosition { joint }))
}

/// Mean rate of change of `values` over the window around each sample; NaN near gaps and ends.
pub(super) fn mean_rate(recording: &Recording, values: &[f64]) -> Vec<f64> {
    let half = half_window(recording);
    let mut rates = vec![f64::NAN; recording.len()];
    for segment in recording.segments() {
        for k in segment.start + half..segment.end.saturating_sub(half) {
            let span_s = recording.time_s(k + half) - recording.time_s(k - half);
            rates[k] = (values[k + half] - values[k - half]) / span_s;
        }
    }
    rates
}

/// Mean of `values` over the same windows as [`mean_rate`]; NaN where a value in them is.
pub(super) fn window_mean(recording: &Recording, values: &[f64]) -> Vec<f64> {
    let half = half_window(recording);
    let mut means = vec![f64::NAN; recording.len()];
    for segment in recording.segments() {
        for k in segment.start + half..segment.end.saturating_sub(half) {
            // The ends count half, as in the integral whose difference the rate is.
            let inner: f64 = values[k - half + 1..k + half].iter().sum();
            means[k] = (inner + 0.5 * (values[k - half] + values[k + half])) / (2 * half) as f64;
        }
    }
    means
}

/// `values` smoothed by a triangle of so many samples on either side; NaN near gaps and ends, and where most values in it are.
pub(super) fn smooth(recording: &Recording, values: &[f64], half: usize) -> Vec<f64> {
    let mut smoothed = vec![f64::NAN; recording.len()];
    for run in recording.segments() {
        let width = 2 * (half / 2) + 1;
        let once = means(&values[run.clone()], width, width / 2 + 1);
        for (k, value) in means(&once, width, width).into_iter().enumerate() {
            smoothed[run.start + k] = value;
        }
    }
    smoothed
}

/// Mean of the valid values in a window of `width` samples (an odd number) around each; NaN at the ends, and where fewer than `least` are valid.
fn means(values: &[f64], width: usize, least: usize) -> Vec<f64> {
    let (mut sum, mut valid) = (0.0, 0usize);
    let mut means = vec![f64::NAN; values.len()];
    for k in 0..values.len() {
        if !values[k].is_nan() {
            sum += values[k];
            valid += 1;
        }
        if let Some(gone) = k.checked_sub(width).filter(|gone| !values[*gone].is_nan()) {
            sum -= values[gone];
            valid -= 1;
        }
        if k + 1 >= width && valid >= least {
            means[k - width / 2] = sum / valid as f64;
        }
    }
    means
}

/// What counts as full input: 1 for a duty, else the greatest input of the recording.
pub(super) fn full_input(recording: &Recording) -> f64 {
    match recording.robot.input.unit {
        InputUnit::Duty => 1.0,
        _ => recording.duty.iter().flatten().fold(0.0, |max: f64, u| max.max(u.abs())),
    }
}

/// Signs of a signal with hysteresis: each change between beyond −threshold and beyond +threshold, by sample.
pub(super) fn reversals(values: &[f64], threshold: f64) -> Vec<usize> {
    let mut side = 0.0;
    let mut reversals = Vec::new();
    for (k, &value) in values.iter().enumerate() {
        if value.abs() > threshold {
            if side * value < 0.0 {
                reversals.push(k);
            }
            side = value.signum();
        }
    }
    reversals
}
