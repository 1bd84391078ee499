//! The driver against a register file that behaves like the part: reset values, reset flag, status cleared by
//! reading, words only while the gyroscope is on.

use embedded_hal::spi::ErrorType;

use super::super::fake::{BusDown, Waited};
use super::*;

struct Part {
    registers: [u8; 128],
    words: [i16; 3],
    alive: bool,
    reset_works: bool,
    frozen: Option<Register>,
    transactions: usize,
}

impl Part {
    fn new() -> Self {
        let mut part =
            Part { registers: [0; 128], words: [0; 3], alive: true, reset_works: true, frozen: None, transactions: 0 };
        part.power_on();
        part
    }

    fn power_on(&mut self) {
        self.registers = [0; 128];
        for (register, value) in [
            (Register::IntfConfig0, 0x30),
            (Register::IntfConfig1, 0x91),
            (Register::GyroConfig0, 0x06),
            (Register::GyroAccelConfig0, 0x11),
            (Register::IntConfig1, 0x10),
            (Register::IntSource0, 0x10),
            (Register::WhoAmI, 0x47),
        ] {
            self.registers[register as usize] = value;
        }
    }

    fn register(&self, register: Register) -> u8 {
        self.registers[register as usize]
    }

    fn write(&mut self, address: u8, value: u8) {
        if self.frozen.is_some_and(|frozen| frozen as u8 == address) {
            return;
        }
        self.registers[address as usize] = value;
        if address == Register::DeviceConfig as u8 && value & 1 != 0 && self.reset_works {
            self.power_on();
            self.registers[Register::IntStatus as usize] = RESET_DONE;
        }
    }

    fn read(&mut self, address: u8) -> u8 {
        let on = self.register(Register::PwrMgmt0) & 0x0C == 0x0C;
        let value = match address {
            0x25..=0x2A => {
                let word = if on { self.words[usize::from(address - 0x25) / 2] } else { INVALID_WORD };
                word.to_be_bytes()[usize::from(address - 0x25) % 2]
            }
            _ => self.registers[address as usize],
        };
        if address == Register::IntStatus as u8 {
            self.registers[address as usize] = 0;
        }
        value
    }

    fn convert(&mut self, words: [i16; 3]) {
        self.words = words;
        self.registers[Register::IntStatus as usize] |= DATA_READY;
    }
}

impl ErrorType for &mut Part {
    type Error = BusDown;
}

