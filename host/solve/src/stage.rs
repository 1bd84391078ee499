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

    /// Multiplies all rows by `weight`, those of the transition too.
    pub fn weigh(&mut self, weight: f64) {
        for unit in &mut self.units {
            unit.slope *= weight;
            unit.residual *= weight;
        }
        for panel in [&mut self.sensors, &mut self.others, &mut self.transition] {
            panel.values.iter_mut().flat_map(|quad| &mut quad.0).for_each(|value| *value *= weight);
            panel.residuals.iter_mut().for_each(|residual| *residual *= weight);
        }
        self.weight.iter_mut().flat_map(|quad| &mut quad.0).for_each(|value| *value *= weight);
    }

    /// Breaks the chain behind this stage.
    pub fn unlink(&mut self) {
        self.linked = false;
    }

    /// An empty stage of a problem of this shape.
    pub fn empty(shape: Shape) -> Self {
        Stage::new(Columns::of(shape).unwrap())
    }

    /// Sets the transitions of a whole batch, whitened. Lane l of the quads belongs to `batch[l]`: `slopes` is ∂φ/∂x and ∂φ/∂p of the leading shared
    /// unknowns, n rows of n + leading; `defect` is φ − x[k+1], n; `weight` is 1/σ, n. Stages that are not `linked` get none.
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
        let (n, padded) = (columns.shape.stage, columns.padded_stage);
        debug_assert_eq!((slopes.len(), defect.len(), weight.len()), (n * (n + columns.shape.leading), n, n));
        for (stage, linked) in batch.iter_mut().zip(linked) {
            stage.linked = linked;
            for (to, from) in stage.weight.iter_mut().zip(weight.chunks(LANES)) {
                to.0[..from.len()].copy_from_slice(from);
            }
        }
        let width = n + columns.shape.leading;
        for (first, defect) in (0..n).step_by(LANES).zip(defect.chunks(LANES)) {
            let mut block = [simd.splat(0.0); LANES];
            for ((to, from), w) in block.iter_mut().zip(defect).zip(&weight[first..]) {
                *to = simd.mul(simd.load(&from.0), simd.splat(*w));
            }
            for (stage, residuals) in batch.iter_mut().zip(simd.transpose(block)) {
                let to = &mut stage.transition.residuals[first..first + defect.len()];
                to.copy_from_slice(&simd.store(residuals)[..to.len()]);
            }
        }
        // Four columns, each four stages wide, become a group of each stage.
        let groups = columns.stage_groups + columns.leading_groups;
        for group in 0..groups {
            let of = if group < columns.stage_groups {
                group * LANES..n.min((group + 1) * LANES)
            } else {
                let first = n + (group - columns.stage_groups) * LANES;
                first..width.min(first + LANES)
            };
            let rows = slopes.chunks_exact(width).zip(weight);
            let at = group * padded..group * padded + n;
            if let [a, b, c, d] = &mut *batch {
                let (a, b) = (&mut a.transition.values[at.clone()], &mut b.transition.values[at.clone()]);
                let (c, d) = (&mut c.transition.values[at.clone()], &mut d.transition.values[at]);
                for (((((row, w), a), b), c), d) in rows.zip(a).zip(b).zip(c).zip(d) {
                    let [p, q, r, s] = by_stage(simd, &row[of.clone()], *w);
                    (a.0, b.0) = (simd.store(p), simd.store(q));
                    (c.0, d.0) = (simd.store(r), simd.store(s));
                }
            } else {
                for (at, (row, w)) in at.zip(rows) {
                    for (stage, quad) in batch.iter_mut().zip(by_stage(simd, &row[of.clone()], *w)) {
                        stage.transition.values[at].0 = simd.store(quad);
                    }
                }
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

/// Up to four columns, each four stages wide, times w: four columns of each stage.
#[inline(always)]
fn by_stage<S: Simd>(simd: S, columns: &[Quad], w: f64) -> [S::Vector; LANES] {
    let (mut block, w) = ([simd.splat(0.0); LANES], simd.splat(w));
    if let Ok(columns) = <&[Quad; LANES]>::try_from(columns) {
        for j in 0..LANES {
            block[j] = simd.mul(simd.load(&columns[j].0), w);
        }
    } else {
        for (to, from) in block.iter_mut().zip(columns) {
            *to = simd.mul(simd.load(&from.0), w);
        }
    }
    simd.transpose(block)
}
