//! What is true of a simulated robot: one value for every parameter of its description.

use nalgebra::{Rotation3, Vector3};
use rand::{Rng, RngExt};

use crate::effect::TrueValue;
use crate::robot::{Matrix3, Robot, Symbol};

/// Spread of the free parameters around what the description says of simulated robots.
pub(super) const SPREAD: f64 = 0.15;
/// How far a gyro is turned away from its nominal rotation, degrees.
const MISALIGNMENT_DEG: std::ops::Range<f64> = 1.0..4.0;

/// The true parameters of a robot, in the order of [`Robot::parameters`].
#[derive(Debug, Clone, PartialEq)]
pub struct Truth {
    values: Vec<f64>,
}

impl Truth {
    /// A robot of its own: a value for each of [`Robot::parameters`], in their order.
    pub fn of(values: Vec<f64>) -> Self {
        Self { values }
    }

    /// The values, in the order of [`Robot::parameters`].
    pub fn as_slice(&self) -> &[f64] {
        &self.values
    }

    /// The average simulated robot of this description, with its gyros mounted exactly.
    pub fn nominal(robot: &Robot) -> Self {
        Self { values: robot.parameters().iter().map(|spec| spec.value.simulated).collect() }
    }

    /// A robot of its own: free parameters within ±15 %, gyros turned by 1 to 4 degrees about an axis of their own.
    /// What the description says is known stays as it is.
    pub fn drawn(robot: &Robot, rng: &mut impl Rng) -> Self {
        let mut truth = Self::nominal(robot);
        for (spec, value) in robot.parameters().iter().zip(&mut truth.values) {
            // Drawn for every parameter, so that fixing one does not change the others.
            let factor = rng.random_range(1.0 - SPREAD..1.0 + SPREAD);
            if spec.value.free {
                *value *= factor;
            }
        }
        for (gyro, sensor) in robot.gyros().enumerate() {
            let direction = isotropic(rng);
            let angle = rng.random_range(MISALIGNMENT_DEG).to_radians();
            if sensor.rotation_free {
                for axis in 0..3 {
                    truth.set(robot, Symbol::Misalignment { gyro, axis }, 0, direction[axis] * angle);
                }
            }
        }
        truth
    }

    /// The value of `symbol` at `joint` (0-based; any for sensors), if the robot has it.
    pub fn get(&self, robot: &Robot, symbol: Symbol, joint: usize) -> Option<f64> {
        index(robot, symbol, joint).map(|i| self.values[i])
    }

    /// Sets the value of `symbol` at `joint`, and with it at all joints that share it. Says whether the robot has it.
    pub fn set(&mut self, robot: &Robot, symbol: Symbol, joint: usize, value: f64) -> bool {
        let found = index(robot, symbol, joint);
        if let Some(i) = found {
            self.values[i] = value;
        }
        found.is_some()
    }

    /// The true bias of a gyro, rad/s.
    pub fn bias(&self, robot: &Robot, gyro: usize) -> [f64; 3] {
        [0, 1, 2].map(|axis| self.get(robot, Symbol::Bias { gyro, axis }, 0).unwrap_or(0.0))
    }

    /// The true rotation of a gyro, body axes → sensor axes: nominal · Rot(δ) as in equation (16).
    pub fn rotation(&self, robot: &Robot, gyro: usize) -> Matrix3 {
        let delta = [0, 1, 2].map(|axis| self.get(robot, Symbol::Misalignment { gyro, axis }, 0).unwrap_or(0.0));
        let turned = Rotation3::from_scaled_axis(Vector3::from(delta));
        let Some(sensor) = robot.gyros().nth(gyro) else {
            return std::array::from_fn(|i| std::array::from_fn(|j| turned[(i, j)]));
        };
        std::array::from_fn(|i| {
            std::array::from_fn(|j| (0..3).map(|k| sensor.rotation[i][k] * turned[(k, j)]).sum::<f64>())
        })
    }

    /// Every value with the name and unit that results use.
    pub fn values(&self, robot: &Robot) -> Vec<TrueValue> {
        let named = robot.parameters().iter().zip(&self.values);
        named.map(|(spec, value)| TrueValue { name: spec.name.clone(), unit: spec.unit, value: *value }).collect()
    }
}

fn index(robot: &Robot, symbol: Symbol, joint: usize) -> Option<usize> {
    let of_sensor = matches!(symbol, Symbol::Bias { .. } | Symbol::Misalignment { .. });
    robot.parameters().iter().position(|spec| spec.symbol == symbol && (of_sensor || spec.joints.contains(&joint)))
}

/// A direction without preference: a point of the unit ball, tried until one is neither outside nor too near 0.
fn isotropic(rng: &mut impl Rng) -> [f64; 3] {
    loop {
        let point: [f64; 3] = std::array::from_fn(|_| rng.random_range(-1.0..1.0));
        let length = point.iter().map(|c| c * c).sum::<f64>().sqrt();
        if (0.1..1.0).contains(&length) {
            return point.map(|c| c / length);
        }
    }
}
