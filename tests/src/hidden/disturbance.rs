//! What spoils a recording without being a cause: the diagnosis has to stay silent about it.

use host::recording::Recording;
use host::robot::ChannelKind;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use serde::{Deserialize, Serialize};

/// Standard deviation of a stamp, µs: samples are taken every millisecond, stamps say otherwise.
const STAMP_US: f64 = 10.0;
/// Correlation of coloured noise from one sample to the next: a low-pass of 50 Hz at 1 kHz.
const CORRELATION: f64 = 0.73;

/// What is done to a recording.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Disturbance {
    /// Nothing.
    #[default]
    Nothing,
    /// Stamps jitter.
    JitteredStamps,
    /// Gyros have coloured noise of a standard deviation like that of their white noise, beside it.
    ColouredNoise,
}

impl Disturbance {
    /// Does it, from a seed.
    pub fn act(self, recording: &mut Recording, seed: u64) {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
        match self {
            Disturbance::Nothing => {}
            Disturbance::JitteredStamps => {
                for t in recording.t_us.iter_mut().skip(1) {
                    // Four standard deviations are far from the half period at which stamps would change places.
                    *t = t.saturating_add_signed((STAMP_US * normal().clamp(-4.0, 4.0)).round() as i64);
                }
            }
            Disturbance::ColouredNoise => {
                let is_gyro = |kind| matches!(kind, ChannelKind::GyroAxis { .. });
                for channel in recording.channels.iter_mut().filter(|channel| is_gyro(channel.spec.kind)) {
                    let mut noise = channel.spec.sigma * normal();
                    for value in &mut channel.values {
                        *value += noise;
                        let fresh = channel.spec.sigma * (1.0 - CORRELATION * CORRELATION).sqrt();
                        noise = CORRELATION * noise + fresh * normal();
                    }
                }
            }
        }
    }
}
