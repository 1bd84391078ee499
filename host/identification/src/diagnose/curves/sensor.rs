//! Curves on what sensors read: a position sensor's by its position or speed (of another time), a gyro's axes by their own rate or by time.

use super::super::curves::shapeless::{Argument, Curve, ID};
use super::spline::{self, Knots};
use crate::model::Number;
use crate::model::law::{Broad, GyroAt, Law, Narrow, Of, Parameters, PositionAt};
use crate::robot::Side;

/// One smooth curve a sensor.
#[derive(Debug, Clone)]
pub struct SensorCurve {
    parameters: Parameters,
    argument: Argument,
    of: Sensors,
}

#[derive(Debug, Clone)]
enum Sensors {
    Positions {
        side: Side,
        curves: Vec<Option<Curve>>,
    },
    /// By (gyro, axis).
    Gyros(Vec<((usize, usize), Knots)>),
}

impl SensorCurve {
    /// On the position sensors of one side of the joints that have a curve.
    pub fn of_positions(side: Side, argument: Argument, curves: Vec<Option<Curve>>) -> Self {
        let mut parameters = Parameters::new(ID);
        for (joint, curve) in curves.iter().enumerate() {
            for i in 0..curve.as_ref().map_or(0, Curve::coefficients) {
                parameters.plain(&format!("c{i}"), "rad", Of::Joint(joint), 0.0);
            }
        }
        SensorCurve { parameters, argument, of: Sensors::Positions { side, curves } }
    }

    /// On these axes of gyros.
    pub fn of_gyros(argument: Argument, axes: Vec<((usize, usize), Knots)>) -> Self {
        let mut parameters = Parameters::new(ID);
        for ((gyro, axis), _) in &axes {
            for i in 0..spline::COEFFICIENTS {
                parameters.plain(&format!("c{i}"), "rad/s", Of::GyroAxis(*gyro, *axis), 0.0);
            }
        }
        SensorCurve { parameters, argument, of: Sensors::Gyros(axes) }
    }
}

impl Law for SensorCurve {
    fn parameters(&self) -> &Parameters {
        &self.parameters
    }

    fn sees_position(&self, side: Side, joint: usize) -> bool {
        matches!(&self.of, Sensors::Positions { side: own, curves } if *own == side && curves[joint].is_some())
    }

    fn position(&self, at: &PositionAt<'_, Narrow>, position: Narrow) -> Narrow {
        let Sensors::Positions { curves, .. } = &self.of else { return position };
        let Some(curve) = &curves[at.joint] else { return position };
        let x = match self.argument {
            Argument::MotorSpeed | Argument::LinkSpeed => at.speed,
            _ => position,
        };
        let mut sum = position;
        curve.each(x.re(), |i, value, slope| sum += at.parameters[i] * x.through(value, slope));
        sum
    }

    fn sees_gyro(&self, gyro: usize) -> bool {
        matches!(&self.of, Sensors::Gyros(axes) if axes.iter().any(|((own, _), _)| *own == gyro))
    }

    fn gyro(&self, at: &GyroAt<'_, Broad>, rate: [Broad; 3], bias: [Broad; 3]) -> [Broad; 3] {
        let mut reading: [Broad; 3] = std::array::from_fn(|axis| rate[axis] + bias[axis]);
        let Sensors::Gyros(axes) = &self.of else { return reading };
        for (place, ((_, axis), knots)) in axes.iter().filter(|((gyro, _), _)| *gyro == at.gyro).enumerate() {
            let x = match self.argument {
                Argument::Time => at.time_s,
                _ => reading[*axis],
            };
            for (i, value, slope) in knots.basis(x.re()) {
                let coefficient = at.parameters[place * spline::COEFFICIENTS + i];
                reading[*axis] += coefficient * x.through(value, slope);
            }
        }
        reading
    }
}
