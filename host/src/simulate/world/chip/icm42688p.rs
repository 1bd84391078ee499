//! TDK ICM-42688-P, user bank 0, gyroscope, on SPI (data sheet DS-000347, chapters 9 and 14).
//!
//! The first byte of a transfer is the address with the read bit; from then on the address counts up. After a soft
//! reset the part does not answer for 1 ms and then shows "reset done". The gyroscope needs 30 ms to start; a
//! conversion sets "data ready", which reading INT_STATUS clears.

use embedded_hal::spi::{ErrorType, Operation, SpiDevice};

use super::{BoardClock, INVALID_WORD, NoAnswer, Shared, word};

mod register {
    pub const DEVICE_CONFIG: u8 = 0x11;
    pub const GYRO_DATA_X1: u8 = 0x25;
    pub const GYRO_DATA_Z0: u8 = 0x2A;
    pub const INT_STATUS: u8 = 0x2D;
    pub const INTF_CONFIG0: u8 = 0x4C;
    pub const PWR_MGMT0: u8 = 0x4E;
    pub const GYRO_CONFIG0: u8 = 0x4F;
    pub const WHO_AM_I: u8 = 0x75;
    pub const BANK_SEL: u8 = 0x76;
}

/// Registers of bank 0 that are not zero after a reset.
const RESET_VALUES: [(u8, u8); 14] = [
    (0x13, 0x05),
    (register::INTF_CONFIG0, 0x30),
    (0x4D, 0x91),
    (register::GYRO_CONFIG0, 0x06),
    (0x50, 0x06),
    (0x51, 0x16),
    (0x52, 0x11),
    (0x53, 0x0D),
    (0x56, 0x82),
    (0x5F, 0x00),
    (0x64, 0x10),
    (0x65, 0x10),
    (register::INT_STATUS, RESET_DONE),
    (register::WHO_AM_I, 0x47),
];
const READ: u8 = 0x80;
const RESET_DONE: u8 = 1 << 4;
const DATA_READY: u8 = 1 << 3;
const BIG_ENDIAN_DATA: u8 = 1 << 4;
const RESET_NS: u64 = 1_000_000;
const START_UP_NS: u64 = 30_000_000;

/// The chip.
#[derive(Debug)]
pub struct Icm42688pChip {
    clock: BoardClock,
    bank0: [u8; 128],
    bank: u8,
    deaf_until_ns: u64,
    /// When the gyroscope was switched on.
    on_since_ns: Option<u64>,
    converted_ns: Option<u64>,
    words: [i16; 3],
}

impl Icm42688pChip {
    /// Just powered on.
    pub fn new(clock: BoardClock) -> Self {
        let mut chip = Self {
            clock,
            bank0: [0; 128],
            bank: 0,
            deaf_until_ns: 0,
            on_since_ns: None,
            converted_ns: None,
            words: [INVALID_WORD; 3],
        };
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
        self.period_ns().filter(|_| started)
    }

    /// A conversion of this rate about the chip's axes, rad/s, ends.
    pub fn convert(&mut self, at_ns: u64, rate_rad_s: [f64; 3]) {
        let full_scale = self.full_scale_dps();
        self.words = rate_rad_s.map(|rate| word(rate, full_scale));
        self.bank0[usize::from(register::INT_STATUS)] |= DATA_READY;
        self.converted_ns = Some(at_ns);
    }

    /// FS_SEL, GYRO_CONFIG0 bits 7:5: 2000 °/s, then halves.
    fn full_scale_dps(&self) -> f64 {
        2000.0 / f64::from(1u16 << (self.bank0[usize::from(register::GYRO_CONFIG0)] >> 5))
    }

    /// ODR, GYRO_CONFIG0 bits 3:0; reserved codes convert nothing.
    fn period_ns(&self) -> Option<u64> {
        let hz = match self.bank0[usize::from(register::GYRO_CONFIG0)] & 0x0F {
            0x1 => 32_000.0,
            0x2 => 16_000.0,
            0x3 => 8_000.0,
            0x4 => 4_000.0,
            0x5 => 2_000.0,
            0x6 => 1_000.0,
            0x7 => 200.0,
            0x8 => 100.0,
            0x9 => 50.0,
            0xA => 25.0,
            0xB => 12.5,
            0xF => 500.0,
            _ => return None,
        };
        Some((1e9 / hz) as u64)
    }

