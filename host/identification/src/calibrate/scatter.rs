//! Errors of the shared unknowns by the scatter between blocks of time.
//!
//! The inverse of the information is the covariance where residuals are white noise of the size that rows are weighted by. What a model misses is not: it lasts,
//! and repeats with the motion. Each block of time then has a gradient of its own, s_b, and the sandwich (Huber 1967; White 1982; by clusters, Liang and Zeger 1986)
//!
//! ```text
//!   A⁻¹ (Σ s_b s_bᵀ) A⁻¹        A = Σ A_b, the information of block b with its states eliminated
//! ```
//! is the covariance whatever the residuals are within a block. Of white residuals tr(A⁻¹ Σ s_b s_bᵀ) is the number of unknowns, give or take a quarter.

use std::ops::Range;

use nalgebra::{DMatrix, DVector};

use super::extension::blocks::{NoColumns, taken};
use super::residuals::point::Point;
use super::residuals::problem::Problem;
use crate::robot::Robot;
use solve::border::Border;
use solve::columns::{BlockSums, block_sums};
use solve::factor::Factor;
use solve::{LeastSquares, Step};

/// Blocks in all. Twice as many see less of what lasts long; half as many tell a standard error to ± 19 % instead of ± 13 %.
const BLOCKS: usize = 30;
/// Fewer blocks tell no scatter.
const FEWEST_BLOCKS: usize = 8;
/// How many times what white residuals scatter, mean over all unknowns, from which on they are not white. Of white residuals and four unknowns it is
/// 1.5 in less than one calibration of a hundred (χ² of 116 degrees); of what EMPS and KUKA KR300 leave it is 56 and 3,100. Halved, it is what white residuals have; doubled,
/// intervals that are √3 times too narrow are not widened.
const COLOURED: f64 = 1.5;
/// Two-sided 95 % of Student's t with 29 degrees of freedom over that of the normal distribution.
const STUDENT: f64 = 2.045 / 1.960;

/// The scatter between blocks.
pub(super) struct Scatter {
    /// How many there are.
    pub blocks: usize,
    /// How many times what white residuals would scatter, mean over all unknowns.
    pub ratio: f64,
    /// Unknowns of the border and what their standard errors are to be multiplied by; none where residuals are white.
    pub wider: Vec<(usize, f64)>,
}

/// The scatter at a solution; none where there are too few blocks, or they cannot be solved.
pub(super) fn between_blocks<'m>(
    problem: &Problem<'m>,
    robot: &Robot,
    point: &Point<'m>,
    held: &[Vec<f64>],
    threads: usize,
) -> Option<Scatter> {
    let (series, starts, places) = problem.series.select(&windows(problem));
    if starts.len() < FEWEST_BLOCKS || series.recordings.len() != problem.series.recordings.len() {
        return None;
    }
    let mut broken = Problem::new(problem.model, robot, &series, problem.assumptions.clone());
    broken.set_noise(problem.noise().clone());
    broken.shift_readings(&point.z);
    let states = places.iter().flat_map(|&k| point.state(k).iter().copied()).collect();
    let mut at = Point { states, ..point.clone() };
    let mut factor = Factor::new(&broken).ok()?;
    factor.factorise_somehow(&broken, &at, threads).ok()?;
    // States at the edges are free of what was beyond them.
    let mut step = Step::default();
    factor.back_substitute(&vec![0.0; broken.border().size()], threads, &mut step);
    let mut moved = at.clone();
    broken.retract(&at, &step, &mut moved);
    at = moved;
    factor.factorise_somehow(&broken, &at, threads).ok()?;
    let (information, gradient) = factor.schur();
    let mut border = Border::new(&information, &gradient, held);
    border.hold_undetermined();
    let free = border.free_directions();
    let take = |_: usize, sums: &BlockSums<'_>| {
        let taken = taken(sums, &free, &[]);
        (taken.shared, taken.shared_gradient)
    };
    let blocks = block_sums((&broken, &at), &factor, &NoColumns, &starts, threads, take);
    of_blocks(&blocks, &free)
}

