//! The moving front of an elimination: linearise a batch of stages, add them up, eliminate them one into the next.

use super::LeastSquares;
use super::error::Singular;
use super::kernel::{self, Pivot, Rows, Sums};
use super::shape::{BATCH, Columns};
use super::stage::Panel;
use super::store::StoreMut;
use super::walk::{Batch, Direction, Front, Steps, walk};
use crate::simd::{LANES, Quad, Simd, Work, vectorised};

/// Sums over rows: a stage's block `[D | E | B]` with its gradient, or the border's with Σ r².
#[derive(Debug, Clone)]
struct Block {
    /// `[D | E | B]` by groups of the stage's padded size.
    values: Vec<Quad>,
    right: Vec<f64>,
    /// The diagonal of D before anything was taken off it: what damping multiplies. Kept only where there is damping.
    diagonal: Vec<f64>,
}

/// The reduced system of the border.
#[derive(Debug, Clone, Default)]
pub(super) struct Reduced {
    /// Its upper groups.
    pub values: Vec<Quad>,
    pub gradient: Vec<f64>,
    /// Σ r² − Σ y².
    pub squares: f64,
}

/// The block of the stage that comes next, and everything its elimination needs.
pub(super) struct Sweep {
    columns: Columns,
    /// The stage at the front: what has been eliminated into it, its coupling, its share of the border.
    front: Block,
    /// The stage that it is eliminated into.
    next: Block,
    damping: f64,
    /// This sweep's share of the border.
    pub(super) border: Reduced,
    pub(super) batch: Batch,
}

impl Sweep {
    fn new(columns: Columns, damping: f64) -> Self {
        let n = columns.padded_stage;
        let block =
            Block { values: vec![Quad::default(); n * columns.front()], right: vec![0.0; n], diagonal: vec![0.0; n] };
        let width = columns.border_groups * LANES;
        Sweep {
            columns,
            front: block.clone(),
            next: block,
            damping,
            border: Reduced {
                values: vec![Quad::default(); width * columns.border_groups],
                gradient: vec![0.0; width],
                squares: 0.0,
            },
            batch: Batch::new(columns),
        }
    }

    /// Joins the front of the other sweep, at the stage where the two meet.
    pub(super) fn take_over(&mut self, other: &Sweep) {
        let blocks = self.front.values.iter_mut().zip(&other.front.values);
        for (a, b) in blocks.chain(self.border.values.iter_mut().zip(&other.border.values)) {
            for (a, b) in a.0.iter_mut().zip(b.0) {
                *a += b;
            }
        }
        let vectors = self.front.right.iter_mut().zip(&other.front.right);
        let diagonals = self.front.diagonal.iter_mut().zip(&other.front.diagonal);
        let gradients = self.border.gradient.iter_mut().zip(&other.border.gradient);
        for (a, b) in vectors.chain(diagonals).chain(gradients) {
            *a += b;
        }
        self.border.squares += other.border.squares;
    }

    /// Adds `Σ rowᵀ row` of a panel to a block and to the border.
    #[inline(always)]
    fn add_panel<S: Simd>(columns: &Columns, simd: S, panel: &Panel, block: &mut Block, border: &mut Reduced) {
        if panel.rows == 0 {
            return;
        }
        let rows = Rows { values: &panel.values, capacity: panel.capacity, count: panel.rows };
        let (states, groups) = (panel.stage_groups, panel.groups());
        let into_border = 2 * columns.stage_groups + panel.border.start;
        let mut sums = Sums { values: &mut block.values, rows: columns.padded_stage };
        for i in 0..states {
            kernel::strip::<S, false>(simd, rows, i, i..states, &mut sums, (i, i));
            kernel::strip::<S, false>(simd, rows, i, states..groups, &mut sums, (i, into_border));
        }
        let mut sums = Sums { values: &mut border.values, rows: columns.border_groups * LANES };
        for i in states..groups {
            let at = i - states + panel.border.start;
            kernel::strip::<S, false>(simd, rows, i, i..groups, &mut sums, (at, at));
        }
        Self::add_residuals(simd, panel, &mut block.right, border);
    }

