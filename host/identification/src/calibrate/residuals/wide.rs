//! The rows of four stages at once, by the model's fast kernel. The same rows as the generic walk makes: a test holds one against the other.
//! Where sensors are read late, or laws change what they read, only transitions are: their slopes take most of the time.

use super::point::Point;
use super::preset::GyroRows;
use super::problem::Problem;
use super::row_plan::GyroRow;
use super::stage_quads::StageQuads;
use super::triple::{Triple, Value, apply, by_rotation, by_rows, cross, dot, splat};
use crate::model::fast::{Fast, GyroQuads, JOINTS, RateSource, Samples, SlopesBy, WITH_PAIR, WITH_PAIRS};
use solve::simd::{LANES, Simd, Work, vectorised};
use solve::{BATCH, Stage};

/// Where rows go: into stages, with their derivatives, or into a sum of squares.
enum Sink<'a> {
    Stages(&'a mut [Stage]),
    Squares(f64),
}

/// A gyro's row in all lanes.
struct GyroRowQuads<'a, S: Simd, const L: usize> {
    residual: Value<S>,
    weight: f64,
    valid: [bool; LANES],
    /// By q and q̇.
    slopes: ([Value<S>; L], [Value<S>; L]),
    /// First shared unknown of three, and the derivatives by them.
    shared: &'a [(usize, Triple<S>)],
    /// By the gyro's own bias along the row's axis: which gyro and axis.
    bias: Option<(usize, usize)>,
    /// By the bias of the base's gyro.
    base_bias: Option<(usize, Triple<S>)>,
}

impl<'m> Problem<'m> {
    /// Fills the stages from `first` on.
    pub(crate) fn linearise_wide(
        &self,
        fast: &Fast,
        point: &Point<'m>,
        first: usize,
        scratch: &mut StageQuads,
        batch: &mut [Stage],
    ) {
        for stage in &mut *batch {
            stage.clear();
        }
        let count = batch.len();
        let sink = Sink::Stages(batch);
        self.run_wide(fast, point, (first, count), scratch, sink);
    }

    /// ½ Σ r² of a run of stages.
    pub(crate) fn cost_wide(
        &self,
        fast: &Fast,
        point: &Point<'m>,
        stages: std::ops::Range<usize>,
        scratch: &mut StageQuads,
    ) -> f64 {
        let mut sum = 0.0;
        for first in stages.clone().step_by(BATCH) {
            let count = BATCH.min(stages.end - first);
            sum += self.run_wide(fast, point, (first, count), scratch, Sink::Squares(0.0));
        }
        0.5 * sum
    }

    /// One batch, by the kernel of the model's number of links.
    fn run_wide(
        &self,
        fast: &Fast,
        point: &Point<'m>,
        (first, count): (usize, usize),
        scratch: &mut StageQuads,
        sink: Sink<'_>,
    ) -> f64 {
        let problem = self;
        match fast.links() {
            JOINTS => vectorised(Batch::<JOINTS> { problem, fast, point, first, count, scratch, sink }),
            WITH_PAIR => vectorised(Batch::<WITH_PAIR> { problem, fast, point, first, count, scratch, sink }),
            _ => vectorised(Batch::<WITH_PAIRS> { problem, fast, point, first, count, scratch, sink }),
        }
    }
}

/// The rows of one batch under a model of L links.
struct Batch<'a, 'm, const L: usize> {
    problem: &'a Problem<'m>,
    fast: &'a Fast,
    point: &'a Point<'m>,
    first: usize,
    count: usize,
    scratch: &'a mut StageQuads,
    sink: Sink<'a>,
}

impl<const L: usize> Work for Batch<'_, '_, L> {
    /// The sum of squares, where it was asked for.
    type Output = f64;

    #[inline(always)]
    fn run<S: Simd>(mut self, simd: S) -> f64 {
        self.scratch.gather(simd, (self.problem.series, self.point), self.first, self.count);
        let samples = Samples::<S, L>::new(simd, self.fast, &self.scratch.x);
        self.transitions(simd, &samples);
        if !self.problem.walks_sensors {
            self.readings(simd, &samples);
        }
        match self.sink {
            Sink::Stages(_) => 0.0,
            Sink::Squares(sum) => sum,
        }
    }
}

impl<const L: usize> Batch<'_, '_, L> {
    /// All rows that are no transition.
    #[inline(always)]
    fn readings<S: Simd>(&mut self, simd: S, samples: &Samples<S, L>) {
        self.scalar_rows();
        match self.problem.assumptions.gyro_rows {
            GyroRows::RigidBase => self.rigid_base_rows(simd, samples),
            GyroRows::Chained => {
                self.chained_rows(simd, samples);
                self.rest_rows();
            }
        }
        self.initial_rows();
    }

