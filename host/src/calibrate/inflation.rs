//! How much more residuals wander than the noise that they are weighted by.
//!
//! ```text
//! residuals of a channel / σ   |· · · ·|· · · ·|· · · ·|      blocks of m samples, sums S
//!                                 S       S       S           S² / m is 1 on average for white noise of σ, for any m
//! ```
//!
//! A score trusts its weights: noise that is correlated in time, or stamps that jitter, make every score too large by about the factor by which
//! sums of residuals wander too far. It is measured here and divides scores where their significance is asked, and nowhere else: a real
//! effect makes residuals wander too, but its score by far more.

use super::point::Point;
use super::problem::Problem;
use solve::LeastSquares;

/// Samples of a block.
const BLOCKS: [usize; 4] = [1, 4, 16, 64];
/// Fewer blocks tell nothing.
const FEWEST: usize = 30;
/// Standard errors by which a ratio has to exceed 1.
const SURE: f64 = 2.0;

/// The largest ratio of all channels and lengths, less two of its standard errors; 1 for noise as it was taken to be. Samples before a recording's
/// first input are left out: an encoder at rest repeats one count.
pub(super) fn inflation<'m>(problem: &Problem<'m>, point: &Point<'m>) -> f64 {
    let mut channels = vec![[Ratio::default(); BLOCKS.len()]; problem.series.channels.len()];
    let mut scratch = problem.scratch();
    for k in 0..problem.series.stages() {
        if problem.series.starts_run(k) {
            channels.iter_mut().flatten().for_each(Ratio::begin);
        }
        if problem.series.rest.iter().any(|rest| rest.contains(&k)) {
            continue;
        }
        problem.sensor_rows(point, k, &mut scratch, false, &mut |row| {
            let Some(channel) = row.channel else { return };
            for (ratio, length) in channels[channel].iter_mut().zip(BLOCKS) {
                ratio.add(row.weight * row.residual, length);
            }
        });
    }
    channels
        .iter()
        .flatten()
        .zip(BLOCKS.iter().cycle())
        .map(|(ratio, length)| ratio.surely(*length))
        .fold(1.0, f64::max)
}

/// Sums of blocks of one length.
#[derive(Debug, Clone, Copy, Default)]
struct Ratio {
    sum: f64,
    count: usize,
    squares: f64,
    blocks: usize,
}

impl Ratio {
    fn begin(&mut self) {
        (self.sum, self.count) = (0.0, 0);
    }

    fn add(&mut self, residual: f64, length: usize) {
        self.sum += residual;
        self.count += 1;
        if self.count == length {
            self.squares += self.sum * self.sum;
            self.blocks += 1;
            self.begin();
        }
    }

    fn surely(&self, length: usize) -> f64 {
        if self.blocks < FEWEST {
            return 1.0;
        }
        let ratio = self.squares / (self.blocks * length) as f64;
        // Squares of normal sums: χ² of one degree of freedom each.
        ratio * (1.0 - SURE * (2.0 / self.blocks as f64).sqrt())
    }
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    use super::*;

    /// The largest ratio of one channel with this noise.
    fn of(mut noise: impl FnMut() -> f64) -> f64 {
        let mut ratios = [Ratio::default(); BLOCKS.len()];
        for _ in 0..12_000 {
            let residual = noise();
            ratios.iter_mut().zip(BLOCKS).for_each(|(ratio, length)| ratio.add(residual, length));
        }
        ratios.iter().zip(BLOCKS).map(|(ratio, length)| ratio.surely(length)).fold(1.0, f64::max)
    }

    #[test]
    fn white_noise_is_not_inflated_and_coloured_noise_is_by_its_density_at_rest() {
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        let mut white = || StandardNormal.sample(&mut rng);
        let found = of(&mut white);
        assert!(found < 1.05, "white: {found}");
        let found = of(|| 1.5 * white());
        assert!((2.0..2.3).contains(&found), "half as much again: 2.25, measured {found}");
        // First order, correlation 0.7 from sample to sample, variance 1: (1 + ρ) / (1 − ρ) = 5.7 at rest.
        let mut state = 0.0;
        let found = of(|| {
            state = 0.7 * state + (1.0 - 0.7_f64.powi(2)).sqrt() * white();
            state
        });
        assert!((4.0..5.7).contains(&found), "coloured: {found}");
    }
}
