//! The elimination of all stages, from both ends of the chain inwards, down to the border.
//!
//! ```text
//!   0 → 1 → … → m−1 → [ m ] ← m+1 ← … ← N−1        → : left sweep (thread 1)   ← : right sweep (thread 2)
//! ```
//!
//! Stage k with block D, coupling E to the stage it is eliminated into, border part B and gradient g becomes
//! `Uᵀ U = D`, `[Y | Z y] = U⁻ᵀ [E | B g]`; its neighbour's `[D | B g]` loses `Yᵀ [Y | Z y]`, the border loses `[Z y]ᵀ [Z y]`.
//! Residuals and derivatives are made four stages at a time just before they are used (in `sweep`): Jacobians never go
//! through memory. U and `[Y | Z y]` do, for the back-substitution: `n(n+4)/2 + n(n+m+1)` doubles a stage.
//! The two sweeps and their order of summation are always the same, so results do not depend on the number of threads.

use std::time::Duration;

use super::kernel::{self, MAX_STAGE_SIZE, Pivot, triangle};
use super::problem::{BATCH, Columns};
use super::sweep::{Finish, Sweep, sweep_left, sweep_right};
use super::threads::both;
use super::{LeastSquares, Step};
use crate::simd::{LANES, Quad, Simd, Work, vectorised};

/// Why an elimination failed: a stage that its residuals do not determine.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Singular {
    /// The stage.
    pub stage: usize,
    /// The pivot that was not positive.
    pub pivot: Pivot,
}

/// Why a problem cannot be solved at all.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum SolveError {
    /// No block of this size is compiled.
    #[error("a stage has {stage} unknowns, the solver is compiled for at most {MAX_STAGE_SIZE}")]
    StageTooLarge {
        /// Unknowns of a stage.
        stage: usize,
    },
    /// A stage stays undetermined however strongly its states are damped: a residual there is not finite.
    #[error("stage {stage}: unknown {unknown} is not determined by its residuals (pivot {pivot:e})")]
    Undetermined {
        /// The stage.
        stage: usize,
        /// Index of the unknown in the stage.
        unknown: usize,
        /// The pivot that was not positive.
        pivot: f64,
    },
}

impl From<Singular> for SolveError {
    fn from(Singular { stage, pivot }: Singular) -> Self {
        SolveError::Undetermined { stage, unknown: pivot.index, pivot: pivot.value }
    }
}

/// A factorised chain: what the back-substitution needs, and the reduced border system.
#[derive(Debug)]
pub struct Factor {
    columns: Columns,
    /// U and `[Y | Z y]` of every stage.
    kept: Vec<f64>,
    /// The stage where the two sweeps meet.
    middle: usize,
    /// The upper groups of the Schur complement with its gradient, and Σ r² − Σ y².
    border: Vec<Quad>,
    linearise: Duration,
}

/// The factor of one stage, dense and row-major: `Uᵀ U = D`, `[Y | Z y] = U⁻ᵀ [E | B g]`. Its memory is used again from stage to stage.
///
/// The stage's step is `x = −U⁻¹ (Y x' + Z p + y)` with the step x' of [`Factor::neighbour`], into which it was eliminated.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct StageFactor {
    /// Upper triangle with its diagonal, n × n; zero below.
    pub u: Vec<f64>,
    /// n × n; zero where the stage is eliminated into none.
    pub y: Vec<f64>,
    /// n × m, shared unknowns in their own order.
    pub z: Vec<f64>,
    /// n.
    pub right: Vec<f64>,
}

impl Columns {
    /// Columns of `[Y | Z y]` that are kept.
    pub(super) fn kept_columns(&self) -> usize {
        self.padded_stage + self.shape.border + 1
    }

    /// Doubles that are kept of a stage.
    pub(super) fn kept(&self) -> usize {
        triangle(self.padded_stage) + self.padded_stage * self.kept_columns()
    }
}

impl Factor {
    /// Room for the factor of `problem`; [`factorise`](Self::factorise) fills it, as often as wanted.
    ///
    /// # Errors
    /// [`SolveError::StageTooLarge`].
    pub fn new(problem: &impl LeastSquares) -> Result<Self, SolveError> {
        let columns = Columns::of(problem.shape())?;
        let stages = columns.shape.stages;
        Ok(Factor {
            columns,
            kept: vec![0.0; columns.kept() * stages],
            // Sweeps go by whole batches.
            middle: stages / (2 * BATCH) * BATCH,
            border: Vec::new(),
            linearise: Duration::ZERO,
        })
    }