fn of_blocks(blocks: &[(DMatrix<f64>, DVector<f64>)], free: &DMatrix<f64>) -> Option<Scatter> {
    let (count, unknowns) = (blocks.len(), free.ncols());
    if count < FEWEST_BLOCKS || unknowns == 0 {
        return None;
    }
    let information = blocks.iter().fold(DMatrix::zeros(unknowns, unknowns), |sum, (a, _)| sum + a);
    let mean = blocks.iter().fold(DVector::zeros(unknowns), |sum, (_, s)| sum + s) / count as f64;
    let scatter = blocks.iter().fold(DMatrix::zeros(unknowns, unknowns), |sum, (_, s)| {
        let own = s - &mean;
        sum + &own * own.transpose()
    }) * (count as f64 / (count - 1) as f64);
    let covariance = information.cholesky()?.inverse();
    let sandwich = &covariance * &scatter * &covariance;
    let ratio = (&covariance * &scatter).trace() / unknowns as f64;
    if !ratio.is_finite() {
        return None;
    }
    let variances = |of: &DMatrix<f64>| (free * of * free.transpose()).diagonal();
    let (white, coloured) = (variances(&covariance), variances(&sandwich));
    let factor = |i: usize| (STUDENT * (coloured[i] / white[i]).sqrt()).max(1.0);
    let wider = match ratio > COLOURED {
        true => (0..free.nrows()).filter(|&i| white[i] > 0.0).map(|i| (i, factor(i))).collect(),
        false => Vec::new(),
    };
    Some(Scatter { blocks: count, ratio, wider })
}

/// Windows of equal length, each within one recording.
fn windows(problem: &Problem<'_>) -> Vec<Range<usize>> {
    let stages = problem.series.stages();
    let of_recording = |recording: &Range<usize>| {
        let count = (BLOCKS * recording.len()).div_ceil(stages.max(1)).max(1);
        let (start, length) = (recording.start, recording.len());
        (0..count).map(move |i| start + i * length / count..start + (i + 1) * length / count)
    };
    problem.series.recordings.iter().flat_map(of_recording).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Blocks whose gradients are so many times what white noise makes of them, by sign.
    fn blocks(times: f64) -> Vec<(DMatrix<f64>, DVector<f64>)> {
        let sign = |b: usize, i: usize| if (b >> i) & 1 == 0 { 1.0 } else { -1.0 };
        (0..32)
            .map(|b| {
                let information = DMatrix::from_diagonal(&DVector::from_vec(vec![4.0, 9.0]));
                (information, times * DVector::from_vec(vec![2.0 * sign(b, 0), 3.0 * sign(b, 1)]))
            })
            .collect()
    }

    #[test]
    fn white_residuals_keep_their_errors_and_coloured_ones_get_those_of_the_scatter() {
        let free = DMatrix::identity(2, 2);
        let white = of_blocks(&blocks(1.0), &free).unwrap();
        // 32/31 of what white noise scatters.
        assert!((white.ratio - 32.0 / 31.0).abs() < 1e-12 && white.wider.is_empty(), "{}", white.ratio);
        let coloured = of_blocks(&blocks(3.0), &free).unwrap();
        assert!((coloured.ratio - 9.0 * 32.0 / 31.0).abs() < 1e-9, "{}", coloured.ratio);
        for (place, (unknown, factor)) in coloured.wider.iter().enumerate() {
            // Three times, as t tells it of 29 degrees.
            let expected = 3.0 * (32.0f64 / 31.0).sqrt() * STUDENT;
            assert!(*unknown == place && (factor / expected - 1.0).abs() < 1e-9, "{unknown}: {factor}");
        }
    }

    #[test]
    fn few_blocks_tell_no_scatter() {
        assert!(of_blocks(&blocks(3.0)[..FEWEST_BLOCKS - 1], &DMatrix::identity(2, 2)).is_none());
        assert!(of_blocks(&blocks(3.0)[..FEWEST_BLOCKS], &DMatrix::identity(2, 2)).is_some());
    }
}
