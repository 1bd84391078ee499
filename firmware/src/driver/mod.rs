//! Sensor drivers: register level, over the bus traits of `embedded-hal` 1.0.
//!
//! ```text
//!   bus words ── decode ──▶ GyroReading { raw: [i16; 3], fresh } ──▶ tick
//! ```
//!
//! A driver has two halves. `new` resets and configures the part, with delays, before the loop runs. The
//! read of a tick is one burst, whose request and decoding are also public as pure functions
//! (`READ_REQUEST`, `decode`): a board that lets DMA move the bytes needs only those.
//!
//! In a tick: `inputs.gyros[0] = imu1.read().into()` and `inputs.encoders[0] = Some(counter.update(timer.count()))`.
//!
//! Both parts run faster than the tick and are low-pass filtered below half the tick rate, so that every
//! tick finds a new word and nothing aliases; a word is at most one sensor period old.

mod bmi323;
#[cfg(test)]
mod fake;
mod icm42688p;
mod quadrature;

pub use bmi323::{BURST as BMI323_BURST, Bmi323, OUTPUT_RATE_HZ as BMI323_RATE_HZ, READ_US as BMI323_READ_US};
pub use icm42688p::{
    BURST as ICM42688P_BURST, Icm42688p, OUTPUT_RATE_HZ as ICM42688P_RATE_HZ, READ_US as ICM42688P_READ_US,
};
pub use quadrature::QuadratureCounter;

/// Register enumerations, named in the drivers' errors.
pub mod register {
    pub use super::bmi323::Register as Bmi323Register;
    pub use super::icm42688p::Register as Icm42688pRegister;
}

/// What both parts put into a data register before their first conversion.
pub const INVALID_WORD: i16 = i16::MIN;

/// By how much both parts' filters delay what changes slowly, µs: a second-order low-pass of 400 Hz, √2 / (2π · 400 Hz). Filters
/// before it, of which the data sheets tell no delay, come on top; a host estimates what is left.
pub const FILTER_DELAY_US: u16 = 563;

/// Full scale of a gyroscope. One step of the raw word is full scale / 32768 in both parts.
///
/// The recordings of Doggy's calibration reach 7.0 rad/s (401 °/s) on the head, and a robot drawn within ±20 % of its
/// figures 7.5 rad/s; ±500 °/s (8.7 rad/s) would leave too little for a softer belt, ±1000 °/s has twice the room.
/// Its step of 0.0305 °/s (5.3e-4 rad/s) adds 1.5e-4 rad/s to a noise of 1.745e-3 rad/s: 0.4 % more.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum GyroRange {
    /// ±500 °/s, 2.66e-4 rad/s a step.
    Dps500,
    /// ±1000 °/s, 5.33e-4 rad/s a step.
    #[default]
    Dps1000,
    /// ±2000 °/s, 1.07e-3 rad/s a step.
    Dps2000,
}

impl GyroRange {
    /// Full scale in degrees per second.
    pub const fn full_scale_dps(self) -> u16 {
        match self {
            GyroRange::Dps500 => 500,
            GyroRange::Dps1000 => 1000,
            GyroRange::Dps2000 => 2000,
        }
    }

    /// Angular rate of one step of the raw word, rad/s.
    pub const fn lsb_rad_s(self) -> f64 {
        self.full_scale_dps() as f64 / 32768.0 * (core::f64::consts::PI / 180.0)
    }

    /// Angular rate of a raw word, rad/s.
    pub const fn convert_rad_s(self, raw: i16) -> f64 {
        raw as f64 * self.lsb_rad_s()
    }
}

/// One burst of a gyroscope.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct GyroReading {
    /// Raw words about the sensor's x, y and z.
    pub raw: [i16; 3],
    /// The part converted since the last read (its data-ready bit was set) and the words are valid.
    pub fresh: bool,
}

/// A gyroscope as the loop sees it: whatever the part, it has words or it has none.
pub trait Gyro {
    /// What a failed read reports.
    type Error;
    /// One burst. The bus implementation bounds its time.
    fn read(&mut self) -> Result<GyroReading, Self::Error>;
}

/// Why a gyroscope could not be set up or read. `R` is the part's register enumeration, `E` the bus error.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum GyroError<R, E> {
    /// The bus failed while this register was accessed: check wiring, pull-ups, address.
    Bus {
        /// First register of the transfer.
        register: R,
        /// What the bus reported.
        error: E,
    },
    /// Another part answers, or none (0x00 or 0xFF): check chip select or address.
    WrongId {
        /// The identification register.
        register: R,
        /// Identification of the part that this driver is for.
        expected: u16,
        /// What was read.
        got: u16,
    },
    /// A register did not hold what it must hold after set-up: the part is not in the state asked for.
    Unexpected {
        /// The register read back.
        register: R,
        /// Bits that must be as given by `expected`.
        mask: u16,
        /// Expected value under the mask.
        expected: u16,
        /// Value read.
        got: u16,
    },
}

impl<R, E> GyroError<R, E> {
    /// Whether a register that was read back holds `expected` under the mask.
    fn verify(register: R, mask: u16, expected: u16, got: u16) -> Result<(), Self> {
        if got & mask == expected & mask {
            return Ok(());
        }
        Err(GyroError::Unexpected { register, mask, expected, got })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Steps of ±1000 °/s against the sensitivity in both data sheets (32.8 words a degree per second).
    #[test]
    fn a_raw_word_converts_to_the_data_sheets_rate() {
        let dps = GyroRange::Dps1000.convert_rad_s(328).to_degrees();
        assert!((dps - 10.0).abs() < 0.011, "{dps} °/s, expected 10 within the data sheet's rounding");
        assert_eq!(GyroRange::Dps500.convert_rad_s(i16::MIN).to_degrees().round(), -500.0);
        assert_eq!(GyroRange::Dps2000.convert_rad_s(0), 0.0);
    }
}
