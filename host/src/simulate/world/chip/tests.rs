//! The firmware's drivers against the chips: what is sensed arrives as the words that the range says.

use embedded_hal::i2c::I2c;
use embedded_hal::spi::SpiDevice;
use firmware::driver::{Bmi323, Gyro, GyroRange, GyroReading, Icm42688p};

use super::*;

const RATES: [f64; 3] = [0.5, -3.0, 40.0];

/// What the driver must read of [`RATES`]: the last axis is beyond every range.
fn expected(range: GyroRange) -> GyroReading {
    let lsb = range.lsb_rad_s();
    GyroReading { raw: [(0.5 / lsb).round() as i16, (-3.0 / lsb).round() as i16, 32767], fresh: true }
}

#[test]
fn the_spi_driver_reads_what_the_chip_senses() {
    for range in [GyroRange::Dps500, GyroRange::Dps1000, GyroRange::Dps2000] {
        let mut clock = BoardClock::default();
        let chip = Shared::new(Icm42688pChip::new(clock.clone()));
        let mut driver = Icm42688p::new(chip.clone(), range, &mut clock).unwrap();
        chip.chip().sense(RATES);
        assert_eq!(driver.read(), Ok(expected(range)), "{range:?}");
        assert!(!driver.read().unwrap().fresh, "no conversion since");
        clock.pass_ns(1_000_000);
        chip.chip().sense([0.0; 3]);
        assert_eq!(driver.read(), Ok(GyroReading { raw: [0; 3], fresh: true }));
    }
}

#[test]
fn the_i2c_driver_reads_what_the_chip_senses() {
    for range in [GyroRange::Dps500, GyroRange::Dps1000, GyroRange::Dps2000] {
        let mut clock = BoardClock::default();
        let chip = Shared::new(Bmi323Chip::new(clock.clone()));
        let mut driver =
            Bmi323::new(chip.clone(), Bmi323::<Shared<Bmi323Chip>>::ADDRESS_SDO_LOW, range, &mut clock).unwrap();
        chip.chip().sense(RATES);
        assert_eq!(driver.read(), Ok(expected(range)), "{range:?}");
        assert!(!driver.read().unwrap().fresh, "no conversion since");
        clock.pass_ns(1_000_000);
        chip.chip().sense([0.0; 3]);
        assert_eq!(driver.read(), Ok(GyroReading { raw: [0; 3], fresh: true }));
    }
}

#[test]
fn nothing_is_converted_while_off_or_before_the_start_up_time() {
    let clock = BoardClock::default();
    let mut chip = Shared::new(Icm42688pChip::new(clock.clone()));
    chip.chip().sense(RATES);
    let mut answer = [0; 7];
    SpiDevice::transfer(&mut chip, &mut answer, &[0x25 | 0x80]).unwrap();
    assert_eq!(answer[1..], [0x80, 0, 0x80, 0, 0x80, 0], "off after power-on: no conversion, no words");

    /// A driver in too great a hurry: its delays are shorter than the chip needs.
    struct Hurry(BoardClock);
    impl DelayNs for Hurry {
        fn delay_ns(&mut self, ns: u32) {
            self.0.pass_ns(u64::from(ns.min(2_000_000)));
        }
    }
    let mut driver = Icm42688p::new(chip.clone(), GyroRange::Dps1000, &mut Hurry(clock.clone())).unwrap();
    chip.chip().sense(RATES);
    assert!(!driver.read().unwrap().fresh, "2 ms after it was switched on");
    clock.pass_ns(30_000_000);
    chip.chip().sense(RATES);
    assert!(driver.read().unwrap().fresh);
}

#[test]
fn a_part_in_reset_does_not_answer() {
    let clock = BoardClock::default();
    let mut chip = Shared::new(Bmi323Chip::new(clock.clone()));
    I2c::write(&mut chip, 0x68, &[0x7E, 0xAF, 0xDE]).unwrap();
    assert_eq!(I2c::write(&mut chip, 0x68, &[0x00]), Err(NoAnswer));
    clock.pass_ns(2_000_000);
    let mut answer = [0; 4];
    chip.write_read(0x68, &[0x02], &mut answer).unwrap();
    assert_eq!(answer, [0, 0, 1, 0], "two dummy bytes, then: a reset was detected");
    assert_eq!(I2c::write(&mut chip, 0x69, &[0x00]), Err(NoAnswer), "another address");
}

/// 1.6 kHz in normal mode does not exist: an error instead of words.
#[test]
fn an_impossible_setting_is_an_error() {
    let clock = BoardClock::default();
    let mut chip = Shared::new(Bmi323Chip::new(clock.clone()));
    I2c::write(&mut chip, 0x68, &[0x21, 0xBC, 0x40]).unwrap();
    clock.pass_ns(100_000_000);
    chip.chip().sense(RATES);
    let mut answer = [0; 6];
    chip.write_read(0x68, &[0x01], &mut answer).unwrap();
    assert_eq!(answer[2] & 1 << 6, 1 << 6, "gyroscope configuration error");
    assert_eq!(answer[4] & 1 << 6, 0, "no conversion");
}

#[test]
fn a_conversion_comes_once_in_a_period_of_the_output_rate() {
    let mut clock = BoardClock::default();
    let chip = Shared::new(Icm42688pChip::new(clock.clone()));
    let mut driver = Icm42688p::new(chip.clone(), GyroRange::Dps1000, &mut clock).unwrap();
    // 500 Hz instead of 2 kHz: every second tick finds no new word.
    let mut bus = chip.clone();
    SpiDevice::write(&mut bus, &[0x4F, 0x2F]).unwrap();
    chip.chip().sense(RATES);
    driver.read().unwrap();
    let fresh: Vec<bool> = (0..6)
        .map(|_| {
            clock.pass_ns(1_000_000);
            chip.chip().sense(RATES);
            driver.read().unwrap().fresh
        })
        .collect();
    assert_eq!(fresh.iter().filter(|fresh| **fresh).count(), 3, "{fresh:?}");
}
