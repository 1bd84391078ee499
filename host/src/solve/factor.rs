//! The elimination of all stages, from both ends of the chain inwards, down to the border.
//!
//! ```text
//!   0 → 1 → … → m−1 → [ m ] ← m+1 ← … ← N−1        → : left sweep (thread 1)   ← : right sweep (thread 2)
//! ```
//!
//! Stage k with block D, coupling E to the stage it is eliminated into, border part B and gradient g becomes
//! `L Lᵀ = D`, `[Y | Z | y] = L⁻¹ [E | B | g]`; its neighbour's `[D | B | g]` loses `Yᵀ [Y | Z | y]`, the border loses `[Z | y]ᵀ [Z | y]`.
//! L and `[Y | Z | y]` are kept for the back-substitution: `n(n+1)/2 + n·width` doubles a stage.
//! The two sweeps and their order of summation are always the same, so results do not depend on the number of threads.

use std::time::{Duration, Instant};

use super::kernel::{self, MAX_STAGE_SIZE, Pivot, Product, STAGE_SIZES, Work, padded, triangle, vectorised};
use super::{LeastSquares, Rows, Step, Transition};

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

/// Sizes of the blocks, with their padding.
#[derive(Debug, Clone, Copy)]
struct Shape {
    /// Unknowns of a stage.
    stage: usize,
    /// The compiled size it runs in.
    padded_stage: usize,
    /// Shared unknowns.
    border: usize,
    /// Shared unknowns and the right-hand side, padded.
    border_width: usize,
    /// `padded_stage + border_width`.
    width: usize,
}

impl Shape {
    fn of(problem: &impl LeastSquares) -> Result<Shape, SolveError> {
        let stage = problem.stage_size();
        let padded_stage =
            STAGE_SIZES.into_iter().find(|&size| size >= stage).ok_or(SolveError::StageTooLarge { stage })?;
        let border_width = padded(problem.border_size() + 1);
        let border = problem.border_size();
        Ok(Shape { stage, padded_stage, border, border_width, width: padded_stage + border_width })
    }
    fn kept(&self) -> usize {
        triangle(self.padded_stage) + self.padded_stage * self.width
    }
}

/// A factorised chain: what the back-substitution needs, and the reduced border system.
#[derive(Debug)]
pub struct Factor {
    shape: Shape,
    /// L and `[Y | Z | y]` of every stage.
    kept: Vec<f64>,
    /// The stage where the two sweeps meet.
    middle: usize,
    /// `border_width²`: the Schur complement, its gradient, and Σ r² − Σ y² in the corner.
    border: Vec<f64>,
    linearise: Duration,
}

impl Factor {
    /// Room for the factor of `problem`; [`factorise`](Self::factorise) fills it, as often as wanted.
    ///
    /// # Errors
    /// [`SolveError::StageTooLarge`].
    pub fn new(problem: &impl LeastSquares) -> Result<Self, SolveError> {
        let shape = Shape::of(problem)?;
        Ok(Factor {
            shape,
            kept: vec![0.0; shape.kept() * problem.stages()],
            middle: problem.stages() / 2,
            border: vec![0.0; shape.border_width * shape.border_width],
            linearise: Duration::ZERO,
        })
    }

