//! The studies of how often intervals hold the truth and how often hidden effects are found, also in robots outside of the model class, the riddle of the bearing, and helpers of the stories: the `host` binary run as a process, scratch folders, the folder of independent recordings.
#![forbid(unsafe_code)]

pub mod coverage;
pub mod decisions;
pub mod healthy;
pub mod hidden;
pub mod machine;
pub mod observed;
pub mod riddle;
pub mod separation;
pub mod study;
pub mod wrong_world;

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// The `host` binary of this build.
///
/// # Panics
/// If it was not built: `tests/run` builds it first.
pub fn host() -> Command {
    let test = std::env::current_exe().expect("a running test has a path");
    // target/debug/deps/story-hash → target/debug/host
    let binary = test.parent().and_then(Path::parent).expect("tests lie in deps").join("host");
    assert!(binary.exists(), "{} is not built: run tests/run, or cargo build first", binary.display());
    Command::new(binary)
}

/// Runs `host` with these arguments to its end.
pub fn run_host<S: AsRef<std::ffi::OsStr>>(arguments: impl IntoIterator<Item = S>) -> Output {
    host().args(arguments).output().expect("the host binary can be started")
}

/// Runs `host`, which must succeed; gives what it printed to stderr.
///
/// # Panics
/// If it ends with another code than 0.
pub fn host_succeeds<S: AsRef<std::ffi::OsStr>>(arguments: impl IntoIterator<Item = S>) -> String {
    let output = run_host(arguments);
    let text = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "host ended with {}:\n{text}", output.status);
    text
}

/// The folder of recordings made by an independent simulator, from `RECORDINGS_DIR`; without it the story is skipped, loudly.
pub fn recordings(story: &str) -> Option<PathBuf> {
    let folder = std::env::var_os("RECORDINGS_DIR").map(PathBuf::from).filter(|folder| folder.is_dir());
    if folder.is_none() {
        eprintln!("SKIPPED {story}: set RECORDINGS_DIR to the folder of independent recordings");
    }
    folder
}

/// The same for a story that takes more than five minutes of a processor: `LONG_STORIES=1` asks for it.
pub fn long_recordings(story: &str) -> Option<PathBuf> {
    if std::env::var_os("LONG_STORIES").is_none() {
        eprintln!("SKIPPED {story}: it takes more than five minutes; LONG_STORIES=1 asks for it");
        return None;
    }
    recordings(story)
}

/// A result file.
///
/// # Panics
/// If it is not there or not JSON.
pub fn json(path: &Path) -> serde_json::Value {
    let text = std::fs::read_to_string(path).expect("the result was written");
    serde_json::from_str(&text).expect("results are JSON")
}

/// A parameter of CAL.json by name.
///
/// # Panics
/// If there is none.
pub fn parameter<'a>(calibration: &'a serde_json::Value, name: &str) -> &'a serde_json::Value {
    calibration["parameters"]
        .as_array()
        .and_then(|list| list.iter().find(|p| p["name"] == name))
        .unwrap_or_else(|| panic!("CAL.json has no parameter {name}"))
}

/// The estimate of a parameter of CAL.json.
///
/// # Panics
/// If there is none.
pub fn estimate(calibration: &serde_json::Value, name: &str) -> f64 {
    parameter(calibration, name)["estimate"].as_f64().unwrap_or_else(|| panic!("{name} has no estimate"))
}

/// Whether a parameter belongs to the dynamics: it is no gyro's bias or rotation.
pub fn is_dynamic(name: &str) -> bool {
    !name.starts_with("bias") && !name.starts_with("R_imu")
}

/// Relative errors of all parameters of the dynamics in CAL.json against what the simulator told, by name, the largest last.
///
/// # Panics
/// If one of them has no estimate.
pub fn shares(calibration: &serde_json::Value, truth: &serde_json::Value) -> Vec<(String, f64)> {
    let values = truth["truth"].as_array().expect("the simulator told the truth");
    let mut shares: Vec<(String, f64)> = values
        .iter()
        .map(|value| (value["name"].as_str().expect("a name"), value["value"].as_f64().expect("a number")))
        .filter(|(name, _)| is_dynamic(name))
        .map(|(name, truth)| (name.to_string(), estimate(calibration, name) / truth - 1.0))
        .collect();
    shares.sort_by(|a, b| a.1.abs().total_cmp(&b.1.abs()));
    shares
}

/// Calibrates a recording with a preset, from the start values of its robot; gives CAL.json.
///
/// # Panics
/// If the calibration does not end with exit code 0.
pub fn calibrate_run(run: &Path, preset: &str) -> serde_json::Value {
    let scratch = tempfile::tempdir().expect("there is room for scratch files");
    let cal = scratch.path().join("cal.json");
    host_succeeds([Path::new("calibrate"), run, Path::new("--preset"), Path::new(preset), Path::new("-o"), &cal]);
    json(&cal)
}
