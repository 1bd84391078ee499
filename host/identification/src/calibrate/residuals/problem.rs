//! The least-squares problem of a calibration, equation (33).
//!
//! ```text
//! stage k            row                                          weight
//! encoder            z − θ(t + offset)                            1/σ of the channel      (20)
//! gyro, default      z − (R ω_body(q, q̇)(instant − lag) + bias)   1/σ of the channel
//! gyro, paper        rows (22), (25)–(26), (32): see `chained`
//! first of a run     q − θ, and at rest q̇, θ̇                      initial noise           (30)
//! k → k+1            x[k+1] = φ(x[k], u[k], z)                    1/process noise         (31)
//! ```

use std::ops::Range;

use super::noise::Noise;
use super::point::{BorderLayout, Point};
use super::preset::{Assumptions, GyroRows};
use super::robot_scale::RobotScale;
use super::row::{Depends, InitialRow, Row};
use super::row_plan::{GyroRow, RowPlan};
use super::stage_quads::StageQuads;
use crate::calibrate::data::series::Series;
use crate::model::fast::Fast;
use crate::model::{Linear, LinksAt, Model, SensorFrame, SensorLaws, StepSlopes, Stepper};
use crate::robot::Robot;
use solve::{LeastSquares, Shape, Stage, Step};

/// A recording (or several) under a model.
pub struct Problem<'m> {
    pub(crate) model: &'m Model,
    pub(crate) series: &'m Series,
    pub(crate) assumptions: Assumptions,
    pub(crate) border: BorderLayout,
    /// Sensors grouped as rows are made.
    pub(crate) rows: RowPlan,
    /// What sizes of parameters follow from.
    pub(crate) scale: RobotScale,
    /// What rows are weighted by.
    pub(crate) noise: Noise,
    /// 1/σ of each state component's step.
    pub(crate) process_weight: Vec<f64>,
    /// What all rows of each stage are multiplied by; empty where that is one.
    pub(crate) stage_weights: Vec<f64>,
    /// Whether a channel is read after the tick's start, so that rows need the accelerations.
    pub(crate) late: bool,
    /// The longest step.
    longest_s: f64,
    /// Whether rows of sensors are made by the generic walk: where they are late, or laws change what they read.
    pub(crate) walks_sensors: bool,
    /// Laws of effects that change what sensors read.
    pub(crate) sensor_laws: SensorLaws,
    /// The kernel that makes four stages at once, where it covers the model.
    pub(crate) fast: Option<Fast>,
}

/// Intermediate values of one thread.
pub struct Scratch {
    pub(crate) stepper: Stepper,
    pub(crate) slopes: StepSlopes,
    pub(crate) linear: Linear,
    pub(crate) frame: SensorFrame,
    pub(crate) next: Vec<f64>,
    /// The state at the instant of a gyro's reading, the dynamics at the stage under the input that is in force there, and halfway between.
    pub(crate) at: Vec<f64>,
    pub(crate) gyro_start: Linear,
    pub(crate) gyro_halfway: Linear,
    pub(crate) halfway: Vec<f64>,
    /// The inputs where they are late, and their derivatives.
    pub(crate) late_input: [Vec<f64>; 2],
    pub(crate) quads: StageQuads,
}

impl<'m> Problem<'m> {
    /// The problem of `series` under `model`.
    pub fn new(model: &'m Model, robot: &Robot, series: &'m Series, assumptions: Assumptions) -> Self {
        let noise = Noise::assumed(robot, model, series, &assumptions);
        let border = BorderLayout {
            dynamics: model.coordinates().len(),
            gyros: robot.gyros().count(),
            recordings: series.recordings.len(),
        };
        let rows = RowPlan::of(series, model, assumptions.gyro_rows);
        let own_instants = assumptions.gyro_rows == GyroRows::RigidBase
            && !rows.gyros.is_empty()
            && (series.has_instants() || model.has_gyro_lags());
        let late = rows.scalars.iter().any(|r| r.offset_s != 0.0)
            || rows.gyros.iter().any(|r| r.offset_s != 0.0)
            || own_instants;
        let sensor_laws = SensorLaws::of(model, border.gyros);
        let walks_sensors =
            late || sensor_laws.see_any() || (0..border.gyros).any(|gyro| model.lagging(gyro).is_some());
        let fast = Fast::of(model);
        let mut problem = Problem {
            model,
            series,
            assumptions,
            border,
            rows,
            scale: RobotScale::of(robot, model),
            noise: noise.clone(),
            process_weight: Vec::new(),
            stage_weights: Vec::new(),
            late,
            longest_s: (0..series.stages()).map(|k| series.duration_s(k)).fold(0.0, f64::max),
            walks_sensors,
            sensor_laws,
            fast,
        };
        problem.set_noise(noise);
        problem
    }

