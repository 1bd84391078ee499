//! A simulated Doggy behind a pseudo-terminal, recorded and calibrated by the binary; its true parameters are told by the simulator.

use std::path::Path;

use tests::{calibrate_run, estimate, host_succeeds, json, parameter, shares};

/// Records the calibration motion of `sim:` with these options; gives the recording's folder and the truth.
fn record(options: &str) -> (tempfile::TempDir, serde_json::Value) {
    let scratch = tempfile::tempdir().unwrap();
    let (run, truth) = (scratch.path().join("run.mcap"), scratch.path().join("truth.json"));
    let port = format!("sim:{options},truth={}", truth.display());
    host_succeeds([Path::new("record"), Path::new("--port"), Path::new(&port), Path::new("-o"), &run]);
    let truth = json(&truth);
    (scratch, truth)
}

fn true_value(truth: &serde_json::Value, name: &str) -> f64 {
    let list = truth["truth"].as_array().unwrap();
    list.iter().find(|value| value["name"] == name).unwrap()["value"].as_f64().unwrap()
}

#[test]
fn a_robot_without_effect_is_calibrated_within_one_percent() {
    let (scratch, truth) = record("seed=11");
    let run = scratch.path().join("run.mcap");
    let check = scratch.path().join("check.json");
    host_succeeds([Path::new("check"), &run, Path::new("-o"), &check]);
    let check = json(&check);
    assert_eq!(check["usable"], true);
    assert_eq!(check["missing_ticks"], 0);
    assert!(check["samples"].as_u64().unwrap() >= 60_000, "{}", check["samples"]);

    let cal = calibrate_run(&run, "default");
    assert_eq!(cal["status"], "converged");
    let shares = shares(&cal, &truth);
    assert_eq!(shares.len(), 12);
    let (median, worst) = (&shares[shares.len() / 2], &shares[shares.len() - 1]);
    eprintln!("error: median {:.4} % ({}), worst {:.4} % ({})", 100.0 * median.1, median.0, 100.0 * worst.1, worst.0);
    assert!(worst.1.abs() < 0.01, "{shares:?}");
    for gyro in [1, 2] {
        for axis in ["x", "y", "z"] {
            let name = format!("bias{gyro}[{axis}]");
            let error = parameter(&cal, &name)["std_error"].as_f64().unwrap();
            let off = (estimate(&cal, &name) - true_value(&truth, &name)) / error;
            assert!(off.abs() < 3.0, "{name} is {off:.1} standard errors off");
        }
    }
    for axis in ["x", "y", "z"] {
        let name = format!("R_imu2[{axis}]");
        let off = estimate(&cal, &name) - true_value(&truth, &name);
        assert!(off.abs() < 1e-3, "{name} is {off:e} rad off");
    }
}

#[test]
fn a_bad_line_costs_samples_but_not_the_calibration() {
    let (scratch, truth) = record("seed=12,fault=drop=0.01,fault=corrupt=0.001,fault=stall-out=0.3@30");
    let run = scratch.path().join("run.mcap");
    let cal = calibrate_run(&run, "default");
    let used = &cal["recordings"][0];
    let (missing, gaps) = (used["missing_ticks"].as_u64().unwrap(), used["gaps"].as_u64().unwrap());
    // 1.1 % of some 76,000 frames, and what a stall of 0.3 s does not let through.
    assert!((600..1600).contains(&missing), "{missing} missing");
    assert!((500..1100).contains(&gaps), "{gaps} gaps");
    let shares = shares(&cal, &truth);
    let worst = &shares[shares.len() - 1];
    eprintln!("error with {missing} ticks missing: worst {:.4} % ({})", 100.0 * worst.1, worst.0);
    assert!(worst.1.abs() < 0.02, "{shares:?}");
}

#[test]
fn the_one_joint_robot_is_calibrated_as_well() {
    let (scratch, truth) = record("robot=one_joint,seed=5");
    let cal = calibrate_run(&scratch.path().join("run.mcap"), "default");
    assert_eq!(cal["status"], "converged");
    let shares = shares(&cal, &truth);
    let worst = &shares[shares.len() - 1];
    eprintln!("one joint: worst {:.4} % ({})", 100.0 * worst.1, worst.0);
    assert!(worst.1.abs() < 0.01, "{shares:?}");
}

#[test]
fn the_demonstration_goes_the_whole_way() {
    let scratch = tempfile::tempdir().unwrap();
    let out = scratch.path().join("demo");
    let said = host_succeeds([Path::new("demo"), Path::new("--out"), &out, Path::new("--seed"), Path::new("2")]);
    assert!(said.contains("farthest from its truth"), "{said}");
    // An exit of zero says so too.
    assert!(said.contains("hidden was") && said.contains("found: that, and nothing else"), "{said}");
    for file in ["calibration.mcap", "validation.mcap", "calibration.json", "diagnosis.json", "demo.html"] {
        assert!(out.join(file).exists(), "{file} is missing:\n{said}");
    }
    let page = std::fs::read_to_string(out.join("demo.html")).unwrap();
    assert!(page.contains("k_s[2]") && page.contains("truth"), "the page compares with the truth");
    // Run again, it overwrites nothing.
    let again = tests::run_host([Path::new("demo"), Path::new("--out"), &out]);
    assert_eq!(again.status.code(), Some(2), "{}", String::from_utf8_lossy(&again.stderr));
}

#[test]
fn a_robot_whose_motion_was_stopped_by_silence_can_be_recorded_again() {
    let scratch = tempfile::tempdir().unwrap();
    let link = scratch.path().join("port");
    let mut simulator = tests::host()
        .args(["simulate", "--seed", "4", "--pace", "fast", "--fault", "stall-in=0.3@5", "--link"])
        .arg(&link)
        .stdout(std::process::Stdio::null())
        .stderr(std::process::Stdio::null())
        .spawn()
        .unwrap();
    for _ in 0..200 {
        if link.exists() {
            break;
        }
        std::thread::sleep(std::time::Duration::from_millis(50));
    }
    let record = |name: &str, zero: &[&str]| {
        let run = scratch.path().join(name);
        let arguments =
            [Path::new("record"), Path::new("--port"), &link, Path::new("--motion"), Path::new("validation")];
        let zero = zero.iter().map(Path::new);
        tests::run_host(arguments.into_iter().chain(zero).chain([Path::new("-o"), &run]))
    };
    let first = record("first.mcap", &["--set-zero"]);
    // The robot stands somewhere else than in its marked pose now, and may still swing. It knows its zero.
    let second = record("second.mcap", &[]);
    simulator.kill().unwrap();
    simulator.wait().unwrap();
    let said = String::from_utf8_lossy(&first.stderr);
    assert!(!first.status.success() && said.contains("heartbeat"), "{said}");
    assert!(second.status.success(), "{}", String::from_utf8_lossy(&second.stderr));
}
