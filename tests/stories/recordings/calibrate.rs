//! Recordings of an independent simulator, imported and calibrated by the binary: the truth is in their README.

use std::path::Path;

use tests::{calibrate_run, estimate, host_succeeds, json, parameter, recordings};

/// Name and true value of the dynamic parameters.
type Truth = [(&'static str, f64); 12];

const CLEAN: Truth = [
    ("k_pwm", 5.0521),
    ("k_mi", 35.4322),
    ("b", 2.6236),
    ("mu[1]", 1.6228),
    ("mu[2]", 2.6626),
    ("mu[3]", 4.7854),
    ("k_s[1]", 448.24),
    ("k_s[2]", 415.96),
    ("k_s[3]", 559.26),
    ("d_s[1]", 1.4944),
    ("d_s[2]", 1.7018),
    ("d_s[3]", 2.8204),
];

/// Imports a table and calibrates it with a preset.
fn calibrate(table: &Path, preset: &str) -> serde_json::Value {
    let scratch = tempfile::tempdir().unwrap();
    let run = scratch.path().join("run.mcap");
    host_succeeds([Path::new("import"), table, Path::new("-o"), &run]);
    calibrate_run(&run, preset)
}

#[test]
fn the_default_preset_finds_every_parameter_of_the_clean_recording() {
    let Some(folder) = recordings("clean, default preset") else { return };
    let cal = calibrate(&folder.join("clean/calibration.csv.gz"), "default");
    assert_eq!(cal["status"], "converged");
    // 5 iterations, after 7 on an excerpt that began at Table 1's initial guess.
    let iterations = cal["iterations"].as_u64().unwrap();
    assert!((3..=10).contains(&iterations), "{iterations} iterations");
    for (name, truth) in CLEAN {
        let share = estimate(&cal, name) / truth - 1.0;
        // Measured: 0.03 % at most (mu[1]); the README prints five digits.
        assert!(share.abs() < 1e-3, "{name}: {:+.4} %", 100.0 * share);
    }
    let k_s = parameter(&cal, "k_s[2]")["std_error"].as_f64().unwrap();
    assert!((2e-3..3e-2).contains(&k_s), "standard error of k_s[2]: {k_s}");
    let biases = [
        ("bias1[x]", 0.051941),
        ("bias1[y]", 0.000233),
        ("bias1[z]", -0.023291),
        ("bias2[x]", 0.049849),
        ("bias2[y]", -0.001943),
        ("bias2[z]", -0.012035),
    ];
    for (name, truth) in biases {
        let error = parameter(&cal, name)["std_error"].as_f64().unwrap();
        let off = (estimate(&cal, name) - truth).abs() / error;
        assert!(off < 3.0, "{name} is {off:.1} standard errors off");
    }
    let truth = [[0.011996, 0.016735, 0.999788], [-0.009147, -0.999816, 0.016845], [0.999886, -0.009347, -0.011841]];
    for (i, row) in truth.iter().enumerate() {
        for (j, entry) in row.iter().enumerate() {
            let found = cal["rotations"]["imu2"][i][j].as_f64().unwrap();
            assert!((found - entry).abs() < 1e-4, "R_imu2[{i}][{j}]: {found} against {entry}"); // 2e-5 measured
        }
    }
    for noise in cal["noise"].as_array().unwrap() {
        if noise["channel"].as_str().unwrap().starts_with("process") {
            continue;
        }
        let chi2 = noise["chi2_per_dof"].as_f64().unwrap();
        // 0.96 to 1.03 measured.
        assert!((0.93..1.06).contains(&chi2), "{}: {chi2}", noise["channel"]);
    }
}

#[test]
fn a_calibrated_model_predicts_another_motion_to_the_noise() {
    let Some(folder) = recordings("prediction of another motion") else { return };
    let scratch = tempfile::tempdir().unwrap();
    let [cal_run, val_run, cal, ver] =
        ["cal.mcap", "val.mcap", "cal.json", "ver.json"].map(|name| scratch.path().join(name));
    for (table, run) in [("calibration", &cal_run), ("validation", &val_run)] {
        let table = folder.join(format!("clean/{table}.csv.gz"));
        host_succeeds([Path::new("import"), &table, Path::new("-o"), run]);
    }
    host_succeeds([Path::new("calibrate"), &cal_run, Path::new("-o"), &cal]);
    host_succeeds([Path::new("verify"), &cal, &val_run, Path::new("-o"), &ver]);
    let ver = json(&ver);
    let horizons = ver["horizons"].as_array().unwrap();
    let at_100_ms = horizons.iter().find(|h| h["horizon_s"] == 0.1).unwrap();
    let channels = at_100_ms["channels"].as_array().unwrap();
    assert_eq!(channels.len(), 9);
    for channel in channels {
        let sigmas = channel["rmse_sigma"].as_f64().unwrap();
        // Measured: 0.98 to 1.05.
        assert!((0.9..1.10).contains(&sigmas), "{}: {sigmas} σ", channel["channel"]);
    }
}

#[test]
fn the_yaw_rotation_of_the_first_gyro_is_given_no_number_in_both_presets() {
    let Some(folder) = recordings("unobservable yaw rotation") else { return };
    for preset in ["default", "paper"] {
        let cal = calibrate(&folder.join("clean/validation.csv.gz"), preset);
        let held = parameter(&cal, "R_imu1[z]");
        assert_eq!(held["identifiable"], false, "{preset}");
        assert!(held["std_error"].is_null() && held["ci95"].is_null(), "{preset}: {held}");
        assert!(held["estimate"].as_f64().unwrap().abs() < 1e-9, "{preset}: held at its nominal value");
        let reason = &cal["unobservable"][0];
        assert_eq!(reason["direction"][0][0], "R_imu1[z]", "{preset}: {reason}");
        assert!(reason["reason"].as_str().unwrap().contains("yaw"), "{preset}: {reason}");
    }
}

#[test]
fn the_paper_preset_converges_and_shows_its_own_biases() {
    let Some(folder) = recordings("clean, paper preset") else { return };
    let cal = calibrate(&folder.join("clean/calibration.csv.gz"), "paper");
    assert_eq!(cal["status"], "converged");
    for (name, truth) in CLEAN {
        let found = estimate(&cal, name);
        match name.split('[').next().unwrap() {
            // Loose process noise: −27, −24, −30 % measured.
            "mu" => assert!((-0.33..-0.14).contains(&(found / truth - 1.0)), "{name}: {found} of {truth}"),
            // Euler damps by k_s T_s: +0.44, +0.41, +0.56 measured.
            "d_s" => {
                let k_s = CLEAN.iter().find(|(k, _)| *k == name.replace('d', "k")).unwrap().1;
                let share = (found - truth) / (k_s * 1e-3);
                assert!((0.9..1.1).contains(&share), "{name}: {share} of k_s T_s too high");
            }
            // 1.5 % measured at worst.
            _ => assert!((found / truth - 1.0).abs() < 0.025, "{name}: {found} of {truth}"),
        }
    }
}

#[test]
fn a_flexible_bearing_makes_belts_too_soft_under_rigid_rows_and_less_so_under_the_papers() {
    let Some(folder) = recordings("base bearing without the bearing in the model") else { return };
    let table = folder.join("base_bearing/calibration.csv.gz");
    let truth = [366.52, 401.95, 531.76];
    let share = |cal: &serde_json::Value, i: usize| estimate(cal, &format!("k_s[{}]", i + 1)) / truth[i];
    let scratch = tempfile::tempdir().unwrap();
    let [run, cal] = ["run.mcap", "cal.json"].map(|name| scratch.path().join(name));
    host_succeeds([Path::new("import"), &table, Path::new("-o"), &run]);
    // Under the file's noise the rigid rows do not fit, and that is said.
    let [calibrate, noise, fixed, unchecked, to] =
        ["calibrate", "--noise", "fixed", "--unchecked", "-o"].map(Path::new);
    host_succeeds([calibrate, &run, noise, fixed, unchecked, to, &cal]);
    assert_eq!(json(&cal)["status"], "does_not_fit");
    let default = json(&cal);
    let paper = calibrate_run(&run, "paper");
    // Measured: the belts of pitch and roll 29 and 38 % too soft where gyros are predicted on a rigid base, 15 and 18 % too soft
    // under (26), which feeds the measured tilt in; yaw, about which nothing tilts, 1 % off.
    let expected = [[(0.98, 1.01), (0.68, 0.74), (0.59, 0.65)], [(0.97, 1.00), (0.82, 0.88), (0.78, 0.85)]];
    for (cal, expected, preset) in [(&default, expected[0], "default"), (&paper, expected[1], "paper")] {
        for (i, (low, high)) in expected.into_iter().enumerate() {
            let share = share(cal, i);
            eprintln!("base_bearing, {preset}: k_s[{}] is {share:.3} of the truth", i + 1);
            assert!((low..high).contains(&share), "{preset}: k_s[{}] is {share:.3} of the truth", i + 1);
        }
    }
}
