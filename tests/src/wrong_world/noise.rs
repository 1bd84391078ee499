//! Random numbers of the study: independent streams for each purpose, coloured noise and random smooth functions.

use std::f64::consts::TAU;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

/// The purposes of random numbers. Each purpose has an independent stream.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u64)]
pub enum Purpose {
    /// The machine's numbers.
    Machine = 1,
    /// The motion.
    Motion = 2,
    /// The main effect.
    Main = 3,
    /// Effects at trace size.
    Traces = 4,
    /// Unmodelled torque.
    Torque = 5,
    /// Sensors and stamps.
    Sensors = 6,
}

/// The stream of a family's seed for a purpose.
pub fn stream(family: u64, seed: u64, purpose: Purpose) -> ChaCha8Rng {
    nth_stream(family, seed, purpose, 0)
}

/// The n-th of several independent streams for the same purpose.
pub fn nth_stream(family: u64, seed: u64, purpose: Purpose, nth: u64) -> ChaCha8Rng {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    rng.set_stream(1000 * nth + 100 * family + purpose as u64);
    rng
}

/// A value of the standard normal distribution.
pub fn normal(rng: &mut ChaCha8Rng) -> f64 {
    StandardNormal.sample(rng)
}

/// A first-order autoregressive process, AR(1).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Coloured {
    sigma: f64,
    decay: f64,
    value: f64,
}

impl Coloured {
    /// Of standard deviation `sigma` and correlation time `time_s`, sampled every `step_s`. The first value is drawn from the stationary distribution.
    pub fn new(sigma: f64, time_s: f64, step_s: f64, rng: &mut ChaCha8Rng) -> Self {
        Self { sigma, decay: (-step_s / time_s).exp(), value: sigma * normal(rng) }
    }

    /// The next value.
    pub fn next(&mut self, rng: &mut ChaCha8Rng) -> f64 {
        self.value = self.decay * self.value + self.sigma * (1.0 - self.decay * self.decay).sqrt() * normal(rng);
        self.value
    }
}

/// A random smooth function: the sum of three sines of random wavelength and phase.
#[derive(Debug, Clone, PartialEq)]
pub struct Smooth {
    waves: [[f64; 3]; 3],
}

impl Smooth {
    /// Of RMS `rms`, with wavelengths of a fifth to the whole of `span`.
    pub fn new(rms: f64, span: f64, rng: &mut ChaCha8Rng) -> Self {
        let amplitude = rms * (2.0_f64 / 3.0).sqrt();
        Self {
            waves: [(); 3].map(|()| [amplitude, TAU / (span * rng.random_range(0.2..1.0)), rng.random_range(0.0..TAU)]),
        }
    }

    /// Its value.
    pub fn at(&self, x: f64) -> f64 {
        self.waves.iter().map(|[amplitude, per_unit, phase]| amplitude * (per_unit * x + phase).sin()).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn coloured_noise_has_its_deviation_and_its_correlation() {
        let mut rng = stream(0, 1, Purpose::Torque);
        let mut noise = Coloured::new(2.0, 0.05, 0.001, &mut rng);
        let values: Vec<f64> = (0..400_000).map(|_| noise.next(&mut rng)).collect();
        let mean = |f: &dyn Fn(usize) -> f64, n: usize| (0..n).map(f).sum::<f64>() / n as f64;
        let variance = mean(&|k| values[k] * values[k], values.len());
        let late = mean(&|k| values[k] * values[k + 50], values.len() - 50);
        // 4000 independent pieces: 3 % of each
        assert!((variance / 4.0 - 1.0).abs() < 0.08, "{variance}");
        assert!((late / variance - (-1.0_f64).exp()).abs() < 0.06, "{late}");
    }
}