    /// The same problem without the fast kernel.
    #[cfg(test)]
    pub(crate) fn generic(self) -> Self {
        Problem { fast: None, ..self }
    }

    /// Weights all rows by `noise`.
    pub fn set_noise(&mut self, noise: Noise) {
        for row in &mut self.rows.scalars {
            row.weight = 1.0 / noise.channels[row.channel];
        }
        for row in &mut self.rows.gyros {
            row.weight = [0, 1, 2].map(|axis| 1.0 / noise.channels[row.channel + axis]);
        }
        self.process_weight = noise.process.iter().map(|sigma| 1.0 / sigma).collect();
        self.noise = noise;
        debug_assert_eq!(self.process_weight.len(), self.shape().stage);
    }

    /// What its rows are weighted by.
    pub fn noise(&self) -> &Noise {
        &self.noise
    }

    /// Where the shared unknowns stand.
    pub fn border(&self) -> &BorderLayout {
        &self.border
    }

    /// Number of residual rows, for degrees of freedom.
    pub fn row_count(&self, point: &Point<'m>) -> usize {
        self.rows_of(point, 0..self.series.stages())
    }

    /// Number of residual rows of these stages.
    pub(crate) fn rows_of(&self, point: &Point<'m>, stages: Range<usize>) -> usize {
        let mut count = 0;
        for k in stages {
            let measured = self.series.measured(k);
            let finite = |gyro: &GyroRow| (0..3).filter(|axis| measured[gyro.channel + axis].is_finite()).count();
            count += self.rows.scalars.iter().filter(|row| self.reading(k, row).is_finite()).count();
            match (self.assumptions.gyro_rows, self.rows.gyros.split_first()) {
                (GyroRows::Chained, Some((base, others))) => {
                    if finite(base) == 3 {
                        count += 1 + others.iter().map(finite).sum::<usize>();
                    }
                    if self.series.rest[self.series.recording_of(k)].contains(&k) {
                        count += self.rows.gyros.iter().map(finite).sum::<usize>();
                    }
                }
                _ => count += self.rows.gyros.iter().map(finite).sum::<usize>(),
            }
            self.initial_rows(point, k, &mut |_| count += 1);
            if self.linked(k) {
                count += self.model.layout().size();
            }
        }
        count
    }

    /// Calls `row` with the kind (unit, sensor, other: as stages keep them) and the channel of every row of stage k that is no transition.
    pub(crate) fn row_channels(
        &self,
        point: &Point<'m>,
        k: usize,
        scratch: &mut Scratch,
        mut row: impl FnMut(usize, Option<usize>),
    ) {
        self.sensor_rows(point, k, scratch, false, &mut |sensor| row(sensor.kind(), sensor.channel));
        self.initial_rows(point, k, &mut |_| row(2, None));
    }

