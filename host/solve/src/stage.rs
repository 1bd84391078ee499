//! What one stage hands to the solver: whitened residual rows and the transition into the next stage.
//!
//! ```text
//! columns of a row   | ∂r/∂x, n | ∂r/∂p of the leading shared unknowns | ∂r/∂p of the others |   r
//! transition rows     ──────────────────────────────────────────────                             ───
//! sensor rows         ─────                                             ─────────────────────    ───  (x: the first few components)
//! other rows          ───────────────────────────────────────────────────────────────────────    ───
//! ```
//! The leading shared unknowns are those that transitions depend on. The solver multiplies the underlined parts only. The residuals stand
//! apart: as one more column they would cost a whole group of four.

use std::ops::Range;

use super::shape::{BATCH, Columns, Shape};
use crate::simd::{LANES, Quad, Simd};

/// Rows of the same reach: `[x | border]` from the first column that they touch to the last, by groups.
#[derive(Debug, Clone)]
pub(super) struct Panel {
    pub values: Vec<Quad>,
    pub residuals: Vec<f64>,
    pub rows: usize,
    /// Rows that each group has room for.
    pub capacity: usize,
    pub stage_groups: usize,
    /// Groups of the border.
    pub border: Range<usize>,
}

impl Panel {
    fn new(stage_groups: usize, border: Range<usize>, capacity: usize) -> Self {
        let values = vec![Quad::default(); (stage_groups + border.len()) * capacity];
        Panel { values, residuals: vec![0.0; capacity], rows: 0, capacity, stage_groups, border }
    }

    #[inline(always)]
    pub(super) fn groups(&self) -> usize {
        self.stage_groups + self.border.len()
    }

    /// Adds a row, which is not cleared, and gives its index.
    fn add(&mut self) -> usize {
        if self.rows == self.capacity {
            let mut larger = Panel::new(self.stage_groups, self.border.clone(), 2 * self.capacity);
            for (to, from) in larger.values.chunks_mut(larger.capacity).zip(self.values.chunks(self.capacity)) {
                to[..self.rows].copy_from_slice(from);
            }
            larger.residuals[..self.rows].copy_from_slice(&self.residuals);
            larger.rows = self.rows;
            *self = larger;
        }
        self.rows += 1;
        self.rows - 1
    }

    /// Row `at`, cleared, with its residual.
    #[inline(always)]
    fn row(&mut self, at: usize, residual: f64) -> Row<'_> {
        for group in 0..self.groups() {
            self.values[group * self.capacity + at] = Quad::default();
        }
        self.residuals[at] = residual;
        Row {
            border: self.stage_groups * LANES,
            first_shared: self.border.start * LANES,
            capacity: self.capacity,
            at,
            values: &mut self.values,
        }
    }
}

/// The gradient of one residual row.
#[derive(Debug)]
pub struct Row<'a> {
    /// The panel, and which row of it this is.
    values: &'a mut [Quad],
    capacity: usize,
    at: usize,
    /// Where the border's columns begin, and which of them is the first here.
    border: usize,
    first_shared: usize,
}

impl Row<'_> {
    #[inline(always)]
    fn at(&mut self, column: usize) -> &mut f64 {
        &mut self.values[column / LANES * self.capacity + self.at].0[column % LANES]
    }

    /// Adds to ∂r/∂x of component i.
    #[inline(always)]
    pub fn add_state(&mut self, i: usize, slope: f64) {
        *self.at(i) += slope;
    }

    /// Adds to ∂r/∂p of shared unknown j.
    #[inline(always)]
    pub fn add_shared(&mut self, j: usize, slope: f64) {
        *self.at(self.border + j - self.first_shared) += slope;
    }
}

/// A residual that is one state component times a factor, plus a constant.
#[derive(Debug, Clone, Copy)]
pub(super) struct UnitRow {
    pub component: usize,
    pub slope: f64,
    pub residual: f64,
}

