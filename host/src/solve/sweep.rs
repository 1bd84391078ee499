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
        let rows = Rows { values: panel.values(), stride: panel.stride(), count: panel.rows };
        let states = panel.stage_groups;
        let into_border = 2 * columns.stage_groups + panel.border.start;
        let mut block = Sums { values: block, stride: columns.front() };
        for i in 0..states {
            kernel::strip::<S, false>(simd, rows, i, i..states, &mut block, (i * LANES, i));
            kernel::strip::<S, false>(simd, rows, i, states..rows.stride, &mut block, (i * LANES, into_border));
        }
        let mut border = Sums { values: border, stride: columns.border_groups };
        for i in states..rows.stride {
            let at = i - states + panel.border.start;
            kernel::strip::<S, false>(simd, rows, i, i..rows.stride, &mut border, (at * LANES, at));
        }
    }

    /// Adds the squares of a panel's state columns to the diagonal that damping multiplies.
    fn add_diagonal(panel: &Panel, diagonal: &mut [f64]) {
        for row in panel.values().chunks_exact(panel.stride()) {
            let states = row[..panel.stage_groups].iter().flat_map(|quad| quad.0);
            for (diagonal, value) in diagonal.iter_mut().zip(states) {
                *diagonal += value * value;
            }
        }
    }

    /// Adds the rows of stage `slot` of the batch to the front.
    #[inline(always)]
    fn add_rows<S: Simd>(&mut self, simd: S, slot: usize) {
        let Sweep { columns, front, border, batch, diagonal, .. } = self;
        let stage = &batch[slot];
        let stride = columns.front();
        let right = columns.right();
        for unit in &stage.units {
            let (i, slope) = (unit.component, unit.slope);
            front[i * stride + i / LANES].0[i % LANES] += slope * slope;
            front[i * stride + 2 * columns.stage_groups + right / LANES].0[right % LANES] += slope * unit.residual;
            border[right * columns.border_groups + right / LANES].0[right % LANES] += unit.residual * unit.residual;
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
        let (n, stride) = (columns.padded_stage, columns.front());
        next.fill(Quad::default());
        next_diagonal.fill(0.0);
        if !stage.linked {
            for row in front.chunks_exact_mut(stride) {
                row[columns.stage_groups..2 * columns.stage_groups].fill(Quad::default());
            }
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
        let panel_stride = panel.stride();
        // E = ∂/∂(front) ∂/∂(next) of ½ (wΦ x − w x')²
        for i in 0..columns.stage_groups {
            for j in 0..columns.stage_groups {
                let mut block = [[0.0; LANES]; LANES];
                for (r, row) in block.iter_mut().enumerate() {
                    let source = simd.load(&panel.values[(i * LANES + r) * panel_stride + j].0);
                    *row = simd.store(simd.mul(source, simd.splat(-stage.weight[i].0[r])));
                }
                let (block, i, j) = match at_front {
                    Front::Successor => (block, i, j),
                    Front::Source => (kernel::transposed(block), j, i),
                };
                for (r, row) in block.into_iter().enumerate() {
                    front[(i * LANES + r) * stride + columns.stage_groups + j] = Quad(row);
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
        let stride = columns.front();
        let panel = &stage.transition;
        let panel_stride = panel.stride();
        for i in 0..columns.padded_stage {
            let row = &mut block[i * stride..(i + 1) * stride];
            let source = &panel.values[i * panel_stride..(i + 1) * panel_stride];
            let w = stage.weight[i / LANES].0[i % LANES];
            row[i / LANES].0[i % LANES] += w * w;
            let w = simd.splat(w);
            for (to, from) in row[2 * columns.stage_groups..].iter_mut().zip(&source[columns.stage_groups..]) {
                to.0 = simd.store(simd.mul_sub_from(w, simd.load(&from.0), simd.load(&to.0)));
            }
        }
    }

    /// Eliminates the stage at the front into the next one, which takes its place; keeps U and `[Y | Z y]`.
    #[inline(always)]
    fn eliminate<S: Simd>(&mut self, simd: S, kept: &mut [f64]) -> Result<(), Pivot> {
        let Sweep { columns, front, next, border, diagonal, .. } = self;
        let (n, stride, own) = (columns.padded_stage, columns.front(), columns.stage_groups);
        for i in 0..n {
            let pivot = &mut front[i * stride + i / LANES].0[i % LANES];
            if i >= columns.shape.stage {
                *pivot = 1.0;
            } else if self.damping > 0.0 {
                *pivot += self.damping * diagonal[i];
            }
        }
        kernel::factor(simd, n, front, stride)?;
        let rows = Rows { values: front, stride, count: n };
        let mut sums = Sums { values: next, stride };
        for i in 0..own {
            kernel::strip::<S, true>(simd, rows, own + i, own + i..2 * own, &mut sums, (i * LANES, i));
            kernel::strip::<S, true>(simd, rows, own + i, 2 * own..stride, &mut sums, (i * LANES, 2 * own));
        }
        let mut sums = Sums { values: border, stride: columns.border_groups };
        for i in 0..columns.border_groups {
            kernel::strip::<S, true>(simd, rows, 2 * own + i, 2 * own + i..stride, &mut sums, (i * LANES, i));
        }
        let (triangle, rest) = kept.split_at_mut(kernel::triangle(n));
        kernel::keep_triangle(front, stride, n, triangle);
        let width = columns.kept_columns();
        for i in 0..n {
            let (whole, tail) = rest[i * width..(i + 1) * width].as_chunks_mut::<LANES>();
            let quads = &front[i * stride + own..(i + 1) * stride];
            for (kept, quad) in whole.iter_mut().zip(quads) {
                *kept = quad.0;
            }
            if !tail.is_empty() {
                tail.copy_from_slice(&quads[whole.len()].0[..tail.len()]);
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
