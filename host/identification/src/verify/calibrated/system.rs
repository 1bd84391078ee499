//! A calibrated model as a [`System`]: steps and readings with their Jacobians.

use std::sync::Arc;

use nalgebra::{DMatrix, DVector};

use super::super::system::{Four, System};
use super::CalibratedModel;
use super::four;
use crate::model::fast::{Fast, StepQuads};
use crate::model::{Dynamics, Input, Linear, SensorFrame, StepSlopes, Stepper};
use crate::robot::{Channel, ChannelKind, Side};
use solve::simd::Quad;

/// The inputs, already as late as they act, at a time.
fn held(u: &[f64], time_s: f64) -> Input<'_> {
    Input { u, by_delay: &[], time_s }
}

/// When the gyros of a recording read.
#[derive(Debug)]
pub(super) struct Instants {
    /// Of its samples, s.
    pub t_s: Vec<f64>,
    /// `[gyro][sample]`: how long after them, s.
    pub after_s: Vec<Vec<f64>>,
}

/// A [`CalibratedModel`] with the scratch space of one thread.
#[derive(Debug, Clone)]
pub struct CalibratedSystem<'m> {
    pub(super) calibrated: &'m CalibratedModel,
    pub(super) dynamics: Dynamics<'m>,
    pub(super) stepper: Stepper,
    pub(super) slopes: StepSlopes,
    pub(super) quads: StepQuads,
    pub(super) linear: Linear,
    pub(super) frame: SensorFrame,
    /// The state at the instant of a reading, and its derivatives by the state of the sample.
    pub(super) late: Vec<f64>,
    pub(super) late_jacobian: Vec<f64>,
    /// The gradient of one reading by it.
    pub(super) row: Vec<f64>,
    pub(super) halfway: Vec<f64>,
    pub(super) time_s: f64,
    /// When gyros read, if a recording tells.
    pub(super) instants: Option<Arc<Instants>>,
    /// The present sample among them.
    pub(super) now: Option<usize>,
}

