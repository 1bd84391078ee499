//! What sensors read where it is not the state itself: laws of effects change it, or an encoder counts from elsewhere; with the derivatives.

use nalgebra::{Matrix3, Vector3};

use crate::model::law::{Broad, GyroAt, Narrow, Of, PositionAt};
use crate::model::parameters::Source;
use crate::model::{Expression, Model, variable};
use crate::robot::Side;
use crate::robot::chain::Lanes;

/// Which laws change which sensors, and by which coordinates.
#[derive(Debug, Clone, Default)]
pub struct SensorLaws {
    /// By gyro: (law, its coordinates among all).
    gyros: Vec<Vec<(usize, Vec<usize>)>>,
    positions: Vec<OfPosition>,
}

#[derive(Debug, Clone)]
struct OfPosition {
    joint: usize,
    side: Side,
    laws: Vec<(usize, Vec<usize>)>,
    /// What it reads at zero.
    zero: Source,
    /// By what share of the position it reads too much.
    scale_error: Source,
}

/// The reading of a position sensor.
#[derive(Debug, Clone, PartialEq)]
pub struct PositionReading {
    /// rad or m.
    pub value: f64,
    /// By the position and the speed of its side.
    pub slopes: [f64; 2],
    /// (coordinate, derivative).
    pub by_z: Vec<(usize, f64)>,
}

/// The reading of a gyro.
#[derive(Debug, Clone, PartialEq)]
pub struct GyroReading {
    /// rad/s, sensor axes.
    pub value: Vector3<f64>,
    /// Gradients of each axis by the rate and by the bias.
    pub by_rate: [Vector3<f64>; 3],
    /// See the rate.
    pub by_bias: [Vector3<f64>; 3],
    /// (coordinate, derivative of each axis).
    pub by_z: Vec<(usize, [f64; 3])>,
}

impl OfPosition {
    /// Whether it reads the position itself.
    fn is_plain(&self) -> bool {
        self.laws.is_empty() && [self.zero, self.scale_error] == [Source::Known(0.0); 2]
    }
}

impl SensorLaws {
    /// Of the laws of `model`, a robot with so many gyros.
    pub fn of(model: &Model, gyros: usize) -> Self {
        let (laws, coordinates) = (model.laws(), model.coordinates());
        let all = |law: usize, wanted: &dyn Fn(Of) -> bool| -> Vec<usize> {
            let own = laws[law].parameters().of(wanted);
            own.into_iter().map(|own| coordinates.first_of_law(law) + own).collect()
        };
        let of_gyro = |gyro: usize| {
            let seeing = (0..laws.len()).filter(|&law| laws[law].sees_gyro(gyro));
            let mine = move |of| match of {
                Of::All => true,
                Of::Gyro(g) | Of::GyroAxis(g, _) => g == gyro,
                _ => false,
            };
            seeing.map(|law| (law, all(law, &mine))).collect()
        };
        let sides = (0..model.layout().joints()).flat_map(|joint| [(joint, Side::Motor), (joint, Side::Link)]);
        let positions = sides.map(|(joint, side)| {
            let seeing = (0..laws.len()).filter(|&law| laws[law].sees_position(side, joint));
            let mine = |of| of == Of::All || of == Of::Joint(joint);
            let [zero, scale_error] =
                if side == Side::Link { model.link_readings[joint] } else { [Source::Known(0.0); 2] };
            OfPosition { joint, side, laws: seeing.map(|law| (law, all(law, &mine))).collect(), zero, scale_error }
        });
        SensorLaws {
            gyros: (0..gyros).map(of_gyro).collect(),
            positions: positions.filter(|of| !of.is_plain()).collect(),
        }
    }

    /// Whether a position sensor reads anything but the position.
    pub fn see_position(&self, side: Side, joint: usize) -> bool {
        self.at(side, joint).is_some()
    }

    /// Whether any sensor reads anything but what it is there for.
    pub fn see_any(&self) -> bool {
        !self.positions.is_empty() || self.gyros.iter().any(|laws| !laws.is_empty())
    }

    /// Whether a law changes what a gyro reads of its rate.
    pub fn see_gyro(&self, gyro: usize) -> bool {
        !self.gyros[gyro].is_empty()
    }

    fn at(&self, side: Side, joint: usize) -> Option<&OfPosition> {
        self.positions.iter().find(|of| of.joint == joint && of.side == side)
    }

