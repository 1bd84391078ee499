//! What an extension brings on a motion that it was not fitted to: predictions of both models over the same windows.

use super::bootstrap;
use super::result::ChannelGain;
use crate::calibrate::Calibration;
use crate::recording::Recording;
use crate::robot::ChannelKind;
use crate::verify::{CalibratedModel, VerifyError, windows};
use solve::threads;

/// Blocks that are drawn, s: errors of windows further apart are independent.
const BLOCK_S: f64 = 1.0;
/// Of the draws.
const SEED: u64 = 1;

/// The gain of `extended` over `base` on `recording`, by horizon and sensor (a gyro's axes together).
///
/// # Errors
/// As a verification's.
pub fn gain(
    base: &Calibration,
    extended: &Calibration,
    recording: &Recording,
    threads: usize,
) -> Result<Vec<ChannelGain>, VerifyError> {
    let models = [CalibratedModel::of(base, None)?, CalibratedModel::of(extended, None)?];
    let (base, extended) = threads::both(threads, || windows(&models[0], recording), || windows(&models[1], recording));
    let (base, extended) = (base?, extended?);
    let sensors = sensors(recording);
    let mut gains = Vec::new();
    for (base, extended) in base.iter().zip(&extended) {
        // Either filter may have settled a little later.
        let pairs: Vec<(usize, usize)> = {
            let place = |k: &usize| extended.starts.binary_search(k).ok();
            base.starts.iter().enumerate().filter_map(|(i, k)| Some((i, place(k)?))).collect()
        };
        let start_s: Vec<f64> = pairs.iter().map(|(i, _)| recording.time_s(base.starts[*i])).collect();
        for (name, channels) in &sensors {
            let error = |errors: &[Vec<f64>], window: usize| {
                (channels.iter().map(|c| errors[*c][window].powi(2)).sum::<f64>() / channels.len() as f64).sqrt()
            };
            let of_base: Vec<f64> = pairs.iter().map(|(i, _)| error(&base.errors, *i)).collect();
            let of_extended: Vec<f64> = pairs.iter().map(|(_, j)| error(&extended.errors, *j)).collect();
            let gain = bootstrap::gain(&start_s, &of_base, &of_extended, BLOCK_S.max(base.horizon_s), SEED);
            if let Some(gain) = gain {
                gains.push(ChannelGain { horizon_s: base.horizon_s, channel: name.clone(), gain });
            }
        }
    }
    Ok(gains)
}

/// Sensors with their channels.
fn sensors(recording: &Recording) -> Vec<(String, Vec<usize>)> {
    let mut sensors: Vec<(String, Vec<usize>)> = Vec::new();
    for (channel, of) in recording.channels.iter().enumerate() {
        let name = match of.spec.kind {
            ChannelKind::GyroAxis { gyro, .. } => format!("gyro{}", gyro + 1),
            _ => of.spec.name.clone(),
        };
        match sensors.iter_mut().find(|(other, _)| *other == name) {
            Some((_, channels)) => channels.push(channel),
            None => sensors.push((name, vec![channel])),
        }
    }
    sensors
}