/// A row of a stage: the how-manieth of its kind.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum RowAt {
    /// Of [`Stage::unit_row`].
    Unit(usize),
    /// Of [`Stage::sensor_row`].
    Sensor(usize),
    /// Of [`Stage::row`].
    Other(usize),
    /// Component i of the transition.
    Transition(usize),
}

impl RowAt {
    #[inline(always)]
    pub(super) fn kind_and_index(self) -> (usize, usize) {
        match self {
            RowAt::Unit(i) => (0, i),
            RowAt::Sensor(i) => (1, i),
            RowAt::Other(i) => (2, i),
            RowAt::Transition(i) => (3, i),
        }
    }
}

/// Everything that one stage adds: its rows, and the transition into the next one, `r = w ∘ (φ(x[k], p) − x[k+1])`.
#[derive(Debug, Clone)]
pub struct Stage {
    pub(super) columns: Columns,
    pub(super) units: Vec<UnitRow>,
    pub(super) sensors: Panel,
    pub(super) others: Panel,
    /// Whitened: `w [∂φ/∂x | ∂φ/∂p]`, and w (φ − x[k+1]).
    pub(super) transition: Panel,
    /// w = 1/σ of each row of the transition.
    pub(super) weight: Vec<Quad>,
    pub(super) linked: bool,
}

impl Stage {
    pub(super) fn new(columns: Columns) -> Self {
        let mut transition = Panel::new(columns.stage_groups, 0..columns.leading_groups, columns.padded_stage);
        transition.rows = columns.padded_stage;
        Stage {
            columns,
            units: Vec::new(),
            sensors: Panel::new(columns.sensed_groups, columns.sensor_group..columns.border_groups, 8),
            others: Panel::new(columns.stage_groups, 0..columns.border_groups, 8),
            transition,
            weight: vec![Quad::default(); columns.stage_groups],
            linked: false,
        }
    }

    /// Forgets all rows.
    pub fn clear(&mut self) {
        self.units.clear();
        self.sensors.rows = 0;
        self.others.rows = 0;
        self.linked = false;
    }

