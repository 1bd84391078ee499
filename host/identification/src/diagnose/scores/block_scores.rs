//! The scan: every law of the catalogue on top of the current model, by blocks of time, from one factorisation.
//!
//! ```text
//!   (K_b, s_b) of [β, γ] ─▶ whitened: one unit of information in all ─▶ score, cross-validated gain, test by the scatter between blocks
//! ```
//! The score is a tangent (Rao 1948). What it promises is confirmed by refits, which start from it.

use std::ops::Range;
use std::sync::Arc;

use nalgebra::{DMatrix, DVector};

use super::cross_validation::{left_out_steps, log_gain};
use super::significance::{p_of_blocks, p_of_both, p_of_gains};
use crate::calibrate::{Bench, BlockFit, BlockScores, CalibrateError, LawBlock, Quadratic, Trial};
use crate::model::law::Law;

/// Directions of a law that keep less than this share of their information beside the shared unknowns cannot be seen.
const LEAST_INFORMATION: f64 = 1e-6;
/// Information of a prior that shrinks a curve, in units of what all blocks tell of each direction; the best by cross-validation is taken.
const RIDGES: [f64; 4] = [0.0, 0.01, 0.1, 1.0];

/// What the blocks say of one law.
#[derive(Debug, Clone)]
pub struct LawScore {
    /// Σ r² that it would save, in all.
    pub score: f64,
    /// Directions that the motion shows.
    pub freedom: usize,
    /// What it gains in each block by what the others say of it, see `log_gain` in `cross_validation`.
    pub gains: Vec<f64>,
    /// By the scatter of scores and of gains between blocks, see `significance`.
    pub p: f64,
    /// The largest variance inflation of its columns by the shared unknowns.
    pub vif: f64,
    /// Estimate over its standard error between blocks, along each column.
    pub z: Vec<f64>,
    /// Where the tangent leads, in its own columns.
    pub step: DVector<f64>,
    /// Own columns by whitened directions.
    whitening: DMatrix<f64>,
    columns: Range<usize>,
}

impl LawScore {
    /// What it gains out of sample, in all blocks.
    pub fn gain(&self) -> f64 {
        self.gains.iter().sum()
    }
}

/// What the blocks of a bench say of laws on top of a trial. Blocks that the trial predicts badly weigh less. What laws have in common is told of the first
/// `crossed` of them with all others.
///
/// # Errors
/// A trial that cannot be factorised.
pub fn block_scores(
    bench: &Bench<'_>,
    trial: &Trial,
    (laws, crossed): (&[Arc<dyn Law>], usize),
) -> Result<BlockScores, CalibrateError> {
    let contiguous = bench.is_contiguous();
    bench.block_scores(trial, (laws, crossed), |base| block_weights(base, &contiguous))
}

/// Of each block: one over its dispersion, where that is more than noise has.
fn block_weights(base: &BlockFit, contiguous: &[bool]) -> Vec<f64> {
    let costs = left_out(base, contiguous).unwrap_or_else(|| base.freedom.clone());
    let dispersion = costs.iter().zip(&base.freedom).map(|(cost, freedom)| cost / freedom.max(1.0));
    dispersion.map(|dispersion| dispersion.max(1.0).recip()).collect()
}

/// What the blocks say of each law: none of one that no column of the motion shows, an error of one whose columns are not finite.
pub fn score_laws(scores: &BlockScores, contiguous: &[bool], shrunk: bool) -> Vec<Result<Option<LawScore>, NotFinite>> {
    let Some(without) = costs_without(scores, contiguous) else { return vec![Ok(None); scores.laws.len()] };
    let laws = scores.laws.iter().zip(&scores.columns);
    laws.map(|(blocks, columns)| match (blocks, columns) {
        (Some(blocks), Some(columns)) => score_law((scores, &without), (blocks, columns.clone()), contiguous, shrunk),
        _ => Ok(None),
    })
    .collect()
}

/// Columns of a law that are not numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct NotFinite {
    /// How many.
    pub columns: usize,
}

