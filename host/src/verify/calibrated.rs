//! A calibrated robot as the filter and the runs see it: its dynamics, its sensors, their Jacobians.

use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

use super::VerifyError;
use super::system::System;
use crate::calibrate::Calibration;
use crate::model::rotation::boxplus;
use crate::model::{Dynamics, Integrator, Linear, Model, SensorFrame, StepSlopes, Stepper};
use crate::robot::{Channel, ChannelKind, ParameterSpec, Robot, Symbol};

/// A robot with values for all of its parameters.
#[derive(Debug, Clone)]
pub struct CalibratedModel {
    robot: Robot,
    channels: Vec<Channel>,
    model: Model,
    /// Coordinates of the dynamics.
    z: Vec<f64>,
    /// R_imu of each gyro, body axes → sensor axes.
    rotations: Vec<Matrix3<f64>>,
    /// rad/s in sensor axes.
    biases: Vec<Vector3<f64>>,
    integrator: Integrator,
}

impl CalibratedModel {
    /// The model of a calibration. Gyro biases are those of recording `recording` of the calibration where each has its
    /// own, and their mean over the recordings if it is `None`.
    ///
    /// # Errors
    /// If the robot description inside the calibration does not parse, or an estimate is missing.
    pub fn of(calibration: &Calibration, recording: Option<usize>) -> Result<Self, VerifyError> {
        let robot = Robot::parse(&calibration.robot_toml)?;
        let recordings = calibration.recordings.len().max(1);
        let estimate = |name: &str| calibration.parameter(name).map(|parameter| parameter.estimate);
        let own = |name: &str, i: usize| estimate(&format!("{name}@{}", i + 1));
        let value = |name: &str| {
            estimate(name).or_else(|| match recording {
                Some(i) => own(name, i),
                None => (0..recordings).map(|i| own(name, i)).sum::<Option<f64>>().map(|sum| sum / recordings as f64),
            })
        };
        Self::from_values(robot, calibration.preset.assumptions().integrator, value)
    }

    /// `robot` with the values that `value` gives for the names of [`Robot::parameters`]; known parameters keep the
    /// robot's value where it gives none.
    ///
    /// # Errors
    /// [`VerifyError::MissingParameter`] if a free parameter has no value.
    pub fn from_values(
        robot: Robot,
        integrator: Integrator,
        value: impl Fn(&str) -> Option<f64>,
    ) -> Result<Self, VerifyError> {
        let of_spec = |spec: &ParameterSpec| match value(&spec.name) {
            Some(value) => Ok(value),
            None if !spec.value.free => Ok(spec.value.start),
            None => Err(VerifyError::MissingParameter { name: spec.name.clone() }),
        };
        let model = Model::new(&robot);
        let physical: Vec<f64> = model.coordinates().iter().map(|c| of_spec(&c.spec)).collect::<Result<_, _>>()?;
        let z = model.coordinates().from_physical(&physical);
        let mut rotations: Vec<Vector3<f64>> = vec![Vector3::zeros(); robot.gyros().count()];
        let mut biases = rotations.clone();
        for spec in robot.parameters() {
            match spec.symbol {
                Symbol::Bias { gyro, axis } => biases[gyro][axis] = of_spec(spec)?,
                Symbol::Misalignment { gyro, axis } => rotations[gyro][axis] = of_spec(spec)?,
                _ => {}
            }
        }
        let rotations = robot
            .gyros()
            .zip(&rotations)
            .map(|(gyro, delta)| boxplus(&Matrix3::from_fn(|i, j| gyro.rotation[i][j]), delta))
            .collect();
        Ok(Self { channels: robot.channels(), robot, model, z, rotations, biases, integrator })
    }

    /// The robot.
    pub fn robot(&self) -> &Robot {
        &self.robot
    }

    /// The model's equations.
    pub fn model(&self) -> &Model {
        &self.model
    }

    /// The model as a system.
    pub fn system(&self) -> CalibratedSystem<'_> {
        CalibratedSystem {
            calibrated: self,
            dynamics: self.model.at(&self.z),
            stepper: Stepper::new(self.integrator),
            slopes: StepSlopes::default(),
            linear: Linear::default(),
            frame: SensorFrame::default(),
            late: vec![0.0; self.model.layout().size()],
            late_jacobian: Vec::new(),
        }
    }

    /// The component of the state that a channel reads directly; `None` for gyros.
    fn component(&self, kind: ChannelKind) -> Option<usize> {
        let layout = self.model.layout();
        match kind {
            ChannelKind::MotorPosition { joint } => Some(layout.theta(joint)),
            ChannelKind::LinkPosition { joint } => Some(layout.q(joint)),
            ChannelKind::MotorSpeed { joint } => Some(layout.thetad(joint)),
            ChannelKind::LinkSpeed { joint } => Some(layout.qd(joint)),
            ChannelKind::GyroAxis { .. } => None,
        }
    }

    /// The state of a robot at rest with relaxed transmissions where the position channels read this.
    pub fn rest_state(&self, readings: &[f64]) -> Vec<f64> {
        let layout = self.model.layout();
        let mut x = vec![0.0; layout.size()];
        let read = |kind: fn(usize) -> ChannelKind, joint: usize| {
            let channel = self.channels.iter().position(|c| c.kind == kind(joint))?;
            Some(readings[channel]).filter(|v| v.is_finite())
        };
        for joint in 0..layout.joints() {
            let motor = read(|joint| ChannelKind::MotorPosition { joint }, joint);
            let link = read(|joint| ChannelKind::LinkPosition { joint }, joint);
            x[layout.q(joint)] = link.or(motor).unwrap_or(0.0);
            x[layout.theta(joint)] = motor.or(link).unwrap_or(0.0);
        }
        x
    }
}