    /// Time that the last factorisation spent in the problem's own residuals and derivatives, s: the slower sweep's.
    pub fn linearise_s(&self) -> f64 {
        self.linearise.as_secs_f64()
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
        let (shape, middle) = (self.shape, self.middle);
        let size = shape.kept();
        let (left_kept, rest) = self.kept.split_at_mut(middle * size);
        let (middle_kept, right_kept) = rest.split_at_mut(size);
        let (left, right) = if threads > 1 {
            std::thread::scope(|scope| {
                let left = scope.spawn(|| sweep_right(problem, point, shape, damping, left_kept));
                let right = sweep_left(problem, point, shape, damping, middle, right_kept);
                (left.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)), right)
            })
        } else {
            (
                sweep_right(problem, point, shape, damping, left_kept),
                sweep_left(problem, point, shape, damping, middle, right_kept),
            )
        };
        let (mut sweep, right) = (left?, right?);
        self.linearise = sweep.linearise.max(right.linearise);
        sweep.take_over(&right);
        sweep.rows.clear();
        problem.border_rows(point, &mut sweep.rows);
        vectorised(AddRows { sweep: &mut sweep });
        sweep.rows.clear();
        problem.rows(point, middle, &mut problem.scratch(), &mut sweep.rows);
        vectorised(AddRows { sweep: &mut sweep });
        sweep.coupling.fill(0.0);
        vectorised(Eliminate { sweep: &mut sweep, damping, kept: middle_kept })
            .map_err(|pivot| Singular { stage: middle, pivot })?;
        self.border = sweep.border;
        Ok(())
    }

    /// The reduced system of the border, `(S, g)` row-major m × m and m: the step solves `S δ = −g`. S is the information matrix of
    /// the shared unknowns with all states eliminated.
    pub fn schur(&self) -> (Vec<f64>, Vec<f64>) {
        let (m, width) = (self.shape.border, self.shape.border_width);
        let mut schur = vec![0.0; m * m];
        for i in 0..m {
            for j in 0..m {
                // The two triangles differ by rounding only.
                schur[i * m + j] = 0.5 * (self.border[i * width + j] + self.border[j * width + i]);
            }
        }
        (schur, (0..m).map(|i| self.border[i * width + m]).collect())
    }

    /// Σ r² that would be left if the states alone took their Gauss–Newton step.
    pub fn eliminated_square_sum(&self) -> f64 {
        let (m, width) = (self.shape.border, self.shape.border_width);
        self.border[m * width + m]
    }

    /// The step of all states that goes with the step `border` of the shared unknowns.
    pub fn back_substitute(&self, border: &[f64], threads: usize) -> Step {
        let (shape, size, n) = (self.shape, self.shape.kept(), self.shape.stage);
        let padded = shape.padded_stage;
        // x = −L⁻ᵀ (y + Y x_neighbour + Z p), in place of the neighbour's x.
        let solve = |k: usize, x: &mut Vec<f64>, own: &mut [f64]| {
            let (l, t) = self.kept[k * size..(k + 1) * size].split_at(triangle(padded));
            let mut right = [0.0; MAX_STAGE_SIZE];
            for (right, row) in right.iter_mut().zip(t.chunks_exact(shape.width)) {
                let (coupling, rest) = row.split_at(padded);
                let shared: f64 = rest.iter().zip(border).map(|(z, p)| z * p).sum();
                let chain: f64 = coupling.iter().zip(&*x).map(|(y, x)| y * x).sum();
                *right = -(rest[shape.border] + shared + chain);
            }
            x.copy_from_slice(&right[..padded]);
            kernel::backward(l, x);
            own.copy_from_slice(&x[..n]);
        };
        let mut states = vec![0.0; self.kept.len() / size * n];
        let (left_states, rest) = states.split_at_mut(self.middle * n);
        let (middle_states, right_states) = rest.split_at_mut(n);
        let mut middle = vec![0.0; padded];
        solve(self.middle, &mut middle, middle_states);
        let mut left = || {
            let mut x = middle.clone();
            for (k, own) in left_states.chunks_exact_mut(n).enumerate().rev() {
                solve(k, &mut x, own);
            }
        };
        let mut right = || {
            let mut x = middle.clone();
            for (k, own) in right_states.chunks_exact_mut(n).enumerate() {
                solve(self.middle + 1 + k, &mut x, own);
            }
        };
        if threads > 1 {
            std::thread::scope(|scope| {
                scope.spawn(left);
                right();
            });
        } else {
            left();
            right();
        }
        Step { states, border: border.to_vec() }
    }
}

fn add(a: &mut [f64], b: &[f64]) {
    for (a, b) in a.iter_mut().zip(b) {
        *a += b;
    }
}

/// The moving front of an elimination: the block of the stage that comes next, and everything its reduction needs.
struct Sweep {
    shape: Shape,
    /// `[D | B | g]` of the stage at the front, with what has been eliminated into it.
    block: Vec<f64>,
    /// Diagonal of D before anything was taken off it: what damping multiplies.
    diagonal: Vec<f64>,
    /// This sweep's share of the border.
    border: Vec<f64>,
    /// E: the block that couples the stage at the front (rows) to the one it is eliminated into (columns).
    coupling: Vec<f64>,
    /// `[D | B | g]` of the stage that is eliminated into, and its diagonal.
    next: Vec<f64>,
    next_diagonal: Vec<f64>,
    rows: Rows,
    transition: Transition,
    /// Time spent in the problem's own code.
    linearise: Duration,
}