    #[inline(always)]
    fn transitions<S: Simd>(&mut self, simd: S, samples: &Samples<S, L>) {
        let Batch { problem, fast, point, first, count, scratch, sink } = self;
        let mut linked = [false; LANES];
        for (lane, linked) in linked.iter_mut().enumerate().take(*count) {
            *linked = problem.linked(*first + lane);
        }
        let StageQuads { x, after, u, time_s, duration_s, step, .. } = &mut **scratch;
        let (integrator, model) = ((problem.assumptions.integrator, SlopesBy::All), (*fast, &point.dynamics));
        match sink {
            Sink::Stages(batch) => {
                step.step::<S, L, true>(integrator, model, (samples, x), (u, time_s), duration_s);
                for (next, after) in step.next.iter_mut().zip(&*after) {
                    next.0 = simd.store(simd.sub(simd.load(&next.0), simd.load(&after.0)));
                }
                let weight = &problem.process_weight;
                Stage::set_transitions(simd, batch, linked, weight, &step.slopes, &step.next);
            }
            Sink::Squares(sum) => {
                step.step::<S, L, false>(integrator, model, (samples, x), (u, time_s), duration_s);
                let mut squares = simd.splat(0.0);
                for ((next, after), weight) in step.next.iter().zip(&*after).zip(&problem.process_weight) {
                    let r = simd.mul(simd.sub(simd.load(&next.0), simd.load(&after.0)), simd.splat(*weight));
                    squares = simd.mul_add(r, r, squares);
                }
                for (square, linked) in simd.store(squares).into_iter().zip(linked) {
                    if linked {
                        *sum += square;
                    }
                }
            }
        }
    }

    /// Channels that read one state component.
    #[inline(always)]
    fn scalar_rows(&mut self) {
        for scalar in &self.problem.rows.scalars {
            let (x, value) = (&self.scratch.x[scalar.component].0, &self.scratch.measured[scalar.channel].0);
            for lane in 0..self.count {
                if value[lane].is_nan() {
                    continue;
                }
                let residual = scalar.weight * (x[lane] - value[lane]);
                match &mut self.sink {
                    Sink::Stages(batch) => batch[lane].unit_row(scalar.component, scalar.weight, residual),
                    Sink::Squares(sum) => *sum += residual * residual,
                }
            }
        }
    }

    /// What is known of the first state of a run.
    #[inline(always)]
    fn initial_rows(&mut self) {
        for lane in 0..self.count {
            let sink = &mut self.sink;
            self.problem.initial_rows(self.point, self.first + lane, &mut |row| match sink {
                Sink::Stages(batch) => row.push(&mut batch[lane]),
                Sink::Squares(sum) => *sum += row.residual * row.residual,
            });
        }
    }

    /// Rows (32), while no input has been given.
    #[inline(always)]
    fn rest_rows(&mut self) {
        let Batch { problem, point, first, count, scratch, sink, .. } = self;
        for lane in 0..*count {
            let k = *first + lane;
            let recording = scratch.recording[lane];
            if !problem.series.rest[recording].contains(&k) {
                continue;
            }
            for gyro in &problem.rows.gyros {
                for axis in 0..3 {
                    let value = scratch.measured[gyro.channel + axis].0[lane];
                    if !value.is_finite() {
                        continue;
                    }
                    let residual = gyro.weight[axis] * (point.biases[recording][gyro.gyro][axis] - value);
                    match sink {
                        Sink::Stages(batch) => {
                            let bias = problem.border.bias(recording, gyro.gyro) + axis;
                            batch[lane].sensor_row(residual).add_shared(bias, gyro.weight[axis]);
                        }
                        Sink::Squares(sum) => *sum += residual * residual,
                    }
                }
            }
        }
    }

    /// A gyro's readings and biases.
    #[inline(always)]
    fn reading<S: Simd>(&self, simd: S, gyro: &GyroRow) -> (Triple<S>, Triple<S>) {
        let mut value = [Value::splat(simd, 0.0); 3];
        let mut bias = value;
        for axis in 0..3 {
            let mut lanes = [0.0; LANES];
            for (to, recording) in lanes.iter_mut().zip(self.scratch.recording) {
                *to = self.point.biases[recording][gyro.gyro][axis];
            }
            value[axis] = Value::load(simd, &self.scratch.measured[gyro.channel + axis].0);
            bias[axis] = Value::load(simd, &lanes);
        }
        (value, bias)
    }

    /// All axes of all gyros from the state on a base at rest.
    #[inline(always)]
    fn rigid_base_rows<S: Simd>(&mut self, simd: S, samples: &Samples<S, L>) {
        for gyro in &self.problem.rows.gyros {
            let (value, bias) = self.reading(simd, gyro);
            let rotation = by_rows(&self.point.rotations[gyro.gyro]);
            let rate = GyroQuads::of(samples, self.fast, gyro.body, &rotation, RateSource::Base);
            let by_rotation = by_rotation(&rate.in_sensor(), &rotation);
            for axis in 0..3 {
                self.push(GyroRowQuads {
                    residual: rate.rate(axis) + bias[axis] - value[axis],
                    weight: gyro.weight[axis],
                    valid: finite(value[axis].to_array(), [true; LANES]),
                    slopes: rate.slopes(axis),
                    shared: &[(self.problem.border.rotation(gyro.gyro), by_rotation[axis])],
                    bias: Some((gyro.gyro, axis)),
                    base_bias: None,
                });
            }
        }
    }

