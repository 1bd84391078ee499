//! What sensors read where it is not the state itself: laws of effects change it, or an encoder counts from elsewhere; with the derivatives.

use nalgebra::Vector3;

use super::law::{Broad, GyroAt, Narrow, Of, PositionAt};
use super::parameters::Source;
use super::{Model, variable};
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
        let mut reading: Narrow = variable(position, 0);
        let (mut lane, mut coordinates) = (2, Vec::new());
        for (law, own) in self.at(side, joint).map_or(&[][..], |of| &of.laws) {
            let parameters = variables(own, z, &mut lane);
            let at = PositionAt { joint, side, speed: variable(speed, 1), shifted_s, parameters: &parameters };
            reading = model.laws()[*law].position(&at, reading);
            coordinates.extend(own.iter().copied());
        }
        let mut known = |source: Source| match source {
            Source::Free { coordinate, .. } => {
                coordinates.push(coordinate);
                variables(&[coordinate], z, &mut lane)[0]
            }
            Source::Known(value) => Narrow::from(value),
        };
        if let Some(of) = self.at(side, joint) {
            let (scale_error, zero) = (known(of.scale_error), known(of.zero));
            reading = reading * (Narrow::from(1.0) + scale_error) + zero;
        }
        let [by_position, by_speed, by_z @ ..] = reading.slope;
        PositionReading {
            value: reading.re,
            slopes: [by_position, by_speed],
            by_z: coordinates.into_iter().zip(by_z).collect(),
        }
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
        let mut seen: [Broad; 3] = std::array::from_fn(|axis| variable(rate[axis], axis));
        let mut left: [Broad; 3] = std::array::from_fn(|axis| variable(bias[axis], 3 + axis));
        let (mut lane, mut coordinates) = (6, Vec::new());
        for (law, own) in &self.gyros[gyro] {
            let parameters = variables(own, z, &mut lane);
            let at = GyroAt { gyro, time_s, parameters: &parameters };
            // What one law reads is the rate of the next, its bias included.
            seen = model.laws()[*law].gyro(&at, seen, left);
            left = [Broad::from(0.0); 3];
            coordinates.extend(own.iter().copied());
        }
        let reading: [Broad; 3] = std::array::from_fn(|axis| seen[axis] + left[axis]);
        let gradient = |first: usize| reading.map(|r| Vector3::from_column_slice(&r.slope[first..first + 3]));
        let by_z = coordinates.into_iter().enumerate().map(|(i, z)| (z, reading.map(|r| r.slope[6 + i])));
        GyroReading {
            value: Vector3::from(reading.map(|r| r.re)),
            by_rate: gradient(0),
            by_bias: gradient(3),
            by_z: by_z.collect(),
        }
    }
}

/// Coordinates as variables from lane `next` on.
fn variables<const N: usize>(coordinates: &[usize], z: &[f64], next: &mut usize) -> Vec<Lanes<N>> {
    let variables = coordinates.iter().map(|&i| {
        *next += 1;
        variable(z[i], *next - 1)
    });
    variables.collect()
}