impl<'m> CalibratedSystem<'m> {
    /// The kernel of four states, if it covers the model and steps as long as theirs are whole: it divides none.
    fn kernel(&self, four: &Four) -> Option<&'m Fast> {
        let longest_s = four.dt_s.0.into_iter().fold(0.0, f64::max);
        let is_whole = || self.calibrated.integrator.leaves_whole(&self.dynamics, longest_s);
        self.calibrated.fast.as_ref().filter(|_| is_whole())
    }

    /// When a channel reads after the sample, s.
    fn instant_s(&self, channel: &Channel) -> f64 {
        let ChannelKind::GyroAxis { gyro, .. } = channel.kind else { return channel.offset_s };
        let own = self.instants.as_ref().zip(self.now).and_then(|(of, now)| of.after_s.get(gyro)?.get(now).copied());
        own.unwrap_or(channel.offset_s) - self.calibrated.model.gyro_lag(gyro, &self.calibrated.z).0
    }

    /// x + offset ẋ: sensors are read a little after the tick, or tell of a moment before it.
    fn read_at(&mut self, x: &[f64], u: &[f64], offset_s: f64, with_jacobian: bool) {
        let n = x.len();
        self.late.copy_from_slice(x);
        if with_jacobian {
            self.late_jacobian.clear();
            self.late_jacobian.resize(n * n, 0.0);
            for i in 0..n {
                self.late_jacobian[i * n + i] = 1.0;
            }
        }
        if offset_s == 0.0 {
            return;
        }
        if with_jacobian {
            self.dynamics.linearise(x, held(u, self.time_s), &mut self.linear);
            let columns = self.dynamics.columns();
            for i in 0..n {
                for j in 0..n {
                    self.late_jacobian[i * n + j] += offset_s * self.linear.slopes[i * columns + j];
                }
            }
        } else {
            self.linear.xdot.resize(n, 0.0);
            self.dynamics.derivative(x, held(u, self.time_s), &mut self.linear.xdot);
        }
        // Over as long as a gyro may be late, the rate on the way matters.
        if self.now.is_some() {
            self.halfway.clear();
            self.halfway.extend(x.iter().zip(&self.linear.xdot).map(|(x, xdot)| x + 0.5 * offset_s * xdot));
            self.dynamics.derivative(&self.halfway, held(u, self.time_s), &mut self.linear.xdot);
        }
        for (late, xdot) in self.late.iter_mut().zip(&self.linear.xdot) {
            *late += offset_s * xdot;
        }
    }

    fn predict_outputs(&mut self, x: &[f64], u: &[f64], outputs: &mut [f64], mut jacobian: Option<&mut [f64]>) {
        let calibrated = self.calibrated;
        let n = x.len();
        let joints = calibrated.model.layout().chain();
        let mut read_at = f64::NAN;
        let mut row = std::mem::take(&mut self.row);
        for (i, channel) in calibrated.channels.iter().enumerate() {
            let instant_s = self.instant_s(channel);
            if instant_s != read_at {
                read_at = instant_s;
                self.read_at(x, u, read_at, jacobian.is_some());
                let (q, qd) = self.late[..2 * joints].split_at(joints);
                if jacobian.is_some() {
                    self.frame.linearise(calibrated.model.chain(), q, qd);
                } else {
                    self.frame.rates(calibrated.model.chain(), q, qd);
                }
            }
            row.fill(0.0);
            outputs[i] = match channel.kind {
                ChannelKind::GyroAxis { gyro, body, axis } if self.gyro_under_laws(gyro) => {
                    let body = calibrated.model.body(body);
                    self.gyro_axis_under_laws((gyro, body, axis), joints, jacobian.is_some(), &mut row)
                }
                ChannelKind::GyroAxis { gyro, body, axis } => {
                    let body = calibrated.model.body(body);
                    let sensor_axis = calibrated.rotations[gyro].row(axis);
                    if jacobian.is_some() {
                        for (column, slope) in row[..2 * joints].iter_mut().enumerate() {
                            *slope = (sensor_axis * self.frame.slope(body, column))[0];
                        }
                    }
                    (sensor_axis * self.frame.rate(body))[0] + calibrated.biases[gyro][axis]
                }
                ChannelKind::MotorPosition { joint } if calibrated.sensor_laws.see_position(Side::Motor, joint) => {
                    self.position_under_laws(Side::Motor, joint, &mut row)
                }
                ChannelKind::LinkPosition { joint } if calibrated.sensor_laws.see_position(Side::Link, joint) => {
                    self.position_under_laws(Side::Link, joint, &mut row)
                }
                kind => {
                    // Every other kind reads a component.
                    let component = calibrated.component(kind).unwrap_or(0);
                    row[component] = 1.0;
                    self.late[component]
                }
            };
            if let Some(jacobian) = jacobian.as_deref_mut() {
                // row · ∂late/∂x
                let out = &mut jacobian[i * n..(i + 1) * n];
                out.fill(0.0);
                for (slope, by_x) in row.iter().zip(self.late_jacobian.chunks_exact(n)) {
                    if *slope != 0.0 {
                        for (out, by_x) in out.iter_mut().zip(by_x) {
                            *out += slope * by_x;
                        }
                    }
                }
            }
        }
        self.row = row;
    }

    fn gyro_under_laws(&self, gyro: usize) -> bool {
        self.calibrated.sensor_laws.see_gyro(gyro) || self.calibrated.model.lagging(gyro).is_some()
    }

    /// What an axis of a gyro reads, and its gradient by the state at the instant of the reading.
    fn gyro_axis_under_laws(
        &self,
        (gyro, body, axis): (usize, usize, usize),
        joints: usize,
        with_gradient: bool,
        row: &mut [f64],
    ) -> f64 {
        let calibrated = self.calibrated;
        let lagging = calibrated.model.lagging(gyro);
        let turns = self.frame.rate(body);
        let omega = lagging.map_or(turns, |lagging| lagging.rate(&self.late, turns.into()).into());
        let rotation = &calibrated.rotations[gyro];
        let at = (gyro, self.time_s);
        let bias = calibrated.biases[gyro];
        let reading = calibrated.sensor_laws.gyro(&calibrated.model, &calibrated.z, at, rotation * omega, bias);
        if with_gradient {
            let by_omega = rotation.transpose() * reading.by_rate[axis];
            let by_body = lagging.map_or(1.0, |lagging| -lagging.beyond);
            if by_body != 0.0 {
                for (column, slope) in row[..2 * joints].iter_mut().enumerate() {
                    *slope = by_body * self.frame.slope(body, column).dot(&by_omega);
                }
            }
            if let Some(lagging) = lagging {
                let by_filtered = (1.0 + lagging.beyond) * by_omega;
                row[lagging.state..lagging.state + 3].copy_from_slice(by_filtered.as_slice());
            }
        }
        reading.value[axis]
    }

    /// What a position sensor reads, and its gradient by the state at the instant of the reading.
    fn position_under_laws(&self, side: Side, joint: usize, row: &mut [f64]) -> f64 {
        let calibrated = self.calibrated;
        let layout = calibrated.model.layout();
        let [position, speed] = match side {
            Side::Motor => [layout.theta(joint), layout.thetad(joint)],
            Side::Link => [layout.q(joint), layout.qd(joint)],
        };
        let at = [self.late[position], self.late[speed]];
        let reading = calibrated.sensor_laws.position(&calibrated.model, &calibrated.z, (side, joint), at, 0.0);
        row[position] += reading.slopes[0];
        row[speed] += reading.slopes[1];
        reading.value
    }

    /// Speeds of the chain that explain the gyros best at positions `x`; zero where nothing does.
    fn speeds_from_gyros(&mut self, x: &[f64], readings: &[f64]) -> Vec<f64> {
        let calibrated = self.calibrated;
        let joints = calibrated.model.layout().chain();
        let (q, _) = x.split_at(joints);
        self.frame.linearise(calibrated.model.chain(), q, &vec![0.0; joints]);
        let mut rows = Vec::new();
        let mut right = Vec::new();
        for (channel, reading) in calibrated.channels.iter().zip(readings) {
            if let ChannelKind::GyroAxis { gyro, body, axis } = channel.kind
                && reading.is_finite()
            {
                let (sensor_axis, body) = (calibrated.rotations[gyro].row(axis), calibrated.model.body(body));
                rows.extend((0..joints).map(|j| (sensor_axis * self.frame.slope(body, joints + j))[0]));
                right.push(reading - calibrated.biases[gyro][axis]);
            }
        }
        if right.is_empty() {
            // A robot without gyros, or none that reads: the singular values of no rows do not exist.
            return vec![0.0; joints];
        }
        let matrix = DMatrix::from_row_slice(right.len(), joints, &rows);
        let solved = matrix.svd(true, true).solve(&DVector::from_vec(right), 1e-6);
        solved.map_or_else(|_| vec![0.0; joints], |speeds| speeds.as_slice().to_vec())
    }
}

