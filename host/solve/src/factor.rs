//! The elimination of all stages, from both ends of the chain inwards, down to the border.
//!
//! ```text
//!   0 → 1 → … → m−1 → [ m ] ← m+1 ← … ← N−1        → : left sweep (thread 1)   ← : right sweep (thread 2)
//! ```
//!
//! Stage k with block D, coupling E to the stage it is eliminated into, border part B and gradient g becomes
//! `Uᵀ U = D`, `[Y | Z y] = U⁻ᵀ [E | B g]`; its neighbour's `[D | B g]` loses `Yᵀ [Y | Z y]`, the border loses `[Z y]ᵀ [Z y]`.
//! Residuals and derivatives are made four stages at a time just before they are used (in `sweep`): Jacobians never go
//! through memory. U and `[Y | Z y]` do, for the back-substitution: see `store`.
//! The two sweeps and their order of summation are always the same, so results do not depend on the number of threads.

use std::time::Duration;

use super::error::{Singular, SolveError};
use super::kernel::groups;
use super::shape::{BATCH, Columns};
use super::store::{Kept, Precision, Store, substitute, triangle};
use super::sweep::{Reduced, Sweep, finish, sweep_left, sweep_right};
use super::threads::both;
use super::{LeastSquares, Step};
use crate::simd::{LANES, Quad, Simd, Work, fetch, vectorised};

/// A factorised chain: what the back-substitution needs, and the reduced border system.
#[derive(Debug)]
pub struct Factor {
    columns: Columns,
    /// U and `[Y | Z y]` of every stage.
    kept: Store,
    /// The stage where the two sweeps meet.
    middle: usize,
    border: Reduced,
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
    /// Groups that are kept of a stage.
    pub(super) fn kept(&self) -> usize {
        let n = self.padded_stage;
        triangle(n) + n * (self.stage_groups + self.border_groups) + self.stage_groups
    }
}

impl Factor {
    /// Room for the factor of `problem` in double precision; [`factorise`](Self::factorise) fills it, as often as wanted.
    ///
    /// # Errors
    /// [`SolveError::StageTooLarge`].
    pub fn new(problem: &impl LeastSquares) -> Result<Self, SolveError> {
        Self::with_precision(problem, Precision::Double)
    }

    /// [`new`](Self::new) with steps of this precision. The Schur complement does not depend on it.
    ///
    /// # Errors
    /// [`SolveError::StageTooLarge`].
    pub fn with_precision(problem: &impl LeastSquares, precision: Precision) -> Result<Self, SolveError> {
        let columns = Columns::of(problem.shape())?;
        Ok(Self::keeping(columns, Store::new(precision, columns.kept() * columns.shape.stages)))
    }

    fn keeping(columns: Columns, kept: Store) -> Self {
        Factor {
            columns,
            kept,
            // Sweeps go by whole batches.
            middle: columns.shape.stages / (2 * BATCH) * BATCH,
            border: Reduced::default(),
            linearise: Duration::ZERO,
        }
    }

    /// Time that the last factorisation spent in the problem's own residuals and derivatives, s: the slower sweep's.
    pub fn linearise_s(&self) -> f64 {
        self.linearise.as_secs_f64()
    }

    pub(super) fn kept_mut(&mut self) -> &mut Store {
        &mut self.kept
    }

    /// Takes in the gradient of other residuals; the matrix stays.
    pub(super) fn take_gradient(&mut self, renewed: Reduced, linearise: Duration) {
        self.border = Reduced { values: std::mem::take(&mut self.border.values), ..renewed };
        self.linearise = linearise;
    }

    /// Where columns stand.
    pub(super) fn columns(&self) -> Columns {
        self.columns
    }

    /// The stage where the two sweeps meet: eliminated last, into nothing.
    pub(super) fn middle(&self) -> usize {
        self.middle
    }

