//! The moving front of an elimination: linearise a batch of stages, add them up, eliminate them one into the next.

use std::time::{Duration, Instant};

use super::LeastSquares;
use super::factor::Singular;
use super::kernel::{self, Pivot, Rows, Sums};
use super::problem::{BATCH, Columns, Panel, Stage};
use crate::simd::{LANES, Quad, Simd, Work, vectorised};

/// The block of the stage that comes next, and everything its elimination needs.
pub(super) struct Sweep {
    columns: Columns,
    /// `[D | E | B g]` of the stage at the front: what has been eliminated into it, its coupling, its share of the border.
    front: Vec<Quad>,
    /// The same of the stage that it is eliminated into.
    next: Vec<Quad>,
    /// Diagonals of the two D before anything was taken off them: what damping multiplies. Kept only where there is damping.
    diagonal: Vec<f64>,
    next_diagonal: Vec<f64>,
    damping: f64,
    /// This sweep's share of the border.
    pub(super) border: Vec<Quad>,
    batch: Vec<Stage>,
    /// Time spent in the problem's own code.
    pub(super) linearise: Duration,
}

/// Which of two linked stages is at the front.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Front {
    Source,
    Successor,
}

impl Sweep {
    fn new(columns: Columns, damping: f64) -> Self {
        let size = columns.padded_stage * columns.front();
        Sweep {
            columns,
            front: vec![Quad::default(); size],
            next: vec![Quad::default(); size],
            diagonal: vec![0.0; columns.padded_stage],
            next_diagonal: vec![0.0; columns.padded_stage],
            damping,
            border: vec![Quad::default(); columns.border_groups * LANES * columns.border_groups],
            batch: vec![Stage::new(columns); BATCH],
            linearise: Duration::ZERO,
        }
    }

    fn linearise<P: LeastSquares>(
        &mut self,
        problem: &P,
        point: &P::Point,
        first: usize,
        scratch: &mut P::Scratch,
    ) -> usize {
        let clock = Instant::now();
        let count = BATCH.min(self.columns.shape.stages - first);
        problem.linearise(point, first, scratch, &mut self.batch[..count]);
        self.linearise += clock.elapsed();
        count
    }

    /// Joins the front of the other sweep, at the stage where the two meet.
    pub(super) fn take_over(&mut self, other: &Sweep) {
        let add = |a: &mut [Quad], b: &[Quad]| {
            for (a, b) in a.iter_mut().zip(b) {
                for (a, b) in a.0.iter_mut().zip(b.0) {
                    *a += b;
                }
            }
        };
        add(&mut self.front, &other.front);
        add(&mut self.border, &other.border);
        for (a, b) in self.diagonal.iter_mut().zip(&other.diagonal) {
            *a += b;
        }
    }

    /// An empty stage for the border's own rows.
    pub(super) fn stage_for_border(&mut self) -> &mut Stage {
        self.batch[0].clear();
        &mut self.batch[0]
    }

    /// Adds `Σ rowᵀ row` of a panel to a block `[D | E | B g]` and to the border.
    #[inline(always)]
    fn add_panel<S: Simd>(columns: &Columns, simd: S, panel: &Panel, block: &mut [Quad], border: &mut [Quad]) {
        if panel.rows == 0 {
            return;
        }
        let rows = Rows { values: &panel.values, capacity: panel.capacity, count: panel.rows };
        let (states, groups) = (panel.stage_groups, panel.groups());
        let into_border = 2 * columns.stage_groups + panel.border.start;
        let mut block = Sums { values: block, rows: columns.padded_stage };
        for i in 0..states {
            kernel::strip::<S, false>(simd, rows, i, i..states, &mut block, (i, i));
            kernel::strip::<S, false>(simd, rows, i, states..groups, &mut block, (i, into_border));
        }
        let mut border = Sums { values: border, rows: columns.border_groups * LANES };
        for i in states..groups {
            let at = i - states + panel.border.start;
            kernel::strip::<S, false>(simd, rows, i, i..groups, &mut border, (at, at));
        }
    }

    /// Adds the squares of a panel's state columns to the diagonal that damping multiplies.
    fn add_diagonal(panel: &Panel, diagonal: &mut [f64]) {
        for (i, diagonal) in diagonal.iter_mut().enumerate().take(panel.stage_groups * LANES) {
            let group = &panel.values[i / LANES * panel.capacity..][..panel.rows];
            *diagonal += group.iter().map(|quad| quad.0[i % LANES].powi(2)).sum::<f64>();
        }
    }