impl Sweep {
    fn new(shape: Shape) -> Self {
        let (n, width) = (shape.padded_stage, shape.width);
        Sweep {
            shape,
            block: vec![0.0; n * width],
            diagonal: vec![0.0; n],
            border: vec![0.0; shape.border_width * shape.border_width],
            coupling: vec![0.0; n * n],
            next: vec![0.0; n * width],
            next_diagonal: vec![0.0; n],
            rows: Rows::new(shape.stage, n, shape.border, width),
            transition: Transition::new(shape.stage, n, shape.border, width),
            linearise: Duration::ZERO,
        }
    }

    /// Linearises stage k, and the transition from stage `from` where it is linked.
    fn linearise<P: LeastSquares>(
        &mut self,
        problem: &P,
        point: &P::Point,
        scratch: &mut P::Scratch,
        k: usize,
        from: usize,
    ) -> bool {
        let clock = Instant::now();
        self.rows.clear();
        problem.rows(point, k, scratch, &mut self.rows);
        let linked = problem.linked(from);
        if linked {
            problem.transition(point, from, scratch, &mut self.transition);
        }
        self.linearise += clock.elapsed();
        linked
    }

    /// Joins the front of the other sweep, at the stage where the two meet.
    fn take_over(&mut self, other: &Sweep) {
        add(&mut self.block, &other.block);
        add(&mut self.diagonal, &other.diagonal);
        add(&mut self.border, &other.border);
    }

    /// Makes the stage that was eliminated into the one at the front.
    fn advance(&mut self) {
        std::mem::swap(&mut self.block, &mut self.next);
        std::mem::swap(&mut self.diagonal, &mut self.next_diagonal);
        self.next.fill(0.0);
        self.next_diagonal.fill(0.0);
        self.coupling.fill(0.0);
    }

    /// Adds products of whitened rows to the block at the front (or the next one), its diagonal and the border.
    #[inline(always)]
    fn add_product<const FMA: bool>(
        shape: Shape,
        (block, diagonal): (&mut Vec<f64>, &mut Vec<f64>),
        border: &mut [f64],
        source: &[f64],
    ) {
        let (n, width) = (shape.padded_stage, shape.width);
        let product = Product { source, rows: source.len() / width, stride: width, left_at: 0, right_at: 0 };
        kernel::gram::<FMA>(block, width, n, product, 1.0);
        for row in source.chunks_exact(width) {
            for (diagonal, value) in diagonal.iter_mut().zip(&row[..n]) {
                *diagonal += value * value;
            }
        }
        let product = Product { left_at: n, right_at: n, ..product };
        kernel::gram::<FMA>(border, shape.border_width, shape.border_width, product, 1.0);
    }
}

/// Stages 0 … middle−1, each into its successor.
fn sweep_right<P: LeastSquares>(
    problem: &P,
    point: &P::Point,
    shape: Shape,
    damping: f64,
    kept: &mut [f64],
) -> Result<Sweep, Singular> {
    let mut sweep = Sweep::new(shape);
    let mut scratch = problem.scratch();
    for (k, kept) in kept.chunks_exact_mut(shape.kept()).enumerate() {
        let linked = sweep.linearise(problem, point, &mut scratch, k, k);
        vectorised(AddRows { sweep: &mut sweep });
        if linked {
            vectorised(AddTransition { sweep: &mut sweep, front_is_successor: false });
        }
        vectorised(Eliminate { sweep: &mut sweep, damping, kept }).map_err(|pivot| Singular { stage: k, pivot })?;
        sweep.advance();
    }
    Ok(sweep)
}