    /// Rows (22) and (25)–(26): see `chained`.
    #[inline(always)]
    fn chained_rows<S: Simd>(&mut self, simd: S, samples: &Samples<S, L>) {
        let problem = self.problem;
        let Some((base, others)) = problem.rows.gyros.split_first() else { return };
        let (value, bias) = self.reading(simd, base);
        let mut complete = [true; LANES];
        for value in value {
            complete = finite(value.to_array(), complete);
        }
        let base_rotation = self.point.rotations[base.gyro];
        let surplus = [value[0] - bias[0], value[1] - bias[1], value[2] - bias[2]];
        let omega = apply(&by_rows(&base_rotation.transpose()), &surplus);

        // (22): the body's rate about the joint axis that carries it.
        let axis = problem.axis_before(base.body);
        let along = [[axis.x, axis.y, axis.z], [0.0; 3], [0.0; 3]];
        let rate = GyroQuads::of(samples, self.fast, base.body, &along, RateSource::Base);
        let axis_quads = splat(simd, &axis);
        let by_base = cross(&omega, &axis_quads);
        self.push(GyroRowQuads {
            residual: rate.rate(0) - dot(&axis_quads, &omega),
            weight: base.weight[0],
            valid: complete,
            slopes: rate.slopes(0),
            shared: &[(problem.border.rotation(base.gyro), by_base)],
            bias: None,
            base_bias: Some((base.gyro, splat(simd, &(base_rotation * axis)))),
        });

        for gyro in others {
            let (value, bias) = self.reading(simd, gyro);
            let rotation = by_rows(&self.point.rotations[gyro.gyro]);
            let rate = GyroQuads::of(samples, self.fast, gyro.body, &rotation, RateSource::Body(base.body, omega));
            let by_rotation = by_rotation(&rate.in_sensor(), &rotation);
            for axis in 0..3 {
                let carried = rate.axis_in(samples, self.fast, axis, base.body);
                let by_base = cross(&carried, &omega);
                let by_base_bias = apply(&by_rows(&-base_rotation), &carried);
                self.push(GyroRowQuads {
                    residual: rate.rate(axis) + bias[axis] - value[axis],
                    weight: gyro.weight[axis],
                    valid: finite(value[axis].to_array(), complete),
                    slopes: rate.slopes(axis),
                    shared: &[
                        (problem.border.rotation(gyro.gyro), by_rotation[axis]),
                        (problem.border.rotation(base.gyro), by_base),
                    ],
                    bias: Some((gyro.gyro, axis)),
                    base_bias: Some((base.gyro, by_base_bias)),
                });
            }
        }
    }

    #[inline(always)]
    fn push<S: Simd>(&mut self, row: GyroRowQuads<'_, S, L>) {
        let residual = (row.residual * row.weight).to_array();
        let batch = match &mut self.sink {
            Sink::Stages(batch) => batch,
            Sink::Squares(sum) => {
                for lane in 0..self.count {
                    if row.valid[lane] {
                        *sum += residual[lane] * residual[lane];
                    }
                }
                return;
            }
        };
        let (mut by_position, mut by_speed) = ([[0.0; LANES]; L], [[0.0; LANES]; L]);
        for j in 0..L {
            by_position[j] = (row.slopes.0[j] * row.weight).to_array();
            by_speed[j] = (row.slopes.1[j] * row.weight).to_array();
        }
        for lane in 0..self.count {
            if !row.valid[lane] {
                continue;
            }
            let mut to = batch[lane].sensor_row(residual[lane]);
            for j in 0..L {
                to.add_state(j, by_position[j][lane]);
                to.add_state(L + j, by_speed[j][lane]);
            }
            for (first, by) in row.shared {
                for axis in 0..3 {
                    to.add_shared(first + axis, row.weight * by[axis].to_array()[lane]);
                }
            }
            let recording = self.scratch.recording[lane];
            if let Some((gyro, axis)) = row.bias {
                to.add_shared(self.problem.border.bias(recording, gyro) + axis, row.weight);
            }
            if let Some((gyro, by)) = &row.base_bias {
                for axis in 0..3 {
                    let column = self.problem.border.bias(recording, *gyro) + axis;
                    to.add_shared(column, row.weight * by[axis].to_array()[lane]);
                }
            }
        }
    }
}

/// Which lanes are finite and were `also` valid.
#[inline(always)]
fn finite(values: [f64; LANES], also: [bool; LANES]) -> [bool; LANES] {
    let mut valid = also;
    for (valid, value) in valid.iter_mut().zip(values) {
        *valid &= value.is_finite();
    }
    valid
}