    /// Adds the rows of stage `slot` of the batch to the front.
    #[inline(always)]
    fn add_rows<S: Simd>(&mut self, simd: S, slot: usize) {
        let Sweep { columns, front, border, batch, diagonal, .. } = self;
        let stage = &batch[slot];
        let n = columns.padded_stage;
        let (right, right_group) = (columns.right(), 2 * columns.stage_groups + columns.right() / LANES);
        let border_rows = columns.border_groups * LANES;
        for unit in &stage.units {
            let (i, slope) = (unit.component, unit.slope);
            front[i / LANES * n + i].0[i % LANES] += slope * slope;
            front[right_group * n + i].0[right % LANES] += slope * unit.residual;
            border[right / LANES * border_rows + right].0[right % LANES] += unit.residual * unit.residual;
        }
        Self::add_panel(columns, simd, &stage.sensors, front, border);
        Self::add_panel(columns, simd, &stage.others, front, border);
        if self.damping > 0.0 {
            for unit in &stage.units {
                diagonal[unit.component] += unit.slope * unit.slope;
            }
            Self::add_diagonal(&stage.sensors, diagonal);
            Self::add_diagonal(&stage.others, diagonal);
        }
    }

    /// Starts the next stage, and adds the transition of `slot` to it and to the stage at the front: the source sees wΦ, the successor −w.
    #[inline(always)]
    fn add_transition<S: Simd>(&mut self, simd: S, slot: usize, at_front: Front) {
        let Sweep { columns, front, next, border, batch, diagonal, next_diagonal, .. } = self;
        let stage = &batch[slot];
        let n = columns.padded_stage;
        next.fill(Quad::default());
        next_diagonal.fill(0.0);
        if !stage.linked {
            front[n * columns.stage_groups..2 * n * columns.stage_groups].fill(Quad::default());
            return;
        }
        let panel = &stage.transition;
        match at_front {
            Front::Source => {
                Self::add_panel(columns, simd, panel, front, border);
                Self::add_successor(columns, simd, stage, next);
            }
            Front::Successor => {
                Self::add_panel(columns, simd, panel, next, border);
                Self::add_successor(columns, simd, stage, front);
            }
        }
        // E = ∂/∂(front) ∂/∂(next) of ½ (wΦ x − w x')²
        for i in 0..columns.stage_groups {
            for j in 0..columns.stage_groups {
                let mut block = [[0.0; LANES]; LANES];
                for (r, row) in block.iter_mut().enumerate() {
                    let source = simd.load(&panel.values[j * n + i * LANES + r].0);
                    *row = simd.store(simd.mul(source, simd.splat(-stage.weight[i].0[r])));
                }
                let (block, i, j) = match at_front {
                    Front::Successor => (block, i, j),
                    Front::Source => (kernel::transposed(block), j, i),
                };
                for (r, row) in block.into_iter().enumerate() {
                    front[(columns.stage_groups + j) * n + i * LANES + r] = Quad(row);
                }
            }
        }
        if self.damping > 0.0 {
            let (source, successor) = match at_front {
                Front::Source => (diagonal, next_diagonal),
                Front::Successor => (next_diagonal, diagonal),
            };
            Self::add_diagonal(panel, source);
            for i in 0..n {
                successor[i] += stage.weight[i / LANES].0[i % LANES].powi(2);
            }
        }
    }

    /// What a transition adds to its successor: w² on the diagonal, −w times the whitened rest of its rows.
    #[inline(always)]
    fn add_successor<S: Simd>(columns: &Columns, simd: S, stage: &Stage, block: &mut [Quad]) {
        let (n, own) = (columns.padded_stage, columns.stage_groups);
        for i in 0..n {
            let w = stage.weight[i / LANES].0[i % LANES];
            block[i / LANES * n + i].0[i % LANES] += w * w;
        }
        for group in 0..columns.leading_groups {
            let from = &stage.transition.values[(own + group) * n..][..n];
            let to = &mut block[(2 * own + group) * n..][..n];
            for (i, (to, from)) in to.iter_mut().zip(from).enumerate() {
                let w = simd.splat(stage.weight[i / LANES].0[i % LANES]);
                to.0 = simd.store(simd.mul_sub_from(w, simd.load(&from.0), simd.load(&to.0)));
            }
        }
    }

    /// Eliminates the stage at the front into the next one, which takes its place; keeps U and `[Y | Z y]`.
    #[inline(always)]
    fn eliminate<S: Simd>(&mut self, simd: S, kept: &mut [f64]) -> Result<(), Pivot> {
        let Sweep { columns, front, next, border, diagonal, .. } = self;
        let (n, groups, own) = (columns.padded_stage, columns.front(), columns.stage_groups);
        for i in 0..n {
            let pivot = &mut front[i / LANES * n + i].0[i % LANES];
            if i >= columns.shape.stage {
                *pivot = 1.0;
            } else if self.damping > 0.0 {
                *pivot += self.damping * diagonal[i];
            }
        }
        kernel::factor(simd, n, front)?;
        let rows = Rows { values: front, capacity: n, count: n };
        let mut sums = Sums { values: next, rows: n };
        for i in 0..own {
            kernel::strip::<S, true>(simd, rows, own + i, own + i..2 * own, &mut sums, (i, i));
            kernel::strip::<S, true>(simd, rows, own + i, 2 * own..groups, &mut sums, (i, 2 * own));
        }
        let mut sums = Sums { values: border, rows: columns.border_groups * LANES };
        for i in 0..columns.border_groups {
            kernel::strip::<S, true>(simd, rows, 2 * own + i, 2 * own + i..groups, &mut sums, (i, i));
        }
        let (triangle, rest) = kept.split_at_mut(kernel::triangle(n));
        kernel::keep_triangle(front, n, triangle);
        let width = columns.kept_columns();
        for i in 0..n {
            let (whole, tail) = rest[i * width..(i + 1) * width].as_chunks_mut::<LANES>();
            for (g, kept) in whole.iter_mut().enumerate() {
                *kept = front[(own + g) * n + i].0;
            }
            if !tail.is_empty() {
                tail.copy_from_slice(&front[(own + whole.len()) * n + i].0[..tail.len()]);
            }
        }
        std::mem::swap(&mut self.front, &mut self.next);
        std::mem::swap(&mut self.diagonal, &mut self.next_diagonal);
        Ok(())
    }
}

