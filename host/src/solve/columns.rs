//! Extra columns beside the Jacobian of a factorised chain: candidates of a score test, probes of a trace, any right-hand side.
//!
//! With Jacobian [J_x J_β] and extra columns C of the same rows, the elimination that the factor keeps (U, Y, Z y of every stage) is
//! run once more over the columns alone:
//!
//! ```text
//!   G_k = J_xᵀ C of stage k − Yᵀ V of the stages eliminated into it       V_k = U⁻ᵀ G_k
//!   S_βγ = J_βᵀ C − Σ Zᵀ V          S_γγ = Cᵀ C − Σ Vᵀ V          s_γ = Cᵀ r − Σ Vᵀ y
//! ```
//! What is left is the information of the columns with all states eliminated: [`Reduced`]. The problem is linearised once more, so that the
//! columns can be given by rows; a column may touch a stage's unknowns directly as well (`H⁻¹ v`). Both ends inwards on two threads,
//! in the order of the factorisation: results do not depend on the number of threads.

use nalgebra::{DMatrix, DVector};

use super::border::Border;
use super::factor::{Factor, StageFactor};
use super::kernel::{self, Rows, Sums, groups};
use super::problem::{BATCH, Columns, Panel, Stage};
use super::{LeastSquares, RowAt};
use crate::simd::{LANES, Quad, Simd, Work, vectorised};

/// Gives the extra columns, four stages at a time.
pub trait ExtraColumns<P: LeastSquares>: Sync {
    /// Room for intermediate values: one a thread.
    type Scratch;

    /// Makes a scratch space.
    fn scratch(&self) -> Self::Scratch;

    /// Number of columns, q.
    fn count(&self) -> usize;

    /// Adds the entries of the stages from `first` on; `stages` holds their rows as the problem has linearised them at `point`.
    fn fill(
        &self,
        point: &P::Point,
        first: usize,
        scratch: &mut Self::Scratch,
        stages: &[Stage],
        entries: &mut [Entries],
    );
}

/// One stage's rows with the extra columns behind them: `[∂r/∂x | ∂r/∂p, r | C]` by groups of columns.
#[derive(Debug, Clone)]
pub struct Entries {
    columns: Columns,
    /// Groups of the extra columns.
    extra: usize,
    /// Rows before those of each kind: unit, sensor, other, transition, and all of them.
    first: [usize; 5],
    capacity: usize,
    values: Vec<Quad>,
    /// Direct entries of the stage's unknowns, by groups of `padded_stage` rows.
    direct: Vec<Quad>,
    has_direct: bool,
}

impl Entries {
    fn new(columns: Columns, count: usize) -> Self {
        let extra = groups(count);
        Entries {
            columns,
            extra,
            first: [0; 5],
            capacity: 0,
            values: Vec::new(),
            direct: vec![Quad::default(); extra * columns.padded_stage],
            has_direct: false,
        }
    }

    /// Adds to entry `column` of a row, whitened as the row is.
    #[inline(always)]
    pub fn add(&mut self, row: RowAt, column: usize, value: f64) {
        let (kind, index) = row.kind_and_index();
        let row = self.first[kind] + index;
        debug_assert!(row < self.first[kind + 1], "the stage has no such row");
        let group = self.columns.stage_groups + self.columns.border_groups + column / LANES;
        self.values[group * self.capacity + row].0[column % LANES] += value;
    }

    /// Adds to entry `column` of component i of the stage's gradient itself.
    pub fn add_state(&mut self, i: usize, column: usize, value: f64) {
        self.has_direct = true;
        self.direct[column / LANES * self.columns.padded_stage + i].0[column % LANES] += value;
    }

    fn groups(&self) -> usize {
        self.columns.stage_groups + self.columns.border_groups + self.extra
    }

