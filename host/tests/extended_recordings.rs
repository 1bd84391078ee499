//! Recordings of a simulated Doggy with a known effect: the model that knows it brings the true parameters back.
//!
//! Takes the folder `recordings` from the environment variable `RECORDINGS_DIR`.

use host::calibrate::{Calibration, Preset, Status, extend, fit};
use host::recording::{Recording, csv};
use host::robot::Robot;
use host::solve::levenberg::Settings;

fn recording(name: &str) -> Option<Recording> {
    let Some(folder) = std::env::var_os("RECORDINGS_DIR") else {
        eprintln!("SKIPPED: set RECORDINGS_DIR to the folder of recordings to run this test");
        return None;
    };
    let path = std::path::Path::new(&folder).join(name).join("calibration.csv.gz");
    Some(csv::read(&path, &Robot::builtin("doggy").unwrap()).unwrap())
}

/// The base model's calibration, and the extended one's.
fn calibrated(recording: &Recording, effect: &str) -> (Calibration, Calibration) {
    let settings = Settings::default();
    let base = fit(&recording.robot, &[recording], Preset::Default, &settings, |_, _| {}).unwrap();
    let clock = std::time::Instant::now();
    let extended = extend(&recording.robot, &[recording], &base, &[effect], &settings, |_, _| {}).unwrap();
    let extended = extended.calibration;
    assert!(matches!(extended.status, Status::Converged), "{effect}: {:?}", extended.status);
    println!(
        "{effect}: {} iterations, {:.1} s of which {:?}; cost {:.4e} after {:.4e}",
        extended.iterations,
        clock.elapsed().as_secs_f64(),
        extended.seconds,
        extended.cost,
        base.calibration.cost
    );
    (base.calibration, extended)
}

/// How far each is off, per cent, the largest.
fn worst(calibration: &Calibration, truth: &[(&str, f64)]) -> f64 {
    let off = truth.iter().map(|(name, value)| {
        let estimate = calibration.parameter(name).unwrap().estimate;
        let off = 100.0 * (estimate / value - 1.0);
        println!("    {name:<20} {estimate:>12.5} of {value:>12.5}: {off:+.2} %");
        off.abs()
    });
    off.fold(0.0, f64::max)
}

#[test]
fn the_bearing_is_found_and_the_belts_are_stiff_again() {
    let Some(recording) = recording("base_bearing") else { return };
    let (base, extended) = calibrated(&recording, "base_bearing");
    let belts = [("k_s[1]", 366.52), ("k_s[2]", 401.95), ("k_s[3]", 531.76)];
    let bearing = [("base_bearing.k[x]", 6885.2), ("base_bearing.k[y]", 7260.5)];
    assert!(worst(&base, &belts) > 10.0, "the rigid base makes belts of the bearing");
    assert!(worst(&extended, &belts) < 2.0);
    assert!(worst(&extended, &bearing) < 5.0);
    assert!(worst(&extended, &[("base_bearing.d[x]", 34.834), ("base_bearing.d[y]", 28.734)]) < 10.0);
}

#[test]
fn the_free_play_is_found() {
    let Some(recording) = recording("backlash") else { return };
    let (_, extended) = calibrated(&recording, "backlash");
    let gaps = [("backlash.h[1]", 7.0663e-3), ("backlash.h[2]", 8.4880e-3), ("backlash.h[3]", 9.1410e-3)];
    assert!(worst(&extended, &gaps) < 5.0);
    assert!(worst(&extended, &[("k_s[1]", 413.42), ("k_s[2]", 389.74), ("k_s[3]", 573.56)]) < 2.0);
}

#[test]
fn the_sagging_supply_is_found() {
    let Some(recording) = recording("voltage_sag") else { return };
    let (_, extended) = calibrated(&recording, "voltage_sag");
    assert!(worst(&extended, &[("voltage_sag.r", 0.01)]) < 5.0);
    let motors = [("k_pwm", 5.1920), ("k_mi", 32.0044), ("b", 2.2685)];
    assert!(worst(&extended, &motors) < 2.0);
}
