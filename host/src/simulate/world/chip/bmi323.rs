//! Bosch BMI323, gyroscope, on I²C (data sheet BST-BMI323-DS000, chapters 5 and 6).
//!
//! Registers hold 16 bits, low byte first; the first byte of a write is the address, and every read begins with two
//! bytes that mean nothing. After a soft reset the part does not acknowledge for 1.5 ms and then shows "power-on reset
//! detected". The gyroscope needs 45 ms to start; a conversion sets "data ready", which reading STATUS clears. A rate
//! that the mode cannot do sets an error and converts nothing.

use embedded_hal::i2c::{ErrorType, I2c, Operation};

use super::{BoardClock, INVALID_WORD, NoAnswer, Shared, word};

mod register {
    pub const CHIP_ID: u8 = 0x00;
    pub const ERR_REG: u8 = 0x01;
    pub const STATUS: u8 = 0x02;
    pub const GYR_DATA_X: u8 = 0x06;
    pub const GYR_DATA_Z: u8 = 0x08;
    pub const GYR_CONF: u8 = 0x21;
    pub const CMD: u8 = 0x7E;
}

/// Address with pin SDO low.
const ADDRESS: u8 = 0x68;
const CHIP_ID: u16 = 0x0043;
const SOFT_RESET: u16 = 0xDEAF;
const POWER_ON_RESET: u16 = 1 << 0;
const GYRO_READY: u16 = 1 << 6;
const GYRO_CONF_ERROR: u16 = 1 << 6;
const GYR_CONF_RESET: u16 = 0x0048;
const DUMMY: usize = 2;
const RESET_NS: u64 = 1_500_000;
const START_UP_NS: u64 = 45_000_000;

/// The chip.
#[derive(Debug)]
pub struct Bmi323Chip {
    clock: BoardClock,
    registers: [u16; 128],
    deaf_until_ns: u64,
    on_since_ns: Option<u64>,
    converted_ns: Option<u64>,
}

impl Bmi323Chip {
    /// Just powered on.
    pub fn new(clock: BoardClock) -> Self {
        let mut chip = Self { clock, registers: [0; 128], deaf_until_ns: 0, on_since_ns: None, converted_ns: None };
        chip.reset();
        chip
    }

    /// The world at this moment: angular rate about the chip's axes, rad/s. Converts if a conversion is due.
    pub fn sense(&mut self, rate_rad_s: [f64; 3]) {
        let now = self.clock.now_ns();
        let Some(period) = self.converts_every_ns(now) else { return };
        if self.converted_ns.is_none_or(|last| now / period > last / period) {
            self.convert(now, rate_rad_s);
        }
    }

    /// The nominal time between conversions, ns, if it converts at this time of the board's clock.
    pub fn converts_every_ns(&self, at_ns: u64) -> Option<u64> {
        let started = self.on_since_ns.is_some_and(|since| at_ns >= since + START_UP_NS);
        self.period_ns().filter(|_| self.full_scale_dps().is_some()).filter(|_| started)
    }

    /// A conversion of this rate about the chip's axes, rad/s, ends.
    pub fn convert(&mut self, at_ns: u64, rate_rad_s: [f64; 3]) {
        let Some(full_scale) = self.full_scale_dps() else { return };
        let first = usize::from(register::GYR_DATA_X);
        for (data, rate) in self.registers[first..].iter_mut().zip(rate_rad_s) {
            *data = word(rate, full_scale) as u16;
        }
        self.registers[usize::from(register::STATUS)] |= GYRO_READY;
        self.converted_ns = Some(at_ns);
    }

    fn gyr_conf(&self) -> u16 {
        self.registers[usize::from(register::GYR_CONF)]
    }

    /// GYR_CONF bits 6:4.
    fn full_scale_dps(&self) -> Option<f64> {
        let code = self.gyr_conf() >> 4 & 0x7;
        (code <= 4).then(|| 125.0 * f64::from(1 << code))
    }

