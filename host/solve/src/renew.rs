//! New residuals under an old factor: what a chord step is made of.
//!
//! Near the end of a search the Jacobian hardly changes from one point to the next, and a step by the last factor leads as far as one by a
//! new factor would. Residuals are made anew, U, Y, Z and the Schur complement stay: of the elimination only its right-hand side is left,
//!
//! ```text
//!   y = U⁻ᵀ g        the neighbour's g loses Yᵀ y        the border's loses Zᵀ y
//! ```
//! Such steps rest only where the gradient is zero, whatever the factor; so it does no harm that what is kept of it has single precision.

use std::convert::Infallible;

use super::LeastSquares;
use super::factor::Factor;
use super::kernel::{self, Subtract};
use super::shape::{BATCH, Columns};
use super::store::{Kept, Store, triangle, upper_group};
use super::sweep::{Reduced, Sweep};
use super::threads::both;
use super::walk::{Batch, Direction, Front, Steps, walk};
use crate::simd::{LANES, Simd, Work, fetch, vectorised};

/// One end's sweep over the gradient.
struct Renewal {
    columns: Columns,
    /// Gradients of the stage at the front and of the one that comes next.
    front: Vec<f64>,
    next: Vec<f64>,
    /// This sweep's share of the border; its matrix is empty.
    border: Reduced,
    batch: Batch,
}

impl Renewal {
    fn new(columns: Columns) -> Self {
        let n = columns.padded_stage;
        Renewal {
            columns,
            front: vec![0.0; n],
            next: vec![0.0; n],
            border: Reduced { gradient: vec![0.0; columns.border_groups * LANES], ..Reduced::default() },
            batch: Batch::new(columns),
        }
    }

    fn take_over(&mut self, other: &Renewal) {
        let stages = self.front.iter_mut().zip(&other.front);
        for (a, b) in stages.chain(self.border.gradient.iter_mut().zip(&other.border.gradient)) {
            *a += b;
        }
        self.border.squares += other.border.squares;
    }

    /// Adds the rows of stage `slot` of the batch to the front.
    #[inline(always)]
    fn add_rows<S: Simd>(&mut self, simd: S, slot: usize) {
        let Renewal { front, border, batch, .. } = self;
        let stage = &batch.stages[slot];
        for unit in &stage.units {
            front[unit.component] += unit.slope * unit.residual;
            border.squares += unit.residual * unit.residual;
        }
        Sweep::add_residuals(simd, &stage.sensors, front, border);
        Sweep::add_residuals(simd, &stage.others, front, border);
    }

    /// Starts the next stage's gradient, and adds the transition of `slot` to it and to the front's.
    #[inline(always)]
    fn add_transition<S: Simd>(&mut self, simd: S, slot: usize, at_front: Front) {
        let Renewal { front, next, border, batch, .. } = self;
        let stage = &batch.stages[slot];
        next.fill(0.0);
        if !stage.linked {
            return;
        }
        let (source, successor) = match at_front {
            Front::Source => (front, next),
            Front::Successor => (next, front),
        };
        Sweep::add_residuals(simd, &stage.transition, source, border);
        for (i, (to, r)) in successor.iter_mut().zip(&stage.transition.residuals).enumerate() {
            *to -= stage.weight[i / LANES].0[i % LANES] * r;
        }
    }

    /// Eliminates the front's gradient into the next stage, which takes its place; `kept` is that of the stage at the front, `y` where its y belongs.
    #[inline(always)]
    fn eliminate<S: Simd, T: Kept>(&mut self, simd: S, kept: &[[T; LANES]], y: &mut [[T; LANES]]) {
        let Renewal { columns, front, next, border, .. } = self;
        let n = columns.padded_stage;
        let (u, rows) = kept.split_at(triangle(n));
        forward(simd, u, front);
        let (by_next, by_border) = rows.split_at(columns.stage_groups * n);
        kernel::change_weighted::<S, _, Subtract>(simd, by_next, n, front, next.as_chunks_mut().0);
        kernel::change_weighted::<S, _, Subtract>(simd, by_border, n, front, border.gradient.as_chunks_mut().0);
        for (to, from) in y.iter_mut().zip(front.as_chunks().0) {
            *to = T::keep(simd, simd.load(from));
        }
        border.squares -= front.iter().map(|y| y * y).sum::<f64>();
        std::mem::swap(front, next);
    }
}

/// Solves `Uᵀ y = g` in place.
#[inline(always)]
fn forward<S: Simd, T: Kept>(simd: S, u: &[[T; LANES]], g: &mut [f64]) {
    for block in 0..g.len() / LANES {
        let (above, own) = u[upper_group(block)..][..(block + 1) * LANES].split_at(block * LANES);
        let (known, g) = g.split_at_mut(block * LANES);
        let [g0, g1, g2, g3, ..] = g else { unreachable!("a block has four rows") };
        let loss = simd.store(kernel::weighted(simd, above, known));
        let [s0, u01, u02, u03] = simd.store(T::back(simd, &own[0]));
        let [_, s1, u12, u13] = simd.store(T::back(simd, &own[1]));
        let [_, _, s2, u23] = simd.store(T::back(simd, &own[2]));
        let [.., s3] = simd.store(T::back(simd, &own[3]));
        *g0 = (*g0 - loss[0]) * s0;
        *g1 = (*g1 - loss[1] - u01 * *g0) * s1;
        *g2 = (*g2 - loss[2] - u02 * *g0 - u12 * *g1) * s2;
        *g3 = (*g3 - loss[3] - u03 * *g0 - u13 * *g1 - u23 * *g2) * s3;
    }
}

