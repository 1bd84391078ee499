//! The score scan: every law of the catalogue on top of the current model, from one factorisation (Rao's score test).
//!
//! With the columns' information K and gradient s (states and shared unknowns eliminated) a law of columns j would gain `s_jᵀ K_jj⁻¹ s_j`, twice
//! the log-likelihood, if residuals were linear in it. Without an effect s is a draw from N(0, K): draws tell how large the best of a whole
//! catalogue of related laws becomes by chance, exactly for the frozen noise (Westfall and Young 1993: the least p of all).

use std::ops::Range;

use nalgebra::{DMatrix, DVector};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use super::significance::{p_of_family, p_of_score};
use crate::calibrate::Scores;

/// Directions of a law that keep less than this share of their information beside the shared unknowns cannot be seen.
const LEAST_SHARE: f64 = 1e-6;
/// Draws of a whole catalogue, and their seed.
const DRAWS: usize = 2_000;
const SEED: u64 = 1;
/// Laws that say the same make K singular. So much of each column's own information makes up for it, far below what [`LEAST_SHARE`] lets pass.
const LOADED: f64 = 1e-9;
/// Draws that tell a share well enough.
const ENOUGH: usize = 20;

/// What the scan says of one law.
#[derive(Debug, Clone, PartialEq)]
pub struct Score {
    /// Twice the log-likelihood that it would gain.
    pub score: f64,
    /// Directions that the motion shows.
    pub freedom: usize,
    /// χ²'s share of noise, of the score over the inflation.
    pub p: f64,
    /// The largest variance inflation of its columns by the shared unknowns.
    pub vif: f64,
    /// Estimate over standard error along each column: its coordinates', behind that of a law that is not nothing at its start.
    pub z: Vec<f64>,
    whitening: DMatrix<f64>,
    columns: Range<usize>,
}

#[cfg(test)]
impl Score {
    /// Of a law of which the scan says no more.
    pub(super) fn told(score: f64, freedom: usize) -> Self {
        let whitening = DMatrix::zeros(freedom, freedom);
        Score { score, freedom, p: p_of_score(score, freedom), vif: 1.0, z: Vec::new(), whitening, columns: 0..freedom }
    }
}

/// A scan of many laws.
#[derive(Debug, Clone)]
pub struct Scan {
    /// Of each law; none where it has no column that this motion shows.
    pub scores: Vec<Option<Score>>,
    /// The least p of the catalogue in every draw, sorted.
    least: Vec<f64>,
}

impl Scan {
    /// The scan of `scores`, which residuals of a wrong noise make so many times too large (see [`Trial::inflation`](crate::calibrate::Trial::inflation)).
    pub fn of(scores: &Scores, inflation: f64) -> Self {
        let law = |columns: &Option<Range<usize>>| score(scores, columns.clone()?, inflation);
        let laws: Vec<Option<Score>> = scores.columns.iter().map(law).collect();
        let least = draws(scores, &laws);
        Scan { scores: laws, least }
    }

    /// Share of noise in which the least p of the whole catalogue is at most `p`. Beyond the draws it goes on as for independent tests.
    pub fn p_of_family(&self, p: f64) -> f64 {
        let draws = self.least.len();
        let at_most = self.least.partition_point(|least| *least <= p);
        if draws < ENOUGH {
            // No law has a column: nothing is surprising.
            return 1.0;
        }
        if at_most >= ENOUGH {
            return at_most as f64 / draws as f64;
        }
        // As many independent tests as have the same p where there are enough draws.
        let tests = (-(ENOUGH as f64 / draws as f64)).ln_1p() / (-self.least[ENOUGH - 1]).ln_1p();
        p_of_family(p, tests)
    }
}

fn score(scores: &Scores, columns: Range<usize>, inflation: f64) -> Option<Score> {
    let whitening = whitening(scores, columns.clone())?;
    let freedom = whitening.ncols();
    let white = whitening.transpose() * scores.gradient.rows(columns.start, columns.len());
    let score = white.norm_squared();
    let (step, z) = (&whitening * &white, |i: usize| whitening.row(i).norm());
    let z = (0..columns.len()).map(|i| if z(i) > 0.0 { step[i] / z(i) } else { 0.0 }).collect();
    let vif = columns.clone().map(|j| scores.alone[j] / scores.information[(j, j)]).fold(1.0, f64::max);
    Some(Score { score, freedom, p: p_of_score(score / inflation, freedom), vif, z, whitening, columns })
}

/// W with `Wᵀ K_jj W = 1` over the directions that can be seen.
fn whitening(scores: &Scores, columns: Range<usize>) -> Option<DMatrix<f64>> {
    let n = columns.len();
    // By the size of each column, so that units do not matter; a column that is nothing at all stays zero.
    let scale = DVector::from_fn(n, |i, _| {
        let alone = scores.alone[columns.start + i];
        if alone > 0.0 && alone.is_finite() { 1.0 / alone.sqrt() } else { 0.0 }
    });
    let information =
        DMatrix::from_fn(n, n, |i, j| scale[i] * scale[j] * scores.information[(columns.start + i, columns.start + j)]);
    let eigen = information.symmetric_eigen();
    let seen: Vec<usize> = (0..n).filter(|&i| eigen.eigenvalues[i] > LEAST_SHARE).collect();
    if seen.is_empty() {
        return None;
    }
    Some(DMatrix::from_fn(n, seen.len(), |i, j| {
        scale[i] * eigen.eigenvectors[(i, seen[j])] / eigen.eigenvalues[seen[j]].sqrt()
    }))
}