/// Of each block: Σ r² of the model without any of the laws, by what the others, weighted, say of the shared unknowns.
fn costs_without(scores: &BlockScores, contiguous: &[bool]) -> Option<Vec<f64>> {
    let base = &scores.base;
    let weighted = |(block, weight): (&Quadratic, &f64)| Quadratic {
        squares: weight * block.squares,
        gradient: *weight * &block.gradient,
        information: *weight * &block.information,
    };
    let blocks: Vec<Quadratic> = base.blocks.iter().zip(&scores.weights).map(weighted).collect();
    let steps = left_out_steps(&blocks, &base.prior, contiguous)?;
    Some(base.blocks.iter().zip(&steps).map(|(block, step)| block.at(step)).collect())
}

fn score_law(
    (scores, without): (&BlockScores, &[f64]),
    (blocks, columns): (&[LawBlock], Range<usize>),
    contiguous: &[bool],
    shrunk: bool,
) -> Result<Option<LawScore>, NotFinite> {
    let own = columns.len();
    let is_finite = |j: &usize| {
        blocks.iter().all(|b| b.gradient[*j].is_finite() && b.information.column(*j).iter().all(|v| v.is_finite()))
    };
    let finite = (0..own).filter(is_finite).count();
    if finite < own {
        return Err(NotFinite { columns: own - finite });
    }
    let (base, weights) = (&scores.base, &scores.weights);
    let Some(whitening) = whitening(scores, (blocks, columns.clone())) else { return Ok(None) };
    let with_law = |((block, law), weight): ((&Quadratic, &LawBlock), &f64)| extended(block, law, &whitening, *weight);
    let extended: Vec<Quadratic> = base.blocks.iter().zip(blocks).zip(weights).map(with_law).collect();
    let (free, seen) = (base.prior.nrows(), whitening.ncols());
    let ridges = if shrunk { &RIDGES[..] } else { &RIDGES[..1] };
    let with_ridge = |ridge: &f64| {
        let mut prior = DMatrix::zeros(free + seen, free + seen);
        prior.view_mut((0, 0), (free, free)).copy_from(&base.prior);
        (free..free + seen).for_each(|i| prior[(i, i)] += ridge);
        let steps = left_out_steps(&extended, &prior, contiguous)?;
        let gains: Vec<f64> = (0..steps.len())
            .map(|b| log_gain(without[b], extended[b].at(&steps[b]) / weights[b], base.freedom[b]))
            .collect();
        Some((steps, gains))
    };
    let sum = |gains: &[f64]| gains.iter().sum::<f64>();
    let best = ridges.iter().filter_map(with_ridge).max_by(|(_, a), (_, b)| sum(a).total_cmp(&sum(b)));
    let Some((steps, gains)) = best else { return Ok(None) };

    // With the shared unknowns where the law leaves them: s_η − K_ηφ K_φφ⁻¹ s_φ of each block.
    let shared =
        extended.iter().fold(base.prior.clone(), |sum, block| sum + block.information.view((0, 0), (free, free)));
    let coupling = extended
        .iter()
        .fold(DMatrix::zeros(free, seen), |sum, block| sum + block.information.view((0, free), (free, seen)));
    let Some(projection) = shared.cholesky().map(|factor| factor.solve(&coupling)) else { return Ok(None) };
    let mut lift = DMatrix::zeros(free + seen, seen);
    lift.view_mut((0, 0), (free, seen)).copy_from(&-&projection);
    (0..seen).for_each(|i| lift[(free + i, i)] = 1.0);
    let u: Vec<DVector<f64>> = extended.iter().map(|block| lift.transpose() * &block.gradient).collect();
    let information: Vec<DMatrix<f64>> =
        extended.iter().map(|block| lift.transpose() * &block.information * &lift).collect();
    let residual = |b: usize| &u[b] + &information[b] * steps[b].rows(free, seen);
    let e: Vec<DVector<f64>> = (0..u.len()).map(residual).collect();
    let shares: Vec<f64> = information.iter().map(|k| k.trace() / seen as f64).collect();
    let total = u.iter().fold(DVector::zeros(seen), |sum, u| sum + u);
    let step = -(&whitening * &total);
    let z = (0..own).map(|j| {
        let spread: f64 = e.iter().map(|e| whitening.row(j).transpose().dot(e).powi(2)).sum();
        if spread > 0.0 { step[j] / spread.sqrt() } else { 0.0 }
    });
    let vif = columns.clone().map(|j| scores.alone[j] / scores.information[(j, j)]).fold(1.0, f64::max);
    Ok(Some(LawScore {
        score: total.norm_squared(),
        freedom: seen,
        p: p_of_both(p_of_blocks(&u, &e, &shares), p_of_gains(&gains)),
        vif,
        z: z.collect(),
        gains,
        step,
        whitening,
        columns,
    }))
}