/// A [`CalibratedModel`] with the scratch space of one thread.
#[derive(Debug, Clone)]
pub struct CalibratedSystem<'m> {
    calibrated: &'m CalibratedModel,
    dynamics: Dynamics<'m>,
    stepper: Stepper,
    slopes: StepSlopes,
    linear: Linear,
    frame: SensorFrame,
    /// The state at the instant of a reading, and its derivatives by the state of the sample.
    late: Vec<f64>,
    late_jacobian: Vec<f64>,
}

impl CalibratedSystem<'_> {
    /// x + offset ẋ: sensors are read a little after the tick.
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
            self.dynamics.linearise(x, u, &mut self.linear);
            let columns = self.dynamics.columns();
            for i in 0..n {
                for j in 0..n {
                    self.late_jacobian[i * n + j] += offset_s * self.linear.slopes[i * columns + j];
                }
            }
        } else {
            self.linear.xdot.resize(n, 0.0);
            self.dynamics.derivative(x, u, &mut self.linear.xdot);
        }
        for (late, xdot) in self.late.iter_mut().zip(&self.linear.xdot) {
            *late += offset_s * xdot;
        }
    }

    fn predict_outputs(&mut self, x: &[f64], u: &[f64], outputs: &mut [f64], mut jacobian: Option<&mut [f64]>) {
        let calibrated = self.calibrated;
        let n = x.len();
        let joints = calibrated.model.layout().joints();
        let mut read_at = f64::NAN;
        let mut row = vec![0.0; n];
        for (i, channel) in calibrated.channels.iter().enumerate() {
            if channel.offset_s != read_at {
                read_at = channel.offset_s;
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
                ChannelKind::GyroAxis { gyro, body, axis } => {
                    let sensor_axis = calibrated.rotations[gyro].row(axis);
                    if jacobian.is_some() {
                        for (column, slope) in row[..2 * joints].iter_mut().enumerate() {
                            *slope = (sensor_axis * self.frame.slope(body, column))[0];
                        }
                    }
                    (sensor_axis * self.frame.rate(body))[0] + calibrated.biases[gyro][axis]
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
    }

    /// q̇ that explains the gyros best at positions `x`; zero where nothing does.
    fn speeds_from_gyros(&mut self, x: &[f64], readings: &[f64]) -> Vec<f64> {
        let calibrated = self.calibrated;
        let joints = calibrated.model.layout().joints();
        let (q, _) = x.split_at(joints);
        self.frame.linearise(calibrated.model.chain(), q, &vec![0.0; joints]);
        let mut rows = Vec::new();
        let mut right = Vec::new();
        for (channel, reading) in calibrated.channels.iter().zip(readings) {
            if let ChannelKind::GyroAxis { gyro, body, axis } = channel.kind
                && reading.is_finite()
            {
                let sensor_axis = calibrated.rotations[gyro].row(axis);
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

    fn step(&mut self, x: &[f64], u: &[f64], dt_s: f64, next: &mut [f64]) {
        self.stepper.step(&self.dynamics, x, u, dt_s, next);
    }

    fn step_jacobian(&mut self, x: &[f64], u: &[f64], dt_s: f64, next: &mut [f64], jacobian: &mut [f64]) {
        let n = x.len();
        self.stepper.step_slopes(&self.dynamics, x, u, dt_s, &mut self.slopes);
        next.copy_from_slice(&self.slopes.next);
        let rows = self.slopes.slopes.chunks_exact(self.dynamics.columns());
        for (row, slopes) in jacobian.chunks_exact_mut(n).zip(rows) {
            row.copy_from_slice(&slopes[..n]);
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
        (0..layout.joints()).any(|j| layout.qd(j) == state || layout.thetad(j) == state)
    }

    fn first_guess(&mut self, readings: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let calibrated = self.calibrated;
        let layout = calibrated.model.layout();
        let mut x = calibrated.rest_state(readings);
        let mut deviation = vec![UNKNOWN_POSITION; x.len()];
        let speeds = self.speeds_from_gyros(&x, readings);
        for (joint, speed) in speeds.into_iter().enumerate() {
            x[layout.qd(joint)] = speed;
            x[layout.thetad(joint)] = speed;
            deviation[layout.qd(joint)] = SPEED;
            deviation[layout.thetad(joint)] = SPEED;
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