    /// Adds a row that touches anything; its gradient is zero until it is filled.
    pub fn row(&mut self, residual: f64) -> Row<'_> {
        let at = self.others.add();
        self.others.row(at, residual)
    }

    /// Adds a row that touches only the leading [`Shape::sensed`] components of the state, and no leading shared unknowns.
    pub fn sensor_row(&mut self, residual: f64) -> Row<'_> {
        let at = self.sensors.add();
        self.sensors.row(at, residual)
    }

    /// Adds the row `residual + slope · δx[component]`.
    pub fn unit_row(&mut self, component: usize, slope: f64, residual: f64) {
        self.units.push(UnitRow { component, slope, residual });
    }

    /// Sets row i of the transition: its weight 1/σ, its whitened defect (φᵢ − x[k+1]ᵢ)/σ; its whitened gradient is zero until it is filled.
    /// All n rows of a transition are set, whatever order.
    pub fn transition_row(&mut self, i: usize, weight: f64, residual: f64) -> Row<'_> {
        self.linked = true;
        self.weight[i / LANES].0[i % LANES] = weight;
        self.transition.row(i, residual)
    }

    /// The rows that the stage has, each with its whitened residual: by kind, in the order in which they were added.
    pub fn residuals(&self) -> impl Iterator<Item = (RowAt, f64)> + '_ {
        let transitions = if self.linked { self.columns.shape.stage } else { 0 };
        let units = self.units.iter().enumerate().map(|(i, unit)| (RowAt::Unit(i), unit.residual));
        let sensors = (0..self.sensors.rows).map(move |i| (RowAt::Sensor(i), self.sensors.residuals[i]));
        let others = (0..self.others.rows).map(move |i| (RowAt::Other(i), self.others.residuals[i]));
        let transitions = (0..transitions).map(move |i| (RowAt::Transition(i), self.transition.residuals[i]));
        units.chain(sensors).chain(others).chain(transitions)
    }

    /// Breaks the chain behind this stage.
    pub fn unlink(&mut self) {
        self.linked = false;
    }

    /// An empty stage of a problem of this shape.
    pub fn empty(shape: Shape) -> Self {
        Stage::new(Columns::of(shape).unwrap())
    }

    /// Sets the transitions of a whole batch. Lane l of the quads belongs to stage l: `slopes` is ∂φ/∂x and ∂φ/∂p of the leading shared
    /// unknowns, n rows of n + leading; `defect` is φ − x[k+1]; `weight` is 1/σ. Lanes that are not `linked` are left out.
    #[inline(always)]
    pub fn set_transitions<S: Simd>(
        simd: S,
        batch: &mut [Stage],
        linked: [bool; BATCH],
        weight: &[f64],
        slopes: &[Quad],
        defect: &[Quad],
    ) {
        let Some(first) = batch.first() else { return };
        let columns = first.columns;
        let (n, leading) = (columns.shape.stage, columns.shape.leading);
        for (stage, linked) in batch.iter_mut().zip(linked) {
            stage.linked = linked;
            for (i, w) in weight.iter().enumerate() {
                stage.weight[i / LANES].0[i % LANES] = *w;
            }
        }
        for i in 0..n {
            let (by_state, by_shared) = slopes[i * (n + leading)..(i + 1) * (n + leading)].split_at(n);
            let w = simd.splat(weight[i]);
            let groups = by_state.chunks(LANES).chain(by_shared.chunks(LANES));
            for (group, columns_of_four) in groups.enumerate() {
                // The columns of this group, each four stages wide.
                let mut block = [simd.splat(0.0); LANES];
                for (to, from) in block.iter_mut().zip(columns_of_four) {
                    *to = simd.mul(simd.load(&from.0), w);
                }
                let block = simd.transpose(block);
                for (stage, quad) in batch.iter_mut().zip(block) {
                    stage.transition.values[group * columns.padded_stage + i] = Quad(simd.store(quad));
                }
            }
            let residuals = simd.store(simd.mul(simd.load(&defect[i].0), w));
            for (stage, residual) in batch.iter_mut().zip(residuals) {
                stage.transition.residuals[i] = residual;
            }
        }
    }

    /// The whitened rows that are no transition, dense: `[∂r/∂x | ∂r/∂p | r]`.
    pub fn dense_rows(&self) -> Vec<Vec<f64>> {
        let shape = &self.columns.shape;
        let (n, m) = (shape.stage, shape.border);
        let mut rows = Vec::new();
        for unit in &self.units {
            let mut row = vec![0.0; n + m + 1];
            row[unit.component] = unit.slope;
            row[n + m] = unit.residual;
            rows.push(row);
        }
        for panel in [&self.sensors, &self.others] {
            rows.extend(self.dense(panel));
        }
        rows
    }

    /// The whitened transition, dense: `[∂r/∂x | ∂r/∂p | r]`; empty where there is none.
    pub fn dense_transition(&self) -> Vec<Vec<f64>> {
        if self.linked { self.dense(&self.transition)[..self.columns.shape.stage].to_vec() } else { Vec::new() }
    }

    fn dense(&self, panel: &Panel) -> Vec<Vec<f64>> {
        let shape = &self.columns.shape;
        let (n, m) = (shape.stage, shape.border);
        let dense = |at: usize| {
            let value = |column: usize| panel.values[column / LANES * panel.capacity + at].0[column % LANES];
            let border = |column: usize| {
                let from = panel.border.start * LANES;
                let inside = column >= from && column < panel.border.end * LANES;
                if inside { value(panel.stage_groups * LANES + column - from) } else { 0.0 }
            };
            let state = |i: usize| if i < panel.stage_groups * LANES { value(i) } else { 0.0 };
            let mut row: Vec<f64> = (0..n).map(state).collect();
            row.extend((0..m).map(border));
            row.push(panel.residuals[at]);
            row
        };
        (0..panel.rows).map(dense).collect()
    }
}
