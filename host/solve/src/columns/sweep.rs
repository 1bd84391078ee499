//! The elimination of a factorised chain once more, over the extra columns alone.

use super::super::LeastSquares;
use super::super::factor::{Factor, StageFactor};
use super::super::kernel::{self, Add, Change, Rows, Subtract, Sums, groups};
use super::super::shape::{BATCH, Columns};
use super::super::stage::Stage;
use super::super::threads::both;
use super::sums::BlockSums;
use super::{Entries, ExtraColumns, Reduced};
use crate::simd::{LANES, Quad, Simd, Work, vectorised};

/// One end's sweep over the columns.
pub(super) struct Sweep {
    columns: Columns,
    extra: usize,
    /// Of each group of the border and the columns, the end of those that it is multiplied with, in groups of all rows.
    ends: Vec<usize>,
    /// G of the stage at the front and of the one that comes next, by groups of `padded_stage` rows.
    front: Vec<Quad>,
    next: Vec<Quad>,
    /// `[Y | Z y | V]` of the stage that is eliminated.
    work: Vec<Quad>,
    factor: StageFactor,
    lower: Vec<f64>,
    /// `[J_β r C]ᵀ [J_β r C] − [Z y V]ᵀ [Z y V]` of the block that the sweep is in, the upper groups: those of the border, then the columns'.
    sums: Vec<Quad>,
    /// V of every stage, if it is kept: `[stage][padded n][4 · extra]`, first stage first.
    pub(super) kept: Option<Vec<Quad>>,
    batch: Vec<Stage>,
    entries: Vec<Entries>,
}

impl Sweep {
    fn new<P: LeastSquares>(columns: Columns, of: &impl ExtraColumns<P>, kept: bool) -> Self {
        let count = of.count();
        let (n, extra) = (columns.padded_stage, groups(count));
        let behind = columns.stage_groups + columns.groups_with_right();
        let last_of = |group: usize| ((group + 1) * LANES).min(count) - 1;
        let of_border = std::iter::repeat_n(behind + extra, columns.groups_with_right());
        Sweep {
            columns,
            extra,
            ends: of_border.chain((0..extra).map(|group| behind + groups(of.reach(last_of(group))))).collect(),
            front: vec![Quad::default(); n * extra],
            next: vec![Quad::default(); n * extra],
            work: vec![Quad::default(); n * (columns.stage_groups + columns.groups_with_right() + extra)],
            factor: StageFactor::default(),
            lower: Vec::new(),
            sums: vec![Quad::default(); (columns.groups_with_right() + extra).pow(2) * LANES],
            kept: kept.then(Vec::new),
            batch: vec![Stage::new(columns); BATCH],
            entries: vec![Entries::new(columns, count); BATCH],
        }
    }

    /// Makes the rows and columns of the stages from `first` on.
    fn fill<P: LeastSquares, E: ExtraColumns<P>>(
        &mut self,
        (problem, point, extra): (&P, &P::Point, &E),
        first: usize,
        scratch: &mut (P::Scratch, E::Scratch),
    ) -> usize {
        let count = BATCH.min(self.columns.shape.stages - first);
        problem.linearise(point, first, &mut scratch.0, &mut self.batch[..count]);
        for (entries, stage) in self.entries.iter_mut().zip(&self.batch[..count]) {
            entries.take(stage);
        }
        extra.fill(point, first, &mut scratch.1, &self.batch[..count], &mut self.entries[..count]);
        count
    }

    /// Adds what the rows of `slot` say of the columns to the front and the border.
    #[inline(always)]
    fn add_rows<S: Simd>(&mut self, simd: S, slot: usize) {
        let Sweep { columns, extra, ends, front, sums, entries, .. } = self;
        let entries = &entries[slot];
        let n = columns.padded_stage;
        if entries.has_direct {
            for (to, from) in front.iter_mut().zip(&entries.direct) {
                to.0 = simd.store(simd.add(simd.load(&to.0), simd.load(&from.0)));
            }
        }
        let rows = Rows { values: &entries.values, capacity: entries.capacity, count: entries.first[4] };
        let (own, behind) = (columns.stage_groups, columns.stage_groups + columns.groups_with_right());
        let mut to = Sums::of(front, n);
        kernel::product::<S, Add>(simd, rows, 0..own, behind..behind + *extra, &mut to);
        Self::add_sums::<S, Add>(columns, simd, rows, sums, ends);
    }

    /// Sums ± `[border C]ᵀ [border C]` of rows `[stage | border | C]`, the upper groups.
    #[inline(always)]
    fn add_sums<S: Simd, C: Change>(columns: &Columns, simd: S, rows: Rows<'_>, sums: &mut [Quad], ends: &[usize]) {
        let own = columns.stage_groups;
        let width = ends.len();
        kernel::upper_within::<S, C>(simd, rows, own..own + width, ends, &mut Sums::of(sums, width * LANES));
    }

