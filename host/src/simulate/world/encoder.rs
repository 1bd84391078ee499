//! A quadrature encoder on a 16-bit hardware counter.

use std::f64::consts::TAU;

use protocol::{EncoderInfo, Side};

use crate::robot::{JointKind, Robot, Sensor};
use crate::simulate::noise::Noise;

/// An encoder: what it sits on, its scale, its noise.
#[derive(Debug, Clone)]
pub struct EncoderChip {
    /// What the firmware is told of it.
    pub info: EncoderInfo,
    counts_per_unit: f64,
    /// Mechanical noise before quantisation, rad or m of the link.
    sigma: f64,
}

impl EncoderChip {
    /// The robot's encoders as the firmware lists them: motor side of the joints in order, then link side.
    ///
    /// # Errors
    /// The number (from 1) of the joint whose encoder has no counts in the description.
    pub fn of_robot(robot: &Robot) -> Result<Vec<Self>, usize> {
        let mut chips = Vec::new();
        for side in [Side::Motor, Side::Link] {
            for joint in 0..robot.joints.len() {
                let wanted = |sensor: &&Sensor| match sensor {
                    Sensor::MotorEncoder(encoder) => side == Side::Motor && encoder.joint == joint,
                    Sensor::LinkEncoder(encoder) => side == Side::Link && encoder.joint == joint,
                    _ => false,
                };
                let (Some(Sensor::MotorEncoder(encoder)) | Some(Sensor::LinkEncoder(encoder))) =
                    robot.sensors.iter().find(wanted)
                else {
                    continue;
                };
                let counts = encoder.counts_per_turn.ok_or(joint + 1)?;
                let counts_per_turn = i32::try_from(counts).map_err(|_| joint + 1)?;
                let gear = match (side, robot.joints[joint].kind) {
                    (Side::Motor, _) => robot.joints[joint].gear,
                    (Side::Link, JointKind::Revolute) => 1.0,
                    (Side::Link, JointKind::Prismatic) => return Err(joint + 1),
                };
                let counts_per_unit = f64::from(counts) * gear / TAU;
                let step = 1.0 / counts_per_unit;
                chips.push(Self {
                    // The layout bounds the joints; 255 of them do not exist.
                    info: EncoderInfo {
                        joint: joint as u8,
                        side,
                        counts_per_turn,
                        gear,
                        offset_us: (encoder.offset_s * 1e6).round() as u16,
                    },
                    counts_per_unit,
                    // sigma² = mechanical² + step²/12
                    sigma: (encoder.sigma.powi(2) - step * step / 12.0).max(0.0).sqrt(),
                });
            }
        }
        Ok(chips)
    }

    /// It counts so many times as much as the firmware is told.
    pub fn count_more(&mut self, factor: f64) {
        self.counts_per_unit *= factor;
    }

    /// The hardware counter at a position (rad or m on the link side), counted from `start`; it wraps at 2¹⁶.
    pub fn counter(&self, position: f64, start: i64, noise: &mut Noise) -> u16 {
        self.counts(position + noise.draw_once_moved(self.sigma)).wrapping_sub(start) as u16
    }

    /// Whole counts at a position, without noise and wrap.
    pub fn counts(&self, position: f64) -> i64 {
        (position * self.counts_per_unit).round() as i64
    }
}

#[cfg(test)]
mod tests {
    use firmware::driver::QuadratureCounter;

    use super::*;

    /// Doggy's encoder over the wrap of its counter: the error is the paper's, mechanical noise and quantisation together.
    #[test]
    fn the_error_is_that_of_the_description() {
        let robot = Robot::builtin("doggy").unwrap();
        let chips = EncoderChip::of_robot(&robot).unwrap();
        assert_eq!(chips.len(), 3);
        let chip = &chips[1];
        assert!((chip.sigma - 5.50e-5).abs() < 1e-8, "mechanical noise {}", chip.sigma);
        let mut noise = Noise::new(1);
        // Before the first motion nothing shakes: the counter starts at exactly zero.
        let mut counter = QuadratureCounter::new(chip.counter(0.0, 0, &mut noise));
        noise.begin_motion();
        let (mut sum, samples) = (0.0, 100_000);
        for k in 0..samples {
            // ±20 rad are ±137,000 counts: the 16 bits wrap several times.
            let position = 20.0 * (f64::from(k) * 1e-4).sin();
            let counts = f64::from(counter.update(chip.counter(position, 0, &mut noise)));
            let error = counts / chip.counts_per_unit - position;
            sum += error * error;
        }
        let rms = (sum / f64::from(samples)).sqrt();
        assert!((rms / 6.9259e-5 - 1.0).abs() < 0.02, "{rms:e}");
    }
}