    /// [`factorise`](Self::factorise) at a point where a search ended: without damping, or where rounding leaves a stage that only damping
    /// determines, with as little as is enough.
    ///
    /// # Errors
    /// A stage that a millionth of its diagonal does not determine either.
    pub fn factorise_somehow<P: LeastSquares>(
        &mut self,
        problem: &P,
        point: &P::Point,
        threads: usize,
    ) -> Result<(), Singular> {
        let weaker = [0.0, 1e-12, 1e-9];
        let done = weaker.iter().any(|&damping| self.factorise(problem, point, damping, threads).is_ok());
        if done { Ok(()) } else { self.factorise(problem, point, 1e-6, threads) }
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
        let (left_kept, rest) = self.kept.all().split_at(middle * size);
        let (middle_kept, right_kept) = rest.split_at(size);
        let left = || sweep_right(problem, point, columns, damping, left_kept);
        let right = || sweep_left(problem, point, columns, damping, middle, right_kept);
        let (left, right) = both(threads, left, right);
        let (left, mut sweep): (Sweep, Sweep) = (left?, right?);
        self.linearise = left.batch.linearise.max(sweep.batch.linearise);
        sweep.take_over(&left);
        problem.border_rows(point, sweep.batch.stage_for_border());
        finish(&mut sweep, middle_kept).map_err(|pivot| Singular { stage: middle, pivot })?;
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
        let Columns { shape, padded_stage: padded, stage_groups: own, border_groups, .. } = self.columns;
        let (n, m) = (shape.stage, shape.border);
        for (dense, size) in [(&mut to.u, n * n), (&mut to.y, n * n), (&mut to.z, n * m), (&mut to.right, n)] {
            dense.clear();
            dense.resize(size, 0.0);
        }
        let mut at = k * self.columns.kept();
        let mut next = || {
            at += 1;
            self.kept.quad(at - 1)
        };
        for group in 0..own {
            let first = group * LANES;
            for i in 0..first + LANES {
                let quad = next();
                // What is below the diagonal means nothing.
                for j in i.max(first)..n.min(first + LANES) {
                    to.u[i * n + j] = quad[j - first];
                }
            }
        }
        for i in 0..n {
            to.u[i * n + i] = 1.0 / to.u[i * n + i];
        }
        for (dense, width, groups) in [(&mut to.y, n, own), (&mut to.z, m, border_groups)] {
            for group in 0..groups {
                let columns = group * LANES..width.min((group + 1) * LANES);
                for i in 0..padded {
                    let quad = next();
                    if i < n {
                        dense[i * width..][columns.clone()].copy_from_slice(&quad[..columns.len()]);
                    }
                }
            }
        }
        for right in to.right.chunks_mut(LANES) {
            right.copy_from_slice(&next()[..right.len()]);
        }
    }

    /// The reduced system of the border, `(S, g)` row-major m × m and m: the step solves `S δ = −g`. S is the information matrix of
    /// the shared unknowns with all states eliminated.
    pub fn schur(&self) -> (Vec<f64>, Vec<f64>) {
        let m = self.columns.shape.border;
        let entry = |i: usize, j: usize| {
            let (i, j) = (i.min(j), i.max(j));
            self.border.values[j / LANES * self.columns.border_groups * LANES + i].0[j % LANES]
        };
        let schur = (0..m * m).map(|at| entry(at / m, at % m)).collect();
        (schur, self.border.gradient[..m].to_vec())
    }

    /// Σ r² that would be left if the states alone took their Gauss–Newton step.
    pub fn eliminated_square_sum(&self) -> f64 {
        self.border.squares
    }

    /// Makes `step` the step of all states that goes with the step `border` of the shared unknowns.
    pub fn back_substitute(&self, border: &[f64], threads: usize, step: &mut Step) {
        debug_assert_eq!(border.len(), self.columns.shape.border, "all shared unknowns have a step");
        step.border.clear();
        step.border.extend_from_slice(border);
        step.states.resize(self.columns.shape.stages * self.columns.shape.stage, 0.0);
        match &self.kept {
            Store::Double(kept) => self.states_of(kept, border, threads, &mut step.states),
            Store::Single(kept) => self.states_of(kept, border, threads, &mut step.states),
            Store::Nothing(_) => unreachable!("a factor that keeps nothing is not handed out"),
        }
    }

