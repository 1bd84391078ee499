//! What the register-level fakes of the driver tests share: a bus that can fail, and a delay that adds up.

use embedded_hal::delay::DelayNs;

/// The only thing that goes wrong on the fake buses.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BusDown;

impl embedded_hal::spi::Error for BusDown {
    fn kind(&self) -> embedded_hal::spi::ErrorKind {
        embedded_hal::spi::ErrorKind::Other
    }
}

impl embedded_hal::i2c::Error for BusDown {
    fn kind(&self) -> embedded_hal::i2c::ErrorKind {
        embedded_hal::i2c::ErrorKind::NoAcknowledge(embedded_hal::i2c::NoAcknowledgeSource::Address)
    }
}

/// Adds up what it was asked to wait.
#[derive(Default)]
pub struct Waited {
    /// Nanoseconds in all.
    pub ns: u64,
}

impl DelayNs for Waited {
    fn delay_ns(&mut self, ns: u32) {
        self.ns += u64::from(ns);
    }
}