impl SpiDevice for &mut Part {
    fn transaction(&mut self, operations: &mut [Operation<'_, u8>]) -> Result<(), BusDown> {
        if !self.alive {
            return Err(BusDown);
        }
        self.transactions += 1;
        // Byte by byte: the first sets address and direction, then the address counts up.
        let mut header: Option<(u8, bool)> = None;
        let mut clock = |part: &mut Part, sent: u8| -> u8 {
            match header {
                None => {
                    header = Some((sent & 0x7F, sent & READ != 0));
                    0
                }
                Some((address, reading)) => {
                    header = Some((address + 1, reading));
                    if reading {
                        return part.read(address);
                    }
                    part.write(address, sent);
                    0
                }
            }
        };
        for operation in operations {
            match operation {
                Operation::Write(bytes) => bytes.iter().for_each(|&byte| {
                    clock(self, byte);
                }),
                Operation::Read(bytes) => bytes.iter_mut().for_each(|byte| *byte = clock(self, 0)),
                Operation::Transfer(read, write) => {
                    for (i, byte) in read.iter_mut().enumerate() {
                        *byte = clock(self, write.get(i).copied().unwrap_or(0));
                    }
                }
                other => panic!("the driver does not use {other:?}"),
            }
        }
        Ok(())
    }
}

#[test]
fn sets_range_rate_and_filter_and_waits_for_the_gyroscope() {
    for (range, bits) in [(GyroRange::Dps2000, 0x05), (GyroRange::Dps1000, 0x25), (GyroRange::Dps500, 0x45)] {
        let mut part = Part::new();
        let mut delay = Waited::default();
        Icm42688p::new(&mut part, range, &mut delay).unwrap();
        assert_eq!(part.register(Register::GyroConfig0), bits);
        assert_eq!(part.register(Register::GyroAccelConfig0) & 0x0F, 2, "bandwidth 2 kHz / 5");
        assert_eq!(part.register(Register::IntfConfig1), 0x51, "adaptive range off, the rest as it was");
        assert_eq!(part.register(Register::IntConfig1), 0x00);
        assert_eq!(part.register(Register::PwrMgmt0), 0x0C);
        assert!(delay.ns >= 46_000_000, "30 ms start-up, with margin; waited {} ns", delay.ns);
    }
}

#[test]
fn reads_words_and_freshness_in_one_transaction() {
    let mut part = Part::new();
    Icm42688p::new(&mut part, GyroRange::Dps1000, &mut Waited::default()).unwrap();
    part.convert([1, -2, 30_000]);
    part.transactions = 0;
    let mut driver = Icm42688p { spi: &mut part };
    assert_eq!(driver.read(), Ok(GyroReading { raw: [1, -2, 30_000], fresh: true }));
    let again = driver.read().unwrap();
    assert_eq!(again, GyroReading { raw: [1, -2, 30_000], fresh: false }, "no conversion since");
    assert_eq!(driver.release().transactions, 2);
}

#[test]
fn words_before_the_first_conversion_are_not_fresh() {
    let mut part = Part::new();
    Icm42688p::new(&mut part, GyroRange::Dps1000, &mut Waited::default()).unwrap();
    part.convert([5, INVALID_WORD, 7]);
    let mut driver = Icm42688p { spi: &mut part };
    assert!(!driver.read().unwrap().fresh);
}

#[test]
fn another_part_is_refused_by_name_before_anything_is_set() {
    let mut part = Part::new();
    part.registers[Register::WhoAmI as usize] = 0x42;
    let refused = Icm42688p::new(&mut part, GyroRange::Dps1000, &mut Waited::default()).err();
    let expected = GyroError::WrongId { register: Register::WhoAmI, expected: 0x47, got: 0x42 };
    assert_eq!(refused, Some(expected));
    assert_eq!(part.register(Register::PwrMgmt0), 0);
}

#[test]
fn failures_name_the_register() {
    let mut part = Part::new();
    part.alive = false;
    let down = Icm42688p::new(&mut part, GyroRange::Dps1000, &mut Waited::default()).err();
    assert_eq!(down, Some(GyroError::Bus { register: Register::BankSel, error: BusDown }));

    let mut part = Part::new();
    part.reset_works = false;
    let stuck = Icm42688p::new(&mut part, GyroRange::Dps1000, &mut Waited::default()).err();
    let expected = GyroError::Unexpected { register: Register::IntStatus, mask: 0x10, expected: 0x10, got: 0 };
    assert_eq!(stuck, Some(expected));

    let mut part = Part::new();
    part.frozen = Some(Register::GyroConfig0);
    let deaf = Icm42688p::new(&mut part, GyroRange::Dps1000, &mut Waited::default()).err();
    let expected = GyroError::Unexpected { register: Register::GyroConfig0, mask: 0xEF, expected: 0x25, got: 0x06 };
    assert_eq!(deaf, Some(expected));
}

#[test]
fn a_bus_that_fails_later_fails_the_read_only() {
    let mut part = Part::new();
    Icm42688p::new(&mut part, GyroRange::Dps1000, &mut Waited::default()).unwrap();
    part.alive = false;
    let mut driver = Icm42688p { spi: &mut part };
    assert_eq!(driver.read(), Err(GyroError::Bus { register: Register::GyroDataX1, error: BusDown }));
    driver.spi.alive = true;
    driver.spi.convert([1, 2, 3]);
    assert!(driver.read().unwrap().fresh, "it recovers with the bus");
}