    /// Time that the last factorisation spent in the problem's own residuals and derivatives, s: the slower sweep's.
    pub fn linearise_s(&self) -> f64 {
        self.linearise.as_secs_f64()
    }

    /// Where columns stand.
    pub(super) fn columns(&self) -> Columns {
        self.columns
    }

    /// The stage where the two sweeps meet: eliminated last, into nothing.
    pub(super) fn middle(&self) -> usize {
        self.middle
    }

    /// Linearises and eliminates all stages at `point`. `damping` multiplies each stage's own diagonal (0: plain Gauss–Newton).
    ///
    /// # Errors
    /// The first stage, seen from either end, that its residuals do not determine.
    pub fn factorise<P: LeastSquares>(
        &mut self,
        problem: &P,
        point: &P::Point,
        damping: f64,
        threads: usize,
    ) -> Result<(), Singular> {
        let (columns, middle) = (self.columns, self.middle);
        let size = columns.kept();
        let (left_kept, rest) = self.kept.split_at_mut(middle * size);
        let (middle_kept, right_kept) = rest.split_at_mut(size);
        let left = || sweep_right(problem, point, columns, damping, left_kept);
        let right = || sweep_left(problem, point, columns, damping, middle, right_kept);
        let (left, right) = both(threads, left, right);
        let (left, mut sweep): (Sweep, Sweep) = (left?, right?);
        self.linearise = left.linearise.max(sweep.linearise);
        sweep.take_over(&left);
        problem.border_rows(point, sweep.stage_for_border());
        vectorised(Finish { sweep: &mut sweep, kept: middle_kept })
            .map_err(|pivot| Singular { stage: middle, pivot })?;
        self.border = sweep.border;
        Ok(())
    }

    /// Number of stages.
    pub fn stages(&self) -> usize {
        self.columns.shape.stages
    }

    /// The stage that stage k is eliminated into; none for the last one, where the two sweeps meet.
    pub fn neighbour(&self, k: usize) -> Option<usize> {
        match k.cmp(&self.middle) {
            std::cmp::Ordering::Less => Some(k + 1),
            std::cmp::Ordering::Equal => None,
            std::cmp::Ordering::Greater => Some(k - 1),
        }
    }

    /// Writes out the factor of stage k.
    pub fn stage(&self, k: usize, to: &mut StageFactor) {
        let (n, m, padded) = (self.columns.shape.stage, self.columns.shape.border, self.columns.padded_stage);
        let kept = &self.kept[k * self.columns.kept()..(k + 1) * self.columns.kept()];
        let (u, rest) = kept.split_at(triangle(padded));
        for (dense, size) in [(&mut to.u, n * n), (&mut to.y, n * n), (&mut to.z, n * m), (&mut to.right, n)] {
            dense.clear();
            dense.resize(size, 0.0);
        }
        let mut first = 0;
        for (i, rest) in rest.chunks_exact(self.columns.kept_columns()).enumerate().take(n) {
            // Rows begin with their diagonal block.
            let from = i / LANES * LANES;
            let row = &u[first..first + padded - from];
            first += row.len();
            to.u[i * n + i..(i + 1) * n].copy_from_slice(&row[i - from..n - from]);
            to.u[i * n + i] = 1.0 / row[i - from];
            let (y, z) = rest.split_at(padded);
            to.y[i * n..(i + 1) * n].copy_from_slice(&y[..n]);
            for (j, to) in to.z[i * m..(i + 1) * m].iter_mut().enumerate() {
                *to = z[self.columns.shared(j)];
            }
            to.right[i] = z[self.columns.right()];
        }
    }

    /// Entry (i, j) of the reduced border system, columns as [`Columns`] gives them.
    fn reduced(&self, i: usize, j: usize) -> f64 {
        let (i, j) = (i.min(j), i.max(j));
        self.border[j / LANES * self.columns.border_groups * LANES + i].0[j % LANES]
    }

    /// The reduced system of the border, `(S, g)` row-major m × m and m: the step solves `S δ = −g`. S is the information matrix of
    /// the shared unknowns with all states eliminated.
    pub fn schur(&self) -> (Vec<f64>, Vec<f64>) {
        let m = self.columns.shape.border;
        let column = |j: usize| self.columns.shared(j);
        let schur = (0..m * m).map(|at| self.reduced(column(at / m), column(at % m))).collect();
        (schur, (0..m).map(|i| self.reduced(column(i), self.columns.right())).collect())
    }