    fn reset(&mut self) {
        self.bank0 = [0; 128];
        for (address, value) in RESET_VALUES {
            self.bank0[usize::from(address)] = value;
        }
        (self.bank, self.on_since_ns, self.converted_ns, self.words) = (0, None, None, [INVALID_WORD; 3]);
    }

    fn write(&mut self, address: u8, value: u8) {
        if address == register::BANK_SEL {
            self.bank = value & 0x07;
            return;
        }
        let read_only = matches!(address, register::GYRO_DATA_X1..=register::INT_STATUS | register::WHO_AM_I);
        if self.bank != 0 || read_only {
            return;
        }
        if address == register::DEVICE_CONFIG && value & 1 != 0 {
            self.reset();
            self.deaf_until_ns = self.clock.now_ns() + RESET_NS;
            return;
        }
        self.bank0[usize::from(address)] = value;
        if address == register::PWR_MGMT0 {
            // GYRO_MODE 0b11 is low noise; standby and off do not convert.
            let on = value & 0x0C == 0x0C;
            self.on_since_ns = on.then(|| self.on_since_ns.unwrap_or(self.clock.now_ns()));
            if !on {
                (self.converted_ns, self.words) = (None, [INVALID_WORD; 3]);
            }
        }
    }

    fn read(&mut self, address: u8) -> u8 {
        match address {
            register::BANK_SEL => self.bank,
            _ if self.bank != 0 => 0,
            register::GYRO_DATA_X1..=register::GYRO_DATA_Z0 => {
                let offset = usize::from(address - register::GYRO_DATA_X1);
                let big = self.bank0[usize::from(register::INTF_CONFIG0)] & BIG_ENDIAN_DATA != 0;
                let word = self.words[offset / 2];
                let bytes = if big { word.to_be_bytes() } else { word.to_le_bytes() };
                bytes[offset % 2]
            }
            register::INT_STATUS => std::mem::take(&mut self.bank0[usize::from(address)]),
            _ => self.bank0[usize::from(address)],
        }
    }
}

impl ErrorType for Shared<Icm42688pChip> {
    type Error = NoAnswer;
}

impl SpiDevice for Shared<Icm42688pChip> {
    fn transaction(&mut self, operations: &mut [Operation<'_, u8>]) -> Result<(), NoAnswer> {
        let mut chip = self.chip();
        let deaf = chip.clock.now_ns() < chip.deaf_until_ns;
        // Address and direction, once the first byte has set them.
        let mut at: Option<(u8, bool)> = None;
        let mut shift = |sent: u8| -> u8 {
            let Some((address, reading)) = at else {
                at = Some((sent & !READ, sent & READ != 0));
                return 0;
            };
            at = Some(((address + 1) & !READ, reading));
            match (deaf, reading) {
                (true, _) => 0,
                (false, true) => chip.read(address),
                (false, false) => {
                    chip.write(address, sent);
                    0
                }
            }
        };
        for operation in operations {
            match operation {
                Operation::Write(bytes) => {
                    for byte in bytes.iter() {
                        shift(*byte);
                    }
                }
                Operation::Read(bytes) => bytes.iter_mut().for_each(|byte| *byte = shift(0)),
                Operation::Transfer(read, write) => {
                    for i in 0..read.len().max(write.len()) {
                        let got = shift(write.get(i).copied().unwrap_or(0));
                        if let Some(byte) = read.get_mut(i) {
                            *byte = got;
                        }
                    }
                }
                Operation::TransferInPlace(bytes) => bytes.iter_mut().for_each(|byte| *byte = shift(*byte)),
                // Far shorter than anything that the simulation resolves.
                Operation::DelayNs(_) => {}
            }
        }
        Ok(())
    }
}