    /// Calls `row` with every sensor row of stage k: residual, weight and, if asked for, what it depends on.
    pub(crate) fn sensor_rows(
        &self,
        point: &Point<'m>,
        k: usize,
        scratch: &mut Scratch,
        with_slopes: bool,
        row: &mut impl FnMut(Row<'_>),
    ) {
        let x = point.state(k);
        if self.late {
            let Scratch { linear, late_input, .. } = &mut *scratch;
            let input = self.input(point, k, late_input);
            if with_slopes {
                point.dynamics.linearise(x, input, linear);
            } else {
                linear.xdot.resize(x.len(), 0.0);
                point.dynamics.derivative(x, input, &mut linear.xdot);
            }
        }
        for scalar in &self.rows.scalars {
            let value = self.reading(k, scalar);
            if value.is_nan() {
                continue;
            }
            let mut predicted = x[scalar.component];
            if scalar.offset_s != 0.0 {
                predicted += scalar.offset_s * scratch.linear.xdot[scalar.component];
            }
            if let Some(position) = self.law_sees(scalar) {
                self.position_row(point, k, (scalar, position, value), scratch, row);
                continue;
            }
            row(Row {
                channel: Some(scalar.channel),
                residual: predicted - value,
                weight: scalar.weight,
                depends: Depends::Component { component: scalar.component, offset_s: scalar.offset_s },
                linear: &scratch.linear,
            });
        }
        match self.assumptions.gyro_rows {
            GyroRows::RigidBase => self.rigid_base_rows(point, k, scratch, with_slopes, row),
            GyroRows::Chained => self.chained_rows(point, k, scratch, with_slopes, row),
        }
    }

    /// What is known of the first state of a run: (component, reference component or value, 1/σ) → residual and gradient.
    pub(crate) fn initial_rows(&self, point: &Point<'m>, k: usize, row: &mut impl FnMut(InitialRow)) {
        if !self.series.starts_run(k) {
            return;
        }
        let layout = self.model.layout();
        let noise = self.assumptions.initial;
        let x = point.state(k);
        for i in (0..layout.joints()).filter(|&i| layout.is_elastic(i)) {
            let (q, theta) = (layout.q(i), layout.theta(i));
            row(InitialRow {
                residual: (x[q] - x[theta]) / noise.windup,
                gradient: [(q, 1.0 / noise.windup), (theta, -1.0 / noise.windup)],
            });
        }
        let mut about_zero = |component: usize, sigma: f64| {
            row(InitialRow { residual: x[component] / sigma, gradient: [(component, 1.0 / sigma), (component, 0.0)] });
        };
        layout.passive().for_each(|i| about_zero(i, noise.windup));
        // The first of a run has no step that leads to it.
        for (joint, i) in layout.inputs().enumerate() {
            about_zero(i, self.noise.process[i] * self.series.input_spread(k, joint));
        }
        let recording = self.series.recording_of(k);
        let rest = &self.series.rest[recording];
        let at_rest = rest.start == k && rest.len() >= SHORTEST_REST;
        for (i, size) in layout.own().zip(self.model.own_size()) {
            about_zero(i, size * if at_rest { noise.own_at_rest } else { noise.own });
        }
        if at_rest {
            (0..layout.chain()).for_each(|i| about_zero(layout.chain() + i, noise.speed));
            let elastic = (0..layout.joints()).filter(|&i| layout.is_elastic(i));
            elastic.for_each(|i| about_zero(layout.thetad(i), noise.speed));
        }
    }
}

/// A recording that starts with at least this many samples without input is taken to start at rest.
pub(crate) const SHORTEST_REST: usize = 100;

impl<'m> Problem<'m> {
    /// Adds the rows of one stage that are no transition by the generic walk.
    fn linearise_readings(&self, point: &Point<'m>, k: usize, scratch: &mut Scratch, stage: &mut Stage) {
        let (size, joints) = (self.model.layout().size(), self.model.layout().chain());
        self.sensor_rows(point, k, scratch, true, &mut |row| row.push(size, joints, stage));
        self.initial_rows(point, k, &mut |row| row.push(stage));
    }

    /// Fills one stage by the generic walk.
    fn linearise_stage(&self, point: &Point<'m>, k: usize, scratch: &mut Scratch, stage: &mut Stage) {
        let size = self.model.layout().size();
        stage.clear();
        self.linearise_readings(point, k, scratch, stage);
        if !self.linked(k) {
            return;
        }
        let Scratch { stepper, slopes, late_input, .. } = scratch;
        let duration_s = self.series.duration_s(k);
        let input = self.input(point, k, late_input);
        stepper.step_slopes(&point.dynamics, point.state(k), input, duration_s, slopes);
        let columns = point.dynamics.columns();
        let after = point.state(k + 1);
        // Errors of inputs are white.
        let errors = self.model.layout().inputs();
        for (i, &weight) in self.process_weight.iter().enumerate() {
            if errors.contains(&i) {
                let weight = weight / self.series.input_spread(k + 1, i - errors.start);
                stage.transition_row(i, weight, -weight * after[i]);
                continue;
            }
            let mut row = stage.transition_row(i, weight, weight * (slopes.next[i] - after[i]));
            let by = &slopes.slopes[i * columns..(i + 1) * columns];
            for (j, slope) in by[..size].iter().enumerate() {
                row.add_state(j, weight * slope);
            }
            for (j, slope) in by[size..].iter().enumerate() {
                row.add_shared(j, weight * slope);
            }
        }
    }

    /// Σ r² of the rows of stage k that are no transition, by the generic walk.
    fn reading_squares(&self, point: &Point<'m>, k: usize, scratch: &mut Scratch) -> f64 {
        let mut sum = 0.0;
        self.sensor_rows(point, k, scratch, false, &mut |row| sum += (row.weight * row.residual).powi(2));
        self.initial_rows(point, k, &mut |row| sum += row.residual * row.residual);
        sum
    }

    /// Σ r² of stage k by the generic walk.
    fn stage_squares(&self, point: &Point<'m>, k: usize, scratch: &mut Scratch) -> f64 {
        let mut sum = self.reading_squares(point, k, scratch);
        if self.linked(k) {
            let next = self.next(point, k, scratch);
            let after = point.state(k + 1);
            let errors = self.model.layout().inputs();
            for (i, weight) in self.process_weight.iter().enumerate().filter(|(i, _)| !errors.contains(i)) {
                sum += (weight * (next[i] - after[i])).powi(2);
            }
            for (joint, i) in errors.enumerate() {
                sum += (self.process_weight[i] / self.series.input_spread(k + 1, joint) * after[i]).powi(2);
            }
        }
        sum
    }

