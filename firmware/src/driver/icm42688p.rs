//! TDK ICM-42688-P on SPI (mode 0 or 3, up to 24 MHz), gyroscope only.
//!
//! ```text
//!   0xA5 │ GYRO_DATA X1 X0 Y1 Y0 Z1 Z0 │ TMST_FSYNC H L │ INT_STATUS      10 bytes, one chip select
//!   0x25 + read bit   0x25 … 0x2A          0x2B 0x2C        0x2D (bit 3: data ready, cleared by the read)
//! ```
//!
//! Set to 2 kHz with the interface filter at 2 kHz / 5 = 400 Hz: each tick of 1 ms finds a new word, at most
//! 0.5 ms old, and what lies above half the tick rate is filtered out. Pin 1 shows the end of each conversion, by which a
//! board tells the words' age: TMST_FSYNC counts from an edge on the FSYNC pin, which is not wired. Registers and values: data sheet
//! DS-000347, chapters 12 to 14, user bank 0.

use embedded_hal::delay::DelayNs;
use embedded_hal::spi::{Operation, SpiDevice};

use super::{Gyro, GyroError, GyroRange, GyroReading, INVALID_WORD};

/// Registers of user bank 0 that the driver touches.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Register {
    /// Soft reset, SPI mode.
    DeviceConfig = 0x11,
    /// Interrupt pins: polarity, drive, pulse or latch.
    IntConfig = 0x14,
    /// First byte of the gyroscope's words, big endian, x y z.
    GyroDataX1 = 0x25,
    /// Bit 4 reset done, bit 3 data ready; cleared by reading.
    IntStatus = 0x2D,
    /// Byte order of the words; which serial interface is off.
    IntfConfig0 = 0x4C,
    /// Clock selection and adaptive full-scale range.
    IntfConfig1 = 0x4D,
    /// Power modes of the sensors.
    PwrMgmt0 = 0x4E,
    /// Gyroscope full scale and output data rate.
    GyroConfig0 = 0x4F,
    /// Bandwidths of the interface filters.
    GyroAccelConfig0 = 0x52,
    /// Interrupt pulse shape, asynchronous reset.
    IntConfig1 = 0x64,
    /// What interrupt pin 1 reports.
    IntSource0 = 0x65,
    /// Identification.
    WhoAmI = 0x75,
    /// Register bank selection.
    BankSel = 0x76,
}

/// Output data rate, Hz.
pub const OUTPUT_RATE_HZ: u32 = 2000;
/// From the start of the burst to the moment at which the part hands its words out, µs: the address byte and what starts it.
pub const READ_US: i32 = 6;
/// Bytes of a burst.
pub const BURST: usize = 10;
/// Set in the address byte of a read.
const READ: u8 = 0x80;
/// Contents of WHO_AM_I.
const WHO_AM_I: u8 = 0x47;
/// DEVICE_CONFIG: soft reset.
const SOFT_RESET: u8 = 0x01;
/// INT_STATUS: reset done.
const RESET_DONE: u8 = 1 << 4;
/// INT_STATUS: a conversion ended since the last read.
const DATA_READY: u8 = 1 << 3;
/// INTF_CONFIG0: counts and words big endian, I²C interface off.
const BIG_ENDIAN_SPI_ONLY: u8 = 0x33;
/// INTF_CONFIG1: adaptive full-scale range, bits 7:6. It stalls the output of some parts, so it is
/// switched off (0b01).
const AFSR_MASK: u8 = 0xC0;
const AFSR_OFF: u8 = 0x40;
/// GYRO_CONFIG0 bits 3:0: 2 kHz.
const ODR_2_KHZ: u8 = 0x05;
/// GYRO_ACCEL_CONFIG0: accelerometer at its reset value, gyroscope bandwidth = output rate / 5.
const FILTER_ODR_BY_5: u8 = 0x12;
/// INT_CONFIG: pin 1 pulsed, push-pull, active high.
const INT1_PUSH_PULL_HIGH: u8 = 0x03;
/// INT_CONFIG1: must be cleared for the interrupt pins to work properly.
const ASYNC_RESET: u8 = 1 << 4;
/// INT_SOURCE0: data ready on pin 1.
const DATA_READY_ON_INT1: u8 = 1 << 3;
/// PWR_MGMT0: gyroscope in low-noise mode, accelerometer off.
const GYRO_LOW_NOISE: u8 = 0x0C;

/// Reset time, data sheet: 1 ms.
const RESET_MS: u32 = 2;
/// From switching the gyroscope on to valid words, data sheet: 30 ms typical.
const START_UP_MS: u32 = 60;

/// The driver. `SPI` is a device on the bus, with its own chip select.
pub struct Icm42688p<SPI> {
    spi: SPI,
}

