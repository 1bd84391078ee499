//! Stories of `host bringup`: simulated robots that are right, and with one mistake each.

use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Instant;

use serde_json::Value;

/// How far a joint may go in a bring-up, motor or link, rad.
const FARTHEST_RAD: f64 = 0.1;

/// What became of a bring-up: exit code, what was said, how far the true joints went.
struct Ended {
    code: Option<i32>,
    said: String,
    farthest_rad: f64,
}

/// Brings a simulated robot up in a folder.
fn bring_up(folder: &Path, port: &str, more: &[&str]) -> Ended {
    let truth = folder.join("truth.json");
    let port = format!("{port},truth={}", truth.display());
    let output = Command::new(env!("CARGO_BIN_EXE_host"))
        .args(["bringup", "--force", "--port", &port, "-o"])
        .arg(folder.join("robot.toml"))
        .args(more)
        .stdin(Stdio::null())
        .output()
        .unwrap();
    let said = String::from_utf8(output.stderr).unwrap();
    let truth: Value = serde_json::from_str(&std::fs::read_to_string(&truth).unwrap()).unwrap();
    let farthest = truth["farthest"].as_array().unwrap().iter().map(|way| way.as_f64().unwrap());
    let farthest_rad = farthest.fold(0.0, f64::max);
    eprintln!("{port}: exit {:?}, at most {farthest_rad:.4} rad\n{said}", output.status.code());
    Ended { code: output.status.code(), said, farthest_rad }
}

/// The mistake is named, no description is written, and no joint went far.
fn named(mistake: &str, words: &[&str]) {
    let folder = tempfile::tempdir().unwrap();
    let Ended { code, said, farthest_rad } = bring_up(folder.path(), &format!("sim:seed=7,mistake={mistake}"), &[]);
    assert_eq!(code, Some(4), "{mistake}: {said}");
    for word in words {
        assert!(said.contains(word), "{mistake}: no \"{word}\" in\n{said}");
    }
    assert!(farthest_rad < FARTHEST_RAD, "{mistake}: {farthest_rad} rad");
    assert!(!folder.path().join("robot.toml").exists());
}

#[test]
fn robots_that_are_right_are_brought_up() {
    for port in ["sim:seed=1", "sim:seed=2", "sim:robot=one_joint,seed=3"] {
        let folder = tempfile::tempdir().unwrap();
        let Ended { code, said, farthest_rad } = bring_up(folder.path(), port, &[]);
        assert_eq!(code, Some(0), "{port}: {said}");
        assert!(farthest_rad > 0.005 && farthest_rad < FARTHEST_RAD, "{port}: {farthest_rad}");
        let text = std::fs::read_to_string(folder.path().join("robot.toml")).unwrap();
        assert!(host::robot::Robot::parse(&text).is_ok() && text.starts_with("# Brought up"), "{text}");
    }
}

#[test]
fn swapped_encoders_are_named() {
    named("encoders-swapped=1+2", &["encoders 1 and 2 are swapped", "encoder 2 ──╱ ╲──▶ counter 2"]);
    named("encoders-swapped=2+3", &["encoders 2 and 3 are swapped"]);
}

#[test]
fn swapped_motors_are_named() {
    named("motors-swapped=1+3", &["motors 1 and 3 are swapped", "driver 1 ──╲ ╱──▶ motor 1"]);
}

#[test]
fn a_reversed_encoder_is_named() {
    named("encoder-reversed=1", &["encoder 1 counts backwards", "swap phases A and B"]);
    named("encoder-reversed=3", &["encoder 3 counts backwards"]);
}

#[test]
fn reversed_leads_are_named() {
    named("leads-reversed=2", &["motor 2 turns backwards", "swap the two leads"]);
}

#[test]
fn an_open_phase_is_named() {
    named("encoder-phase=1", &["one phase of encoder 1 is open", "goes to and fro by 1"]);
    named("encoder-phase=3", &["one phase of encoder 3 is open"]);
}

#[test]
fn wrong_counts_are_named() {
    named("counts=1*0.5", &["encoder 1 has 0.5 times the counts", "not all four edges"]);
    named("counts=2*4", &["encoder 2 has 4 times the counts"]);
}

#[test]
fn a_wrong_gear_is_named() {
    named("gear=3*0.7", &["the gear of joint 3 is about", "42.092"]);
}

#[test]
fn a_turned_gyro_is_named() {
    named("gyro-turned=2z", &["gyro 2 is turned by -90° about its z axis", "which way do its axes point"]);
    named("gyro-turned=1x", &["gyro 1 is turned by"]);
}