/// Σ r² of each block by what the others say of the shared unknowns.
pub fn left_out(fit: &BlockFit, contiguous: &[bool]) -> Option<Vec<f64>> {
    super::cross_validation::left_out(&fit.blocks, &fit.prior, contiguous)
}

/// A block over [φ, η], with this weight.
fn extended(base: &Quadratic, law: &LawBlock, whitening: &DMatrix<f64>, weight: f64) -> Quadratic {
    let (free, seen) = (base.gradient.len(), whitening.ncols());
    let coupling = &law.coupling * whitening;
    let mut information = DMatrix::zeros(free + seen, free + seen);
    information.view_mut((0, 0), (free, free)).copy_from(&base.information);
    information.view_mut((0, free), (free, seen)).copy_from(&coupling);
    information.view_mut((free, 0), (seen, free)).copy_from(&coupling.transpose());
    information.view_mut((free, free), (seen, seen)).copy_from(&(whitening.transpose() * &law.information * whitening));
    let mut gradient = DVector::zeros(free + seen);
    gradient.rows_mut(0, free).copy_from(&base.gradient);
    gradient.rows_mut(free, seen).copy_from(&(whitening.transpose() * &law.gradient));
    Quadratic { squares: weight * base.squares, gradient: weight * gradient, information: weight * information }
}

/// W with `Wᵀ K_jj W = 1` over the directions that can be seen, K of the weighted blocks with the shared unknowns eliminated.
fn whitening(scores: &BlockScores, (blocks, columns): (&[LawBlock], Range<usize>)) -> Option<DMatrix<f64>> {
    let (n, free) = (columns.len(), scores.base.prior.nrows());
    let mut shared = scores.base.prior.clone();
    let (mut coupling, mut alone) = (DMatrix::zeros(free, n), DMatrix::zeros(n, n));
    for ((base, law), weight) in scores.base.blocks.iter().zip(blocks).zip(&scores.weights) {
        shared += *weight * &base.information;
        coupling += *weight * &law.coupling;
        alone += *weight * &law.information;
    }
    // By the size of each column, so that units do not matter; a column that is nothing at all stays zero.
    let scale = DVector::from_fn(n, |i, _| {
        let alone = alone[(i, i)];
        if alone > 0.0 && alone.is_finite() { 1.0 / alone.sqrt() } else { 0.0 }
    });
    let by_columns = shared.cholesky()?.solve(&coupling);
    let information = &alone - coupling.transpose() * by_columns;
    let information = DMatrix::from_fn(n, n, |i, j| scale[i] * scale[j] * information[(i, j)]);
    if information.iter().any(|value| !value.is_finite()) {
        return None;
    }
    let eigen = information.symmetric_eigen();
    let seen: Vec<usize> = (0..n).filter(|&i| eigen.eigenvalues[i] > LEAST_INFORMATION).collect();
    if seen.is_empty() {
        return None;
    }
    Some(DMatrix::from_fn(n, seen.len(), |i, j| {
        scale[i] * eigen.eigenvectors[(i, seen[j])] / eigen.eigenvalues[seen[j]].sqrt()
    }))
}

/// Information of all blocks, by their weights, about the columns of two laws.
fn information_of(scores: &BlockScores, a: &LawScore, b: &LawScore) -> DMatrix<f64> {
    scores.information.view((a.columns.start, b.columns.start), (a.columns.len(), b.columns.len())).into_owned()
}

/// |cos| of the angle between what `of` does to the residuals at its step and the columns of `by`, both with the shared unknowns eliminated.
pub fn collinearity(scores: &BlockScores, of: &LawScore, by: &LawScore) -> f64 {
    let block = |a: &LawScore, b: &LawScore| information_of(scores, a, b);
    let cross = by.whitening.transpose() * block(by, of) * &of.step;
    let own = by.whitening.transpose() * block(by, by) * &by.whitening;
    let whole = of.step.dot(&(block(of, of) * &of.step));
    let explained = own.svd(true, true).solve(&cross, 1e-9).map_or(0.0, |along| along.dot(&cross));
    if whole > 0.0 { (explained / whole).max(0.0).sqrt().min(1.0) } else { 0.0 }
}

