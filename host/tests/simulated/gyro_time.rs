//! Gyros with clocks and filters of their own: calibrated as exactly as ideal ones where the device tells what it can.

use host::calibrate::{Calibration, Preset, Status, calibrate};
use host::robot::Robot;
use host::simulate::{Direct, GyroChips, Options, SHORT_MOTION};
use solve::levenberg::Settings;

/// A calibration by default of the robot of this seed, and by how much each parameter of the dynamics is off, as a share.
fn calibrated(seed: u64, gyros: GyroChips) -> (Calibration, Vec<(String, f64)>) {
    let options = Options { seed, gyros, ..Options::new(Robot::builtin("doggy").unwrap()) };
    let Direct { recording, truth, .. } = Direct::record(&options, SHORT_MOTION).unwrap();
    let found = calibrate(&recording.robot, &[&recording], Preset::Default, &Settings::default(), |_, _| {}).unwrap();
    let is_dynamic = |name: &str| !["bias", "R_imu", "lag"].iter().any(|of| name.starts_with(of));
    let off = truth.iter().filter(|of| is_dynamic(&of.name)).map(|of| {
        let estimate = found.parameter(&of.name).unwrap().estimate;
        (of.name.clone(), estimate / of.value - 1.0)
    });
    let off = off.collect();
    (found, off)
}

fn worst(off: &[(String, f64)]) -> &(String, f64) {
    off.iter().max_by(|a, b| a.1.abs().total_cmp(&b.1.abs())).unwrap()
}

/// Five robots, seeds 1 to 5.
#[test]
fn real_gyros_are_calibrated_within_a_thousandth() {
    for seed in 1..=5 {
        let (ideal, off) = calibrated(seed, GyroChips::Ideal);
        println!("seed {seed}, ideal: worst {:?}, {:.1} s", worst(&off), ideal.seconds.total);
        assert!(ideal.parameter("lag1").is_none());
        let (real, off) = calibrated(seed, GyroChips::Real);
        let lags = ["lag1", "lag2"].map(|lag| real.parameter(lag).unwrap().estimate * 1e6);
        println!("seed {seed}, real: worst {:?}, lags {lags:.1?} µs, {:.1} s", worst(&off), real.seconds.total);
        for (name, off) in &off {
            let found = real.parameter(name).unwrap();
            println!("  {name} {off:+.6} ± {:.6}", found.std_error.unwrap() / found.estimate);
        }
        assert_eq!(real.status, Status::Converged);
        assert!(worst(&off).1.abs() < 1e-3, "seed {seed}: {:?}", worst(&off));
        // Filters of 225 to 400 Hz delay by 563 to 1000 µs, and 563 are told.
        assert!(lags.iter().all(|lag| (-20.0..460.0).contains(lag)), "seed {seed}: {lags:?}");
        assert!(real.notes.is_empty(), "{:?}", real.notes);
    }
}

/// One robot, seed 1.
#[test]
fn what_unknown_ages_cost_is_told() {
    let (found, off) = calibrated(1, GyroChips::Unstamped);
    println!("without stamps: worst {:?}, {:?}", worst(&off), found.notes);
    let told = |gyro: usize, ms: &str| {
        let begin = format!("the device does not tell how old the words of gyro {gyro} are: by up to {ms} ms");
        found.notes.iter().any(|note| note.starts_with(&begin))
    };
    assert!(found.notes.len() == 2 && told(1, "0.50") && told(2, "0.62"), "{:?}", found.notes);
}
