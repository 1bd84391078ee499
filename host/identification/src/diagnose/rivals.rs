//! Which of several explanations is meant: by how often it predicts other blocks best when blocks are drawn again, the simpler one where two are equal.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha12Rng;

use super::criteria::RIVAL_SHARE;
use super::interval::standard_error;

/// Draws of blocks.
const DRAWS: usize = 1000;
const SEED: u64 = 2;

/// What decides between laws.
#[derive(Debug, Clone, PartialEq)]
pub struct Contender {
    /// Σ r² saved of each block, out of sample.
    pub gains: Vec<f64>,
    /// Parameters.
    pub freedom: usize,
    /// Standard deviations by which its size is beyond what is usual.
    pub implausibility: f64,
}

impl Contender {
    fn gain(&self) -> f64 {
        self.gains.iter().sum()
    }
}

/// Weights that add up to one: the share of draws of blocks in which each is chosen. In each draw that is the one that gains most, but for simpler or more plausible
/// ones that come within one standard error of it (the one standard error rule of Breiman et al. 1984), or within [`RIVAL_SHARE`] of its gain: where every law is an
/// approximation, so little more is no evidence of another shape.
pub fn weights(contenders: &[Contender]) -> Vec<f64> {
    let blocks = contenders.first().map_or(0, |contender| contender.gains.len());
    let mut chosen = vec![0usize; contenders.len()];
    if blocks == 0 {
        return vec![0.0; contenders.len()];
    }
    let apart: Vec<Vec<f64>> = contenders
        .iter()
        .map(|a| {
            contenders
                .iter()
                .map(|b| standard_error(&a.gains.iter().zip(&b.gains).map(|(a, b)| a - b).collect::<Vec<_>>()))
                .collect()
        })
        .collect();
    let mut rng = ChaCha12Rng::seed_from_u64(SEED);
    for _ in 0..DRAWS {
        let drawn: Vec<usize> = (0..blocks).map(|_| rng.random_range(0..blocks)).collect();
        let sums: Vec<f64> = contenders.iter().map(|c| drawn.iter().map(|b| c.gains[*b]).sum()).collect();
        chosen[choose(contenders, &sums, &apart)] += 1;
    }
    chosen.into_iter().map(|count| count as f64 / DRAWS as f64).collect()
}

/// The place of the one that is meant.
pub fn best(contenders: &[Contender]) -> Option<usize> {
    let weights = weights(contenders);
    let by_weight = |a: &usize, b: &usize| {
        weights[*a].total_cmp(&weights[*b]).then(contenders[*a].gain().total_cmp(&contenders[*b].gain()))
    };
    (0..contenders.len()).max_by(by_weight)
}

fn choose(contenders: &[Contender], sums: &[f64], apart: &[Vec<f64>]) -> usize {
    let most = (0..sums.len()).max_by(|a, b| sums[*a].total_cmp(&sums[*b])).unwrap_or(0);
    let is_near = |i: &usize| sums[most] - sums[*i] <= apart[most][*i].max(RIVAL_SHARE * sums[most]);
    let simple = |i: &usize| contenders[*i].freedom as f64 + contenders[*i].implausibility.min(1e3);
    let near = (0..sums.len()).filter(is_near);
    near.min_by(|a, b| simple(a).total_cmp(&simple(b)).then(sums[*b].total_cmp(&sums[*a]))).unwrap_or(most)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn contender(freedom: usize, gain: impl Fn(usize) -> f64) -> Contender {
        Contender { gains: (0..24).map(gain).collect(), freedom, implausibility: 0.0 }
    }

    #[test]
    fn the_law_that_predicts_better_is_meant_whatever_its_size() {
        let (good, poor) = (contender(6, |b| 100.0 + (b % 3) as f64), contender(1, |b| 60.0 + (b % 5) as f64));
        let weights = weights(&[good, poor]);
        assert!(weights[0] > 0.99, "{weights:?}");
    }

    #[test]
    fn of_two_that_predict_alike_the_simpler_one_is_meant_and_then_the_plausible_one() {
        let noise = |b: usize| if b.is_multiple_of(2) { 3.0 } else { -2.5 };
        let (large, simple) = (contender(6, |b| 50.0 + noise(b)), contender(2, |_| 50.0));
        assert_eq!(best(&[large.clone(), simple.clone()]), Some(1));
        let tonnes = Contender { implausibility: 6.0, ..simple.clone() };
        assert_eq!(best(&[tonnes, simple]), Some(1));
        assert_eq!(best(&[]), None);
    }

    #[test]
    fn a_little_more_is_no_evidence_of_another_shape_where_blocks_agree_about_it() {
        let (shape, simple) = (contender(6, |b| 1020.0 + (b % 2) as f64), contender(3, |_| 1000.0));
        assert_eq!(best(&[shape, simple.clone()]), Some(1));
        let better = contender(6, |b| 1100.0 + (b % 2) as f64);
        assert_eq!(best(&[better, simple]), Some(0));
    }

    #[test]
    fn what_blocks_disagree_about_stays_open() {
        let a = contender(2, |b| if b.is_multiple_of(2) { 100.0 } else { 0.0 });
        let b = contender(2, |b| if b % 2 == 1 { 101.0 } else { 0.0 });
        let weights = weights(&[a, b]);
        assert!(weights.iter().all(|weight| *weight > 0.1), "{weights:?}");
        assert!((weights.iter().sum::<f64>() - 1.0).abs() < 1e-12);
    }
}