    /// Adds what the transition of `slot` says of its successor, −w times its entries.
    #[inline(always)]
    fn add_successor<S: Simd>(&mut self, simd: S, slot: usize, at_front: bool) {
        let Sweep { columns, front, next, entries, batch, .. } = self;
        let (entries, stage) = (&entries[slot], &batch[slot]);
        if !stage.linked {
            return;
        }
        let (n, behind) = (columns.padded_stage, columns.stage_groups + columns.groups_with_right());
        let block = if at_front { front } else { next };
        for (g, to) in block.chunks_exact_mut(n).enumerate() {
            let from = &entries.values[(behind + g) * entries.capacity + entries.first[3]..];
            for (i, (to, from)) in to.iter_mut().zip(from).enumerate().take(columns.shape.stage) {
                let w = simd.splat(stage.weight[i / LANES].0[i % LANES]);
                to.0 = simd.store(simd.mul_sub_from(w, simd.load(&from.0), simd.load(&to.0)));
            }
        }
    }

    /// Eliminates stage k at the front into `next`, which takes its place.
    #[inline(always)]
    fn eliminate<S: Simd>(&mut self, simd: S, factor: &Factor, k: usize) {
        factor.stage(k, &mut self.factor);
        let Sweep { columns, extra, ends, front, next, work, factor, lower, sums, kept, .. } = self;
        let (n, m, padded) = (columns.shape.stage, columns.shape.border, columns.padded_stage);
        let (own, behind) = (columns.stage_groups, columns.stage_groups + columns.groups_with_right());
        for i in 0..n {
            for (j, y) in factor.y[i * n..(i + 1) * n].iter().enumerate() {
                work[j / LANES * padded + i].0[j % LANES] = *y;
            }
            let border = &mut work[own * padded..];
            for (j, z) in factor.z[i * m..(i + 1) * m].iter().enumerate() {
                border[j / LANES * padded + i].0[j % LANES] = *z;
            }
            let right = columns.shape.border;
            border[right / LANES * padded + i].0[right % LANES] = factor.right[i];
        }
        lower.resize(n * n, 0.0);
        for i in 0..n {
            for j in 0..i {
                lower[i * n + j] = factor.u[j * n + i];
            }
            lower[i * n + i] = 1.0 / factor.u[i * n + i];
        }
        let v = &mut work[behind * padded..];
        v.copy_from_slice(front);
        forward(simd, lower, n, padded, v);
        if let Some(kept) = kept {
            kept.extend_from_slice(v);
        }
        let rows = Rows { values: work, capacity: padded, count: padded };
        let mut to = Sums::of(next, padded);
        kernel::product::<S, Subtract>(simd, rows, 0..own, behind..behind + *extra, &mut to);
        Self::add_sums::<S, Subtract>(columns, simd, rows, sums, ends);
        std::mem::swap(front, next);
        next.fill(Quad::default());
    }

    /// Joins the other end's sweep.
    fn take_over(&mut self, other: &Sweep) {
        let pairs = self.front.iter_mut().zip(&other.front).chain(self.sums.iter_mut().zip(&other.sums));
        for (to, from) in pairs {
            for (to, from) in to.0.iter_mut().zip(from.0) {
                *to += from;
            }
        }
    }

    /// The sums of the block that the sweep is in, of so many extra columns.
    pub(super) fn block(&self, count: usize) -> BlockSums<'_> {
        BlockSums::new(&self.sums, self.columns, self.extra, count)
    }

    pub(super) fn reduced(&self, count: usize) -> Reduced {
        self.block(count).reduced()
    }
}

/// Solves `Uᵀ V = V` in place; `lower` is Uᵀ by rows with the reciprocals of its diagonal.
#[inline(always)]
fn forward<S: Simd>(simd: S, lower: &[f64], n: usize, padded: usize, v: &mut [Quad]) {
    let (fours, others) = v.split_at_mut(v.len() / (4 * padded) * 4 * padded);
    for block in fours.chunks_exact_mut(4 * padded) {
        for i in 0..n {
            let row = &lower[i * n..i * n + i + 1];
            let mut sums = [simd.splat(0.0); 4];
            for (g, sum) in sums.iter_mut().enumerate() {
                *sum = simd.load(&block[g * padded + i].0);
            }
            for (j, l) in row[..i].iter().enumerate() {
                let l = simd.splat(*l);
                for (g, sum) in sums.iter_mut().enumerate() {
                    *sum = simd.mul_sub_from(l, simd.load(&block[g * padded + j].0), *sum);
                }
            }
            let inverse = simd.splat(row[i]);
            for (g, sum) in sums.into_iter().enumerate() {
                block[g * padded + i].0 = simd.store(simd.mul(sum, inverse));
            }
        }
    }
    for block in others.chunks_exact_mut(padded) {
        for i in 0..n {
            let mut sum = simd.load(&block[i].0);
            for (j, l) in lower[i * n..i * n + i].iter().enumerate() {
                sum = simd.mul_sub_from(simd.splat(*l), simd.load(&block[j].0), sum);
            }
            block[i].0 = simd.store(simd.mul(sum, simd.splat(lower[i * n + i])));
        }
    }
}

