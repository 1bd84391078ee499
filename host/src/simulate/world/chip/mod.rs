//! The gyro chips at register level, as their data sheets describe them, behind the buses of `embedded-hal`: the
//! firmware's own drivers run against them.
//!
//! A chip converts at its output data rate once it is switched on and has started up. Only the last conversion before a
//! burst is ever seen. Of an ideal chip it is of the moment of the burst; a real one converts by a clock of its own, behind a
//! filter (`gyro_clock`).

use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use std::sync::{Arc, Mutex, MutexGuard};

use embedded_hal::delay::DelayNs;

mod bmi323;
mod icm42688p;
#[cfg(test)]
mod tests;

pub use bmi323::Bmi323Chip;
pub use icm42688p::Icm42688pChip;

/// Both parts show this word until their first conversion.
const INVALID_WORD: i16 = i16::MIN;

/// The time that chips and delays share, ns since power-on.
#[derive(Debug, Clone, Default)]
pub struct BoardClock(Arc<AtomicU64>);

impl BoardClock {
    /// Nanoseconds since power-on.
    pub fn now_ns(&self) -> u64 {
        self.0.load(Relaxed)
    }

    /// Lets time pass.
    pub fn pass_ns(&self, ns: u64) {
        self.0.fetch_add(ns, Relaxed);
    }
}

impl DelayNs for BoardClock {
    fn delay_ns(&mut self, ns: u32) {
        self.pass_ns(u64::from(ns));
    }
}

/// A chip that its driver (through the bus) and the simulation (through the world) both hold.
#[derive(Debug)]
pub struct Shared<C>(Arc<Mutex<C>>);

impl<C> Shared<C> {
    /// The only other holders will be its clones.
    pub fn new(chip: C) -> Self {
        Self(Arc::new(Mutex::new(chip)))
    }

    /// The chip, for one access.
    pub fn chip(&self) -> MutexGuard<'_, C> {
        self.0.lock().unwrap_or_else(|poisoned| poisoned.into_inner())
    }
}

impl<C> Clone for Shared<C> {
    fn clone(&self) -> Self {
        Self(Arc::clone(&self.0))
    }
}

/// What the buses report: nobody there acknowledges, or the transfer is not one that the part understands.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct NoAnswer;

impl embedded_hal::spi::Error for NoAnswer {
    fn kind(&self) -> embedded_hal::spi::ErrorKind {
        embedded_hal::spi::ErrorKind::Other
    }
}

impl embedded_hal::i2c::Error for NoAnswer {
    fn kind(&self) -> embedded_hal::i2c::ErrorKind {
        embedded_hal::i2c::ErrorKind::NoAcknowledge(embedded_hal::i2c::NoAcknowledgeSource::Address)
    }
}

/// The word for a rate at a full scale: rounded, and held at the ends of the range.
fn word(rate_rad_s: f64, full_scale_dps: f64) -> i16 {
    let steps = (rate_rad_s.to_degrees() / full_scale_dps * 32768.0).round();
    // The lowest word means "no conversion yet", so the range is symmetric.
    steps.clamp(-32767.0, 32767.0) as i16
}
