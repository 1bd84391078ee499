//! Recordings of an independent simulator, imported and diagnosed by the binary: what is hidden in them, and how large it is, stands in their
//! README. One of them is the riddle of the paper: belts that read far too soft on a robot whose base gives way.

use std::ops::Range;
use std::path::Path;

use serde_json::Value;
use tests::{estimate, host_succeeds, json, long_recordings, recordings, run_host};

/// Diagnoses the calibration recording of a robot, with its validation recording held out. The exit code, DIAG.json, and the page.
fn diagnosed(folder: &Path, robot: &str) -> (i32, Value, String) {
    let scratch = tempfile::tempdir().unwrap();
    let run = |name: &str| {
        let run = scratch.path().join(format!("{name}.mcap"));
        let table = folder.join(robot).join(format!("{name}.csv.gz"));
        host_succeeds([Path::new("import"), &table, Path::new("-o"), &run]);
        run
    };
    let (calibration, validation) = (run("calibration"), run("validation"));
    let (diag, page) = (scratch.path().join("diag.json"), scratch.path().join("diag.html"));
    let arguments = [Path::new("diagnose"), &calibration, Path::new("--holdout"), &validation, Path::new("-o"), &diag];
    let output = run_host(arguments.into_iter().chain([Path::new("--report"), &*page]));
    eprintln!("{robot}: {}", String::from_utf8_lossy(&output.stderr));
    (output.status.code().unwrap(), json(&diag), std::fs::read_to_string(&page).unwrap())
}

/// Holds the one finding against the truth: every parameter of the effect, and all belts, within a share of their own; and by which share of the
/// error half a second ahead, on a motion that no fit has seen, every sensor gains.
fn is_named(
    diag: &Value,
    effect: &str,
    truth: &[(&str, f64, f64)],
    (belts, belts_within): ([f64; 3], f64),
    gained: Range<f64>,
) {
    assert_eq!(diag["verdict"], "named");
    let findings = diag["findings"].as_array().unwrap();
    assert_eq!(findings.len(), 1, "{findings:?}");
    assert_eq!(findings[0]["effect"], effect);
    let extended = &diag["extended"];
    let belts =
        [1, 2, 3].map(|joint| format!("k_s[{joint}]")).into_iter().zip(belts).map(|(name, k)| (name, k, belts_within));
    for (name, truth, within) in
        truth.iter().map(|(name, truth, within)| (name.to_string(), *truth, *within)).chain(belts)
    {
        let share = estimate(extended, &name) / truth - 1.0;
        eprintln!("{name}: {:+.4} %", 100.0 * share);
        assert!(share.abs() < within, "{name}: {:+.4} %", 100.0 * share);
    }
    let gains = findings[0]["gain"].as_array().unwrap();
    let ahead: Vec<&Value> = gains.iter().filter(|gain| gain["horizon_s"] == 0.5).collect();
    assert_eq!(ahead.len(), 5, "three encoders and two gyros");
    for gain in ahead {
        let low = gain["ci95"][0].as_f64().unwrap();
        assert!(low > 0.0 && gained.contains(&gain["gain"].as_f64().unwrap()), "{gained:?}: {gain}");
    }
}

/// How far the base model's belts read off, as shares.
fn base_belts(diag: &Value, truth: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|i| estimate(&diag["base"], &format!("k_s[{}]", i + 1)) / truth[i] - 1.0)
}

#[test]
fn of_a_robot_with_nothing_hidden_nothing_is_said() {
    let Some(folder) = recordings("diagnosis of a clean robot") else { return };
    let (exit, diag, _) = diagnosed(&folder, "clean");
    assert_eq!((exit, &diag["verdict"]), (0, &Value::from("none")));
    assert_eq!(diag["findings"], Value::Array(Vec::new()));
}