/// Standard deviations of a state that only one tick's readings are known of: positions where a sensor reads them and
/// where none does, windup of a transmission (the paper's (37): 5°), speeds. rad, rad/s (m, m/s).
const READ_POSITION: f64 = 0.01;
const UNKNOWN_POSITION: f64 = 1.0;
const WINDUP: f64 = 0.0872;
const SPEED: f64 = 1.0;

impl System for CalibratedSystem<'_> {
    fn states(&self) -> usize {
        self.calibrated.model.layout().size()
    }

    fn outputs(&self) -> usize {
        self.calibrated.channels.len()
    }

    fn at_time(&mut self, time_s: f64) {
        self.time_s = time_s;
        self.now = self.instants.as_ref().and_then(|of| of.t_s.binary_search_by(|t_s| t_s.total_cmp(&time_s)).ok());
    }

    fn step(&mut self, x: &[f64], u: &[f64], dt_s: f64, next: &mut [f64]) {
        self.stepper.step(&self.dynamics, x, held(u, self.time_s), dt_s, next);
    }

    fn step_jacobian(&mut self, x: &[f64], u: &[f64], dt_s: f64, next: &mut [f64], jacobian: &mut [f64]) {
        let n = x.len();
        self.stepper.step_slopes(&self.dynamics, x, held(u, self.time_s), dt_s, &mut self.slopes);
        next.copy_from_slice(&self.slopes.next);
        let rows = self.slopes.slopes.chunks_exact(self.dynamics.columns());
        for (row, slopes) in jacobian.chunks_exact_mut(n).zip(rows) {
            row.copy_from_slice(&slopes[..n]);
        }
    }

    fn step_four(&mut self, of: &Four, next: &mut [Quad]) {
        let calibrated = self.calibrated;
        let Some(fast) = self.kernel(of) else { return of.step_each(self, next) };
        four::step::<false>((fast, &self.dynamics, calibrated.integrator), of, &mut self.quads);
        next.copy_from_slice(&self.quads.next);
    }

    fn step_jacobian_four(&mut self, of: &Four, next: &mut [Quad], jacobian: &mut [Quad]) {
        let calibrated = self.calibrated;
        let Some(fast) = self.kernel(of) else { return of.step_jacobian_each(self, next, jacobian) };
        four::step::<true>((fast, &self.dynamics, calibrated.integrator), of, &mut self.quads);
        next.copy_from_slice(&self.quads.next);
        let rows = self.quads.slopes.chunks_exact(self.dynamics.columns());
        for (row, slopes) in jacobian.chunks_exact_mut(next.len()).zip(rows) {
            row.copy_from_slice(&slopes[..next.len()]);
        }
    }

    fn outputs_of(&mut self, x: &[f64], u: &[f64], outputs: &mut [f64]) {
        self.predict_outputs(x, u, outputs, None);
    }

    fn outputs_jacobian(&mut self, x: &[f64], u: &[f64], outputs: &mut [f64], jacobian: &mut [f64]) {
        self.predict_outputs(x, u, outputs, Some(jacobian));
    }

    fn is_velocity(&self, state: usize) -> bool {
        let layout = self.calibrated.model.layout();
        let of_chain = layout.chain()..2 * layout.chain();
        of_chain.contains(&state) || (0..layout.joints()).any(|j| layout.thetad(j) == state)
    }

    fn first_guess(&mut self, readings: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let calibrated = self.calibrated;
        let layout = calibrated.model.layout();
        let mut x = calibrated.rest_state(readings);
        let mut deviation = vec![UNKNOWN_POSITION; x.len()];
        let speeds = self.speeds_from_gyros(&x, readings);
        for (i, speed) in speeds.iter().enumerate() {
            x[layout.chain() + i] = *speed;
            deviation[layout.chain() + i] = SPEED;
        }
        for joint in 0..layout.joints() {
            x[layout.thetad(joint)] = x[layout.qd(joint)];
            deviation[layout.thetad(joint)] = SPEED;
        }
        for i in layout.passive() {
            deviation[i] = WINDUP;
        }
        for (i, size) in layout.own().zip(calibrated.model.own_size()) {
            deviation[i] = *size;
        }
        for channel in &calibrated.channels {
            // A gyro that lags shows the body's rate of a moment ago.
            if let ChannelKind::GyroAxis { gyro, body, axis: 0 } = channel.kind
                && let Some(lagging) = calibrated.model.lagging(gyro)
            {
                let (q, qd) = x[..2 * layout.chain()].split_at(layout.chain());
                self.frame.rates(calibrated.model.chain(), q, qd);
                let rate = self.frame.rate(calibrated.model.body(body));
                x[lagging.state..lagging.state + 3].copy_from_slice(rate.as_slice());
            }
        }
        for (channel, reading) in calibrated.channels.iter().zip(readings) {
            let Some(component) = calibrated.component(channel.kind).filter(|_| reading.is_finite()) else { continue };
            match channel.kind {
                ChannelKind::MotorSpeed { .. } | ChannelKind::LinkSpeed { .. } => x[component] = *reading,
                _ => deviation[component] = READ_POSITION,
            }
        }
        for joint in (0..layout.joints()).filter(|&j| layout.is_elastic(j)) {
            // Only one side of the transmission is read: the other is known to its windup.
            for (side, other) in [(layout.q(joint), layout.theta(joint)), (layout.theta(joint), layout.q(joint))] {
                if deviation[side] == UNKNOWN_POSITION && deviation[other] == READ_POSITION {
                    deviation[side] = WINDUP;
                }
            }
        }
        (x, deviation)
    }
}