/// The least p of all laws in draws from N(0, K).
fn draws(scores: &Scores, laws: &[Option<Score>]) -> Vec<f64> {
    let Some(root) = root(scores) else { return Vec::new() };
    let mut rng = ChaCha8Rng::seed_from_u64(SEED);
    let white = DMatrix::from_fn(root.ncols(), DRAWS, |_, _| StandardNormal.sample(&mut rng));
    let gradients = root * white;
    // Of laws of equal freedom the largest score has the least p, which is much dearer than a score.
    let most_free = laws.iter().flatten().map(|law| law.freedom).max().unwrap_or(0);
    let mut largest = DMatrix::from_element(most_free, DRAWS, f64::NEG_INFINITY);
    for law in laws.iter().flatten() {
        let white = law.whitening.transpose() * gradients.rows(law.columns.start, law.columns.len());
        for (score, largest) in white.column_iter().zip(largest.row_mut(law.freedom - 1).iter_mut()) {
            *largest = largest.max(score.norm_squared());
        }
    }
    let p = |(freedom, score): (usize, &f64)| if score.is_finite() { p_of_score(*score, freedom) } else { 1.0 };
    let mut least: Vec<f64> =
        largest.column_iter().map(|of_draw| (1..).zip(of_draw.iter()).map(p).fold(1.0, f64::min)).collect();
    least.sort_by(f64::total_cmp);
    least
}

/// R with `R Rᵀ = K`, but for [`LOADED`] on the diagonal.
fn root(scores: &Scores) -> Option<DMatrix<f64>> {
    let n = scores.gradient.len();
    if n == 0 {
        return None;
    }
    let scale = DVector::from_fn(n, |i, _| scores.alone[i].max(0.0).sqrt());
    let inverse = |i: usize| if scale[i] > 0.0 { 1.0 / scale[i] } else { 0.0 };
    let scaled = DMatrix::from_fn(n, n, |i, j| inverse(i) * inverse(j) * scores.information[(i, j)]);
    let loaded = &scaled + DMatrix::from_diagonal_element(n, n, LOADED);
    let root = match loaded.cholesky() {
        Some(factor) => factor.unpack(),
        None => {
            let eigen = scaled.symmetric_eigen();
            &eigen.eigenvectors * DMatrix::from_diagonal(&eigen.eigenvalues.map(|value| value.max(0.0).sqrt()))
        }
    };
    Some(DMatrix::from_diagonal(&scale) * root)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Laws of one column each, with correlation `r` between any two.
    fn laws(count: usize, r: f64, gradient: f64) -> Scores {
        Scores {
            information: DMatrix::from_fn(count, count, |i, j| if i == j { 4.0 } else { 4.0 * r }),
            gradient: DVector::from_element(count, gradient),
            alone: DVector::from_element(count, 8.0),
            columns: (0..count).map(|i| Some(i..i + 1)).collect(),
        }
    }

    #[test]
    fn a_score_is_that_of_its_gradient_and_its_column_s_information() {
        let scan = Scan::of(&laws(3, 0.5, 5.0), 1.0);
        let score = scan.scores[0].as_ref().unwrap();
        // 5² / 4, and 8 of information of which 4 are left.
        assert!((score.score - 6.25).abs() < 1e-12 && (score.z[0] - 2.5).abs() < 1e-12, "{score:?}");
        assert_eq!((score.freedom, score.vif), (1, 2.0));
        assert!((score.p - 0.012_419_33).abs() < 1e-8, "{}", score.p);
        let inflated = Scan::of(&laws(3, 0.5, 5.0), 6.25 / 3.841_458_8);
        let score = inflated.scores[0].as_ref().unwrap();
        assert!((score.score - 6.25).abs() < 1e-12 && (score.p - 0.05).abs() < 1e-8, "{score:?}");
    }

    #[test]
    fn a_family_of_independent_laws_is_as_strict_as_its_number_and_copies_count_once() {
        // The share of 2,000 draws: within four standard deviations of it.
        let near = |share: f64, truth: f64| (share - truth).abs() < 4.0 * (truth * (1.0 - truth) / 2000.0).sqrt();
        let independent = Scan::of(&laws(50, 0.0, 0.0), 1.0);
        let copies = Scan::of(&laws(50, 1.0, 0.0), 1.0);
        for p in [0.001_f64, 0.01, 0.05] {
            let truth = 1.0 - (1.0 - p).powi(50);
            assert!(near(independent.p_of_family(p), truth), "{p}: {} of {truth}", independent.p_of_family(p));
        }
        for p in [0.05, 0.3, 0.8] {
            assert!(near(copies.p_of_family(p), p), "{p}: {}", copies.p_of_family(p));
        }
        // Beyond the draws: about as many tests as there are laws.
        let beyond = independent.p_of_family(1e-9) / 1e-9;
        assert!((30.0..80.0).contains(&beyond), "{beyond} tests");
    }

    #[test]
    fn draws_of_laws_that_say_a_little_more_than_the_same_are_those_of_copies() {
        // Correlated by more than one: rounding leaves an eigenvalue below zero, and there is no Cholesky root.
        let scan = Scan::of(&laws(2, 1.0 + 1e-6, 0.0), 1.0);
        for p in [0.05_f64, 0.3, 0.8] {
            // Within four standard deviations of 2,000 draws.
            let off = (scan.p_of_family(p) - p).abs();
            assert!(off < 4.0 * (p * (1.0 - p) / 2000.0).sqrt(), "{p}: {}", scan.p_of_family(p));
        }
    }

    #[test]
    fn a_column_that_the_shared_unknowns_take_away_has_no_score() {
        let mut scores = laws(2, 0.0, 1.0);
        scores.information[(1, 1)] = 1e-9;
        let scan = Scan::of(&scores, 1.0);
        assert!(scan.scores[0].is_some() && scan.scores[1].is_none());
    }
}