#[test]
fn a_mirrored_gyro_is_named() {
    named("gyro-mirrored=2y", &["gyro 2 is mirrored", "+x, -y, +z"]);
    // The only joint that turns gyro 1 is along its y.
    named("gyro-mirrored=1y", &["gyro 1 is turned by", "or mirrored"]);
}

/// What the description says and the firmware does not is told before anything moves.
#[test]
fn a_description_of_another_robot_is_refused_at_rest() {
    let folder = tempfile::tempdir().unwrap();
    let start = folder.path().join("start.toml");
    let doggy = host::robot::Robot::builtin("doggy").unwrap().toml().replace("gear = 42.092", "gear = 30.0");
    std::fs::write(&start, doggy).unwrap();
    let Ended { code, said, farthest_rad } =
        bring_up(folder.path(), "sim:seed=1", &["--robot", start.to_str().unwrap()]);
    assert_eq!((code, farthest_rad), (Some(4), 0.0), "{said}");
    assert!(said.contains("is 42.092 on the device and 30 in the description") && said.contains("--blank"), "{said}");
}

/// Doggy's description before anybody has seen its drives and sensors: chain, bodies and limits are from the drawings.
fn blank_doggy() -> String {
    let text = host::robot::Robot::builtin("doggy").unwrap().toml().to_owned();
    let line = |line: &str| match line.split(" = ").next().unwrap_or_default() {
        "counts_per_turn" | "range_rad_s" => None,
        "gear" => Some("gear = 1.0".to_owned()),
        "mu" => Some("mu = { start = 1.0 }".to_owned()),
        "bias_rad_s" => Some("bias_rad_s = { start = [0.0, 0.0, 0.0] }".to_owned()),
        // That of the third joint's frame stays: it has no start.
        "rotation" if line.contains("start") => {
            Some("rotation = { start = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]] }".to_owned())
        }
        _ => Some(line.to_owned()),
    };
    text.lines().filter_map(line).map(|line| line + "\n").collect()
}

/// A new robot on the table: brought up from a blank description, switched on again in its marked pose, recorded and
/// calibrated.
#[test]
fn from_a_blank_description_to_a_calibration() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name).display().to_string();
    std::fs::write(at("blank.toml"), blank_doggy()).unwrap();
    let host = |arguments: &[&str]| {
        let output = Command::new(env!("CARGO_BIN_EXE_host")).args(arguments).stdin(Stdio::null()).output().unwrap();
        let said = String::from_utf8(output.stderr).unwrap();
        assert!(output.status.success(), "{arguments:?}:\n{said}");
        said
    };
    let begun = Instant::now();
    let said =
        host(&["bringup", "--port", "sim:seed=5", "--robot", &at("blank.toml"), "--blank", "-o", &at("robot.toml")]);
    eprintln!("{said}bring-up: {:.1} s", begun.elapsed().as_secs_f64());
    let robot = host::robot::Robot::load(&at("robot.toml")).unwrap();
    assert_eq!(robot.joints[2].gear, 42.092);
    let nominal = host::robot::Robot::builtin("doggy").unwrap();
    assert_eq!(robot.gyros().nth(1).unwrap().rotation, nominal.gyros().nth(1).unwrap().rotation, "three axes tell all");
    host(&["robot", "show", &at("robot.toml")]);

    let port = format!("sim:seed=5,truth={}", at("truth.json"));
    host(&["record", "--port", &port, "--robot", &at("robot.toml"), "-o", &at("run.mcap")]);
    host(&["calibrate", &at("run.mcap"), "-o", &at("cal.json")]);
    let read = |name: &str| -> Value { serde_json::from_str(&std::fs::read_to_string(at(name)).unwrap()).unwrap() };
    let (calibration, truth) = (read("cal.json"), read("truth.json"));
    assert_eq!(calibration["status"], "converged");
    let estimates = calibration["parameters"].as_array().unwrap();
    let mut compared = 0;
    for value in truth["truth"].as_array().unwrap() {
        let name = value["name"].as_str().unwrap();
        if name.starts_with("bias") || name.starts_with("R_imu") {
            continue;
        }
        let estimate =
            estimates.iter().find(|parameter| parameter["name"] == name).unwrap()["estimate"].as_f64().unwrap();
        let off = estimate / value["value"].as_f64().unwrap() - 1.0;
        eprintln!("{name}: {:+.4} %", 100.0 * off);
        assert!(off.abs() < 1e-3, "{name} is off by {:.3} %", 100.0 * off);
        compared += 1;
    }
    assert_eq!(compared, 12);
}
