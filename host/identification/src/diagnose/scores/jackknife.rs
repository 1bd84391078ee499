//! Errors of parameters by the jackknife that leaves blocks of time out together with their neighbours.
//!
//! ```text
//!   θ₋b: without block b and the m_b − 1 that follow on it or go before      Var θ = Σ_b (n − m_b) / (n m_b) (θ₋b − θ̄)²
//! ```
//! Residuals that are correlated over less than a block are allowed for (the moving-block jackknife: Künsch 1989; Liu and Singh 1992). The degrees of freedom of the variance are
//! Satterthwaite's: windows overlap, and blocks differ in what they tell of a parameter.

use std::ops::Range;

use nalgebra::DMatrix;
use statrs::distribution::{ContinuousCDF, StudentsT};

use super::cross_validation::left_out_steps;
use crate::calibrate::{Bench, BlockFit, CalibrateError, ParameterAt, Trial};

/// Singular values of the information, of unit diagonal, below which a direction is rounding.
const ROUNDING: f64 = 1e-12;

/// A parameter with its error between blocks.
#[derive(Debug, Clone)]
pub struct BetweenBlocks {
    /// As in results.
    pub name: String,
    /// Standard error.
    pub error: f64,
    /// Degrees of freedom of the error.
    pub freedom: f64,
}

impl BetweenBlocks {
    /// Half of the 95 % interval by Student's t, in standard errors.
    pub fn t95(&self) -> Option<f64> {
        let t = StudentsT::new(0.0, 1.0, self.freedom.max(1.0)).ok()?.inverse_cdf(0.975);
        t.is_finite().then_some(t)
    }
}

/// Every parameter of a trial with its error between blocks.
///
/// # Errors
/// A model that cannot be built, and blocks that determine nothing.
pub fn between_blocks(
    bench: &Bench<'_>,
    (trial, fit): (&Trial, &BlockFit),
    contiguous: &[bool],
) -> Result<Vec<BetweenBlocks>, CalibrateError> {
    let steps = left_out_steps(&fit.blocks, &fit.prior, contiguous).ok_or(CalibrateError::Undetermined)?;
    let windows = windows(fit.blocks.len(), contiguous);
    let whole = fit.blocks.iter().fold(fit.prior.clone(), |sum, block| sum + &block.information);
    let scale = whole.diagonal().map(|d| if d > 0.0 { d.sqrt().recip() } else { 0.0 });
    let scaled = DMatrix::from_fn(whole.nrows(), whole.ncols(), |i, j| scale[i] * scale[j] * whole[(i, j)]);
    let inverse = scaled.svd(true, true).pseudo_inverse(ROUNDING).map_err(|_| CalibrateError::Undetermined)?;
    let with_error = |parameter: ParameterAt| {
        let direction = (&inverse * parameter.slope.component_mul(&scale)).component_mul(&scale);
        let share: Vec<f64> =
            fit.blocks.iter().map(|block| direction.dot(&(&block.information * &direction))).collect();
        BetweenBlocks {
            error: error(&parameter.stepped, &windows),
            freedom: freedom(&share, &windows),
            name: parameter.name,
        }
    };
    Ok(bench.parameters_at(trial, fit, &steps)?.into_iter().map(with_error).collect())
}

/// The blocks that are left out with each.
fn windows(blocks: usize, contiguous: &[bool]) -> Vec<Range<usize>> {
    let follows = |block: usize| contiguous.get(block).copied().unwrap_or(false);
    (0..blocks).map(|b| b - usize::from(b > 0 && follows(b - 1))..b + 1 + usize::from(follows(b))).collect()
}

fn error(without: &[f64], windows: &[Range<usize>]) -> f64 {
    let count = without.len() as f64;
    let mean = without.iter().sum::<f64>() / count;
    let of_window = |(value, window): (&f64, &Range<usize>)| {
        let left_out = window.len() as f64;
        (count - left_out) / (count * left_out) * (value - mean).powi(2)
    };
    without.iter().zip(windows).map(of_window).sum::<f64>().max(0.0).sqrt()
}

/// Of a mean square of sums over windows, where block b has this share of the information.
fn freedom(shares: &[f64], windows: &[Range<usize>]) -> f64 {
    let common = |a: &Range<usize>, b: &Range<usize>| {
        shares[a.start.max(b.start)..a.end.min(b.end).max(a.start.max(b.start))].iter().sum::<f64>()
    };
    let weight = |window: &Range<usize>| (window.len() as f64).recip();
    let trace: f64 = windows.iter().map(|a| weight(a) * common(a, a)).sum();
    let squares: f64 =
        windows.iter().flat_map(|a| windows.iter().map(move |b| weight(a) * weight(b) * common(a, b).powi(2))).sum();
    trace * trace / squares - 1.0
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    use super::*;

    /// A mean of `blocks` numbers, each of which has `correlation` with the next one: its value and those without each window.
    fn mean(rng: &mut ChaCha8Rng, blocks: usize, correlation: f64, contiguous: bool) -> (f64, BetweenBlocks) {
        let windows = windows(blocks, &vec![contiguous; blocks - 1]);
        let mut last: f64 = StandardNormal.sample(rng);
        let readings: Vec<f64> = (0..blocks)
            .map(|_| {
                let own: f64 = StandardNormal.sample(rng);
                last = correlation * last + (1.0 - correlation * correlation).sqrt() * own;
                last
            })
            .collect();
        let all: f64 = readings.iter().sum();
        let without = windows
            .iter()
            .map(|window| (all - readings[window.clone()].iter().sum::<f64>()) / (blocks - window.len()) as f64);
        let without: Vec<f64> = without.collect();
        let (error, freedom) = (error(&without, &windows), freedom(&vec![1.0 / blocks as f64; blocks], &windows));
        (all / blocks as f64, BetweenBlocks { name: "m".into(), error, freedom })
    }

    #[test]
    fn intervals_hold_the_truth_also_where_neighbours_are_correlated() {
        // Blocks, correlation, neighbours left out, and the two sides of how often the interval misses the truth.
        for (blocks, correlation, contiguous, least, most) in [
            (30, 0.0, false, 0.04, 0.06),
            (30, 0.0, true, 0.03, 0.08),
            (30, 0.25, true, 0.04, 0.11),
            // What leaving the neighbours in would say of the same.
            (30, 0.25, false, 0.11, 0.2),
        ] {
            let mut rng = ChaCha8Rng::seed_from_u64(3);
            let misses = |_: &usize| {
                let (value, found) = mean(&mut rng, blocks, correlation, contiguous);
                value.abs() > found.error * found.t95().unwrap()
            };
            let missed = (0..4000).filter(misses).count() as f64 / 4000.0;
            assert!((least..=most).contains(&missed), "{correlation}, {contiguous}: {missed}");
        }
    }

    #[test]
    fn degrees_of_freedom_are_those_of_what_there_is() {
        let of = |shares: &[f64], contiguous: bool| {
            freedom(shares, &windows(shares.len(), &vec![contiguous; shares.len() - 1]))
        };
        assert!((of(&[0.1; 10], false) - 9.0).abs() < 1e-12);
        // Overlapping windows of three: 9/19 of the blocks (Meketon and Schmeiser 1984), and the shorter ones at the ends. rtol 0.1.
        assert!(
            (of(&[1.0 / 60.0; 60], true) / (60.0 * 9.0 / 19.0 - 1.0) - 1.0).abs() < 0.1,
            "{}",
            of(&[1.0 / 60.0; 60], true)
        );
        // One block has it all.
        assert!(of(&[1.0, 0.0, 0.0, 0.0], false).abs() < 1e-12);
    }
}
