//! The C of `host export --c` in an optimal control problem of CasADi: a calibrated model leads the simulated robot along a path better than a guess does.
//! Needs Python with the package `casadi`; `PYTHON` names another interpreter.

use std::path::Path;
use std::process::Command;

use crate::program::{host, json};
use host::simulate::{Drawn, Options};

/// By which factor, at least, the calibrated model tracks better than the description's start values.
const FACTOR: f64 = 10.0;
const ROBOT: &str = "seed=4";
const TRACK: &str = include_str!("track.py");

fn python() -> Option<Command> {
    let command = || Command::new(std::env::var_os("PYTHON").unwrap_or_else(|| "python3".into()));
    let works = command().args(["-c", "import casadi"]).output().is_ok_and(|output| output.status.success());
    works.then(command)
}

/// Root mean square distance of the robot's links from the path of `track.py` over its samples, rad, under the inputs that a model's parameters lead to.
fn distance_rad(folder: &Path, parameters: &str) -> f64 {
    let mut python = python().unwrap();
    let output =
        python.current_dir(folder).args(["track.py", "./doggy.so", "cal.json", parameters, "0.001"]).output().unwrap();
    assert!(output.status.success(), "{parameters}: {}", String::from_utf8_lossy(&output.stderr));
    let output = String::from_utf8(output.stdout).unwrap();
    let mut world = Drawn::new(&Options::parse(ROBOT).unwrap()).unwrap().world;
    world.begin_motion();
    let (mut sum, mut count) = (0.0, 0.0);
    for (k, line) in output.lines().enumerate() {
        let u: Vec<f64> = line.split_whitespace().map(|word| word.parse().unwrap()).collect();
        world.pass(&u);
        let share = 0.5 * (1.0 - (std::f64::consts::TAU * (k + 1) as f64 * 0.001).cos());
        for (joint, end_rad) in [0.3, -0.2, 0.25].into_iter().enumerate() {
            sum += (world.plant().link_position(joint) - end_rad * share).powi(2);
            count += 1.0;
        }
    }
    assert_eq!(count, 3.0 * 500.0);
    (sum / count).sqrt()
}

#[test]
fn a_calibrated_model_leads_the_robot_along_a_path_better_than_a_guess() {
    if python().is_none() {
        eprintln!(
            "SKIPPED a_calibrated_model_leads_the_robot_along_a_path_better_than_a_guess: python3 -m pip install casadi, or PYTHON=… with it"
        );
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let short = concat!(env!("CARGO_MANIFEST_DIR"), "/src/simulate/motion/short.toml");
    host(folder.path(), &["record", "-q", "--port", &format!("sim:{ROBOT}"), "--motion", short, "-o", "run.mcap"], 0);
    host(folder.path(), &["calibrate", "-q", "run.mcap", "-o", "cal.json"], 0);
    assert_eq!(json(&folder.path().join("cal.json"))["status"], "converged");
    host(folder.path(), &["export", "cal.json", "--c", "doggy.c"], 0);
    let compiled = Command::new("cc")
        .current_dir(folder.path())
        .args(["-O2", "-shared", "-fPIC", "-o", "doggy.so", "doggy.c", "-lm"])
        .status()
        .unwrap();
    assert!(compiled.success());
    std::fs::write(folder.path().join("track.py"), TRACK).unwrap();
    let (calibrated_rad, guess_rad) = (distance_rad(folder.path(), "estimate"), distance_rad(folder.path(), "initial"));
    println!(
        "links beside a path of 0.5 s, inputs by CasADi: {:.2} mrad with the calibrated model, {:.1} mrad with the start values, {:.0} times as far",
        1e3 * calibrated_rad,
        1e3 * guess_rad,
        guess_rad / calibrated_rad
    );
    assert!(guess_rad > FACTOR * calibrated_rad, "{calibrated_rad}, {guess_rad}");
}
