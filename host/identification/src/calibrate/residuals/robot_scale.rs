//! How large parameters of the dynamics are in the scale of a robot and its motion, whatever its file starts them with.
//!
//! ```text
//!   μ, o    root mean square torque of the drive, τ
//!   v, k_mi τ / q̇        b, J    τ / q̈        mx, my, mz    τ / g, or τ / q̈ without gravity        root mean squares of the motion
//! ```
//! A parameter of that size makes all of the torque. Constants of drives and transmissions are as large as they are found.

use super::point::Point;
use crate::calibrate::data::series::Series;
use crate::model::{Coordinate, Model};
use crate::robot::{Robot, Symbol, Transmission};

/// Accelerations are differences of speeds over this time, s: of single samples they would be those of the noise. Halved or doubled, they change by the share
/// of the motion that is faster than 25 Hz.
const ACCELERATION_OVER_S: f64 = 0.02;

/// Root mean squares of one joint's motion.
#[derive(Debug, Clone, Copy, Default)]
struct Motion {
    torque: f64,
    speed: f64,
    acceleration: f64,
}

/// What of a robot is needed to tell sizes.
#[derive(Debug, Clone)]
pub(crate) struct RobotScale {
    /// m/s².
    gravity: f64,
    /// Torque of one unit of input, of each joint.
    drives: Vec<Drive>,
    /// No joint has a spring.
    rigid: bool,
}

/// Where the torque of one unit of input comes from.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Drive {
    /// It is known, N m or N.
    Known(f64),
    /// This coordinate of the dynamics, times this.
    Free(usize, f64),
}

impl Drive {
    pub(crate) fn of(robot: &Robot, model: &Model, joint: usize) -> Self {
        let Some(symbol) = robot.input.unit.torque_constant() else { return Drive::Known(1.0) };
        let is = |c: &Coordinate| c.spec.symbol == symbol && c.spec.joints.contains(&joint);
        match model.coordinates().iter().position(is) {
            Some(free) => Drive::Free(free, robot.input.scale),
            None => {
                let known = robot.joint_parameter(symbol, joint).map_or(1.0, |spec| spec.value.start.abs());
                Drive::Known(known * robot.input.scale)
            }
        }
    }

    /// Torque of one unit of input, without its sign, where the dynamics have these physical values.
    pub(crate) fn per_input(self, physical: &[f64]) -> f64 {
        match self {
            Drive::Known(torque) => torque,
            Drive::Free(i, scale) => physical[i].abs() * scale,
        }
    }
}

impl RobotScale {
    pub(crate) fn of(robot: &Robot, model: &Model) -> Self {
        let drive = |joint: usize| Drive::of(robot, model, joint);
        let gravity = robot.gravity_m_s2.iter().map(|g| g * g).sum::<f64>().sqrt();
        let rigid = robot.joints.iter().all(|joint| joint.transmission == Transmission::Rigid);
        RobotScale { gravity, drives: (0..robot.joints.len()).map(drive).collect(), rigid }
    }

    /// Whether sizes are those of the motion. Where joints have springs they are the start values, since a stiffness that runs away takes its size along.
    pub(crate) fn is_of_motion(&self) -> bool {
        self.rigid
    }

    /// How large each coordinate of the base model is taken to be before a motion is judged; not a number where nothing is known of it.
    pub(crate) fn guesses(&self, model: &Model, series: &Series, point: &Point<'_>) -> Vec<f64> {
        if self.rigid {
            return self.sizes(model, series, point);
        }
        let start = |c: &Coordinate| if c.spec.value.start == 0.0 { f64::NAN } else { c.spec.value.start.abs() };
        model.coordinates().iter().map(start).collect()
    }

    /// The size of every coordinate of the base model, in the physical parameter's unit; not a number where the motion has none.
    pub(crate) fn sizes(&self, model: &Model, series: &Series, point: &Point<'_>) -> Vec<f64> {
        let coordinates = model.coordinates();
        let physical = coordinates.to_physical(&point.z);
        let motions = self.drives.iter().enumerate();
        let motions: Vec<Motion> =
            motions.map(|(i, drive)| motion(model, series, point, (i, drive.per_input(&physical)))).collect();
        let of = |(i, coordinate): (usize, &Coordinate)| {
            let joints = &coordinate.spec.joints;
            let over =
                |of: fn(&Motion) -> f64| joints.iter().map(|&joint| of(&motions[joint]).powi(2)).sum::<f64>().sqrt();
            let torque = over(|motion| motion.torque);
            let size = match coordinate.spec.symbol {
                Symbol::Mu | Symbol::O => torque / (joints.len().max(1) as f64).sqrt(),
                Symbol::V | Symbol::KMi => torque / over(|motion| motion.speed),
                Symbol::B | Symbol::J => torque / over(|motion| motion.acceleration),
                Symbol::FirstMoment { .. } if self.gravity > 0.0 => torque / self.gravity,
                Symbol::FirstMoment { .. } => torque / over(|motion| motion.acceleration),
                Symbol::KPwm | Symbol::KT | Symbol::KS | Symbol::DS => physical[i].abs(),
                // What turns readings has no torque.
                _ => f64::NAN,
            };
            if size.is_finite() && size > 0.0 { size } else { f64::NAN }
        };
        coordinates.iter().enumerate().map(of).collect()
    }
}

/// The motion of a joint whose torque is so much for one unit of input.
fn motion(model: &Model, series: &Series, point: &Point<'_>, (joint, per_input): (usize, f64)) -> Motion {
    let layout = model.layout();
    let speed = |k: usize| point.state(k)[layout.thetad(joint)];
    let apart = ((ACCELERATION_OVER_S / series.period_s).round() as usize).max(1);
    let (mut inputs, mut speeds, mut accelerations, mut differences) = (0.0, 0.0, 0.0, 0usize);
    for run in &series.segments {
        for k in run.clone() {
            inputs += series.input(k)[joint].powi(2);
            speeds += speed(k).powi(2);
        }
        for k in run.clone().step_by(apart).filter(|k| k + apart < run.end) {
            let over_s = series.time_s(k + apart) - series.time_s(k);
            accelerations += ((speed(k + apart) - speed(k)) / over_s).powi(2);
            differences += 1;
        }
    }
    let samples = series.stages().max(1) as f64;
    Motion {
        torque: per_input * (inputs / samples).sqrt(),
        speed: (speeds / samples).sqrt(),
        acceleration: (accelerations / differences.max(1) as f64).sqrt(),
    }
}