#[test]
fn the_riddle_of_the_bearing_is_solved() {
    let Some(folder) = recordings("the riddle of the bearing") else { return };
    let (exit, diag, page) = diagnosed(&folder, "base_bearing");
    assert_eq!(exit, 10);
    let belts = [366.52, 401.95, 531.76];
    // Without the bearing pitch and roll read too soft, as the paper suspected of its own; yaw is right. How far off a wrong model reads depends on
    // the noise it assumes, so the bounds are half and one and a half of what is measured.
    let [yaw, pitch, roll] = base_belts(&diag, belts);
    assert!((-0.01..0.01).contains(&yaw), "yaw {yaw:+.3}"); // −0.002 measured
    assert!((-0.40..-0.13).contains(&pitch), "pitch {pitch:+.3}"); // −0.265 measured
    assert!((-0.48..-0.16).contains(&roll), "roll {roll:+.3}"); // −0.321 measured
    // Measured: 0.001 % (stiffness), 0.007 % (damping) and 0.002 % (belts).
    let bearing = [
        ("base_bearing.k[x]", 6885.2, 5e-5),
        ("base_bearing.k[y]", 7260.5, 5e-5),
        ("base_bearing.d[x]", 34.834, 4e-4),
        ("base_bearing.d[y]", 28.734, 4e-4),
    ];
    // The error half a second ahead on another motion is cut by more than half: by 0.94 to 0.99 measured.
    is_named(&diag, "base_bearing", &bearing, (belts, 5e-5), 0.85..0.999);
    assert!(page.contains("flexible base bearing"), "the page tells the same story");
}

#[test]
fn free_play_in_the_belts_is_named_with_its_size() {
    let Some(folder) = recordings("diagnosis of backlash") else { return };
    let (exit, diag, _) = diagnosed(&folder, "backlash");
    assert_eq!(exit, 10);
    // Measured: 0.4 to 0.8 % (gaps) and 0.03 to 0.09 % (belts).
    let gaps =
        [("backlash.h[1]", 7.0663e-3, 0.025), ("backlash.h[2]", 8.4880e-3, 0.025), ("backlash.h[3]", 9.1410e-3, 0.025)];
    // Gains of 0.94 to 0.98.
    is_named(&diag, "backlash", &gaps, ([413.42, 389.74, 573.56], 0.003), 0.85..0.995);
    assert_eq!(diag["findings"][0]["axes"], serde_json::json!([1, 2, 3]));
}

#[test]
fn a_sagging_supply_is_named_with_its_size() {
    let Some(folder) = recordings("diagnosis of a sagging supply") else { return };
    let (exit, diag, _) = diagnosed(&folder, "voltage_sag");
    assert_eq!(exit, 10);
    // Measured: 0.04 % (resistance) and 0.002 % (belts); the belts' truth is printed to 0.001 %.
    // Gains of 0.86 to 0.99.
    let sag = [("voltage_sag.r", 0.01, 0.003)];
    is_named(&diag, "voltage_sag", &sag, ([435.64, 441.56, 540.01], 6e-5), 0.78..0.999);
    assert_eq!(diag["extended"]["status"], "converged");
}

/// Holds what is named against what is hidden: nothing else has a name, and the other motion supports every name. `alike` do to these motors what a hidden
/// effect does.
fn nothing_false_is_named(diag: &Value, hidden: &[&str], alike: &[&str]) {
    for finding in diag["findings"].as_array().unwrap() {
        let id = finding["effect"].as_str().unwrap();
        assert!(hidden.contains(&id) || alike.contains(&id), "{id} is not hidden: {}", diag["summary"]);
        assert!(finding["holdout_gain"]["ci95"][0].as_f64().unwrap() > 0.0, "{finding}");
    }
}

/// The share of the error that all findings together save half a second ahead on the other motion.
fn gain_half_a_second_ahead(diag: &Value) -> f64 {
    let ahead = diag["holdout_gain"]["by_horizon"].as_array().unwrap();
    ahead.iter().find(|horizon| horizon["horizon_s"] == 0.5).unwrap()["share"].as_f64().unwrap()
}

/// Holds the parameters of the first finding against the truth: within 5 %, or in their interval.
fn main_cause_is(diag: &Value, effect: &str, truth: &[(&str, f64)]) {
    let main = &diag["findings"][0];
    assert_eq!(main["effect"], effect, "{}", diag["summary"]);
    for (name, truth) in truth {
        let parameters = main["parameters"].as_array().unwrap();
        let parameter = parameters.iter().find(|parameter| parameter["name"] == *name).unwrap();
        let share = parameter["estimate"].as_f64().unwrap() / truth - 1.0;
        eprintln!("{name}: {:+.2} %, ci95 {}", 100.0 * share, parameter["ci95"]);
        let holds = |end: usize, is_beyond: fn(&f64, &f64) -> bool| {
            parameter["ci95"][end].as_f64().is_some_and(|end| is_beyond(&end, truth))
        };
        assert!(share.abs() < 0.05 || holds(0, f64::le) && holds(1, f64::ge), "{parameter}, truth {truth}");
    }
}

