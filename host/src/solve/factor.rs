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

use super::kernel::{self, LANES, Pivot, Product, Work, padded, triangle, vectorised};
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

/// Block sizes that are compiled; a stage of n unknowns runs in the next larger one.
const STAGE_SIZES: [usize; 9] = [4, 8, 12, 16, 20, 24, 28, 32, 36];

/// The largest stage that can be solved.
pub const MAX_STAGE_SIZE: usize = STAGE_SIZES[STAGE_SIZES.len() - 1];

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
}

/// What one sweep hands to the middle stage: its block `[D | B | g]`, the undamped diagonal of D, and its share of the border.
struct Carry {
    block: Vec<f64>,
    diagonal: Vec<f64>,
    border: Vec<f64>,
}

impl Carry {
    fn new(shape: Shape) -> Self {
        Carry {
            block: vec![0.0; shape.padded_stage * shape.width],
            diagonal: vec![0.0; shape.padded_stage],
            border: vec![0.0; shape.border_width * shape.border_width],
        }
    }
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
        })
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
        macro_rules! dispatch {
            ($($size:literal)*) => {
                match self.shape.padded_stage {
                    $($size => self.factorise_sized::<P, $size>(problem, point, damping, threads),)*
                    other => unreachable!("stage size {other} is not among STAGE_SIZES"),
                }
            };
        }
        dispatch!(4 8 12 16 20 24 28 32 36)
    }

    fn factorise_sized<P: LeastSquares, const N: usize>(
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
        let sweep = |kept, leftward| Sweep::<P, N> { problem, point, damping, shape, middle, kept, leftward };
        let (left, right) = (sweep(left_kept, false), sweep(right_kept, true));
        let (left, right) = if threads > 1 {
            std::thread::scope(|scope| {
                let left = scope.spawn(|| vectorised(left));
                let right = vectorised(right);
                (left.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)), right)
            })
        } else {
            (vectorised(left), vectorised(right))
        };
        let (mut carry, right) = (left?, right?);
        add(&mut carry.block, &right.block);
        add(&mut carry.diagonal, &right.diagonal);
        add(&mut carry.border, &right.border);
        let mut rows = Rows::new(shape.stage, N, shape.border, shape.width);
        problem.border_rows(point, &mut rows);
        add_border_rows(&mut carry.border, &rows, shape);
        rows.clear();
        problem.rows(point, middle, &mut problem.scratch(), &mut rows);
        add_rows::<N, false>(&mut carry, &rows, shape);
        let uncoupled = [[0.0; N]; N];
        eliminate::<N, false>(&mut carry, &uncoupled, shape, damping, middle_kept)
            .map_err(|pivot| Singular { stage: middle, pivot })?;
        self.border = carry.border;
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
        macro_rules! dispatch {
            ($($size:literal)*) => {
                match self.shape.padded_stage {
                    $($size => self.back_substitute_sized::<$size>(border, threads),)*
                    other => unreachable!("stage size {other} is not among STAGE_SIZES"),
                }
            };
        }
        dispatch!(4 8 12 16 20 24 28 32 36)
    }

    fn back_substitute_sized<const N: usize>(&self, border: &[f64], threads: usize) -> Step {
        let (shape, size, n) = (self.shape, self.shape.kept(), self.shape.stage);
        let stage = |k: usize, neighbour: &[f64; N]| -> [f64; N] {
            let kept = &self.kept[k * size..(k + 1) * size];
            let (l, t) = kept.split_at(triangle(N));
            let mut x = [0.0; N];
            for i in 0..N {
                let row = &t[i * shape.width..(i + 1) * shape.width];
                let (coupling, rest) = row.split_at(N);
                let shared: f64 = rest[..shape.border].iter().zip(border).map(|(z, p)| z * p).sum();
                let chain: f64 = coupling.iter().zip(neighbour).map(|(y, x)| y * x).sum();
                x[i] = -(rest[shape.border] + shared + chain);
            }
            kernel::backward::<N>(l, &mut x);
            x
        };
        let mut states = vec![0.0; self.kept.len() / size * n];
        let (left_states, rest) = states.split_at_mut(self.middle * n);
        let (middle_states, right_states) = rest.split_at_mut(n);
        let middle = stage(self.middle, &[0.0; N]);
        middle_states.copy_from_slice(&middle[..n]);
        let mut left = || {
            let mut x = middle;
            for (k, state) in left_states.chunks_exact_mut(n).enumerate().rev() {
                x = stage(k, &x);
                state.copy_from_slice(&x[..n]);
            }
        };
        let mut right = || {
            let mut x = middle;
            for (k, state) in right_states.chunks_exact_mut(n).enumerate() {
                x = stage(self.middle + 1 + k, &x);
                state.copy_from_slice(&x[..n]);
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

/// Adds `Σ rowᵀ row` to the stage's block and the border.
#[inline(always)]
fn add_rows<const N: usize, const FMA: bool>(carry: &mut Carry, rows: &Rows, shape: Shape) {
    let product = Product { source: rows.values(), rows: rows.count(), stride: shape.width, left_at: 0, right_at: 0 };
    add_product::<N, FMA>(carry, product, shape);
}

/// Adds a product of whitened rows to the stage's block, its undamped diagonal and the border.
#[inline(always)]
fn add_product<const N: usize, const FMA: bool>(carry: &mut Carry, product: Product<'_>, shape: Shape) {
    kernel::gram::<FMA>(&mut carry.block, shape.width, N, product, 1.0);
    for row in product.source.chunks_exact(product.stride).take(product.rows) {
        for i in 0..N {
            carry.diagonal[i] += row[i] * row[i];
        }
    }
    let product = Product { left_at: N, right_at: N, ..product };
    kernel::gram::<FMA>(&mut carry.border, shape.border_width, shape.border_width, product, 1.0);
}

/// Adds the border's own rows to the border.
fn add_border_rows(border: &mut [f64], rows: &Rows, shape: Shape) {
    let at = shape.padded_stage;
    let product = Product { source: rows.values(), rows: rows.count(), stride: shape.width, left_at: at, right_at: at };
    kernel::gram::<false>(border, shape.border_width, shape.border_width, product, 1.0);
}

/// Eliminates the stage whose block is `carry` and whose coupling to its neighbour is given: keeps L and `[Y | Z | y]`, reduces the border.
#[inline(always)]
fn eliminate<const N: usize, const FMA: bool>(
    carry: &mut Carry,
    coupling: &[[f64; N]; N],
    shape: Shape,
    damping: f64,
    kept: &mut [f64],
) -> Result<(), Pivot> {
    let width = shape.width;
    for i in 0..N {
        carry.block[i * width + i] += damping * carry.diagonal[i];
        if i >= shape.stage {
            carry.block[i * width + i] = 1.0;
        }
    }
    let (l, t) = kept.split_at_mut(triangle(N));
    kernel::cholesky::<N, FMA>(&carry.block, width, l)?;
    for i in 0..N {
        let row = &mut t[i * width..(i + 1) * width];
        row[..N].copy_from_slice(&coupling[i]);
        row[N..].copy_from_slice(&carry.block[i * width + N..(i + 1) * width]);
    }
    kernel::forward::<N, FMA>(l, t, width);
    let product = Product { source: t, rows: N, stride: width, left_at: N, right_at: N };
    kernel::gram::<FMA>(&mut carry.border, shape.border_width, shape.border_width, product, -1.0);
    Ok(())
}

/// One sweep over one half of the chain.
struct Sweep<'a, P: LeastSquares, const N: usize> {
    problem: &'a P,
    point: &'a P::Point,
    damping: f64,
    shape: Shape,
    middle: usize,
    kept: &'a mut [f64],
    /// False: stages 0 … middle−1, each into its successor. True: stages N−1 … middle+1, each into its predecessor.
    leftward: bool,
}

impl<P: LeastSquares, const N: usize> Work for Sweep<'_, P, N> {
    type Output = Result<Carry, Singular>;

    #[inline(always)]
    fn run<const FMA: bool>(self) -> Result<Carry, Singular> {
        let Sweep { problem, point, damping, shape, middle, kept, leftward } = self;
        let width = shape.width;
        debug_assert_eq!(width % LANES, 0);
        let mut rows = Rows::new(shape.stage, N, shape.border, width);
        let mut transition = Transition::new(shape.stage, N, shape.border, width);
        let mut carry = Carry::new(shape);
        let mut scratch = problem.scratch();
        let mut coupling = [[0.0; N]; N];
        let mut next = vec![0.0; N * width];
        let mut next_diagonal = [0.0; N];
        let count = kept.len() / shape.kept();
        for step in 0..count {
            let k = if leftward { middle + count - step } else { step };
            rows.clear();
            problem.rows(point, k, &mut scratch, &mut rows);
            add_rows::<N, FMA>(&mut carry, &rows, shape);
            let from = if leftward { k - 1 } else { k };
            next.fill(0.0);
            next_diagonal.fill(0.0);
            for row in coupling.iter_mut() {
                row.fill(0.0);
            }
            if problem.linked(from) {
                problem.transition(point, from, &mut scratch, &mut transition);
                let w = &transition.weight;
                for (row, w) in transition.values.chunks_exact_mut(width).zip(w) {
                    for value in row {
                        *value *= w;
                    }
                }
                let r = &transition.values;
                let product = Product { source: r, rows: N, stride: width, left_at: 0, right_at: 0 };
                // Stage `from` sees wΦ, its successor −w: either may be the one that is eliminated now.
                let successor = |block: &mut [f64], diagonal: &mut [f64]| {
                    for i in 0..N {
                        let row = &mut block[i * width..(i + 1) * width];
                        row[i] += w[i] * w[i];
                        diagonal[i] += w[i] * w[i];
                        for (b, r) in row[N..].iter_mut().zip(&r[i * width + N..(i + 1) * width]) {
                            *b -= w[i] * r;
                        }
                    }
                };
                if leftward {
                    successor(&mut carry.block, &mut carry.diagonal);
                    for i in 0..N {
                        for j in 0..N {
                            coupling[i][j] = -w[i] * r[i * width + j];
                        }
                    }
                    kernel::gram::<FMA>(&mut next, width, N, product, 1.0);
                    for i in 0..N {
                        next_diagonal[i] = (0..N).map(|j| r[j * width + i] * r[j * width + i]).sum();
                    }
                    let border = Product { left_at: N, right_at: N, ..product };
                    kernel::gram::<FMA>(&mut carry.border, shape.border_width, shape.border_width, border, 1.0);
                } else {
                    successor(&mut next, &mut next_diagonal);
                    for i in 0..N {
                        for j in 0..N {
                            coupling[i][j] = -w[j] * r[j * width + i];
                        }
                    }
                    add_product::<N, FMA>(&mut carry, product, shape);
                }
            }
            let slot = if leftward { k - middle - 1 } else { k };
            let kept = &mut kept[slot * shape.kept()..(slot + 1) * shape.kept()];
            eliminate::<N, FMA>(&mut carry, &coupling, shape, damping, kept)
                .map_err(|pivot| Singular { stage: k, pivot })?;
            let t = &kept[triangle(N)..];
            let product = Product { source: t, rows: N, stride: width, left_at: 0, right_at: 0 };
            kernel::gram::<FMA>(&mut next, width, N, product, -1.0);
            std::mem::swap(&mut carry.block, &mut next);
            carry.diagonal.copy_from_slice(&next_diagonal);
        }
        Ok(carry)
    }
}
