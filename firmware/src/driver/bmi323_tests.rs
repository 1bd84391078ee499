//! The driver against a register file that behaves like the part: two dummy bytes before every read, 16-bit
//! registers, reset flag, status cleared by reading, configuration errors.

use embedded_hal::i2c::{ErrorType, Operation};

use super::super::fake::{BusDown, Waited};
use super::*;

const ADDRESS: u8 = Bmi323::<Part>::ADDRESS_SDO_LOW;

struct Part {
    registers: [u16; 128],
    alive: bool,
    reset_works: bool,
    transactions: usize,
}

impl Part {
    fn new() -> Self {
        let mut part = Part { registers: [0; 128], alive: true, reset_works: true, transactions: 0 };
        part.power_on();
        part
    }

    fn power_on(&mut self) {
        self.registers = [0; 128];
        self.registers[Register::ChipId as usize] = 0xA043;
        self.registers[Register::GyrConf as usize] = 0x0048;
        self.registers[0x03..=0x08].fill(0x8000);
    }

    fn register(&self, register: Register) -> u16 {
        self.registers[register as usize]
    }

    fn write_register(&mut self, address: u8, value: u16) {
        self.registers[address as usize] = value;
        if address == Register::Cmd as u8 && value == SOFT_RESET && self.reset_works {
            self.power_on();
            self.registers[Register::Status as usize] = POWER_ON_RESET;
        }
        // Rates from 800 Hz (code 0xB) on exist in high-performance mode only.
        if address == Register::GyrConf as u8 && value & 0xF >= 0xB && value >> 12 & 7 != 7 {
            self.registers[Register::ErrReg as usize] |= 1 << 6;
        }
    }

    fn convert(&mut self, words: [i16; 3]) {
        for (register, word) in self.registers[0x06..=0x08].iter_mut().zip(words) {
            *register = word as u16;
        }
        self.registers[Register::Status as usize] |= GYRO_READY;
    }
}

impl ErrorType for Part {
    type Error = BusDown;
}

impl I2c for Part {
    fn transaction(&mut self, address: u8, operations: &mut [Operation<'_>]) -> Result<(), BusDown> {
        if !self.alive || address != ADDRESS {
            return Err(BusDown);
        }
        self.transactions += 1;
        let mut pointer = 0;
        for operation in operations {
            match operation {
                Operation::Write(bytes) => {
                    pointer = bytes[0];
                    for (i, word) in bytes[1..].chunks_exact(2).enumerate() {
                        self.write_register(pointer + i as u8, u16::from_le_bytes([word[0], word[1]]));
                    }
                }
                Operation::Read(bytes) => {
                    let words = bytes.len().saturating_sub(DUMMY) / 2;
                    for byte in bytes.iter_mut() {
                        *byte = 0xEE;
                    }
                    for i in 0..words {
                        let register = usize::from(pointer) + i;
                        let value = self.registers[register].to_le_bytes();
                        bytes[DUMMY + 2 * i..DUMMY + 2 * i + 2].copy_from_slice(&value);
                        if register == Register::Status as usize {
                            self.registers[register] = 0;
                        }
                    }
                }
            }
        }
        Ok(())
    }
}

fn started() -> Bmi323<Part> {
    Bmi323::new(Part::new(), ADDRESS, GyroRange::Dps1000, &mut Waited::default()).unwrap()
}

#[test]
fn sets_mode_range_rate_and_bandwidth_and_waits_for_the_gyroscope() {
    for (range, config) in [(GyroRange::Dps500, 0x70AC), (GyroRange::Dps1000, 0x70BC), (GyroRange::Dps2000, 0x70CC)] {
        let mut delay = Waited::default();
        let part = Bmi323::new(Part::new(), ADDRESS, range, &mut delay).unwrap().release();
        assert_eq!(part.register(Register::GyrConf), config);
        assert_eq!([Register::IoIntCtrl, Register::IntMap2].map(|pin| part.register(pin)), [0x0005, 0x0100]);
        assert!(delay.ns >= 60_000_000, "45 ms start-up, with margin; waited {} ns", delay.ns);
    }
}

#[test]
fn reads_words_and_freshness_in_one_transaction() {
    let mut driver = started();
    driver.bus.convert([-1, 2, -30_000]);
    driver.bus.transactions = 0;
    assert_eq!(driver.read(), Ok(GyroReading { raw: [-1, 2, -30_000], fresh: true }));
    assert_eq!(driver.read(), Ok(GyroReading { raw: [-1, 2, -30_000], fresh: false }), "no conversion since");
    assert_eq!(driver.release().transactions, 2);
}

#[test]
fn words_before_the_first_conversion_are_not_fresh() {
    let mut driver = started();
    driver.bus.registers[Register::Status as usize] |= GYRO_READY;
    assert_eq!(driver.read(), Ok(GyroReading { raw: [INVALID_WORD; 3], fresh: false }));
}

#[test]
fn another_part_is_refused_by_name_before_anything_is_set() {
    let mut part = Part::new();
    part.registers[Register::ChipId as usize] = 0x0024;
    let refused = Bmi323::new(part, ADDRESS, GyroRange::Dps1000, &mut Waited::default()).err();
    let expected = GyroError::WrongId { register: Register::ChipId, expected: 0x43, got: 0x24 };
    assert_eq!(refused, Some(expected));
}

#[test]
fn failures_name_the_register() {
    let wrong_address = Bmi323::new(Part::new(), 0x69, GyroRange::Dps1000, &mut Waited::default()).err();
    assert_eq!(wrong_address, Some(GyroError::Bus { register: Register::ChipId, error: BusDown }));

    let mut part = Part::new();
    part.reset_works = false;
    let stuck = Bmi323::new(part, ADDRESS, GyroRange::Dps1000, &mut Waited::default()).err();
    let expected = GyroError::Unexpected { register: Register::Status, mask: 1, expected: 1, got: 0 };
    assert_eq!(stuck, Some(expected));

    let mut driver = started();
    driver.bus.alive = false;
    assert_eq!(driver.read(), Err(GyroError::Bus { register: Register::Status, error: BusDown }));
}