    /// Takes in the rows of `stage`; no extra column has an entry then.
    fn take(&mut self, stage: &Stage) {
        let rows = [
            stage.units.len(),
            stage.sensors.rows,
            stage.others.rows,
            if stage.linked { self.columns.shape.stage } else { 0 },
        ];
        for (kind, rows) in rows.into_iter().enumerate() {
            self.first[kind + 1] = self.first[kind] + rows;
        }
        self.capacity = self.capacity.max(self.first[4]);
        self.values.clear();
        self.values.resize(self.groups() * self.capacity, Quad::default());
        if self.has_direct {
            self.direct.fill(Quad::default());
            self.has_direct = false;
        }
        let (own, right) = (self.columns.stage_groups, self.columns.right());
        for (at, unit) in stage.units.iter().enumerate() {
            self.values[unit.component / LANES * self.capacity + at].0[unit.component % LANES] = unit.slope;
            self.values[(own + right / LANES) * self.capacity + at].0[right % LANES] = unit.residual;
        }
        let panels: [(&Panel, usize); 3] = [(&stage.sensors, 1), (&stage.others, 2), (&stage.transition, 3)];
        for (panel, kind) in panels {
            let rows = self.first[kind + 1] - self.first[kind];
            let states = (0..panel.stage_groups).map(|g| (g, g));
            let border = panel.border.clone().enumerate().map(|(g, to)| (panel.stage_groups + g, own + to));
            for (from, to) in states.chain(border) {
                let to = to * self.capacity + self.first[kind];
                self.values[to..to + rows].copy_from_slice(&panel.values[from * panel.capacity..][..rows]);
            }
        }
    }
}

/// What the columns are once all states are eliminated.
#[derive(Debug, Clone, PartialEq)]
pub struct Reduced {
    /// S_βγ, m × q.
    pub coupling: DMatrix<f64>,
    /// S_γγ, q × q: the information of the columns if the shared unknowns were known.
    pub information: DMatrix<f64>,
    /// s_γ, q: the gradient along the columns with the states at their Gauss–Newton step.
    pub gradient: DVector<f64>,
}

/// What the columns are once the shared unknowns are eliminated too.
#[derive(Debug, Clone, PartialEq)]
pub struct Score {
    /// S_γγ − S_γβ S_ββ⁻¹ S_βγ, q × q.
    pub information: DMatrix<f64>,
    /// s_γ − S_γβ S_ββ⁻¹ g_β, q: half the slope of Σ r² along the columns.
    pub gradient: DVector<f64>,
}

impl Reduced {
    /// Eliminates the shared unknowns, whose reduced gradient is `border_gradient`; directions that `border` holds stay where they are.
    /// `None` where the border is singular.
    pub fn score(&self, border: &Border, border_gradient: &[f64]) -> Option<Score> {
        let by_columns = border.covariance()? * &self.coupling;
        Some(Score {
            information: &self.information - self.coupling.transpose() * &by_columns,
            gradient: &self.gradient - by_columns.transpose() * DVector::from_row_slice(border_gradient),
        })
    }
}

/// One end's sweep over the columns.
struct Sweep {
    columns: Columns,
    extra: usize,
    /// G of the stage at the front and of the one that comes next, by groups of `padded_stage` rows.
    front: Vec<Quad>,
    next: Vec<Quad>,
    /// `[Y | Z y | V]` of the stage that is eliminated.
    work: Vec<Quad>,
    factor: StageFactor,
    lower: Vec<f64>,
    /// `[J_β r C]ᵀ C − [Z y V]ᵀ V`, rows of the border's groups and then of the columns'.
    sums: Vec<Quad>,
    /// V of every stage, if it is kept: `[stage][padded n][4 · extra]`, first stage first.
    kept: Option<Vec<Quad>>,
    batch: Vec<Stage>,
    entries: Vec<Entries>,
}