    /// Adds `Σ rowᵀ r` of a panel to a stage's gradient and to the border's.
    #[inline(always)]
    pub(super) fn add_residuals<S: Simd>(simd: S, panel: &Panel, right: &mut [f64], border: &mut Reduced) {
        let residuals = &panel.residuals[..panel.rows];
        let (right, gradient) = (right.as_chunks_mut().0, border.gradient.as_chunks_mut().0);
        let to = right[..panel.stage_groups].iter_mut().chain(&mut gradient[panel.border.clone()]);
        for (group, to) in panel.values.chunks_exact(panel.capacity).zip(to) {
            kernel::add_weighted::<S, false>(simd, &group[..panel.rows], residuals, to);
        }
        border.squares += residuals.iter().map(|r| r * r).sum::<f64>();
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
        let Sweep { columns, front, border, batch, .. } = self;
        let stage = &batch.stages[slot];
        let n = columns.padded_stage;
        for unit in &stage.units {
            let (i, slope) = (unit.component, unit.slope);
            front.values[i / LANES * n + i].0[i % LANES] += slope * slope;
            front.right[i] += slope * unit.residual;
            border.squares += unit.residual * unit.residual;
        }
        Self::add_panel(columns, simd, &stage.sensors, front, border);
        Self::add_panel(columns, simd, &stage.others, front, border);
        if self.damping > 0.0 {
            for unit in &stage.units {
                front.diagonal[unit.component] += unit.slope * unit.slope;
            }
            Self::add_diagonal(&stage.sensors, &mut front.diagonal);
            Self::add_diagonal(&stage.others, &mut front.diagonal);
        }
    }

    /// Starts the next stage, and adds the transition of `slot` to it and to the stage at the front: the source sees wΦ, the successor −w.
    #[inline(always)]
    fn add_transition<S: Simd>(&mut self, simd: S, slot: usize, at_front: Front) {
        let Sweep { columns, front, next, border, batch, .. } = self;
        let stage = &batch.stages[slot];
        let (n, own) = (columns.padded_stage, columns.stage_groups);
        next.values[..n * own].fill(Quad::default());
        next.values[2 * n * own..].fill(Quad::default());
        next.right.fill(0.0);
        next.diagonal.fill(0.0);
        if !stage.linked {
            front.values[n * own..2 * n * own].fill(Quad::default());
            return;
        }
        let panel = &stage.transition;
        let (source, successor) = match at_front {
            Front::Source => (&mut *front, &mut *next),
            Front::Successor => (&mut *next, &mut *front),
        };
        let rows = Rows { values: &panel.values, capacity: n, count: n };
        let all = panel.groups();
        let mut sums = Sums { values: &mut source.values, rows: n };
        for i in 0..own {
            kernel::strip::<S, false>(simd, rows, i, i..own, &mut sums, (i, i));
            kernel::strip::<S, false>(simd, rows, i, own..all, &mut sums, (i, 2 * own));
        }
        let mut sums = Sums { values: &mut border.values, rows: columns.border_groups * LANES };
        for i in own..all {
            kernel::strip::<S, false>(simd, rows, i, i..all, &mut sums, (i - own, i - own));
        }
        let (states, shared) = panel.values.split_at(own * n);
        Self::add_residuals(simd, panel, &mut source.right, border);
        // The successor: w² on the diagonal, −w times the whitened rest of its rows.
        for i in 0..n {
            let w = stage.weight[i / LANES].0[i % LANES];
            successor.values[i / LANES * n + i].0[i % LANES] += w * w;
            successor.right[i] -= w * panel.residuals[i];
        }
        let blocks = successor.values[2 * own * n..].chunks_exact_mut(n);
        for (to, from) in blocks.zip(shared.chunks_exact(n)) {
            for (i, (to, from)) in to.iter_mut().zip(from).enumerate() {
                let w = simd.splat(stage.weight[i / LANES].0[i % LANES]);
                to.0 = simd.store(simd.mul_sub_from(w, simd.load(&from.0), simd.load(&to.0)));
            }
        }
        if self.damping > 0.0 {
            Self::add_diagonal(panel, &mut source.diagonal);
            for i in 0..n {
                successor.diagonal[i] += stage.weight[i / LANES].0[i % LANES].powi(2);
            }
        }
        // E = ∂/∂(front) ∂/∂(next) of ½ (wΦ x − w x')²
        let coupling = &mut front.values[own * n..];
        for i in 0..own {
            for j in 0..own {
                let mut block = [simd.splat(0.0); LANES];
                for (r, row) in block.iter_mut().enumerate() {
                    let w = simd.splat(-stage.weight[i].0[r]);
                    *row = simd.mul(simd.load(&states[j * n + i * LANES + r].0), w);
                }
                let (block, i, j) = match at_front {
                    Front::Successor => (block, i, j),
                    Front::Source => (simd.transpose(block), j, i),
                };
                for (to, row) in coupling[j * n + i * LANES..].iter_mut().zip(block) {
                    to.0 = simd.store(row);
                }
            }
        }
    }