    /// Where the model carries the state of stage k; errors of inputs stay.
    pub(crate) fn next<'a>(&self, point: &Point<'m>, k: usize, scratch: &'a mut Scratch) -> &'a [f64] {
        let Scratch { stepper, next, late_input, .. } = scratch;
        let input = self.input(point, k, late_input);
        stepper.step(&point.dynamics, point.state(k), input, self.series.duration_s(k), next);
        next
    }

    /// ẋ at a state x within the step from stage k on, where the links are so.
    pub(crate) fn rates(
        &self,
        point: &Point<'m>,
        k: usize,
        (x, links): (&[f64], &LinksAt),
        scratch: &mut Scratch,
        xdot: &mut [f64],
    ) {
        let input = self.input(point, k, &mut scratch.late_input);
        point.dynamics.derivative_with(x, input, links, xdot);
    }

    /// What all rows of stage k are multiplied by.
    pub(crate) fn stage_weight(&self, k: usize) -> f64 {
        self.stage_weights.get(k).copied().unwrap_or(1.0)
    }

    /// The fast kernel, if steps are made in one part: it knows no others.
    fn kernel(&self, point: &Point<'m>) -> Option<&Fast> {
        let is_whole = || self.assumptions.integrator.leaves_whole(&point.dynamics, self.longest_s);
        self.fast.as_ref().filter(|_| is_whole())
    }

    fn unweighted_cost(&self, point: &Point<'m>, stages: Range<usize>, scratch: &mut Scratch) -> f64 {
        if let Some(fast) = self.kernel(point) {
            let by_kernel = self.cost_wide(fast, point, stages.clone(), &mut scratch.quads);
            if !self.walks_sensors {
                return by_kernel;
            }
            return by_kernel + 0.5 * stages.map(|k| self.reading_squares(point, k, scratch)).sum::<f64>();
        }
        0.5 * stages.map(|k| self.stage_squares(point, k, scratch)).sum::<f64>()
    }

    /// Whether stage k is carried into stage k+1.
    pub(crate) fn linked(&self, k: usize) -> bool {
        !self.series.duration_s(k).is_nan()
    }
}

impl<'m> LeastSquares for Problem<'m> {
    type Point = Point<'m>;
    type Scratch = Scratch;

    fn scratch(&self) -> Scratch {
        Scratch {
            stepper: Stepper::new(self.assumptions.integrator),
            slopes: StepSlopes::default(),
            linear: Linear::default(),
            frame: SensorFrame::default(),
            next: vec![0.0; self.model.layout().size()],
            at: Vec::new(),
            gyro_start: Linear::default(),
            gyro_halfway: Linear::default(),
            halfway: Vec::new(),
            late_input: [Vec::new(), Vec::new()],
            quads: StageQuads::default(),
        }
    }

    fn shape(&self) -> Shape {
        Shape {
            stages: self.series.stages(),
            stage: self.model.layout().size(),
            border: self.border.size(),
            leading: self.border.dynamics,
            sensed: 2 * self.model.layout().chain(),
        }
    }

    fn linearise(&self, point: &Point<'m>, first: usize, scratch: &mut Scratch, batch: &mut [Stage]) {
        if let Some(fast) = self.kernel(point) {
            self.linearise_wide(fast, point, first, &mut scratch.quads, batch);
            if self.walks_sensors {
                for (k, stage) in (first..).zip(&mut *batch) {
                    self.linearise_readings(point, k, scratch, stage);
                }
            }
        } else {
            for (k, stage) in (first..).zip(&mut *batch) {
                self.linearise_stage(point, k, scratch, stage);
            }
        }
        for (stage, weight) in batch.iter_mut().zip(self.stage_weights.get(first..).unwrap_or_default()) {
            stage.weigh(*weight);
        }
    }

    fn cost(&self, point: &Point<'m>, stages: Range<usize>, scratch: &mut Scratch) -> f64 {
        let mut sum = 0.0;
        let mut first = stages.start;
        while first < stages.end {
            let weight = self.stage_weight(first);
            let alike = (first..stages.end).take_while(|k| self.stage_weight(*k) == weight).count();
            sum += weight * weight * self.unweighted_cost(point, first..first + alike, scratch);
            first += alike;
        }
        sum
    }

    fn retract(&self, point: &Point<'m>, step: &Step, to: &mut Point<'m>) {
        point.move_into(step, &self.border, self.model, to);
    }
}
