//! Extra columns beside the Jacobian of a factorised chain: candidates of a score test, probes of a trace, any right-hand side.
//!
//! With Jacobian [J_x J_β] and extra columns C of the same rows, the elimination that the factor keeps (U, Y, Z y of every stage) is
//! run once more over the columns alone:
//!
//! ```text
//!   G_k = J_xᵀ C of stage k − Yᵀ V of the stages eliminated into it       V_k = U⁻ᵀ G_k
//!   S_βγ = J_βᵀ C − Σ Zᵀ V          S_γγ = Cᵀ C − Σ Vᵀ V          s_γ = Cᵀ r − Σ Vᵀ y
//! ```
//! What is left is the information of the columns with all states eliminated: [`Reduced`]. Where the chain breaks between blocks of stages the sums
//! of each block stand on their own: [`block_sums`]. The problem is linearised once more, so that the
//! columns can be given by rows; a column may touch a stage's unknowns directly as well (`H⁻¹ v`). Both ends inwards on two threads,
//! in the order of the factorisation: results do not depend on the number of threads.

mod blocks;
mod solution;
mod sums;
mod sweep;

pub use blocks::block_sums;
pub use solution::{Solutions, solve};
pub use sums::BlockSums;

use nalgebra::{DMatrix, DVector};

use super::border::Border;
use super::factor::Factor;
use super::kernel::groups;
use super::shape::Columns;
use super::stage::{Panel, Stage};
use super::{LeastSquares, RowAt};
use crate::simd::{LANES, Quad};

/// Gives the extra columns, four stages at a time.
pub trait ExtraColumns<P: LeastSquares>: Sync {
    /// Room for intermediate values: one a thread.
    type Scratch;

    /// Makes a scratch space.
    fn scratch(&self) -> Self::Scratch;

    /// Number of columns, q.
    fn count(&self) -> usize;

    /// The end of the columns behind `column` whose products with it are wanted; ascending. Others may be left out.
    fn reach(&self, column: usize) -> usize {
        let _ = column;
        self.count()
    }

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
        let group = self.columns.stage_groups + self.columns.groups_with_right() + column / LANES;
        self.values[group * self.capacity + row].0[column % LANES] += value;
    }

    /// Adds to entry `column` of component i of the stage's gradient itself.
    pub fn add_state(&mut self, i: usize, column: usize, value: f64) {
        self.has_direct = true;
        self.direct[column / LANES * self.columns.padded_stage + i].0[column % LANES] += value;
    }

    fn groups(&self) -> usize {
        self.columns.stage_groups + self.columns.groups_with_right() + self.extra
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
        let (own, right) = (self.columns.stage_groups, self.columns.shape.border);
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
            let to = (own + right / LANES) * self.capacity + self.first[kind];
            for (to, residual) in self.values[to..to + rows].iter_mut().zip(&panel.residuals) {
                to.0[right % LANES] = *residual;
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
    let whole = [&mut sweep::Whole, &mut sweep::Whole];
    sweep::sweep((problem, point, extra), factor, threads, false, whole).1.reduced(extra.count())
}