/// What happens to the sums of a block when the sweep leaves it.
pub(super) trait Leave {
    /// The sweep leaves the block of this stage behind.
    fn leave(&mut self, stage: usize, sums: &BlockSums<'_>);

    /// Whether a block begins with this stage. It lies behind a break of the chain.
    fn begins(&self, stage: usize) -> bool;
}

/// One block that holds the whole chain.
pub(super) struct Whole;

impl Leave for Whole {
    fn leave(&mut self, _: usize, _: &BlockSums<'_>) {}

    fn begins(&self, _: usize) -> bool {
        false
    }
}

/// The stages of a batch, away from the end where the sweep began.
struct Batch<'a, L> {
    sweep: &'a mut Sweep,
    factor: &'a Factor,
    leave: &'a mut L,
    first: usize,
    count: usize,
    /// Extra columns.
    extra: usize,
    rightwards: bool,
}

impl<L: Leave> Batch<'_, L> {
    /// Hands out the sums of the block that holds `stage`, and begins another one.
    fn leave(&mut self, stage: usize) {
        self.leave.leave(stage, &self.sweep.block(self.extra));
        self.sweep.sums.fill(Quad::default());
    }
}

impl<L: Leave> Work for Batch<'_, L> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(mut self, simd: S) {
        if self.rightwards {
            // In order, each into its successor.
            for slot in 0..self.count {
                let stage = self.first + slot;
                self.sweep.add_rows(simd, slot);
                self.sweep.add_successor(simd, slot, false);
                self.sweep.eliminate(simd, self.factor, stage);
                if self.leave.begins(stage + 1) {
                    self.leave(stage);
                }
            }
            return;
        }
        // From the last one on: each takes in its successor, then its own rows.
        for slot in (0..self.count).rev() {
            let successor = self.first + slot + 1;
            if successor < self.sweep.columns.shape.stages {
                self.sweep.add_successor(simd, slot, true);
                self.sweep.eliminate(simd, self.factor, successor);
                if self.leave.begins(successor) {
                    self.leave(successor);
                }
            }
            self.sweep.add_rows(simd, slot);
        }
    }
}

/// The last stage, into nothing.
struct Finish<'a> {
    sweep: &'a mut Sweep,
    factor: &'a Factor,
}

impl Work for Finish<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        self.sweep.eliminate(simd, self.factor, self.factor.middle());
    }
}

/// Both sweeps and the stage in the middle; the left sweep is kept for its V. Each sweep has its own `leaves`; the sums of the block in the middle
/// are those of the right sweep in the end.
pub(super) fn sweep<P: LeastSquares, E: ExtraColumns<P>, L: Leave + Send>(
    given: (&P, &P::Point, &E),
    factor: &Factor,
    threads: usize,
    kept: bool,
    leaves: [&mut L; 2],
) -> (Sweep, Sweep) {
    let (problem, _, extra) = given;
    let (columns, middle, count) = (factor.columns(), factor.middle(), extra.count());
    let new = || (Sweep::new(columns, extra, kept), (problem.scratch(), extra.scratch()));
    let [leave_left, leave_right] = leaves;
    let left = || {
        let (mut sweep, mut scratch) = new();
        for first in (0..middle).step_by(BATCH) {
            let stages = sweep.fill(given, first, &mut scratch);
            let (sweep, leave) = (&mut sweep, &mut *leave_left);
            vectorised(Batch { sweep, factor, leave, first, count: stages, extra: count, rightwards: true });
        }
        sweep
    };
    let right = || {
        let (mut sweep, mut scratch) = new();
        for first in (middle..columns.shape.stages).step_by(BATCH).rev() {
            let stages = sweep.fill(given, first, &mut scratch);
            let (sweep, leave) = (&mut sweep, &mut *leave_right);
            vectorised(Batch { sweep, factor, leave, first, count: stages, extra: count, rightwards: false });
        }
        sweep
    };
    let (left, mut right) = both(threads, left, right);
    right.take_over(&left);
    vectorised(Finish { sweep: &mut right, factor });
    (left, right)
}