/// Not generic over the problem, so that it is compiled once for each precision.
fn turn<T: Kept>(renewal: &mut Renewal, kept: &mut [[T; LANES]], direction: Direction) {
    let Ok(()) = vectorised(Turn { renewal, kept, direction });
}

/// The stages of a batch, as many as `kept` has.
struct Turn<'a, T> {
    renewal: &'a mut Renewal,
    kept: &'a mut [[T; LANES]],
    direction: Direction,
}

impl<T: Kept> Work for Turn<'_, T> {
    type Output = Result<(), (usize, Infallible)>;

    #[inline(always)]
    fn run<S: Simd>(mut self, simd: S) -> Self::Output {
        let eliminated = self.kept.len() / self.renewal.columns.kept();
        let direction = self.direction;
        walk(simd, &mut self, direction, eliminated)
    }
}

impl<T: Kept> Steps for Turn<'_, T> {
    type Failure = Infallible;

    #[inline(always)]
    fn add_rows<S: Simd>(&mut self, simd: S, slot: usize) {
        self.renewal.add_rows(simd, slot);
    }

    #[inline(always)]
    fn add_transition<S: Simd>(&mut self, simd: S, slot: usize, at_front: Front) {
        self.renewal.add_transition(simd, slot, at_front);
    }

    #[inline(always)]
    fn eliminate<S: Simd>(&mut self, simd: S, slot: usize) -> Result<(), Infallible> {
        let (size, own) = (self.renewal.columns.kept(), self.renewal.columns.stage_groups);
        let (kept, y) = self.kept[slot * size..(slot + 1) * size].split_at_mut(size - own);
        self.renewal.eliminate(simd, kept, y);
        Ok(())
    }
}

/// A problem at a point.
type At<'a, P> = (&'a P, &'a <P as LeastSquares>::Point);

impl Factor {
    /// Makes all residuals anew at `point` and eliminates their gradient by the factor that is there, so that steps and
    /// [`schur`](Factor::schur)'s gradient are those of this point, by the matrix of the other one. Of a factor that
    /// [`factorise`](Factor::factorise) has filled.
    pub(super) fn renew<P: LeastSquares>(&mut self, problem: &P, point: &P::Point, threads: usize) {
        let (columns, middle) = (self.columns(), self.middle());
        let renewed = match self.kept_mut() {
            Store::Double(kept) => renew((problem, point), columns, middle, kept, threads),
            Store::Single(kept) => renew((problem, point), columns, middle, kept, threads),
            Store::Nothing(_) => unreachable!("a factor that keeps nothing is not handed out"),
        };
        self.take_gradient(renewed.border, renewed.batch.linearise);
    }
}

fn renew<P: LeastSquares, T: Kept>(
    at: At<'_, P>,
    columns: Columns,
    middle: usize,
    kept: &mut [[T; LANES]],
    threads: usize,
) -> Renewal {
    let size = columns.kept();
    let (left_kept, rest) = kept.split_at_mut(middle * size);
    let (middle_kept, right_kept) = rest.split_at_mut(size);
    let left = || rightwards(at, columns, left_kept);
    let right = || leftwards(at, columns, middle, right_kept);
    let (left, mut renewal) = both(threads, left, right);
    renewal.batch.linearise = renewal.batch.linearise.max(left.batch.linearise);
    renewal.take_over(&left);
    at.0.border_rows(at.1, renewal.batch.stage_for_border());
    turn(&mut renewal, middle_kept, Direction::Right);
    renewal
}

/// Stages 0 … middle−1: see `sweep_right`.
fn rightwards<P: LeastSquares, T: Kept>(
    (problem, point): At<'_, P>,
    columns: Columns,
    kept: &mut [[T; LANES]],
) -> Renewal {
    let (mut renewal, mut scratch) = (Renewal::new(columns), problem.scratch());
    for (batch, kept) in kept.chunks_mut(BATCH * columns.kept()).enumerate() {
        // What no machine sees coming while it is at the residuals.
        fetch(kept);
        renewal.batch.fill(problem, point, batch * BATCH, &mut scratch);
        turn(&mut renewal, kept, Direction::Right);
    }
    renewal
}

/// Stages N−1 … middle+1: see `sweep_left`.
fn leftwards<P: LeastSquares, T: Kept>(
    (problem, point): At<'_, P>,
    columns: Columns,
    middle: usize,
    kept: &mut [[T; LANES]],
) -> Renewal {
    let (mut renewal, mut scratch) = (Renewal::new(columns), problem.scratch());
    let (stages, size) = (columns.shape.stages, columns.kept());
    for first in (middle..stages).step_by(BATCH).rev() {
        let count = BATCH.min(stages - first);
        let eliminated = if first + count == stages { count - 1 } else { count };
        let kept = &mut kept[(first - middle) * size..(first - middle + eliminated) * size];
        fetch(kept);
        renewal.batch.fill(problem, point, first, &mut scratch);
        turn(&mut renewal, kept, Direction::Left { count });
    }
    renewal
}