    /// What a position sensor reads of a joint's side at `position`, with its speed; `shifted_s` as in [`PositionAt`].
    pub fn position(
        &self,
        model: &Model,
        z: &[f64],
        (side, joint): (Side, usize),
        [position, speed]: [f64; 2],
        shifted_s: f64,
    ) -> PositionReading {
        let mut reading = PositionReading { value: position, slopes: [1.0, 0.0], by_z: Vec::new() };
        let Some(of) = self.at(side, joint) else { return reading };
        for (law, own) in &of.laws {
            let parameters = variables(own, z, 2);
            let at = PositionAt { joint, side, speed: variable(speed, 1), shifted_s, parameters: &parameters };
            let read: Narrow = model.laws()[*law].position(&at, variable(reading.value, 0));
            // The chain rule: each law reads what the one before it has read.
            let [by_reading, by_speed, by_own @ ..] = read.slope;
            reading.value = read.re;
            reading.slopes = [by_reading * reading.slopes[0], by_reading * reading.slopes[1] + by_speed];
            reading.by_z.iter_mut().for_each(|(_, slope)| *slope *= by_reading);
            reading.by_z.extend(own.iter().copied().zip(by_own));
        }
        let value = |source: Source| match source {
            Source::Free { coordinate, .. } => (Some(coordinate), z[coordinate]),
            Source::Known(value) => (None, value),
        };
        let ((scale_of, scale_error), (zero_of, zero)) = (value(of.scale_error), value(of.zero));
        let by_scale = reading.value;
        reading.value = by_scale * (1.0 + scale_error) + zero;
        reading.slopes.iter_mut().for_each(|slope| *slope *= 1.0 + scale_error);
        reading.by_z.iter_mut().for_each(|(_, slope)| *slope *= 1.0 + scale_error);
        reading.by_z.extend(scale_of.map(|coordinate| (coordinate, by_scale)));
        reading.by_z.extend(zero_of.map(|coordinate| (coordinate, 1.0)));
        reading
    }

    /// What a position sensor reads of a joint's side, written down.
    pub fn traced_position(
        &self,
        model: &Model,
        z: &[Expression],
        (side, joint): (Side, usize),
        [position, speed]: [Expression; 2],
    ) -> Expression {
        let Some(of) = self.at(side, joint) else { return position };
        let mut reading = position;
        for (law, own) in &of.laws {
            let parameters: Vec<_> = own.iter().map(|own| z[*own]).collect();
            let at = PositionAt { joint, side, speed, shifted_s: 0.0, parameters: &parameters };
            let read = model.laws()[*law].position_traced(&at, reading);
            reading = read.unwrap_or_else(Expression::unknown);
        }
        reading * (Expression::from(1.0) + of.scale_error.value(z)) + of.zero.value(z)
    }

    /// What a gyro reads at this rate and bias, in sensor axes, written down.
    pub fn traced_gyro(
        &self,
        model: &Model,
        z: &[Expression],
        (gyro, time_s): (usize, Expression),
        rate: [Expression; 3],
        bias: [Expression; 3],
    ) -> [Expression; 3] {
        let (mut seen, mut left) = (rate, bias);
        for (law, own) in &self.gyros[gyro] {
            let parameters: Vec<_> = own.iter().map(|own| z[*own]).collect();
            let at = GyroAt { gyro, time_s, parameters: &parameters };
            let read = model.laws()[*law].gyro_traced(&at, seen, left);
            (seen, left) = (read.unwrap_or([Expression::unknown(); 3]), [Expression::from(0.0); 3]);
        }
        std::array::from_fn(|axis| seen[axis] + left[axis])
    }

    /// What a gyro reads at this rate and bias, rad/s in sensor axes, `time_s` after the start of the motion.
    pub fn gyro(
        &self,
        model: &Model,
        z: &[f64],
        (gyro, time_s): (usize, f64),
        rate: Vector3<f64>,
        bias: Vector3<f64>,
    ) -> GyroReading {
        let (mut seen, mut left) = (rate, bias);
        let (mut by_rate, mut by_bias) = (Matrix3::identity(), Matrix3::zeros());
        let mut by_left = Matrix3::identity();
        let mut by_z: Vec<(usize, [f64; 3])> = Vec::new();
        for (law, own) in &self.gyros[gyro] {
            let parameters = variables(own, z, 6);
            let at = GyroAt { gyro, time_s: Broad::from(time_s), parameters: &parameters };
            let rate: [Broad; 3] = std::array::from_fn(|axis| variable(seen[axis], axis));
            let rest: [Broad; 3] = std::array::from_fn(|axis| variable(left[axis], 3 + axis));
            let read = model.laws()[*law].gyro(&at, rate, rest);
            // The chain rule: what one law reads is the rate of the next, its bias included.
            let by = |first: usize| Matrix3::from_fn(|row, column| read[row].slope[first + column]);
            (by_rate, by_bias) = (by(0) * by_rate, by(0) * by_bias + by(3) * by_left);
            for (_, slope) in &mut by_z {
                *slope = (by(0) * Vector3::from(*slope)).into();
            }
            by_z.extend(own.iter().enumerate().map(|(i, z)| (*z, read.map(|axis| axis.slope[6 + i]))));
            seen = Vector3::from(read.map(|axis| axis.re));
            (left, by_left) = (Vector3::zeros(), Matrix3::zeros());
        }
        let rows = |by: Matrix3<f64>| std::array::from_fn(|axis| by.row(axis).transpose());
        GyroReading { value: seen + left, by_rate: rows(by_rate), by_bias: rows(by_bias + by_left), by_z }
    }
}

/// Coordinates as variables from lane `first` on.
fn variables<const N: usize>(coordinates: &[usize], z: &[f64], first: usize) -> Vec<Lanes<N>> {
    coordinates.iter().enumerate().map(|(i, own)| variable(z[*own], first + i)).collect()
}
