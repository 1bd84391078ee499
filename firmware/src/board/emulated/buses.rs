//! The buses for the drivers' set-up, before the first tick and from `idle`: each transfer is an exchange.

use cortex_m::asm;
use embedded_hal::delay::DelayNs;
use embedded_hal::i2c::{self, I2c};
use embedded_hal::spi::{self, SpiDevice};
use firmware::driver::Bmi323;
use firmware::lockstep::{Answer, Kind, Transfer};

use super::{clock, exchange};

/// Address of the gyro on I²C: its pin SDO is low.
pub const BMI323_ADDRESS: u8 = Bmi323::<I2cBus>::ADDRESS_SDO_LOW;

/// The gyro on SPI, with its chip select.
pub struct SpiBus;
/// The I²C.
pub struct I2cBus;
/// Lets the world's time pass; the processor's stands still. Before the first tick.
pub struct Wait;
/// Lets ticks pass. From `idle`.
pub struct Spin;

/// Nobody answered, or the transfer is longer than any driver needs.
#[derive(Debug)]
pub struct Failed;

impl DelayNs for Wait {
    fn delay_ns(&mut self, ns: u32) {
        self.delay_us(ns.div_ceil(1000));
    }

    fn delay_us(&mut self, us: u32) {
        exchange::tell(&exchange::request(Kind::Delay { us }));
    }

    fn delay_ms(&mut self, ms: u32) {
        self.delay_us(1000 * ms);
    }
}

impl DelayNs for Spin {
    fn delay_ns(&mut self, ns: u32) {
        let (since, us) = (clock::period_us(), ns.div_ceil(1000));
        while clock::period_us().wrapping_sub(since) < us {
            asm::wfi();
        }
    }
}

impl spi::ErrorType for SpiBus {
    type Error = Failed;
}

impl SpiDevice for SpiBus {
    fn transaction(&mut self, operations: &mut [spi::Operation<'_, u8>]) -> Result<(), Failed> {
        let mut sent = Transfer::new();
        for operation in operations.iter() {
            match operation {
                spi::Operation::Write(bytes) => put(&mut sent, bytes)?,
                spi::Operation::Read(bytes) => zeros(&mut sent, bytes.len())?,
                spi::Operation::Transfer(read, write) => {
                    put(&mut sent, write)?;
                    zeros(&mut sent, read.len().saturating_sub(write.len()))?;
                }
                spi::Operation::TransferInPlace(bytes) => put(&mut sent, bytes)?,
                spi::Operation::DelayNs(_) => {}
            }
        }
        let answer = bytes(Kind::Spi(sent))?;
        let mut rest = answer.iter().copied();
        for operation in operations.iter_mut() {
            match operation {
                spi::Operation::Write(bytes) => rest.by_ref().take(bytes.len()).for_each(drop),
                spi::Operation::Read(bytes) | spi::Operation::TransferInPlace(bytes) => fill(bytes, &mut rest),
                spi::Operation::Transfer(read, write) => {
                    let longer = write.len().saturating_sub(read.len());
                    fill(read, &mut rest);
                    rest.by_ref().take(longer).for_each(drop);
                }
                spi::Operation::DelayNs(_) => {}
            }
        }
        Ok(())
    }
}

impl i2c::ErrorType for I2cBus {
    type Error = Failed;
}

impl I2c for I2cBus {
    /// Writes, then reads: all that the drivers do.
    fn transaction(&mut self, address: u8, operations: &mut [i2c::Operation<'_>]) -> Result<(), Failed> {
        let (mut written, mut count) = (Transfer::new(), 0);
        for operation in operations.iter() {
            match operation {
                i2c::Operation::Write(bytes) => put(&mut written, bytes)?,
                i2c::Operation::Read(bytes) => count += bytes.len(),
            }
        }
        let read = u8::try_from(count).map_err(|_| Failed)?;
        let answer = bytes(Kind::I2c { address, read, written })?;
        let mut rest = answer.iter().copied();
        for operation in operations.iter_mut() {
            if let i2c::Operation::Read(bytes) = operation {
                fill(bytes, &mut rest);
            }
        }
        Ok(())
    }
}

impl spi::Error for Failed {
    fn kind(&self) -> spi::ErrorKind {
        spi::ErrorKind::Other
    }
}

impl i2c::Error for Failed {
    fn kind(&self) -> i2c::ErrorKind {
        i2c::ErrorKind::Other
    }
}

fn bytes(kind: Kind) -> Result<Transfer, Failed> {
    match exchange::ask(&exchange::request(kind), Answer::read) {
        Answer::Bytes(bytes) => Ok(bytes),
        Answer::Nothing => Err(Failed),
    }
}

fn put(sent: &mut Transfer, bytes: &[u8]) -> Result<(), Failed> {
    sent.extend_from_slice(bytes).map_err(|_| Failed)
}

fn zeros(sent: &mut Transfer, count: usize) -> Result<(), Failed> {
    sent.resize(sent.len() + count, 0).map_err(|_| Failed)
}

fn fill(bytes: &mut [u8], rest: &mut impl Iterator<Item = u8>) {
    bytes.iter_mut().zip(rest).for_each(|(byte, read)| *byte = read);
}