/// The effects beside the main one in two of the recordings with many.
const BACKGROUND: [&str; 6] =
    ["stribeck", "asymmetric_friction", "encoder_eccentricity", "gyro_scale", "viscous_friction", "voltage_sag"];
/// A constant torque is what friction that differs by direction does to motors that hardly stop.
const ALIKE: [&str; 1] = ["torque_offset"];
/// And in the two others.
const OTHER_BACKGROUND: [&str; 6] =
    ["cogging", "gravity_residual", "gyro_bias_drift", "friction_drift", "link_friction", "pwm_dead_zone"];

#[test]
fn small_effects_side_by_side_are_named_and_nothing_that_is_not_there() {
    let Some(folder) = long_recordings("diagnosis of many small effects") else { return };
    let (exit, diag, _) = diagnosed(&folder, "dirty_background");
    assert!(exit == 10 || exit == 12, "named, or named with its rivals: {exit}");
    nothing_false_is_named(&diag, &BACKGROUND, &ALIKE);
    let findings = diag["findings"].as_array().unwrap();
    for id in ["voltage_sag", "gyro_scale"] {
        assert!(findings.iter().any(|finding| finding["effect"] == id), "{id}: {}", diag["summary"]);
    }
    // Measured: +0.2 %, with a standard error of 1.1 %.
    let share = estimate(&diag["extended"], "voltage_sag.r") / 0.0035 - 1.0;
    assert!(share.abs() < 0.05, "{:+.2} %", 100.0 * share);
    // Measured: 89 % half a second ahead.
    assert!(gain_half_a_second_ahead(&diag) > 0.7, "{}", diag["holdout_gain"]);
}

#[test]
fn gyros_that_lag_are_the_main_cause_among_small_effects() {
    let Some(folder) = long_recordings("diagnosis of lagging gyros among small effects") else { return };
    let (exit, diag, _) = diagnosed(&folder, "dirty_gyro_lag");
    assert!(exit == 10 || exit == 12, "named, or named with its rivals: {exit}");
    // Two equal poles of 1.75 ms, taken a step of the integration of 0.2 ms at a time: y += (1 − r) (x − y) with r = exp(−0.2/1.75) delays what is slow by
    // 0.2 ms r/(1 − r) each. Measured: 3.3042 and 3.3039 ms, ± 0.005.
    let r = (-0.2_f64 / 1.75).exp();
    let delay_s = 2.0 * 0.2e-3 * r / (1.0 - r);
    main_cause_is(&diag, "gyro_lag", &[("gyro_lag.T[1]", delay_s), ("gyro_lag.T[2]", delay_s)]);
    for gyro in [1, 2] {
        let share = estimate(&diag["extended"], &format!("gyro_lag.T[{gyro}]")) / delay_s - 1.0;
        assert!(share.abs() < 2e-3, "{:+.3} %", 100.0 * share);
    }
    assert_eq!(estimate(&diag["extended"], "gyro_lag.poles"), 2.0);
    let mut hidden = vec!["gyro_lag"];
    hidden.extend(OTHER_BACKGROUND);
    nothing_false_is_named(&diag, &hidden, &[]);
}

#[test]
fn a_friction_that_no_law_has_keeps_its_place_without_a_name_among_small_effects() {
    let Some(folder) = long_recordings("diagnosis of an unknown cause among small effects") else { return };
    let (_, diag, _) = diagnosed(&folder, "dirty_outsider");
    nothing_false_is_named(&diag, &OTHER_BACKGROUND, &[]);
    // The friction of the second motor follows the third joint's angle.
    let place = &diag["unexplained"]["where"][0];
    assert_eq!((&place["row"], &place["axis"]), (&Value::from("motor"), &Value::from(2)), "{}", diag["unexplained"]);
}
