//! Bosch BMI323 on I²C (fast mode, 400 kHz), gyroscope only.
//!
//! ```text
//!   write 0x02 │ read: dummy dummy │ STATUS │ ACC X Y Z │ GYR X Y Z       16 bytes, one transaction
//!                                    0x02     0x03…0x05   0x06…0x08       16-bit registers, little endian
//!                                    bit 6: gyroscope data ready, cleared by the read
//! ```
//!
//! Set to 1.6 kHz with a bandwidth of 1.6 kHz / 4 = 400 Hz in high-performance mode (rates from 800 Hz need
//! it): each tick of 1 ms finds a new word, at most 0.625 ms old, and what lies above half the tick rate is
//! filtered out. Pin 1 shows the end of each conversion, by which a board tells the words' age. With the addresses the burst is 19 bytes: 19 × 9 bits / 400 kHz = 0.43 ms of the bus.
//! Registers and values: data sheet BST-BMI323-DS000, chapter 6.

use embedded_hal::delay::DelayNs;
use embedded_hal::i2c::{I2c, SevenBitAddress};

use super::{Gyro, GyroError, GyroRange, GyroReading, INVALID_WORD};

/// Registers that the driver touches; each holds 16 bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Register {
    /// Identification in the low byte.
    ChipId = 0x00,
    /// Errors: bit 0 fatal, bit 6 gyroscope configuration not possible.
    ErrReg = 0x01,
    /// Bit 0 set after a reset, bit 6 gyroscope data ready; cleared by reading.
    Status = 0x02,
    /// Gyroscope mode, bandwidth, range, rate.
    GyrConf = 0x21,
    /// Interrupt pins: level, drive, on or off.
    IoIntCtrl = 0x38,
    /// Which pin reports what: the upper half of the sources.
    IntMap2 = 0x3B,
    /// Commands.
    Cmd = 0x7E,
}

/// Low byte of CHIP_ID.
const CHIP_ID: u16 = 0x43;
/// CMD: soft reset.
const SOFT_RESET: u16 = 0xDEAF;
/// STATUS: the part was reset since the last read.
const POWER_ON_RESET: u16 = 1 << 0;
/// STATUS: a gyroscope conversion ended since the last read.
const GYRO_READY: u16 = 1 << 6;
/// ERR_REG: fatal error, or a gyroscope configuration that the part cannot do.
const ERRORS: u16 = 1 << 0 | 1 << 6;
/// GYR_CONF bits 14:12: high-performance mode.
const HIGH_PERFORMANCE: u16 = 7 << 12;
/// GYR_CONF bit 7: bandwidth = rate / 4.
const BANDWIDTH_ODR_BY_4: u16 = 1 << 7;
/// IO_INT_CTRL: pin 1 on, push-pull, active high.
const INT1_PUSH_PULL_HIGH: u16 = 0x0005;
/// INT_MAP2 bits 9:8: gyroscope data ready on pin 1.
const GYRO_READY_ON_INT1: u16 = 1 << 8;
/// GYR_CONF bits 3:0: 1.6 kHz.
const ODR_1_6_KHZ: u16 = 0xC;

/// Output data rate, Hz.
pub const OUTPUT_RATE_HZ: u32 = 1600;
/// From the start of the burst to the moment at which the part hands its words out, µs: address, register, address and the
/// dummies, 45 bits at 400 kHz, and what starts them.
pub const READ_US: i32 = 120;
/// Bytes of a burst: the dummies, and status, accelerometer and gyroscope.
pub const BURST: usize = DUMMY + 14;
/// Bytes that every I²C read begins with and that mean nothing.
const DUMMY: usize = 2;
/// Reset time, data sheet: 1.5 ms.
const RESET_MS: u32 = 3;
/// Time that a write may need before the next access while the sensors are suspended.
const WRITE_US: u32 = 500;
/// From switching the gyroscope on to valid words, data sheet: 45 ms typical.
const START_UP_MS: u32 = 80;

/// The driver.
pub struct Bmi323<I2C> {
    bus: I2C,
    address: SevenBitAddress,
}

