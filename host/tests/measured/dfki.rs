//! Pendulums on quasi-direct drives, measured: numbers of the slow motion, and what does not fit (host/doc/dfki.md).

use crate::files::{machine, within};
use crate::program::{host, json};
use serde_json::Value;

/// The calibration of a table by a description that comes with the program.
fn calibrated(robot: &str, folder: &str, table: &str) -> Option<Value> {
    let data = machine(folder)?;
    let at = tempfile::tempdir().unwrap();
    let table = data.join(format!("{table}.csv"));
    host(at.path(), &["import", table.to_str().unwrap(), "--robot", robot, "-o", "run.mcap"], 0);
    host(at.path(), &["calibrate", "run.mcap", "-o", "cal.json", "--unchecked"], 0);
    Some(json(&at.path().join("cal.json")))
}

fn estimate(calibration: &Value, name: &str) -> (f64, f64) {
    let found = crate::files::parameter(&calibration["parameters"], name);
    (found["estimate"].as_f64().unwrap(), found["std_error"].as_f64().unwrap())
}

/// Least squares on energy has J 0.19 kg m² and m g l 3.70 N m. In `energy_shaping` something pushes the pendulum at 16 s.
#[test]
fn inertia_and_weight_of_the_pendulum_agree_between_recordings() {
    let names = ["ddp", "energy_shaping", "pd_sysid"];
    let found = names.map(|name| calibrated("dfki_pendulum", "dfki_pendulum", name));
    let [Some(ddp), Some(energy), Some(pd)] = &found else { return };
    for (name, calibration) in names.iter().zip([ddp, energy, pd]) {
        let ((b, b_error), (mz, mz_error)) = (estimate(calibration, "b[1]"), estimate(calibration, "mz[1]"));
        let status = calibration["status"].as_str().unwrap();
        println!(
            "{name}: J {b:.4} ± {b_error:.4} kg m², m g l {:.3} ± {:.3} N m, {status}",
            -9.81 * mz,
            9.81 * mz_error
        );
    }
    // Measured: 0 to 6 % apart from least squares on energy, and 8 % in the short one, whose errors are 10 %. It is said of all that they do not fit.
    for (name, truth) in [("b[1]", 0.19), ("mz[1]", -3.70 / 9.81)] {
        for (calibration, most) in [(ddp, 0.08), (energy, 0.08), (pd, 0.2)] {
            within(&(estimate(calibration, name).0 / truth).into(), 1.0 - most..=1.0 + most);
        }
    }
    for calibration in [ddp, energy, pd] {
        assert_eq!(calibration["status"], "does_not_fit", "{}", calibration["misfit"]);
    }
    // The push is told with its time, and nothing else in that recording.
    let pushes = energy["pushes"].as_array().unwrap();
    println!("energy_shaping: {}", energy["pushes"]);
    assert_eq!(pushes.len(), 1, "{pushes:?}");
    within(&pushes[0]["from_s"], 15.9..=16.1);
    within(&pushes[0]["to_s"], 16.0..=16.3);
}

/// Published: m2 r2 0.181 kg m, m1 r1 + m2 l1 0.241 kg m, I2 0.054 kg m². Measured here: 9 to 11 % below, and it is said that the model does not fit.
#[test]
fn the_double_pendulum_is_that_of_its_publication() {
    let Some(found) = calibrated("dfki_double_pendulum", "dfki_double_pendulum", "trajectory_02") else { return };
    println!("{} {}", found["status"], found["misfit"]);
    assert_eq!(found["status"], "does_not_fit");
    for (name, published, apart) in [("mz[1]", -0.241, 0.12), ("mz[2]", -0.181, 0.12), ("J[2]", 0.054, 0.12)] {
        let (value, error) = estimate(&found, name);
        println!("{name}: {value:.4} ± {error:.4}, published {published}");
        within(&(value / published).into(), 1.0 - apart..=1.0 + apart);
    }
}
