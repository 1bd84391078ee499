//! The moving front of an elimination: linearise a batch of stages, add them up, eliminate them one into the next.

use super::LeastSquares;
use super::error::Singular;
use super::kernel::{self, Add, Change, Pivot, Rows, Set, Subtract, Sums};
use super::shape::{BATCH, Columns};
use super::stage::{Panel, Stage};
use super::store::StoreMut;
use super::walk::{Batch, Direction, Front, Steps, walk};
use crate::simd::{LANES, Quad, Simd, Work, vectorised};

/// Sums over the rows of a stage: its block `[D | E | B]`, and its gradient.
///
/// Of D the groups on and above the diagonal are meant, and of its diagonal blocks the upper triangle: whatever is below is nobody's. E is set where the
/// stage's transition is added, or where it has none; D and B of the stage that comes next are set there, too.
#[derive(Debug, Clone)]
struct Block {
    /// `[D | E | B]` by groups of the stage's padded size.
    values: Vec<Quad>,
    /// Σ ∂r/∂x r, of the padded size.
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

/// The block of the stage at the front, of the one that comes next, and everything their elimination needs.
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
        let mut front =
            Block { values: vec![Quad::default(); n * columns.front()], right: vec![0.0; n], diagonal: vec![0.0; n] };
        let mut next = front.clone();
        if cfg!(test) {
            // What should be set before it is read.
            let unset = Quad([f64::NAN; LANES]);
            next.values.fill(unset);
            front.values[n * columns.stage_groups..2 * n * columns.stage_groups].fill(unset);
        }
        let width = columns.border_groups * LANES;
        Sweep {
            columns,
            front,
            next,
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
        let mut sums = Sums { gap: states..into_border, ..Sums::of(&mut block.values, columns.padded_stage) };
        kernel::upper::<S, Add>(simd, rows, 0..states, groups, &mut sums);
        let mut sums = border_sums(columns, border, panel.border.start);
        kernel::upper::<S, Add>(simd, rows, states..groups, groups, &mut sums);
        Self::add_residuals(simd, panel, &mut block.right, border);
    }

