//! Intervals of sums over blocks of time: the bias-corrected and accelerated bootstrap (Efron 1987), blocks drawn whole.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha12Rng;
use serde::{Deserialize, Serialize};
use statrs::distribution::{ContinuousCDF, Normal};

use super::criteria::LEAST_BLOCKS;

/// Resamples.
const RESAMPLES: usize = 2000;
const SEED: u64 = 1;

/// A share with its interval.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Gain {
    /// The share.
    pub share: f64,
    /// 95 % interval; none of fewer blocks than an interval takes.
    pub ci95: Option<[f64; 2]>,
    /// How many blocks it is of.
    pub blocks: usize,
}

impl Gain {
    /// Whether the interval lies above zero.
    pub fn is_supported(&self) -> bool {
        self.ci95.is_some_and(|[low, _]| low > 0.0)
    }

    /// Whether the interval lies below zero.
    pub fn is_harmful(&self) -> bool {
        self.ci95.is_some_and(|[_, high]| high < 0.0)
    }
}

/// The 95 % interval of `statistic` of blocks, of which there are so many: it is asked with the blocks drawn. `None` of too few blocks.
pub fn bca(blocks: usize, statistic: impl Fn(&mut dyn Iterator<Item = usize>) -> f64) -> Option<[f64; 2]> {
    if blocks < LEAST_BLOCKS {
        return None;
    }
    let found = statistic(&mut (0..blocks));
    let mut rng = ChaCha12Rng::seed_from_u64(SEED);
    let mut draws: Vec<f64> = (0..RESAMPLES)
        .map(|_| statistic(&mut (0..blocks).map(|_| rng.random_range(0..blocks))))
        .filter(|value| value.is_finite())
        .collect();
    if draws.len() < RESAMPLES / 2 || !found.is_finite() {
        return None;
    }
    draws.sort_by(f64::total_cmp);
    let normal = Normal::standard();
    let half = 0.5 / draws.len() as f64;
    let below = draws.partition_point(|value| *value < found) as f64 / draws.len() as f64;
    let bias = normal.inverse_cdf(below.clamp(half, 1.0 - half));
    // The acceleration, by the jackknife.
    let without = |left_out: usize| statistic(&mut (0..blocks).filter(|block| *block != left_out));
    let jackknife: Vec<f64> = (0..blocks).map(without).collect();
    let mean = jackknife.iter().sum::<f64>() / blocks as f64;
    let sum = |power: i32| jackknife.iter().map(|value| (mean - value).powi(power)).sum::<f64>();
    let spread = sum(2).powf(1.5);
    let acceleration = if spread > 0.0 { sum(3) / (6.0 * spread) } else { 0.0 };
    let at = |level: f64| {
        let z = bias + normal.inverse_cdf(level);
        let share = normal.cdf(bias + z / (1.0 - acceleration * z));
        draws[((draws.len() - 1) as f64 * share.clamp(0.0, 1.0)).round() as usize]
    };
    Some([at(0.025), at(0.975)])
}

/// Standard error of the sum of these.
pub fn standard_error(values: &[f64]) -> f64 {
    let count = values.len() as f64;
    let mean = values.iter().sum::<f64>() / count;
    let squares: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
    (squares * count / (count - 1.0).max(1.0)).sqrt()
}

#[cfg(test)]
mod tests {
    use rand_distr::{Distribution, StandardNormal};

    use super::*;

    fn sum_of(values: &[f64]) -> Option<[f64; 2]> {
        bca(values.len(), |blocks| blocks.map(|b| values[b]).sum())
    }

    #[test]
    fn intervals_of_a_mean_hold_it_about_as_often_as_they_say_also_where_values_are_skewed() {
        let mut rng = ChaCha12Rng::seed_from_u64(3);
        for skewed in [false, true] {
            let covers = (0..400).filter(|_| {
                let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
                let values: Vec<f64> =
                    (0..24).map(|_| if skewed { normal().powi(2) - 1.0 } else { normal() }).collect();
                sum_of(&values).is_some_and(|[low, high]| low <= 0.0 && high >= 0.0)
            });
            // Of 400, 95 % are 380; two sides: 24 blocks make intervals a little too short.
            let covered = covers.count();
            assert!((352..=394).contains(&covered), "{covered} of 400, skewed: {skewed}");
        }
    }

    #[test]
    fn what_a_few_blocks_gain_and_none_loses_is_above_zero_and_one_block_is_not() {
        let of = |gaining: usize| -> Vec<f64> {
            (0..24).map(|b| if b % 5 == 0 && b / 5 < gaining { 50.0 } else { [0.3, -0.4][b % 2] }).collect()
        };
        assert!(sum_of(&of(5)).unwrap()[0] > 0.0, "{:?}", sum_of(&of(5)));
        assert!(sum_of(&of(1)).unwrap()[0] < 0.0, "{:?}", sum_of(&of(1)));
        assert_eq!(sum_of(&[1.0; 7]), None);
    }
}
