//! Mistakes of wiring and assembly: the firmware is built for another robot than the one that stands there.
//!
//! ```text
//!   duty of joint j ─▶ leads, motors ─▶ plant ─┬─▶ counts per turn, gear ─▶ phases, order ─▶ counters
//!                                              └─▶ mounting of gyros ──────────────────────▶ chips
//! ```

use std::str::FromStr;

use protocol::{MAX_ENCODERS, MAX_GYROS, MAX_JOINTS};

use super::SimulateError;
use crate::robot::Robot;

/// A mistake. Joints, encoders (in the order of the samples) and gyros are counted from 0.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Mistake {
    /// Two encoders are plugged in at each other's place: `encoders-swapped=1+2`.
    EncodersSwapped(usize, usize),
    /// Two motors are connected to each other's driver: `motors-swapped=1+2`.
    MotorsSwapped(usize, usize),
    /// The phases of an encoder are swapped: `encoder-reversed=1`.
    EncoderReversed(usize),
    /// The leads of a motor are swapped: `leads-reversed=1`.
    LeadsReversed(usize),
    /// One phase of an encoder is open, and its count goes to and fro by one: `encoder-phase=1`.
    EncoderPhase(usize),
    /// An encoder has so many times the counts: `counts=1*0.5`.
    Counts(usize, f64),
    /// A gear has so many times its ratio, as far as the encoder tells: `gear=1*0.7`. Torques stay as they are.
    Gear(usize, f64),
    /// A gyro is turned by 90° about one of its axes: `gyro-turned=2z`.
    GyroTurned(usize, usize),
    /// An axis of a gyro has the wrong sign: `gyro-mirrored=2z`.
    GyroMirrored(usize, usize),
}

impl FromStr for Mistake {
    type Err = SimulateError;

    fn from_str(text: &str) -> Result<Self, SimulateError> {
        let forms = "encoders-swapped=1+2, motors-swapped=1+2, encoder-reversed=1, leads-reversed=1, encoder-phase=1, \
                     counts=1*0.5, gear=1*0.7, gyro-turned=2z or gyro-mirrored=2z";
        let wrong = || SimulateError::option("mistake", text, forms);
        let index = |text: &str, most: usize| -> Result<usize, SimulateError> {
            let number: usize = text.parse().map_err(|_| wrong())?;
            if (1..=most).contains(&number) { Ok(number - 1) } else { Err(wrong()) }
        };
        let two = |text: &str, most| -> Result<(usize, usize), SimulateError> {
            let (a, b) = text.split_once('+').ok_or_else(wrong)?;
            Ok((index(a, most)?, index(b, most)?))
        };
        let times = |text: &str| -> Result<(usize, f64), SimulateError> {
            let (a, b) = text.split_once('*').ok_or_else(wrong)?;
            let factor: f64 = b.parse().map_err(|_| wrong())?;
            if !(0.01..=100.0).contains(&factor) {
                return Err(wrong());
            }
            Ok((index(a, MAX_ENCODERS)?, factor))
        };
        let axis = |text: &str| -> Result<(usize, usize), SimulateError> {
            let (axis, name) = ["x", "y", "z"]
                .iter()
                .enumerate()
                .find_map(|(axis, name)| Some((axis, text.strip_suffix(name)?)))
                .ok_or_else(wrong)?;
            Ok((index(name, MAX_GYROS)?, axis))
        };
        let (kind, value) = text.split_once('=').ok_or_else(wrong)?;
        Ok(match kind {
            "encoders-swapped" => two(value, MAX_ENCODERS).map(|(a, b)| Self::EncodersSwapped(a, b))?,
            "motors-swapped" => two(value, MAX_JOINTS).map(|(a, b)| Self::MotorsSwapped(a, b))?,
            "encoder-reversed" => Self::EncoderReversed(index(value, MAX_ENCODERS)?),
            "leads-reversed" => Self::LeadsReversed(index(value, MAX_JOINTS)?),
            "encoder-phase" => Self::EncoderPhase(index(value, MAX_ENCODERS)?),
            "counts" => times(value).map(|(encoder, factor)| Self::Counts(encoder, factor))?,
            "gear" => times(value).map(|(encoder, factor)| Self::Gear(encoder, factor))?,
            "gyro-turned" => axis(value).map(|(gyro, axis)| Self::GyroTurned(gyro, axis))?,
            "gyro-mirrored" => axis(value).map(|(gyro, axis)| Self::GyroMirrored(gyro, axis))?,
            _ => return Err(wrong()),
        })
    }
}