impl<SPI: SpiDevice> Icm42688p<SPI> {
    /// Bytes to send for the burst of a tick; the answer has the same length.
    pub const READ_REQUEST: [u8; BURST] = [Register::GyroDataX1 as u8 | READ, 0, 0, 0, 0, 0, 0, 0, 0, 0];

    /// Checks the identification, resets, configures, starts the gyroscope and reads the settings back.
    /// Takes about 65 ms; not for the loop.
    pub fn new(spi: SPI, range: GyroRange, delay: &mut impl DelayNs) -> Result<Self, GyroError<Register, SPI::Error>> {
        let mut part = Icm42688p { spi };
        part.write(Register::BankSel, 0)?;
        let got = part.read_register(Register::WhoAmI)?;
        if got != WHO_AM_I {
            let (expected, got) = (WHO_AM_I.into(), got.into());
            return Err(GyroError::WrongId { register: Register::WhoAmI, expected, got });
        }
        part.write(Register::DeviceConfig, SOFT_RESET)?;
        delay.delay_ms(RESET_MS);
        part.must_hold(Register::IntStatus, RESET_DONE, RESET_DONE)?;

        part.write(Register::IntfConfig0, BIG_ENDIAN_SPI_ONLY)?;
        let intf = part.read_register(Register::IntfConfig1)?;
        part.write(Register::IntfConfig1, intf & !AFSR_MASK | AFSR_OFF)?;
        let config = full_scale_bits(range) | ODR_2_KHZ;
        part.write(Register::GyroConfig0, config)?;
        part.write(Register::GyroAccelConfig0, FILTER_ODR_BY_5)?;
        part.write(Register::IntConfig, INT1_PUSH_PULL_HIGH)?;
        let int = part.read_register(Register::IntConfig1)?;
        part.write(Register::IntConfig1, int & !ASYNC_RESET)?;
        part.write(Register::IntSource0, DATA_READY_ON_INT1)?;
        part.write(Register::PwrMgmt0, GYRO_LOW_NOISE)?;
        delay.delay_ms(START_UP_MS);

        part.must_hold(Register::GyroConfig0, 0xEF, config)?;
        part.must_hold(Register::GyroAccelConfig0, 0xFF, FILTER_ODR_BY_5)?;
        part.must_hold(Register::PwrMgmt0, 0x0F, GYRO_LOW_NOISE)?;
        Ok(part)
    }

    /// Decodes the answer to [`Self::READ_REQUEST`]. Pure.
    pub fn decode(answer: &[u8; BURST]) -> GyroReading {
        let [_, x1, x0, y1, y0, z1, z0, _, _, status] = *answer;
        let raw = [i16::from_be_bytes([x1, x0]), i16::from_be_bytes([y1, y0]), i16::from_be_bytes([z1, z0])];
        GyroReading { raw, fresh: status & DATA_READY != 0 && !raw.contains(&INVALID_WORD) }
    }

    /// Gives the bus device back.
    pub fn release(self) -> SPI {
        self.spi
    }

    fn write(&mut self, register: Register, value: u8) -> Result<(), GyroError<Register, SPI::Error>> {
        self.spi.write(&[register as u8, value]).map_err(|error| GyroError::Bus { register, error })
    }

    fn read_register(&mut self, register: Register) -> Result<u8, GyroError<Register, SPI::Error>> {
        let mut value = [0];
        let request = [register as u8 | READ];
        let mut operations = [Operation::Write(&request), Operation::Read(&mut value)];
        self.spi.transaction(&mut operations).map_err(|error| GyroError::Bus { register, error })?;
        Ok(value[0])
    }

    fn must_hold(&mut self, register: Register, mask: u8, expected: u8) -> Result<(), GyroError<Register, SPI::Error>> {
        let got = self.read_register(register)?;
        GyroError::verify(register, mask.into(), expected.into(), got.into())
    }
}

impl<SPI: SpiDevice> Gyro for Icm42688p<SPI> {
    type Error = GyroError<Register, SPI::Error>;

    fn read(&mut self) -> Result<GyroReading, Self::Error> {
        let mut answer = [0; BURST];
        self.spi
            .transfer(&mut answer, &Self::READ_REQUEST)
            .map_err(|error| GyroError::Bus { register: Register::GyroDataX1, error })?;
        Ok(Self::decode(&answer))
    }
}

/// GYRO_CONFIG0 bits 7:5.
const fn full_scale_bits(range: GyroRange) -> u8 {
    match range {
        GyroRange::Dps2000 => 0 << 5,
        GyroRange::Dps1000 => 1 << 5,
        GyroRange::Dps500 => 2 << 5,
    }
}

#[cfg(test)]
#[path = "icm42688p_tests.rs"]
mod tests;
