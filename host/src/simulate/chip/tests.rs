//! The firmware's drivers against the chips: what is sensed arrives as the words that the range says.

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
fn nothing_is_converted_before_the_start_up_time_or_while_off() {
    let clock = BoardClock::default();
    let mut chip = Icm42688pChip::new(clock.clone());
    chip.sense(RATES);
    assert_eq!(chip.words, [INVALID_WORD; 3], "off after power-on");
    // A driver in too great a hurry: its delays are shorter than the chip needs.
    struct Hurry(BoardClock);
    impl DelayNs for Hurry {
        fn delay_ns(&mut self, ns: u32) {
            self.0.pass_ns(u64::from(ns.min(2_000_000)));
        }
    }
    let shared = Shared::new(Icm42688pChip::new(clock.clone()));
    let mut driver = Icm42688p::new(shared.clone(), GyroRange::Dps1000, &mut Hurry(clock)).unwrap();
    shared.chip().sense(RATES);
    assert!(driver.read().is_err() || !driver.read().unwrap().fresh);
}

#[test]
fn a_conversion_comes_once_in_a_period_of_the_output_rate() {
    let mut clock = BoardClock::default();
    let chip = Shared::new(Icm42688pChip::new(clock.clone()));
    let mut driver = Icm42688p::new(chip.clone(), GyroRange::Dps1000, &mut clock).unwrap();
    // 500 Hz instead of 2 kHz: every second tick finds no new word.
    chip.chip().write(0x4F, 0x2F);
    let fresh: Vec<bool> = (0..6)
        .map(|_| {
            clock.pass_ns(1_000_000);
            chip.chip().sense(RATES);
            driver.read().unwrap().fresh
        })
        .collect();
    assert_eq!(fresh.iter().filter(|fresh| **fresh).count(), 3, "{fresh:?}");
}
