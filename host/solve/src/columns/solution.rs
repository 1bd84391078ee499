//! Solutions with the whole matrix: the back-substitution of the extra columns.

use nalgebra::DMatrix;

use super::super::LeastSquares;
use super::super::border::Border;
use super::super::factor::{Factor, StageFactor};
use super::super::kernel::groups;
use super::ExtraColumns;
use super::sweep::{Whole, sweep};
use crate::simd::LANES;

/// Solutions of `H x = v` for the columns' gradients v = Jᵀ C (and what was added to them directly; the border's part is that of the
/// rows).
#[derive(Debug, Clone, PartialEq)]
pub struct Solutions {
    /// `[stage · n + i]` by columns.
    pub states: DMatrix<f64>,
    /// m × q.
    pub border: DMatrix<f64>,
}

/// Solves with H for every column. Keeps N n q doubles: for few columns. `None` where the border is singular.
pub fn solve<P: LeastSquares>(
    problem: &P,
    point: &P::Point,
    factor: &Factor,
    extra: &impl ExtraColumns<P>,
    border: &Border,
    threads: usize,
) -> Option<Solutions> {
    let (left, right) = sweep((problem, point, extra), factor, threads, true, [&mut Whole, &mut Whole]);
    let (columns, middle, count) = (factor.columns(), factor.middle(), extra.count());
    let (n, padded, stages) = (columns.shape.stage, columns.padded_stage, columns.shape.stages);
    let shared = border.covariance()? * right.reduced(count).coupling;
    let mut states = DMatrix::zeros(stages * n, count);
    let size = padded * groups(count);
    let (left, right) = (left.kept.unwrap_or_default(), right.kept.unwrap_or_default());
    let mut stage = StageFactor::default();
    let mut substitute = |k: usize, parent: Option<usize>| {
        // The right sweep went from the last stage inwards and ended with the one in the middle.
        let v = if k < middle { &left[k * size..][..size] } else { &right[(stages - 1 - k) * size..][..size] };
        factor.stage(k, &mut stage);
        let mut x = DMatrix::from_fn(n, count, |i, j| v[j / LANES * padded + i].0[j % LANES]);
        x -= DMatrix::from_row_slice(n, columns.shape.border, &stage.z) * &shared;
        if let Some(parent) = parent {
            x -= DMatrix::from_row_slice(n, n, &stage.y) * states.rows(parent * n, n);
        }
        let u = DMatrix::from_row_slice(n, n, &stage.u);
        let solved = u.solve_upper_triangular_mut(&mut x);
        debug_assert!(solved, "the diagonal of a factor is positive");
        states.rows_mut(k * n, n).copy_from(&x);
    };
    substitute(middle, None);
    (0..middle).rev().for_each(|k| substitute(k, Some(k + 1)));
    (middle + 1..stages).for_each(|k| substitute(k, Some(k - 1)));
    Some(Solutions { states, border: shared })
}
