//! A calibrated robot as the filter and the runs see it: its dynamics, its sensors, their Jacobians.

mod four;
mod system;

pub use system::CalibratedSystem;
use system::Instants;

use std::sync::Arc;

use nalgebra::{Matrix3, Vector3};

use super::VerifyError;
use crate::calibrate::data::instants::GyroInstants;
use crate::calibrate::extension::laws;
use crate::calibrate::{Calibration, Preset, Trial};
use crate::model::fast::{Fast, StepQuads};
use crate::model::law::Law;
use crate::model::rotation::boxplus;
use crate::model::{Integrator, Linear, Model, ModelError, SensorFrame, SensorLaws, StepSlopes, Stepper};
use crate::recording::Recording;
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
    sensor_laws: SensorLaws,
    /// The kernel that steps four states at once, where it covers the model.
    fast: Option<Fast>,
}

/// The model as it predicts: its inputs are what is recorded.
fn predicting(robot: &Robot, laws: Vec<Arc<dyn Law>>) -> Result<Model, ModelError> {
    Model::extended(&robot.clone().with_exact_input(), laws)
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
        let laws = laws::laws_of(&robot, &calibration.extensions, value)?;
        let integrator = laws::integrator(&laws, calibration.preset);
        let model = predicting(&robot, laws)?;
        Self::of_model(robot, model, integrator, value)
    }

    /// The model of a trial on a bench, with the biases of its first recording.
    ///
    /// # Errors
    /// A model that cannot be built.
    pub fn of_trial(robot: &Robot, preset: Preset, trial: &Trial) -> Result<Self, VerifyError> {
        let model = predicting(robot, trial.laws.clone())?;
        let value = |name: &str| trial.value(name).map(|value| value.estimate);
        let (rotations, biases) = trial.gyros();
        let integrator = laws::integrator(&trial.laws, preset);
        let gyros = robot.gyros().count();
        let of_gyros =
            |name: &str| (gyros > 0 && (name.starts_with("bias") || name.starts_with("R_imu"))).then_some(0.0);
        let built = Self::of_model(robot.clone(), model, integrator, |name| value(name).or_else(|| of_gyros(name)))?;
        Ok(Self { rotations: rotations.to_vec(), biases: biases.to_vec(), ..built })
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
        let model = predicting(&robot, Vec::new())?;
        Self::of_model(robot, model, integrator, value)
    }

    fn of_model(
        robot: Robot,
        model: Model,
        integrator: Integrator,
        value: impl Fn(&str) -> Option<f64>,
    ) -> Result<Self, VerifyError> {
        let of_spec = |spec: &ParameterSpec| match value(&spec.name) {
            Some(value) => Ok(value),
            None if !spec.value.free => Ok(spec.value.start),
            None => Err(VerifyError::MissingParameter { name: spec.name.clone() }),
        };
        let base = model.coordinates().iter().count();
        let mut physical: Vec<f64> = model.coordinates().iter().map(|c| of_spec(&c.spec)).collect::<Result<_, _>>()?;
        for (name, _) in model.coordinates().names().skip(base) {
            physical.push(value(name).ok_or_else(|| VerifyError::MissingParameter { name: name.to_string() })?);
        }
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
        let sensor_laws = SensorLaws::of(&model, robot.gyros().count());
        let fast = Fast::of(&model);
        Ok(Self { channels: robot.channels(), robot, model, z, rotations, biases, integrator, sensor_laws, fast })
    }

    /// The inputs `[joint][k]` as they act on the motors: late, where the model says so.
    pub fn inputs_as_they_act(&self, inputs: &[Vec<f64>], segments: &[std::ops::Range<usize>]) -> Vec<Vec<f64>> {
        let Some(delay) = self.model.input_delay() else { return inputs.to_vec() };
        let samples = self.z[delay] / self.robot.sample_period_s;
        let (whole, share) = (samples.floor() as isize, samples - samples.floor());
        let late = |input: &Vec<f64>| {
            let mut late = input.clone();
            for segment in segments {
                let at =
                    |k: usize, back: isize| input[k.saturating_add_signed(-back).clamp(segment.start, segment.end - 1)];
                for k in segment.clone() {
                    late[k] = (1.0 - share) * at(k, whole) + share * at(k, whole + 1);
                }
            }
            late
        };
        inputs.iter().map(late).collect()
    }

    /// The coordinates of the dynamics at the calibrated values.
    pub fn z(&self) -> &[f64] {
        &self.z
    }

    /// What each gyro reads at rest, rad/s in sensor axes.
    pub fn biases(&self) -> &[Vector3<f64>] {
        &self.biases
    }

    /// R_imu of each gyro, body axes → sensor axes.
    pub fn rotations(&self) -> &[Matrix3<f64>] {
        &self.rotations
    }

    /// How it is integrated.
    pub fn integrator(&self) -> Integrator {
        self.integrator
    }

    /// What sensors read where it is not the state itself.
    pub fn sensor_laws(&self) -> &SensorLaws {
        &self.sensor_laws
    }

    /// The robot.
    pub fn robot(&self) -> &Robot {
        &self.robot
    }

    /// The model's equations.
    pub fn model(&self) -> &Model {
        &self.model
    }

    /// The model as a system whose gyros read when a recording says so: [`Columns::t_s`](super::Columns) are its samples' times.
    pub fn system_of(&self, recording: &Recording, t_s: &[f64]) -> CalibratedSystem<'_> {
        let of = |(gyro, sensor): (usize, &crate::robot::Gyro)| GyroInstants::of(recording, gyro, sensor.offset_s);
        let found: Vec<Option<GyroInstants>> = self.robot.gyros().enumerate().map(of).collect();
        if found.iter().all(Option::is_none) {
            return self.system();
        }
        let own = found.into_iter().zip(self.robot.gyros()).map(|(instants, sensor)| {
            instants.map_or_else(|| vec![sensor.offset_s; t_s.len()], |instants| instants.own_s())
        });
        let instants = Instants { t_s: t_s.to_vec(), after_s: own.collect() };
        CalibratedSystem { instants: Some(Arc::new(instants)), ..self.system() }
    }

    /// The model as a system.
    pub fn system(&self) -> CalibratedSystem<'_> {
        CalibratedSystem {
            calibrated: self,
            dynamics: self.model.at(&self.z),
            stepper: Stepper::new(self.integrator),
            slopes: StepSlopes::default(),
            quads: StepQuads::default(),
            linear: Linear::default(),
            frame: SensorFrame::default(),
            late: vec![0.0; self.model.layout().size()],
            late_jacobian: Vec::new(),
            row: vec![0.0; self.model.layout().size()],
            halfway: Vec::new(),
            time_s: 0.0,
            instants: None,
            now: None,
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
            let link = read(|joint| ChannelKind::LinkPosition { joint }, joint)
                .map(|reading| self.model.link_position(joint, reading, &self.z));
            x[layout.q(joint)] = link.or(motor).unwrap_or(0.0);
            x[layout.theta(joint)] = motor.or(link).unwrap_or(0.0);
        }
        x
    }
}
