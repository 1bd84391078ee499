//! What a calibration loses where nobody tells how old the words of gyros are, though they convert by clocks of their own.

use super::calibration::Calibration;
use crate::recording::Recording;
use crate::robot::{ChannelKind, Robot};

/// Samples between two whose difference tells an acceleration: noise of single readings matters less.
const APART: usize = 10;

/// A sentence for every gyro of a recording whose ages are not told.
///
/// An age that is unknown between nothing and a period P is taken for its mean, which is part of the lag that is estimated. What is left
/// scatters by P/√12, and a reading by so much times the rate's own change.
pub(crate) fn sentences(robot: &Robot, recordings: &[&Recording], calibration: &Calibration) -> Vec<String> {
    let mut sentences = Vec::new();
    for (gyro, sensor) in robot.gyros().enumerate() {
        for (number, recording) in recordings.iter().enumerate() {
            let told = recording.gyro_times.get(gyro).and_then(|told| told.output_rate_hz);
            let Some(rate_hz) = told.filter(|rate_hz| *rate_hz > 0.0) else { continue };
            if recording.ticks.iter().any(|tick| tick.gyro_ages_us.get(gyro).is_some_and(|age| age.is_finite())) {
                continue;
            }
            let scatter_s = 1.0 / rate_hz / 12_f64.sqrt();
            let error = scatter_s * change_per_s(recording, gyro);
            let name = format!("gyro{}", gyro + 1);
            let noise = calibration.noise.iter().find(|noise| noise.channel.starts_with(&name));
            let sigma = noise.map_or(sensor.sigma_rad_s, |noise| noise.sigma);
            let of = if recordings.len() > 1 { format!(" in recording {}", number + 1) } else { String::new() };
            sentences.push(format!(
                "the device does not tell how old the words of gyro {}{of} are: by up to {:.2} ms. In this motion that is an error of \
                 {error:.1e} rad/s beside a noise of {sigma:.1e} rad/s, which is no white noise, and the mean age is part of the lag; \
                 wire the gyro's \"data ready\" to the board's capture pin",
                gyro + 1,
                1e3 / rate_hz,
            ));
        }
    }
    sentences
}

/// Root mean square change of a gyro's rate about an axis, rad/s².
fn change_per_s(recording: &Recording, gyro: usize) -> f64 {
    let of_gyro = |kind| matches!(kind, ChannelKind::GyroAxis { gyro: g, .. } if g == gyro);
    let (mut sum, mut count) = (0.0, 0.0_f64);
    for channel in recording.channels.iter().filter(|channel| of_gyro(channel.spec.kind)) {
        let apart = channel.values.windows(APART + 1).map(|values| values[APART] - values[0]);
        for difference in apart.filter(|difference| difference.is_finite()) {
            (sum, count) = (sum + difference * difference, count + 1.0);
        }
    }
    (sum / count.max(1.0)).sqrt() / (APART as f64 * recording.period_s)
}