impl Mistake {
    /// Whether the robot has the parts that it is about.
    ///
    /// # Errors
    /// [`SimulateError::Unsuited`] that names the part.
    pub(super) fn suits(&self, robot: &Robot, encoders: usize) -> Result<(), SimulateError> {
        let (what, last, there) = match *self {
            Self::EncodersSwapped(a, b) => ("encoder", a.max(b), encoders),
            Self::EncoderReversed(a) | Self::EncoderPhase(a) | Self::Counts(a, _) | Self::Gear(a, _) => {
                ("encoder", a, encoders)
            }
            Self::MotorsSwapped(a, b) => ("motor", a.max(b), robot.joints.len()),
            Self::LeadsReversed(a) => ("motor", a, robot.joints.len()),
            Self::GyroTurned(gyro, _) | Self::GyroMirrored(gyro, _) => ("gyro", gyro, robot.gyros().count()),
        };
        if last < there {
            return Ok(());
        }
        let reason = format!("a mistake is about {what} {}, and {} has {there}", last + 1, robot.name);
        Err(SimulateError::Unsuited { reason })
    }

    /// By how much more an encoder counts.
    pub(super) fn counts_factor(&self, encoder: usize) -> f64 {
        match *self {
            Self::Counts(which, factor) | Self::Gear(which, factor) if which == encoder => factor,
            _ => 1.0,
        }
    }

    /// What the motors get of the duties of the joints.
    pub(super) fn drives(&self, duty: &mut [f64]) {
        match *self {
            Self::MotorsSwapped(a, b) => duty.swap(a, b),
            Self::LeadsReversed(a) => duty[a] = -duty[a],
            _ => {}
        }
    }

    /// What the hardware counters show of the counts.
    pub(super) fn counts(&self, counters: &mut [u16; MAX_ENCODERS]) {
        match *self {
            Self::EncodersSwapped(a, b) => counters.swap(a, b),
            Self::EncoderReversed(a) => counters[a] = counters[a].wrapping_neg(),
            Self::EncoderPhase(a) => counters[a] &= 1,
            _ => {}
        }
    }

    /// What a gyro measures of a rate in the axes that it should have.
    pub(super) fn measures(&self, gyro: usize, rate: &mut [f64; 3]) {
        match *self {
            Self::GyroTurned(which, axis) if which == gyro => {
                let (a, b) = ((axis + 1) % 3, (axis + 2) % 3);
                (rate[a], rate[b]) = (rate[b], -rate[a]);
            }
            Self::GyroMirrored(which, axis) if which == gyro => rate[axis] = -rate[axis],
            _ => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_not_understood_is_refused_with_the_forms() {
        assert_eq!("encoders-swapped=1+3".parse::<Mistake>().unwrap(), Mistake::EncodersSwapped(0, 2));
        assert_eq!("gyro-turned=2z".parse::<Mistake>().unwrap(), Mistake::GyroTurned(1, 2));
        assert_eq!("counts=1*0.5".parse::<Mistake>().unwrap(), Mistake::Counts(0, 0.5));
        for text in ["encoder-reversed=0", "gear=1", "gear=1*0", "gyro-turned=2", "leads-reversed=8", "phase=1", "x"] {
            let error = text.parse::<Mistake>().unwrap_err().to_string();
            assert!(error.contains(text) && error.contains("encoders-swapped=1+2"), "{error}");
        }
        let robot = Robot::builtin("one_joint").unwrap();
        let error = Mistake::EncodersSwapped(0, 1).suits(&robot, 1).unwrap_err().to_string();
        assert!(error.contains("encoder 2") && error.contains("has 1"), "{error}");
    }

    /// A turn by 90° about z: what was along x is along −y.
    #[test]
    fn a_turned_gyro_measures_the_same_rate_in_other_axes() {
        let mut rate = [1.0, 2.0, 3.0];
        Mistake::GyroTurned(0, 2).measures(0, &mut rate);
        assert_eq!(rate, [2.0, -1.0, 3.0]);
        Mistake::GyroTurned(0, 2).measures(1, &mut rate);
        assert_eq!(rate, [2.0, -1.0, 3.0]);
    }
}
