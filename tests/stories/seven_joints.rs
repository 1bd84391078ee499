//! A made-up arm of seven elastic joints with two gyros: chain and inertias from a URDF, a minute of motion of its own, every parameter back.

use std::path::{Path, PathBuf};

use tests::{host_succeeds, json, shares};

/// A file of the made-up robot.
fn given(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("robots").join(name)
}

#[test]
fn seven_joints_with_two_gyros_are_calibrated() {
    let scratch = tempfile::tempdir().unwrap();
    let at = |name: &str| scratch.path().join(name);
    let (run, truth, cal) = (at("run.mcap"), at("truth.json"), at("cal.json"));
    let port = format!("sim:robot={},seed=3,truth={}", given("arm7.toml").display(), truth.display());
    let motion = given("arm7_motion.toml");
    let record = ["record", "--baud", "3000000", "--port", &port, "--motion"].map(Path::new);
    host_succeeds(record.into_iter().chain([&*motion, Path::new("-o"), &run]));
    // The robot file lies inside the recording, complete: neither it nor the URDF is needed any more.
    let calibrate = ["calibrate", "--noise", "fixed", "-o"].map(Path::new);
    let said = host_succeeds(calibrate.into_iter().chain([&*cal, &run]));

    let (cal, truth) = (json(&cal), json(&truth));
    assert_eq!(cal["status"], "converged", "{said}");
    assert!(cal["recordings"][0]["samples"].as_u64().unwrap() >= 60_000, "{}", cal["recordings"]);
    let shares = shares(&cal, &truth);
    // Three shared parameters, and friction, stiffness and damping of every joint.
    assert_eq!(shares.len(), 3 + 3 * 7);
    let (name, worst) = &shares[shares.len() - 1];
    eprintln!("seven joints: worst {:.4} % ({}), {}", 100.0 * worst.abs(), name, cal["seconds"]);
    // Measured: 0.034 %, the damping of the second joint. A file that told the truth would be off by nothing.
    assert!((1e-5..2e-3).contains(&worst.abs()), "{shares:?}");
}
