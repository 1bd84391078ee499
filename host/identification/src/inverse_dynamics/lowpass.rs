//! Low-pass filters without phase: forwards, then backwards over the same samples.
//!
//! ```text
//! analogue poles p of the corner at 1 ─▶ bilinear, s = (1/w)(z − 1)/(z + 1) with w = tan(π f_c/f_s) ─▶ second-order sections
//! ```
//! Each section has unit gain at rest and starts as if its first value had lasted for ever; beyond both ends the samples are mirrored about the
//! end point, so that nothing rings there.

use std::f64::consts::PI;

/// y = b (x + 2 x₋₁ + x₋₂) − a₁ y₋₁ − a₂ y₋₂.
#[derive(Debug, Clone, Copy)]
struct Section {
    b: f64,
    a1: f64,
    a2: f64,
}

/// A chain of second-order sections.
#[derive(Debug, Clone)]
pub struct Lowpass {
    sections: Vec<Section>,
    /// Samples in which it settles.
    settles: usize,
}

impl Lowpass {
    /// Butterworth's filter of fourth order; `corner` is that frequency over the sampling frequency, below 1/2.
    pub fn butterworth(corner: f64) -> Self {
        Self::of_poles(corner, 4, |angle| [angle.sin(), angle.cos()])
    }

    /// Chebyshev's filter of eighth order with a ripple of 0.05 dB up to `corner`: what is customary before samples are dropped.
    pub fn chebyshev(corner: f64) -> Self {
        const ORDER: usize = 8;
        const RIPPLE_DB: f64 = 0.05;
        let mu = (10f64.powf(RIPPLE_DB / 10.0) - 1.0).sqrt().recip().asinh() / ORDER as f64;
        Self::of_poles(corner, ORDER, |angle| [mu.sinh() * angle.sin(), mu.cosh() * angle.cos()])
    }

    /// Pairs of poles −re ± i im at the angles (2k + 1) π / 2n.
    fn of_poles(corner: f64, order: usize, pole: impl Fn(f64) -> [f64; 2]) -> Self {
        let w = (PI * corner).tan();
        let section = |k: usize| {
            let [re, im] = pole(PI * (2 * k + 1) as f64 / (2 * order) as f64).map(|part| part * w);
            let square = re * re + im * im;
            let denominator = 1.0 + 2.0 * re + square;
            Section {
                b: square / denominator,
                a1: 2.0 * (square - 1.0) / denominator,
                a2: (1.0 - 2.0 * re + square) / denominator,
            }
        };
        let settles = (2.0 * f64::from(order as u32) / corner).ceil() as usize + 10;
        Lowpass { sections: (0..order / 2).map(section).collect(), settles }
    }

    /// The filtered samples.
    pub fn zero_phase(&self, samples: &[f64]) -> Vec<f64> {
        let (Some(&first), Some(&last)) = (samples.first(), samples.last()) else { return Vec::new() };
        let beyond = self.settles.min(samples.len() - 1);
        let before = samples[1..=beyond].iter().rev().map(|x| 2.0 * first - x);
        let after = samples[samples.len() - 1 - beyond..samples.len() - 1].iter().rev().map(|x| 2.0 * last - x);
        let mut extended: Vec<f64> = before.chain(samples.iter().copied()).chain(after).collect();
        for _ in 0..2 {
            self.sections.iter().for_each(|section| section.run(&mut extended));
            extended.reverse();
        }
        extended[beyond..beyond + samples.len()].to_vec()
    }
}

impl Section {
    fn run(&self, samples: &mut [f64]) {
        let Some(&start) = samples.first() else { return };
        let mut second = (self.b - self.a2) * start;
        let mut first = (2.0 * self.b - self.a1) * start + second;
        for x in samples {
            let y = self.b * *x + first;
            first = 2.0 * self.b * *x - self.a1 * y + second;
            second = self.b * *x - self.a2 * y;
            *x = y;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Amplitude of what is left of a sine of this frequency over the sampling frequency, in the middle of many periods.
    fn gain(filter: &Lowpass, frequency: f64) -> f64 {
        let samples: Vec<f64> = (0..4000).map(|k| (2.0 * PI * frequency * f64::from(k)).sin()).collect();
        let filtered = filter.zero_phase(&samples);
        let product = |a: &[f64], b: &[f64]| a[1000..3000].iter().zip(&b[1000..3000]).map(|(a, b)| a * b).sum::<f64>();
        product(&filtered, &samples) / product(&samples, &samples)
    }

    #[test]
    fn gains_are_those_of_the_filters_twice() {
        let butterworth = Lowpass::butterworth(0.1);
        // At the corner half the power, twice; atol 1e-3: no whole number of periods.
        assert!((gain(&butterworth, 0.1) - 0.5).abs() < 1e-3, "{}", gain(&butterworth, 0.1));
        assert!((gain(&butterworth, 0.01) - 1.0).abs() < 1e-3);
        // 1/(1 + (tan(0.3 π)/tan(0.1 π))⁸)
        assert!((gain(&butterworth, 0.3) - 9.7e-6).abs() < 1e-6, "{:e}", gain(&butterworth, 0.3));
        let chebyshev = Lowpass::chebyshev(0.04);
        // The ripple of 0.05 dB lies above the gain at rest: 0 to 1.2 % for both passes.
        for frequency in [0.004, 0.01, 0.02, 0.03, 0.039] {
            let gain = gain(&chebyshev, frequency);
            assert!((0.999..1.013).contains(&gain), "{frequency}: {gain}");
        }
        assert!(gain(&chebyshev, 0.06) < 0.01, "{}", gain(&chebyshev, 0.06));
    }

    #[test]
    fn straight_lines_pass_unchanged() {
        let line: Vec<f64> = (0..300).map(|k| 3.0 - 0.2 * f64::from(k)).collect();
        for filter in [Lowpass::butterworth(0.1), Lowpass::chebyshev(0.04)] {
            for (a, b) in filter.zero_phase(&line).iter().zip(&line) {
                // atol 1e-3 of a range of 60: the mirrored ends are what the line goes on as, and the start is taken for rest
                assert!((a - b).abs() < 1e-3, "{a} against {b}");
            }
        }
    }
}