    /// Σ r² that would be left if the states alone took their Gauss–Newton step.
    pub fn eliminated_square_sum(&self) -> f64 {
        self.reduced(self.columns.right(), self.columns.right())
    }

    /// Makes `step` the step of all states that goes with the step `border` of the shared unknowns.
    pub fn back_substitute(&self, border: &[f64], threads: usize, step: &mut Step) {
        let (columns, size, n) = (self.columns, self.columns.kept(), self.columns.shape.stage);
        step.border.clear();
        step.border.extend_from_slice(border);
        step.states.resize(self.columns.shape.stages * n, 0.0);
        let (left_states, rest) = step.states.split_at_mut(self.middle * n);
        let (middle_states, right_states) = rest.split_at_mut(n);
        let (left_kept, rest) = self.kept.split_at(self.middle * size);
        let (middle_kept, right_kept) = rest.split_at(size);
        let mut x = Substitution::new(columns, border);
        vectorised(BackSubstitute { x: &mut x, kept: middle_kept, states: middle_states, backwards: false });
        let mut right_x = x.clone();
        let left = || vectorised(BackSubstitute { x: &mut x, kept: left_kept, states: left_states, backwards: true });
        let right =
            || vectorised(BackSubstitute { x: &mut right_x, kept: right_kept, states: right_states, backwards: false });
        both(threads, left, right);
    }
}

/// What a stage's step is made of: `[x of the neighbour | shared unknowns, 1]`, in the columns that are kept.
#[derive(Debug, Clone)]
struct Substitution {
    columns: Columns,
    known: Vec<f64>,
    own: Vec<Quad>,
}

impl Substitution {
    fn new(columns: Columns, border: &[f64]) -> Self {
        let mut known = vec![0.0; columns.kept_columns()];
        known[columns.padded_stage + columns.right()] = 1.0;
        for (j, value) in border.iter().enumerate() {
            known[columns.padded_stage + columns.shared(j)] = *value;
        }
        Substitution { columns, known, own: vec![Quad::default(); columns.stage_groups] }
    }
}

/// The steps of consecutive stages, from the first one to the last or from the last one to the first.
struct BackSubstitute<'a> {
    x: &'a mut Substitution,
    kept: &'a [f64],
    states: &'a mut [f64],
    backwards: bool,
}

impl Work for BackSubstitute<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        let columns = self.x.columns;
        let (size, n) = (columns.kept(), columns.shape.stage);
        let count = self.states.len() / n;
        for i in 0..count {
            let k = if self.backwards { count - 1 - i } else { i };
            self.x.stage(simd, &self.kept[k * size..(k + 1) * size]);
            let own = &mut self.states[k * n..(k + 1) * n];
            own.copy_from_slice(&self.x.known[..n]);
        }
    }
}

impl Substitution {
    /// x = −U⁻¹ ([Y | Z y] [x' | p, 1]), which then takes the place of x'.
    #[inline(always)]
    fn stage<S: Simd>(&mut self, simd: S, kept: &[f64]) {
        let (n, width) = (self.columns.padded_stage, self.columns.kept_columns());
        let (u, rest) = kept.split_at(triangle(n));
        let whole = width / LANES * LANES;
        for (rows, own) in rest.chunks_exact(LANES * width).zip(&mut self.own) {
            let mut sums = [simd.splat(0.0); LANES];
            // What does not wait for the neighbour comes first.
            let mut at = n;
            while at < whole {
                let known = simd.load(kernel::quad(&self.known, at));
                for (r, sum) in sums.iter_mut().enumerate() {
                    *sum = simd.mul_add(simd.load(kernel::quad(rows, r * width + at)), known, *sum);
                }
                at += LANES;
            }
            let mut at = 0;
            while at < n {
                let known = simd.load(kernel::quad(&self.known, at));
                for (r, sum) in sums.iter_mut().enumerate() {
                    *sum = simd.mul_add(simd.load(kernel::quad(rows, r * width + at)), known, *sum);
                }
                at += LANES;
            }
            let mut right = kernel::add_across(simd, sums);
            for (r, right) in right.iter_mut().enumerate() {
                for at in whole..width {
                    *right += rows[r * width + at] * self.known[at];
                }
                *right = -*right;
            }
            *own = Quad(right);
        }
        kernel::backward(simd, u, &mut self.own);
        debug_assert!(n <= MAX_STAGE_SIZE);
        for (known, own) in self.known.chunks_exact_mut(LANES).zip(&self.own) {
            known.copy_from_slice(&own.0);
        }
    }
}