    /// Eliminates the stage at the front into the next one, which takes its place; keeps U and `[Y | Z y]`.
    #[inline(always)]
    fn eliminate<S: Simd>(&mut self, simd: S, mut kept: StoreMut<'_>) -> Result<(), Pivot> {
        let Sweep { columns, front, next, border, .. } = self;
        let (n, own) = (columns.padded_stage, columns.stage_groups);
        for i in 0..n {
            let pivot = &mut front.values[i / LANES * n + i].0[i % LANES];
            if i >= columns.shape.stage {
                *pivot = 1.0;
            } else if self.damping > 0.0 {
                *pivot += self.damping * front.diagonal[i];
            }
        }
        let right = &mut front.right;
        kernel::factor(simd, &mut front.values, right)?;
        let (shared, all) = (2 * own, columns.front());
        let rows = Rows { values: &front.values, capacity: n, count: n };
        let mut sums = Sums { values: &mut next.values, rows: n };
        for i in own..shared {
            kernel::strip::<S, true>(simd, rows, i, i..shared, &mut sums, (i - own, i - own));
            kernel::strip::<S, true>(simd, rows, i, shared..all, &mut sums, (i - own, shared));
        }
        let mut sums = Sums { values: &mut border.values, rows: columns.border_groups * LANES };
        for i in shared..all {
            kernel::strip::<S, true>(simd, rows, i, i..all, &mut sums, (i - shared, i - shared));
        }
        let to = next.right.as_chunks_mut().0.iter_mut().chain(border.gradient.as_chunks_mut().0);
        for (group, to) in front.values[own * n..].chunks_exact(n).zip(to) {
            kernel::add_weighted::<S, true>(simd, group, right, to);
        }
        border.squares -= right.iter().map(|y| y * y).sum::<f64>();
        kept.keep(&front.values, right);
        std::mem::swap(&mut self.front, &mut self.next);
        Ok(())
    }
}

/// Stages 0 … middle−1, each into its successor; `kept` has room for them. `middle` is a multiple of the batch.
pub(super) fn sweep_right<P: LeastSquares>(
    problem: &P,
    point: &P::Point,
    columns: Columns,
    damping: f64,
    mut kept: StoreMut<'_>,
) -> Result<Sweep, Singular> {
    let mut sweep = Sweep::new(columns, damping);
    let mut scratch = problem.scratch();
    let size = columns.kept();
    for first in (0..kept.groups() / size).step_by(BATCH) {
        sweep.batch.fill(problem, point, first, &mut scratch);
        let kept = kept.part(first * size..(first + BATCH) * size);
        turn(&mut sweep, kept, Direction::Right).map_err(|(slot, pivot)| Singular { stage: first + slot, pivot })?;
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
    mut kept: StoreMut<'_>,
) -> Result<Sweep, Singular> {
    let mut sweep = Sweep::new(columns, damping);
    let mut scratch = problem.scratch();
    let (stages, size) = (columns.shape.stages, columns.kept());
    for first in (middle..stages).step_by(BATCH).rev() {
        let count = sweep.batch.fill(problem, point, first, &mut scratch);
        // Stage `first + slot + 1` is eliminated at the turn of `slot`: there is none behind the last one.
        let eliminated = if first + count == stages { count - 1 } else { count };
        let kept = kept.part((first - middle) * size..(first - middle + eliminated) * size);
        turn(&mut sweep, kept, Direction::Left { count })
            .map_err(|(slot, pivot)| Singular { stage: first + slot + 1, pivot })?;
    }
    Ok(sweep)
}

/// The border's own rows, then the last stage, into nothing.
pub(super) fn finish(sweep: &mut Sweep, kept: StoreMut<'_>) -> Result<(), Pivot> {
    sweep.batch.stages[0].unlink();
    turn(sweep, kept, Direction::Right).map_err(|(_, pivot)| pivot)
}

/// Not generic over the problem, so that it is compiled once.
fn turn(sweep: &mut Sweep, kept: StoreMut<'_>, direction: Direction) -> Result<(), (usize, Pivot)> {
    vectorised(Turn { sweep, kept, direction })
}

/// The stages of a batch, as many as `kept` has room for.
struct Turn<'a> {
    sweep: &'a mut Sweep,
    kept: StoreMut<'a>,
    direction: Direction,
}

impl Work for Turn<'_> {
    type Output = Result<(), (usize, Pivot)>;

    #[inline(always)]
    fn run<S: Simd>(mut self, simd: S) -> Self::Output {
        let eliminated = self.kept.groups() / self.sweep.columns.kept();
        let direction = self.direction;
        walk(simd, &mut self, direction, eliminated)
    }
}

impl Steps for Turn<'_> {
    type Failure = Pivot;

    #[inline(always)]
    fn add_rows<S: Simd>(&mut self, simd: S, slot: usize) {
        self.sweep.add_rows(simd, slot);
    }

    #[inline(always)]
    fn add_transition<S: Simd>(&mut self, simd: S, slot: usize, at_front: Front) {
        self.sweep.add_transition(simd, slot, at_front);
    }

    #[inline(always)]
    fn eliminate<S: Simd>(&mut self, simd: S, slot: usize) -> Result<(), Pivot> {
        let size = self.sweep.columns.kept();
        self.sweep.eliminate(simd, self.kept.part(slot * size..(slot + 1) * size))
    }
}