    /// GYR_CONF bits 3:0: 0.78125 Hz and doubles up to 6.4 kHz.
    fn period_ns(&self) -> Option<u64> {
        let code = self.gyr_conf() & 0xF;
        ((0x1..=0xE).contains(&code) && !self.impossible()).then(|| (1e9 / 0.781_25) as u64 >> (code - 1))
    }

    /// Rates from 800 Hz on exist in high-performance mode only, rates below 25 Hz in low-power mode only.
    fn impossible(&self) -> bool {
        let (rate, mode) = (self.gyr_conf() & 0xF, self.gyr_conf() >> 12 & 0x7);
        match mode {
            0x3 => rate > 0xA,
            0x4 => !(0x6..=0xA).contains(&rate),
            0x7 => !(0x5..=0xE).contains(&rate),
            _ => false,
        }
    }

    fn reset(&mut self) {
        self.registers = [0; 128];
        self.registers[usize::from(register::CHIP_ID)] = CHIP_ID;
        self.registers[usize::from(register::STATUS)] = POWER_ON_RESET;
        self.registers[0x03..=usize::from(register::GYR_DATA_Z)].fill(INVALID_WORD as u16);
        self.registers[0x20] = 0x0028;
        self.registers[usize::from(register::GYR_CONF)] = GYR_CONF_RESET;
        (self.on_since_ns, self.converted_ns) = (None, None);
    }

    fn write(&mut self, address: u8, value: u16) {
        match address {
            register::CMD if value == SOFT_RESET => {
                self.reset();
                self.deaf_until_ns = self.clock.now_ns() + RESET_NS;
            }
            // Identification, errors, status and data are read only.
            0x00..=0x1F => {}
            register::GYR_CONF => {
                self.registers[usize::from(address)] = value;
                // Modes 3, 4, 7: low power, normal, high performance.
                let on = matches!(value >> 12 & 0x7, 0x3 | 0x4 | 0x7);
                self.on_since_ns = on.then(|| self.on_since_ns.unwrap_or(self.clock.now_ns()));
                let error = if self.impossible() { GYRO_CONF_ERROR } else { 0 };
                self.registers[usize::from(register::ERR_REG)] = error;
            }
            _ => self.registers[usize::from(address)] = value,
        }
    }

    fn read(&mut self, address: u8) -> u16 {
        match address {
            register::STATUS | register::ERR_REG => std::mem::take(&mut self.registers[usize::from(address)]),
            _ => self.registers[usize::from(address)],
        }
    }
}

impl ErrorType for Shared<Bmi323Chip> {
    type Error = NoAnswer;
}

impl I2c for Shared<Bmi323Chip> {
    fn transaction(&mut self, address: u8, operations: &mut [Operation<'_>]) -> Result<(), NoAnswer> {
        let mut chip = self.chip();
        if address != ADDRESS || chip.clock.now_ns() < chip.deaf_until_ns {
            return Err(NoAnswer);
        }
        let mut pointer = 0u8;
        for operation in operations {
            match operation {
                Operation::Write(bytes) => {
                    let Some((first, data)) = bytes.split_first() else { continue };
                    pointer = first & 0x7F;
                    for pair in data.chunks_exact(2) {
                        chip.write(pointer, u16::from_le_bytes([pair[0], pair[1]]));
                        pointer = (pointer + 1) & 0x7F;
                    }
                }
                Operation::Read(bytes) => {
                    let (dummy, data) = bytes.split_at_mut(DUMMY.min(bytes.len()));
                    dummy.fill(0);
                    for pair in data.chunks_mut(2) {
                        let value = chip.read(pointer).to_le_bytes();
                        pair.copy_from_slice(&value[..pair.len()]);
                        pointer = (pointer + 1) & 0x7F;
                    }
                }
            }
        }
        Ok(())
    }
}