/// Stages N−1 … middle+1, each into its predecessor.
fn sweep_left<P: LeastSquares>(
    problem: &P,
    point: &P::Point,
    shape: Shape,
    damping: f64,
    middle: usize,
    kept: &mut [f64],
) -> Result<Sweep, Singular> {
    let mut sweep = Sweep::new(shape);
    let mut scratch = problem.scratch();
    for (slot, kept) in kept.chunks_exact_mut(shape.kept()).enumerate().rev() {
        let k = middle + 1 + slot;
        let linked = sweep.linearise(problem, point, &mut scratch, k, k - 1);
        vectorised(AddRows { sweep: &mut sweep });
        if linked {
            vectorised(AddTransition { sweep: &mut sweep, front_is_successor: true });
        }
        vectorised(Eliminate { sweep: &mut sweep, damping, kept }).map_err(|pivot| Singular { stage: k, pivot })?;
        sweep.advance();
    }
    Ok(sweep)
}

/// Adds `Σ rowᵀ row` of the stage's own rows.
struct AddRows<'a> {
    sweep: &'a mut Sweep,
}

impl Work for AddRows<'_> {
    type Output = ();

    #[inline(always)]
    fn run<const FMA: bool>(self) {
        let Sweep { shape, block, diagonal, border, rows, .. } = self.sweep;
        Sweep::add_product::<FMA>(*shape, (block, diagonal), border, rows.values());
    }
}

/// Adds a transition: its source stage sees wΦ, its successor −w. Either may be the one at the front.
struct AddTransition<'a> {
    sweep: &'a mut Sweep,
    front_is_successor: bool,
}

impl Work for AddTransition<'_> {
    type Output = ();

    #[inline(always)]
    fn run<const FMA: bool>(self) {
        let Sweep { shape, block, diagonal, border, coupling, next, next_diagonal, transition, .. } = self.sweep;
        let (n, width) = (shape.padded_stage, shape.width);
        let w = &transition.weight;
        for (row, w) in transition.values.chunks_exact_mut(width).zip(w) {
            for value in row {
                *value *= w;
            }
        }
        let r = &transition.values;
        let (source, successor) = if self.front_is_successor {
            ((next, next_diagonal), (block, diagonal))
        } else {
            ((block, diagonal), (next, next_diagonal))
        };
        Sweep::add_product::<FMA>(*shape, source, border, r);
        let (block, diagonal) = successor;
        for i in 0..n {
            let row = &mut block[i * width..(i + 1) * width];
            row[i] += w[i] * w[i];
            diagonal[i] += w[i] * w[i];
            for (b, r) in row[n..].iter_mut().zip(&r[i * width + n..(i + 1) * width]) {
                *b -= w[i] * r;
            }
        }
        for i in 0..n {
            for j in 0..n {
                // ∂/∂(successor i) ∂/∂(source j) of ½ (wΦ x − w x')²
                let (front, other) = if self.front_is_successor { (i, j) } else { (j, i) };
                coupling[front * n + other] = -w[i] * r[i * width + j];
            }
        }
    }
}

/// Eliminates the stage at the front: keeps L and `[Y | Z | y]`, reduces the next stage and the border.
struct Eliminate<'a> {
    sweep: &'a mut Sweep,
    damping: f64,
    kept: &'a mut [f64],
}

impl Work for Eliminate<'_> {
    type Output = Result<(), Pivot>;

    #[inline(always)]
    fn run<const FMA: bool>(self) -> Result<(), Pivot> {
        let Sweep { shape, block, diagonal, border, coupling, next, .. } = self.sweep;
        let (n, width) = (shape.padded_stage, shape.width);
        for i in 0..n {
            block[i * width + i] += self.damping * diagonal[i];
            if i >= shape.stage {
                block[i * width + i] = 1.0;
            }
        }
        let (l, t) = self.kept.split_at_mut(triangle(n));
        for i in 0..n {
            let row = &mut t[i * width..(i + 1) * width];
            row[..n].copy_from_slice(&coupling[i * n..(i + 1) * n]);
            row[n..].copy_from_slice(&block[i * width + n..(i + 1) * width]);
        }
        kernel::factor_and_solve::<FMA>(n, block, width, l, t)?;
        let product = Product { source: t, rows: n, stride: width, left_at: n, right_at: n };
        kernel::gram::<FMA>(border, shape.border_width, shape.border_width, product, -1.0);
        let product = Product { left_at: 0, right_at: 0, ..product };
        kernel::gram::<FMA>(next, width, n, product, -1.0);
        Ok(())
    }
}