impl Sweep {
    fn new(columns: Columns, count: usize, kept: bool) -> Self {
        let (n, extra) = (columns.padded_stage, groups(count));
        Sweep {
            columns,
            extra,
            front: vec![Quad::default(); n * extra],
            next: vec![Quad::default(); n * extra],
            work: vec![Quad::default(); n * (columns.stage_groups + columns.border_groups + extra)],
            factor: StageFactor::default(),
            lower: Vec::new(),
            sums: vec![Quad::default(); (columns.border_groups + extra) * LANES * extra],
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
        let Sweep { columns, extra, front, sums, entries, .. } = self;
        let entries = &entries[slot];
        let n = columns.padded_stage;
        if entries.has_direct {
            for (to, from) in front.iter_mut().zip(&entries.direct) {
                to.0 = simd.store(simd.add(simd.load(&to.0), simd.load(&from.0)));
            }
        }
        let rows = Rows { values: &entries.values, capacity: entries.capacity, count: entries.first[4] };
        let (own, behind) = (columns.stage_groups, columns.stage_groups + columns.border_groups);
        let mut to = Sums { values: front, rows: n };
        for i in 0..own {
            kernel::strip::<S, false>(simd, rows, i, behind..behind + *extra, &mut to, (i, 0));
        }
        Self::add_sums::<S, false>(columns, simd, rows, sums, *extra);
    }

    /// Sums ± `[border C]ᵀ C` of rows `[stage | border | C]`; of `Cᵀ C` the upper groups.
    #[inline(always)]
    fn add_sums<S: Simd, const SUBTRACT: bool>(
        columns: &Columns,
        simd: S,
        rows: Rows<'_>,
        sums: &mut [Quad],
        extra: usize,
    ) {
        let (own, behind) = (columns.stage_groups, columns.stage_groups + columns.border_groups);
        let mut to = Sums { values: sums, rows: (columns.border_groups + extra) * LANES };
        for i in own..behind + extra {
            let from = i.max(behind);
            kernel::strip::<S, SUBTRACT>(simd, rows, i, from..behind + extra, &mut to, (i - own, from - behind));
        }
    }

    /// Adds what the transition of `slot` says of its successor, −w times its entries.
    #[inline(always)]
    fn add_successor<S: Simd>(&mut self, simd: S, slot: usize, at_front: bool) {
        let Sweep { columns, front, next, entries, batch, .. } = self;
        let (entries, stage) = (&entries[slot], &batch[slot]);
        if !stage.linked {
            return;
        }
        let (n, behind) = (columns.padded_stage, columns.stage_groups + columns.border_groups);
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
        let Sweep { columns, extra, front, next, work, factor, lower, sums, kept, .. } = self;
        let (n, m, padded) = (columns.shape.stage, columns.shape.border, columns.padded_stage);
        let (own, behind) = (columns.stage_groups, columns.stage_groups + columns.border_groups);
        for i in 0..n {
            for (j, y) in factor.y[i * n..(i + 1) * n].iter().enumerate() {
                work[j / LANES * padded + i].0[j % LANES] = *y;
            }
            let border = &mut work[own * padded..];
            for (j, z) in factor.z[i * m..(i + 1) * m].iter().enumerate() {
                let column = columns.shared(j);
                border[column / LANES * padded + i].0[column % LANES] = *z;
            }
            let right = columns.right();
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
        let mut to = Sums { values: next, rows: padded };
        for i in 0..own {
            kernel::strip::<S, true>(simd, rows, i, behind..behind + *extra, &mut to, (i, 0));
        }
        Self::add_sums::<S, true>(columns, simd, rows, sums, *extra);
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

    fn sum(&self, row: usize, column: usize) -> f64 {
        let rows = (self.columns.border_groups + self.extra) * LANES;
        self.sums[column / LANES * rows + row].0[column % LANES]
    }

    fn reduced(&self, count: usize) -> Reduced {
        let (columns, behind) = (&self.columns, self.columns.border_groups * LANES);
        Reduced {
            coupling: DMatrix::from_fn(columns.shape.border, count, |i, j| self.sum(columns.shared(i), j)),
            information: DMatrix::from_fn(count, count, |i, j| self.sum(behind + i.min(j), i.max(j))),
            gradient: DVector::from_fn(count, |j, _| self.sum(columns.right(), j)),
        }
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

/// The stages of a batch in order, each into its successor.
struct Rightwards<'a> {
    sweep: &'a mut Sweep,
    factor: &'a Factor,
    first: usize,
    count: usize,
}

impl Work for Rightwards<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        for slot in 0..self.count {
            self.sweep.add_rows(simd, slot);
            self.sweep.add_successor(simd, slot, false);
            self.sweep.eliminate(simd, self.factor, self.first + slot);
        }
    }
}

/// The stages of a batch from the last one on: each takes in its successor, then its own rows.
struct Leftwards<'a> {
    sweep: &'a mut Sweep,
    factor: &'a Factor,
    first: usize,
    count: usize,
}

impl Work for Leftwards<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        for slot in (0..self.count).rev() {
            let successor = self.first + slot + 1;
            if successor < self.sweep.columns.shape.stages {
                self.sweep.add_successor(simd, slot, true);
                self.sweep.eliminate(simd, self.factor, successor);
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

/// Both sweeps and the stage in the middle; the left sweep is kept for its V.
fn sweep<P: LeastSquares, E: ExtraColumns<P>>(
    given: (&P, &P::Point, &E),
    factor: &Factor,
    threads: usize,
    kept: bool,
) -> (Sweep, Sweep) {
    let (problem, _, extra) = given;
    let (columns, middle) = (factor.columns(), factor.middle());
    let new = || (Sweep::new(columns, extra.count(), kept), (problem.scratch(), extra.scratch()));
    let left = || {
        let (mut sweep, mut scratch) = new();
        for first in (0..middle).step_by(BATCH) {
            let count = sweep.fill(given, first, &mut scratch);
            vectorised(Rightwards { sweep: &mut sweep, factor, first, count });
        }
        sweep
    };
    let right = || {
        let (mut sweep, mut scratch) = new();
        for first in (middle..columns.shape.stages).step_by(BATCH).rev() {
            let count = sweep.fill(given, first, &mut scratch);
            vectorised(Leftwards { sweep: &mut sweep, factor, first, count });
        }
        sweep
    };
    let (left, mut right) = if threads > 1 {
        std::thread::scope(|scope| {
            let left = scope.spawn(left);
            let right = right();
            (left.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)), right)
        })
    } else {
        (left(), right())
    };
    right.take_over(&left);
    vectorised(Finish { sweep: &mut right, factor });
    (left, right)
}

/// Eliminates the states of `problem` from the extra columns; `factor` is that of the same problem at the same point, without damping.
///
/// The border's own rows have no entries.
pub fn eliminate<P: LeastSquares>(
    problem: &P,
    point: &P::Point,
    factor: &Factor,
    extra: &impl ExtraColumns<P>,
    threads: usize,
) -> Reduced {
    sweep((problem, point, extra), factor, threads, false).1.reduced(extra.count())
}

/// Solutions of `H x = v` for the columns' gradients v = Jᵀ C (and what was added to them directly; the border's part is that of the
/// rows).
#[derive(Debug, Clone, PartialEq)]
pub struct Solutions {
    /// `[stage · n + i]` by columns.
    pub states: DMatrix<f64>,
    /// m × q.
    pub border: DMatrix<f64>,
}

/// Solves with H for every column. Keeps N n q doubles: for few columns. `None` where the border is singular.
pub fn solve<P: LeastSquares>(
    problem: &P,
    point: &P::Point,
    factor: &Factor,
    extra: &impl ExtraColumns<P>,
    border: &Border,
    threads: usize,
) -> Option<Solutions> {
    let (left, right) = sweep((problem, point, extra), factor, threads, true);
    let (columns, middle, count) = (factor.columns(), factor.middle(), extra.count());
    let (n, padded, stages) = (columns.shape.stage, columns.padded_stage, columns.shape.stages);
    let shared = border.covariance()? * right.reduced(count).coupling;
    let mut states = DMatrix::zeros(stages * n, count);
    let size = padded * groups(count);
    let (left, right) = (left.kept.unwrap_or_default(), right.kept.unwrap_or_default());
    let mut stage = StageFactor::default();
    let mut substitute = |k: usize, parent: Option<usize>| {
        // The right sweep went from the last stage inwards and ended with the one in the middle.
        let v = if k < middle { &left[k * size..][..size] } else { &right[(stages - 1 - k) * size..][..size] };
        factor.stage(k, &mut stage);
        let mut x = DMatrix::from_fn(n, count, |i, j| v[j / LANES * padded + i].0[j % LANES]);
        x -= DMatrix::from_row_slice(n, columns.shape.border, &stage.z) * &shared;
        if let Some(parent) = parent {
            x -= DMatrix::from_row_slice(n, n, &stage.y) * states.rows(parent * n, n);
        }
        let u = DMatrix::from_row_slice(n, n, &stage.u);
        let solved = u.solve_upper_triangular_mut(&mut x);
        debug_assert!(solved, "the diagonal of a factor is positive");
        states.rows_mut(k * n, n).copy_from(&x);
    };
    substitute(middle, None);
    (0..middle).rev().for_each(|k| substitute(k, Some(k + 1)));
    (middle + 1..stages).for_each(|k| substitute(k, Some(k - 1)));
    Some(Solutions { states, border: shared })
}