/// Stages 0 … middle−1, each into its successor; `kept` has room for them. `middle` is a multiple of the batch.
pub(super) fn sweep_right<P: LeastSquares>(
    problem: &P,
    point: &P::Point,
    columns: Columns,
    damping: f64,
    kept: &mut [f64],
) -> Result<Sweep, Singular> {
    let mut sweep = Sweep::new(columns, damping);
    let mut scratch = problem.scratch();
    for (batch, kept) in kept.chunks_mut(BATCH * columns.kept()).enumerate() {
        let first = batch * BATCH;
        sweep.linearise(problem, point, first, &mut scratch);
        vectorised(Rightwards { sweep: &mut sweep, kept })
            .map_err(|(slot, pivot)| Singular { stage: first + slot, pivot })?;
    }
    Ok(sweep)
}

/// Stages N−1 … middle+1, each into its predecessor, so that `middle`, a multiple of the batch, is left; `kept` has room for them.
pub(super) fn sweep_left<P: LeastSquares>(
    problem: &P,
    point: &P::Point,
    columns: Columns,
    damping: f64,
    middle: usize,
    kept: &mut [f64],
) -> Result<Sweep, Singular> {
    let mut sweep = Sweep::new(columns, damping);
    let mut scratch = problem.scratch();
    let stages = columns.shape.stages;
    for first in (middle..stages).step_by(BATCH).rev() {
        let count = sweep.linearise(problem, point, first, &mut scratch);
        // Stage `first + slot + 1` is eliminated at the turn of `slot`: there is none behind the last one.
        let eliminated = if first + count == stages { count - 1 } else { count };
        let from = (first - middle) * columns.kept();
        let kept = &mut kept[from..from + eliminated * columns.kept()];
        vectorised(Leftwards { sweep: &mut sweep, count, eliminated, kept })
            .map_err(|(slot, pivot)| Singular { stage: first + slot + 1, pivot })?;
    }
    Ok(sweep)
}

/// All stages of the batch, in order, each into its successor.
struct Rightwards<'a> {
    sweep: &'a mut Sweep,
    kept: &'a mut [f64],
}

impl Work for Rightwards<'_> {
    type Output = Result<(), (usize, Pivot)>;

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> Self::Output {
        for (slot, kept) in self.kept.chunks_exact_mut(self.sweep.columns.kept()).enumerate() {
            self.sweep.add_rows(simd, slot);
            self.sweep.add_transition(simd, slot, Front::Source);
            if let Err(pivot) = self.sweep.eliminate(simd, kept) {
                return Err((slot, pivot));
            }
        }
        Ok(())
    }
}

/// The stages of the batch from the last one on: each takes in its successor, then its own rows.
struct Leftwards<'a> {
    sweep: &'a mut Sweep,
    count: usize,
    /// How many of them have a successor at the front.
    eliminated: usize,
    kept: &'a mut [f64],
}

impl Work for Leftwards<'_> {
    type Output = Result<(), (usize, Pivot)>;

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> Self::Output {
        for slot in self.eliminated..self.count {
            self.sweep.add_rows(simd, slot);
        }
        for (slot, kept) in self.kept.chunks_exact_mut(self.sweep.columns.kept()).enumerate().rev() {
            self.sweep.add_transition(simd, slot, Front::Successor);
            if let Err(pivot) = self.sweep.eliminate(simd, kept) {
                return Err((slot, pivot));
            }
            self.sweep.add_rows(simd, slot);
        }
        Ok(())
    }
}

/// Adds the border's own rows and eliminates the last stage, into nothing.
pub(super) struct Finish<'a> {
    pub sweep: &'a mut Sweep,
    pub kept: &'a mut [f64],
}

impl Work for Finish<'_> {
    type Output = Result<(), Pivot>;

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> Self::Output {
        self.sweep.add_rows(simd, 0);
        self.sweep.batch[0].linked = false;
        self.sweep.add_transition(simd, 0, Front::Source);
        self.sweep.eliminate(simd, self.kept)
    }
}