    /// Adds `Σ rowᵀ r` of a panel to a stage's gradient and to the border's.
    #[inline(always)]
    pub(super) fn add_residuals<S: Simd>(simd: S, panel: &Panel, right: &mut [f64], border: &mut Reduced) {
        let residuals = &panel.residuals[..panel.rows];
        let (states, shared) = panel.values.split_at(panel.stage_groups * panel.capacity);
        let right = &mut right.as_chunks_mut().0[..panel.stage_groups];
        kernel::change_weighted::<S, _, Add>(simd, states, panel.capacity, residuals, right);
        let gradient = &mut border.gradient.as_chunks_mut().0[panel.border.clone()];
        kernel::change_weighted::<S, _, Add>(simd, shared, panel.capacity, residuals, gradient);
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

    /// Starts the next stage with the transition of `slot`, and adds it to the stage at the front: the source sees wΦ, the successor −w.
    #[inline(always)]
    fn add_transition<S: Simd>(&mut self, simd: S, slot: usize, at_front: Front) {
        let Sweep { columns, front, next, border, batch, .. } = self;
        let stage = &batch.stages[slot];
        let (n, own) = (columns.padded_stage, columns.stage_groups);
        next.right.fill(0.0);
        next.diagonal.fill(0.0);
        if !stage.linked {
            next.values[..n * own].fill(Quad::default());
            next.values[2 * n * own..].fill(Quad::default());
            front.values[n * own..2 * n * own].fill(Quad::default());
            return;
        }
        // The groups of the border that no transition touches.
        next.values[n * (2 * own + columns.leading_groups)..].fill(Quad::default());
        let (source, successor) = match at_front {
            Front::Source => {
                Self::change_source::<S, Add>(columns, simd, stage, &mut front.values);
                next.values[..n * own].fill(Quad::default());
                Self::change_successor::<S, Set>(columns, simd, stage, &mut next.values);
                (&mut *front, &mut *next)
            }
            Front::Successor => {
                Self::change_source::<S, Set>(columns, simd, stage, &mut next.values);
                Self::change_successor::<S, Add>(columns, simd, stage, &mut front.values);
                (&mut *next, &mut *front)
            }
        };
        let panel = &stage.transition;
        let rows = Rows { values: &panel.values, capacity: n, count: n };
        let all = panel.groups();
        let mut sums = border_sums(columns, border, 0);
        kernel::upper::<S, Add>(simd, rows, own..all, all, &mut sums);
        Self::add_residuals(simd, panel, &mut source.right, border);
        for (i, right) in successor.right.iter_mut().enumerate() {
            *right -= stage.weight[i / LANES].0[i % LANES] * panel.residuals[i];
        }
        if self.damping > 0.0 {
            Self::add_diagonal(panel, &mut source.diagonal);
            for (i, diagonal) in successor.diagonal.iter_mut().enumerate() {
                *diagonal += stage.weight[i / LANES].0[i % LANES].powi(2);
            }
        }
        Self::set_coupling(columns, simd, stage, at_front, &mut front.values[own * n..2 * own * n]);
    }

    /// What a transition says of its source: `[wΦ]ᵀ [wΦ]` and the border's columns beside it.
    #[inline(always)]
    fn change_source<S: Simd, C: Change>(columns: &Columns, simd: S, stage: &Stage, values: &mut [Quad]) {
        let (n, own, panel) = (columns.padded_stage, columns.stage_groups, &stage.transition);
        let rows = Rows { values: &panel.values, capacity: n, count: n };
        let mut sums = Sums { gap: own..2 * own, ..Sums::of(values, n) };
        kernel::upper::<S, C>(simd, rows, 0..own, panel.groups(), &mut sums);
    }

    /// What it says of its successor: w² on the diagonal, −w times the whitened rest of its rows.
    #[inline(always)]
    fn change_successor<S: Simd, C: Change>(columns: &Columns, simd: S, stage: &Stage, values: &mut [Quad]) {
        let (n, own) = (columns.padded_stage, columns.stage_groups);
        for i in 0..n {
            values[i / LANES * n + i].0[i % LANES] += stage.weight[i / LANES].0[i % LANES].powi(2);
        }
        let shared = stage.transition.values[own * n..].chunks_exact(n);
        for (to, from) in values[2 * own * n..].chunks_exact_mut(n).zip(shared) {
            let blocks = to.as_chunks_mut::<LANES>().0.iter_mut().zip(from.as_chunks::<LANES>().0);
            for ((to, from), weight) in blocks.zip(&stage.weight) {
                for r in 0..LANES {
                    let change = simd.mul(simd.splat(-weight.0[r]), simd.load(&from[r].0));
                    to[r].0 = simd.store(C::of(simd, &to[r], change));
                }
            }
        }
    }

    /// E = ∂/∂(front) ∂/∂(next) of ½ (wΦ x − w x')²
    #[inline(always)]
    fn set_coupling<S: Simd>(columns: &Columns, simd: S, stage: &Stage, at_front: Front, coupling: &mut [Quad]) {
        let (n, own) = (columns.padded_stage, columns.stage_groups);
        let (coupling, _) = coupling.as_chunks_mut::<LANES>();
        let (states, _) = stage.transition.values[..own * n].as_chunks::<LANES>();
        for (j, states) in states.chunks_exact(own).enumerate() {
            for (i, (block, weight)) in states.iter().zip(&stage.weight).enumerate() {
                let mut rows = [simd.splat(0.0); LANES];
                match at_front {
                    Front::Successor => {
                        for r in 0..LANES {
                            rows[r] = simd.mul(simd.load(&block[r].0), simd.splat(-weight.0[r]));
                        }
                    }
                    Front::Source => {
                        let weight = simd.sub(rows[0], simd.load(&weight.0));
                        for r in 0..LANES {
                            rows[r] = simd.load(&block[r].0);
                        }
                        rows = simd.transpose(rows);
                        for r in 0..LANES {
                            rows[r] = simd.mul(rows[r], weight);
                        }
                    }
                }
                let to = match at_front {
                    Front::Successor => &mut coupling[j * own + i],
                    Front::Source => &mut coupling[i * own + j],
                };
                for r in 0..LANES {
                    to[r].0 = simd.store(rows[r]);
                }
            }
        }
    }

    /// Eliminates the stage at the front into the next one, which takes its place; keeps U and `[Y | Z y]`.
    #[inline(always)]
    fn eliminate<S: Simd>(&mut self, simd: S, mut kept: StoreMut<'_>) -> Result<(), Pivot> {
        kept.fetch();
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
        let mut sums = Sums { gap: own..shared, ..Sums::of(&mut next.values, n) };
        kernel::upper::<S, Subtract>(simd, rows, own..shared, all, &mut sums);
        let mut sums = border_sums(columns, border, 0);
        kernel::upper::<S, Subtract>(simd, rows, shared..all, all, &mut sums);
        let (by_next, by_border) = front.values[own * n..].split_at(own * n);
        kernel::change_weighted::<S, _, Subtract>(simd, by_next, n, right, next.right.as_chunks_mut().0);
        kernel::change_weighted::<S, _, Subtract>(simd, by_border, n, right, border.gradient.as_chunks_mut().0);
        border.squares -= right.iter().map(|y| y * y).sum::<f64>();
        kept.keep(simd, &front.values, right);
        std::mem::swap(&mut self.front, &mut self.next);
        Ok(())
    }
}

/// The border's matrix from group `first` on.
#[inline(always)]
fn border_sums<'a>(columns: &Columns, border: &'a mut Reduced, first: usize) -> Sums<'a> {
    let rows = columns.border_groups * LANES;
    // Behind the last group there is nothing, and nothing to be summed.
    let at = (first * (rows + LANES)).min(border.values.len());
    Sums::of(&mut border.values[at..], rows)
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
        let kept = kept.part(first * size..(first + BATCH) * size);
        sweep.batch.fill(problem, point, first, &mut scratch);
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
        let count = BATCH.min(stages - first);
        // Stage `first + slot + 1` is eliminated at the turn of `slot`: there is none behind the last one.
        let eliminated = if first + count == stages { count - 1 } else { count };
        let kept = kept.part((first - middle) * size..(first - middle + eliminated) * size);
        sweep.batch.fill(problem, point, first, &mut scratch);
        turn(&mut sweep, kept, Direction::Left { count })
            .map_err(|(slot, pivot)| Singular { stage: first + slot + 1, pivot })?;
    }
    Ok(sweep)
}

/// The border's own rows, then the last stage, into nothing.
pub(super) fn finish(sweep: &mut Sweep, kept: StoreMut<'_>) -> Result<(), Pivot> {
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
