//! A ripple: some waves of one turn, of any size and phase.
//!
//! ```text
//! τ(φ) = Σ_k a_k sin(w_k φ) + b_k cos(w_k φ)      w_k: whole numbers
//! ```
//! A smooth curve over an angle follows few waves; what has many of them a turn, as magnets that pass teeth do, is followed by these.

use std::f64::consts::TAU;

/// Which waves: so many of them a turn.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Waves(pub Vec<u8>);

impl Waves {
    /// A sine and a cosine for each.
    pub fn coefficients(&self) -> usize {
        2 * self.0.len()
    }

    /// One turn.
    pub fn range(&self) -> [f64; 2] {
        [0.0, TAU]
    }

    /// Tells `f` all of them at an angle, as (index, value, slope).
    #[inline(always)]
    pub fn each(&self, angle: f64, mut f: impl FnMut(usize, f64, f64)) {
        for (k, &wave) in self.0.iter().enumerate() {
            let wave = f64::from(wave);
            let (sin, cos) = (wave * angle).sin_cos();
            f(2 * k, sin, wave * cos);
            f(2 * k + 1, cos, -wave * sin);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn waves_come_back_after_a_turn_and_have_the_slopes_of_differences() {
        let waves = Waves(vec![1, 5, 14]);
        let both = |angle: f64| {
            let mut both = (0.0, 0.0);
            waves.each(angle, |i, value, slope| {
                both.0 += (1.0 + i as f64) * value;
                both.1 += (1.0 + i as f64) * slope;
            });
            both
        };
        let value = |angle: f64| both(angle).0;
        for angle in [-3.0, 0.0, 0.3, 2.0] {
            assert!((value(angle) - value(angle + TAU)).abs() < 1e-12);
            let slope = both(angle).1;
            let by = 1e-6;
            let expected = (value(angle + by) - value(angle - by)) / (2.0 * by);
            assert!((slope - expected).abs() < 1e-6 * (1.0 + expected.abs()), "{angle}: {slope} and {expected}");
        }
        let mut count = 0;
        waves.each(0.0, |_, _, _| count += 1);
        assert_eq!(count, waves.coefficients());
    }
}