/// Share of the score of `law` that is left beside `other`, both with the shared unknowns eliminated: (s − K_lo K_oo⁻¹ s_o)ᵀ K_l|o⁻¹ (…) over sᵀ K_ll⁻¹ s.
pub fn score_left_beside(scores: &BlockScores, law: &LawScore, other: &LawScore) -> f64 {
    let whitened = |a: &LawScore, b: &LawScore| a.whitening.transpose() * information_of(scores, a, b) * &b.whitening;
    let gradient = |a: &LawScore| -(a.whitening.transpose() * information_of(scores, a, a) * &a.step);
    let (own, cross, theirs) = (whitened(law, law), whitened(law, other), whitened(other, other));
    let (s, s_other) = (gradient(law), gradient(other));
    let solved = |matrix: &DMatrix<f64>, right: &DMatrix<f64>| matrix.clone().svd(true, true).solve(right, 1e-9).ok();
    let column = |v: &DVector<f64>| DMatrix::from_column_slice(v.len(), 1, v.as_slice());
    let left = || {
        let alone = solved(&own, &column(&s))?.column(0).dot(&s);
        let beside = &s - (&cross * solved(&theirs, &column(&s_other))?).column(0);
        let information = &own - &cross * solved(&theirs, &cross.transpose())?;
        // Directions that the other law has as its own are left out: nothing is left along them.
        let eigen = information.symmetric_eigen();
        let seen = (0..eigen.eigenvalues.len()).filter(|i| eigen.eigenvalues[*i] > LEAST_INFORMATION);
        let squares =
            seen.map(|i| eigen.eigenvectors.column(i).dot(&beside).powi(2) / eigen.eigenvalues[i]).sum::<f64>();
        (alone > 0.0).then(|| squares / alone)
    };
    left().unwrap_or(1.0)
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    use super::*;

    /// Blocks of a regression with one shared unknown and laws of one column each; the readings have so much of each law's column, and coloured noise of
    /// this size in whole blocks.
    fn scores(columns: usize, effect: &[f64], coloured: f64, seed: u64) -> BlockScores {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
        let mut base = BlockFit {
            blocks: Vec::new(),
            prior: DMatrix::zeros(1, 1),
            freedom: vec![39.0; 24],
            log_determinants: vec![0.0; 24],
            weights: vec![1.0; 24],
            free: DMatrix::identity(1, 1),
            laws: Vec::new(),
        };
        let mut laws = vec![Vec::new(); columns];
        let mut designs: Vec<DMatrix<f64>> = Vec::new();
        for _ in 0..24 {
            let c = DMatrix::from_fn(40, columns, |_, _| normal());
            let ones = DVector::from_element(40, 1.0);
            let wandering = coloured * normal();
            // A model error that follows the first column and changes its sign from block to block.
            let r = DVector::from_fn(40, |i, _| {
                normal() + wandering * c[(i, 0)] - (0..effect.len()).map(|j| effect[j] * c[(i, j)]).sum::<f64>()
            });
            base.blocks.push(Quadratic {
                squares: r.norm_squared(),
                gradient: DVector::from_element(1, ones.dot(&r)),
                information: DMatrix::from_element(1, 1, 40.0),
            });
            for (j, law) in laws.iter_mut().enumerate() {
                let column = c.column(j);
                law.push(LawBlock {
                    coupling: DMatrix::from_element(1, 1, column.sum()),
                    information: DMatrix::from_element(1, 1, column.norm_squared()),
                    gradient: DVector::from_element(1, column.dot(&r)),
                });
            }
            designs.push(c);
        }
        let weights = block_weights(&base, &[false; 23]);
        let (mut information, mut coupling, mut shared) =
            (DMatrix::zeros(columns, columns), DMatrix::zeros(1, columns), 0.0);
        for (c, weight) in designs.iter().zip(&weights) {
            information += *weight * (c.transpose() * c);
            coupling += *weight * c.row_sum();
            shared += weight * 40.0;
        }
        let alone = information.diagonal();
        let information = &information - coupling.transpose() * &coupling / shared;
        let laws = laws.into_iter().map(Some).collect();
        let columns = (0..columns).map(|j| Some(j..j + 1)).collect();
        BlockScores { base, laws, columns, weights, information, alone }
    }

    fn scored(scores: &BlockScores) -> Vec<LawScore> {
        score_laws(scores, &[false; 23], false).into_iter().map(|law| law.unwrap().unwrap()).collect()
    }

    #[test]
    fn a_law_that_is_there_gains_out_of_sample_and_one_that_is_not_loses() {
        let laws = scored(&scores(3, &[0.5], 0.0, 1));
        // 960 samples of 0.5²: 240, less some.
        assert!((180.0..300.0).contains(&laws[0].gain()) && laws[0].p < 1e-6, "{} {}", laws[0].gain(), laws[0].p);
        assert!((laws[0].step[0] - 0.5).abs() < 0.15, "{}", laws[0].step[0]);
        let lost = (1..100).filter(|seed| scored(&scores(2, &[], 0.0, *seed))[1].gain() < 0.0).count();
        // χ²₁ below one: 68 %.
        assert!((55..=85).contains(&lost), "{lost} of 99");
    }

    #[test]
    fn a_law_that_helps_in_sample_only_is_not_believed() {
        // The same size in every block, but of either sign: the score is 30 to 300 times that of noise, the blocks do not agree.
        let few = (1..60).filter(|seed| scored(&scores(2, &[], 2.0, *seed))[0].p < 0.05).count();
        assert!(few <= 8, "{few} of 59 below 0.05");
        let laws = scored(&scores(2, &[], 2.0, 1));
        assert!(laws[0].score > 4.0 * laws[1].score.max(1.0) || laws[0].p > 0.05);
    }

    #[test]
    fn a_column_that_is_not_a_number_is_left_out_and_spoils_no_other() {
        let mut spoilt = scores(3, &[0.5], 0.0, 1);
        let sound = scored(&spoilt)[0].p;
        for block in spoilt.laws[1].as_mut().unwrap() {
            block.gradient[0] = f64::NAN;
        }
        spoilt.information.column_mut(1).fill(f64::NAN);
        spoilt.information.row_mut(1).fill(f64::NAN);
        let laws = score_laws(&spoilt, &[false; 23], false);
        assert_eq!(laws[1].as_ref().unwrap_err().columns, 1);
        assert_eq!(laws[0].as_ref().unwrap().as_ref().unwrap().p, sound);
    }

    #[test]
    fn columns_that_say_the_same_are_collinear_and_others_are_not() {
        let mut scores = scores(3, &[0.5], 0.0, 1);
        // The third law is the first one by another name.
        scores.laws[2] = scores.laws[0].clone();
        for i in 0..3 {
            scores.information[(2, i)] = scores.information[(0, i)];
        }
        for i in 0..3 {
            scores.information[(i, 2)] = scores.information[(i, 0)];
        }
        scores.alone[2] = scores.alone[0];
        let laws = scored(&scores);
        assert!(collinearity(&scores, &laws[0], &laws[2]) > 0.999);
        assert!(collinearity(&scores, &laws[0], &laws[1]) < 0.2);
    }

    #[test]
    fn beside_what_is_there_nothing_is_left_of_its_shadow_and_all_of_another_law() {
        let mut scores = scores(3, &[0.5, 0.5], 0.0, 1);
        // The third law is half of the first one and half of noise of its own.
        let (a, own) = (scores.information[(0, 0)], scores.information[(2, 2)]);
        let cross: Vec<f64> = (0..3).map(|i| scores.information[(0, i)] + scores.information[(2, i)]).collect();
        let of_blocks: Vec<LawBlock> = (scores.laws[0].as_ref().unwrap().iter())
            .zip(scores.laws[2].as_ref().unwrap())
            .map(|(first, third)| LawBlock {
                coupling: &first.coupling + &third.coupling,
                // Columns of a block are nearly orthogonal.
                information: &first.information + &third.information,
                gradient: &first.gradient + &third.gradient,
            })
            .collect();
        scores.laws[2] = Some(of_blocks);
        for i in 0..2 {
            scores.information[(2, i)] = cross[i];
            scores.information[(i, 2)] = cross[i];
        }
        scores.information[(2, 2)] = a + own + 2.0 * scores.information[(0, 2)] - 2.0 * a;
        scores.alone[2] = scores.information[(2, 2)];
        let laws = scored(&scores);
        let left = |law: usize, other: usize| score_left_beside(&scores, &laws[law], &laws[other]);
        assert!(left(2, 0) < 0.1, "{}", left(2, 0));
        assert!(left(1, 0) > 0.7, "{}", left(1, 0));
        assert!(left(0, 0) < 1e-6, "{}", left(0, 0));
    }
}