    fn states_of<T: Kept>(&self, kept: &[[T; LANES]], border: &[f64], threads: usize, states: &mut [f64]) {
        let (columns, size, n) = (self.columns, self.columns.kept(), self.columns.shape.stage);
        let (left_states, rest) = states.split_at_mut(self.middle * n);
        let (middle_states, right_states) = rest.split_at_mut(n);
        let (left_kept, rest) = kept.split_at(self.middle * size);
        let (middle_kept, right_kept) = rest.split_at(size);
        let mut x = Known::new(columns, border);
        vectorised(BackSubstitute { x: &mut x, kept: middle_kept, states: middle_states, backwards: false });
        let mut right_x = x.clone();
        let left = || vectorised(BackSubstitute { x: &mut x, kept: left_kept, states: left_states, backwards: true });
        let right =
            || vectorised(BackSubstitute { x: &mut right_x, kept: right_kept, states: right_states, backwards: false });
        both(threads, left, right);
    }
}

/// [`Factor::schur`] at `point` alone: nothing of the stages is kept, so that it takes no memory to speak of.
///
/// # Errors
/// [`SolveError`].
pub fn reduced<P: LeastSquares>(
    problem: &P,
    point: &P::Point,
    threads: usize,
) -> Result<(Vec<f64>, Vec<f64>), SolveError> {
    let columns = Columns::of(problem.shape())?;
    let mut factor = Factor::keeping(columns, Store::Nothing(columns.kept() * columns.shape.stages));
    factor.factorise(problem, point, 0.0, threads)?;
    Ok(factor.schur())
}

/// So many stages ahead what is kept of them is asked for.
const SOON: usize = 3;

/// What a stage's step is made of.
#[derive(Debug, Clone)]
struct Known {
    columns: Columns,
    /// `[x of the neighbour | shared unknowns]`.
    quads: Vec<Quad>,
    own: Vec<Quad>,
}

impl Known {
    fn new(columns: Columns, border: &[f64]) -> Self {
        let mut quads = vec![Quad::default(); columns.stage_groups + groups(border.len())];
        for (j, value) in border.iter().enumerate() {
            quads[columns.stage_groups + j / LANES].0[j % LANES] = *value;
        }
        Known { columns, quads, own: vec![Quad::default(); columns.stage_groups] }
    }

    /// Makes the step of the next stage, and knows it.
    #[inline(always)]
    fn go_on<S: Simd, T: Kept>(&mut self, simd: S, kept: &[[T; LANES]], states: &mut [f64]) {
        let Known { quads, own, .. } = self;
        substitute(simd, kept, quads, own);
        quads[..own.len()].copy_from_slice(own);
        for (to, own) in states.chunks_mut(LANES).zip(own.iter()) {
            to.copy_from_slice(&own.0[..to.len()]);
        }
    }
}

/// The steps of consecutive stages, from the first one to the last or from the last one to the first.
struct BackSubstitute<'a, T> {
    x: &'a mut Known,
    kept: &'a [[T; LANES]],
    states: &'a mut [f64],
    backwards: bool,
}

impl<T: Kept> Work for BackSubstitute<'_, T> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        let BackSubstitute { x, kept, states, backwards } = self;
        let (size, n) = (x.columns.kept(), x.columns.shape.stage);
        let stages = kept.len() / size;
        for turn in 0..stages {
            // Memory that is read backwards no machine sees coming, and of what is read forwards not the next page.
            let (k, soon) = if backwards {
                (stages - 1 - turn, (stages - 1 - turn).checked_sub(SOON))
            } else {
                (turn, Some(turn + SOON))
            };
            if let Some(soon) = soon.and_then(|soon| kept.get(soon * size..(soon + 1) * size)) {
                fetch(soon);
            }
            x.go_on(simd, &kept[k * size..(k + 1) * size], &mut states[k * n..(k + 1) * n]);
        }
    }
}