impl<I2C: I2c> Bmi323<I2C> {
    /// Address with pin SDO low.
    pub const ADDRESS_SDO_LOW: SevenBitAddress = 0x68;
    /// Address with pin SDO high.
    pub const ADDRESS_SDO_HIGH: SevenBitAddress = 0x69;
    /// Byte to write for the burst of a tick; [`BURST`] bytes are then read.
    pub const READ_REQUEST: [u8; 1] = [Register::Status as u8];

    /// Checks the identification, resets, configures, starts the gyroscope and reads the settings back.
    /// Takes about 85 ms; not for the loop.
    pub fn new(
        bus: I2C,
        address: SevenBitAddress,
        range: GyroRange,
        delay: &mut impl DelayNs,
    ) -> Result<Self, GyroError<Register, I2C::Error>> {
        let mut part = Bmi323 { bus, address };
        let got = part.read_register(Register::ChipId)? & 0x00FF;
        if got != CHIP_ID {
            return Err(GyroError::WrongId { register: Register::ChipId, expected: CHIP_ID, got });
        }
        part.write(Register::Cmd, SOFT_RESET)?;
        delay.delay_ms(RESET_MS);
        part.must_hold(Register::Status, POWER_ON_RESET, POWER_ON_RESET)?;

        for (register, value) in [(Register::IoIntCtrl, INT1_PUSH_PULL_HIGH), (Register::IntMap2, GYRO_READY_ON_INT1)] {
            part.write(register, value)?;
            delay.delay_us(WRITE_US);
        }
        let config = HIGH_PERFORMANCE | BANDWIDTH_ODR_BY_4 | range_bits(range) | ODR_1_6_KHZ;
        part.write(Register::GyrConf, config)?;
        delay.delay_us(WRITE_US);
        delay.delay_ms(START_UP_MS);
        part.must_hold(Register::ErrReg, ERRORS, 0)?;
        part.must_hold(Register::GyrConf, 0x70FF, config)?;
        Ok(part)
    }

    /// Decodes the answer to [`Self::READ_REQUEST`]. Pure.
    pub fn decode(answer: &[u8; BURST]) -> GyroReading {
        let [_, _, status0, status1, _, _, _, _, _, _, x0, x1, y0, y1, z0, z1] = *answer;
        let raw = [i16::from_le_bytes([x0, x1]), i16::from_le_bytes([y0, y1]), i16::from_le_bytes([z0, z1])];
        let ready = u16::from_le_bytes([status0, status1]) & GYRO_READY != 0;
        GyroReading { raw, fresh: ready && !raw.contains(&INVALID_WORD) }
    }

    /// Gives the bus back.
    pub fn release(self) -> I2C {
        self.bus
    }

    fn write(&mut self, register: Register, value: u16) -> Result<(), GyroError<Register, I2C::Error>> {
        let [low, high] = value.to_le_bytes();
        self.bus.write(self.address, &[register as u8, low, high]).map_err(|error| GyroError::Bus { register, error })
    }

    fn read_register(&mut self, register: Register) -> Result<u16, GyroError<Register, I2C::Error>> {
        let mut answer = [0; DUMMY + 2];
        self.bus
            .write_read(self.address, &[register as u8], &mut answer)
            .map_err(|error| GyroError::Bus { register, error })?;
        let [_, _, low, high] = answer;
        Ok(u16::from_le_bytes([low, high]))
    }

    fn must_hold(
        &mut self,
        register: Register,
        mask: u16,
        expected: u16,
    ) -> Result<(), GyroError<Register, I2C::Error>> {
        GyroError::verify(register, mask, expected, self.read_register(register)?)
    }
}

impl<I2C: I2c> Gyro for Bmi323<I2C> {
    type Error = GyroError<Register, I2C::Error>;

    fn read(&mut self) -> Result<GyroReading, Self::Error> {
        let mut answer = [0; BURST];
        self.bus
            .write_read(self.address, &Self::READ_REQUEST, &mut answer)
            .map_err(|error| GyroError::Bus { register: Register::Status, error })?;
        Ok(Self::decode(&answer))
    }
}

/// GYR_CONF bits 6:4.
const fn range_bits(range: GyroRange) -> u16 {
    match range {
        GyroRange::Dps500 => 2 << 4,
        GyroRange::Dps1000 => 3 << 4,
        GyroRange::Dps2000 => 4 << 4,
    }
}

#[cfg(test)]
#[path = "bmi323_tests.rs"]
mod tests;
