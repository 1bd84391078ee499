//! How sure a gain is: paired block bootstrap of the errors of two models on the same windows.
//!
//! ```text
//! windows in time   |■■■■■■|■■■■■■|■■■■■■| …   blocks; each resample draws whole blocks, both models' errors together
//! gain = 1 − rms(extended) / rms(base)
//! ```
//! Errors of windows that follow each other are alike, so blocks and not windows are drawn; the same windows of both models, so what both miss
//! cancels.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha12Rng;
use serde::{Deserialize, Serialize};

/// Resamples.
const RESAMPLES: usize = 2000;

/// Root mean squares of two models' errors, and what the second gains.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Gain {
    /// Of the base model.
    pub rmse_base: f64,
    /// Of the extended model.
    pub rmse_extended: f64,
    /// 1 − extended/base: the share of the error that the extension takes away.
    pub gain: f64,
    /// 95 % interval of the gain.
    pub ci95: [f64; 2],
}

/// The gain on windows that start at `start_s`, with blocks of `block_s`; pairs with a missing error are left out. `None` without two
/// blocks or with an error of zero.
pub fn gain(start_s: &[f64], base: &[f64], extended: &[f64], block_s: f64, seed: u64) -> Option<Gain> {
    let first = *start_s.first()?;
    // (Σ base², Σ extended², windows) of every block.
    let mut blocks: Vec<[f64; 3]> = Vec::new();
    for ((t, base), extended) in start_s.iter().zip(base).zip(extended) {
        if !(base.is_finite() && extended.is_finite()) {
            continue;
        }
        let block = ((t - first) / block_s) as usize;
        if blocks.len() <= block {
            blocks.resize(block + 1, [0.0; 3]);
        }
        let sums = &mut blocks[block];
        *sums = [sums[0] + base * base, sums[1] + extended * extended, sums[2] + 1.0];
    }
    blocks.retain(|sums| sums[2] > 0.0);
    if blocks.len() < 2 {
        return None;
    }
    let add = |a: [f64; 3], b: &[f64; 3]| [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
    let whole = blocks.iter().fold([0.0; 3], add);
    let gain_of = |sums: [f64; 3]| 1.0 - (sums[1] / sums[0]).sqrt();
    if whole[0] <= 0.0 {
        return None;
    }
    let mut rng = ChaCha12Rng::seed_from_u64(seed);
    let mut gains: Vec<f64> = (0..RESAMPLES)
        .map(|_| {
            let drawn = (0..blocks.len()).map(|_| &blocks[rng.random_range(0..blocks.len())]);
            gain_of(drawn.fold([0.0; 3], add))
        })
        .filter(|gain| gain.is_finite())
        .collect();
    gains.sort_by(f64::total_cmp);
    let at = |share: f64| gains[((gains.len() - 1) as f64 * share).round() as usize];
    Some(Gain {
        rmse_base: (whole[0] / whole[2]).sqrt(),
        rmse_extended: (whole[1] / whole[2]).sqrt(),
        gain: gain_of(whole),
        ci95: if gains.is_empty() { [f64::NAN; 2] } else { [at(0.025), at(0.975)] },
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand_distr::{Distribution, StandardNormal};

    /// Autocorrelated errors (correlated over 0.2 s) of two equal models: the interval covers no gain about as often as it says.
    #[test]
    fn intervals_of_no_gain_hold_zero() {
        let start_s: Vec<f64> = (0..1500).map(|i| 0.02 * i as f64).collect();
        let mut rng = ChaCha12Rng::seed_from_u64(3);
        let mut series = || {
            let mut value = 0.0;
            let mut next = || {
                let white: f64 = StandardNormal.sample(&mut rng);
                value = 0.9 * value + white;
                value
            };
            (0..1500).map(|_| next()).collect::<Vec<f64>>()
        };
        let covers = (0..200).filter(|trial| {
            let (base, extended) = (series(), series());
            let gain = gain(&start_s, &base, &extended, 1.0, *trial).unwrap();
            gain.ci95[0] <= 0.0 && gain.ci95[1] >= 0.0
        });
        // 95 % of 200 ± the binomial's 99.9 % band, and a little less since thirty blocks are few: measured below.
        let covered = covers.count();
        assert!((178..=200).contains(&covered), "{covered} of 200");
    }

    #[test]
    fn a_halved_error_is_a_gain_of_a_half() {
        let start_s: Vec<f64> = (0..100).map(f64::from).collect();
        let base: Vec<f64> = (0..100).map(|i| f64::from(i % 7) - 3.0).collect();
        let extended: Vec<f64> = base.iter().map(|error| 0.5 * error).collect();
        let gain = gain(&start_s, &base, &extended, 10.0, 1).unwrap();
        assert!((gain.gain - 0.5).abs() < 1e-12 && (gain.ci95[0] - 0.5).abs() < 1e-12, "{gain:?}");
        assert!(super::gain(&start_s[..5], &base[..5], &extended[..5], 10.0, 1).is_none());
    }
}
