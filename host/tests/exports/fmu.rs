//! `host export --fmu` in another tool: FMPy validates the archive and plays it with a recording's inputs, beside the model's own right-hand side.
//! Needs Python with the package `fmpy`; `PYTHON` names another interpreter.

use std::path::Path;
use std::process::Command;

use crate::program::{host, json};
use host::calibrate::Calibration;
use host::export::Exported;
use host::model::{Input, Stepper};
use host::recording::{self, Recording};
use host::verify::system::System;

/// Largest difference from the model, in shares of the largest value of a variable.
const RTOL: f64 = 1e-9;
const SECONDS: f64 = 5.0;
/// Tolerance of the tool's solver, which multiplies it by the number of its steps.
const SOLVER_RTOL: &str = "1e-14";
/// Parts of a sample by which our own right-hand side is integrated beside the solver; half of them give the same within a tenth of [`RTOL`].
const PARTS: usize = 64;

const PLAY: &str = include_str!("play.py");

fn python() -> Option<Command> {
    let command = || Command::new(std::env::var_os("PYTHON").unwrap_or_else(|| "python3".into()));
    let works = command().args(["-c", "import fmpy"]).output().is_ok_and(|output| output.status.success());
    works.then(command)
}

/// States, then readings, of every sample from rest, with inputs held; a sample in so many equal steps of the estimator.
fn played(exported: &Exported<'_>, inputs: &[Vec<f64>], parts: usize) -> Vec<Vec<f64>> {
    let (calibrated, period_s) = (&exported.calibrated, exported.calibrated.robot().sample_period_s);
    let dynamics = calibrated.model().at(calibrated.z());
    let mut stepper = Stepper::new(exported.integrator());
    let mut system = calibrated.system();
    let (mut x, mut next) = (exported.rest(), exported.rest());
    let mut readings = vec![0.0; exported.readings.len()];
    let mut rows = Vec::new();
    for (k, u) in inputs.iter().enumerate() {
        // A reading that comes late sees the input that is in force: a tool gives the one before the jump.
        let before = &inputs[k.saturating_sub(1)];
        system.outputs_of(&x, before, &mut readings);
        rows.push([&x[..], &readings].concat());
        for part in 0..parts {
            let time_s = (k as f64 + part as f64 / parts as f64) * period_s;
            let input = Input { u, by_delay: &[], time_s };
            stepper.step(&dynamics, &x, input, period_s / parts as f64, &mut next);
            std::mem::swap(&mut x, &mut next);
        }
    }
    rows
}

/// The largest difference of two runs, in shares of the largest value of each variable.
fn apart(found: &[Vec<f64>], expected: &[Vec<f64>]) -> f64 {
    assert_eq!(found.len(), expected.len());
    let of = |column: usize| {
        let largest = expected.iter().map(|row| row[column].abs()).fold(0.0, f64::max);
        let worst = found.iter().zip(expected).map(|(a, b)| (a[column] - b[column]).abs()).fold(0.0, f64::max);
        worst / largest
    };
    (0..expected[0].len()).map(of).fold(0.0, f64::max)
}

/// The recording's inputs from the end of its rest on.
fn inputs(recording: &Recording, samples: usize) -> Vec<Vec<f64>> {
    let first = recording.rest_window().end;
    (first..first + samples).map(|k| recording.duty.iter().map(|duty| duty[k]).collect()).collect()
}

fn write_table(path: &Path, inputs: &[Vec<f64>], period_s: f64) {
    let row = |(k, u): (usize, &Vec<f64>)| {
        let numbers: Vec<String> = u.iter().map(|u| format!("{u:?}")).collect();
        format!("{:?},{}\n", k as f64 * period_s, numbers.join(","))
    };
    std::fs::write(path, inputs.iter().enumerate().map(row).collect::<String>()).unwrap();
}

#[test]
fn fmpy_finds_nothing_wrong_and_plays_what_the_model_plays() {
    let Some(mut python) = python() else {
        eprintln!(
            "SKIPPED fmpy_finds_nothing_wrong_and_plays_what_the_model_plays: python3 -m pip install fmpy, or PYTHON=… with it"
        );
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let short = concat!(env!("CARGO_MANIFEST_DIR"), "/src/simulate/motion/short.toml");
    host(folder.path(), &["record", "-q", "--port", "sim:seed=4", "--motion", short, "-o", "run.mcap"], 0);
    host(folder.path(), &["calibrate", "-q", "run.mcap", "-o", "cal.json"], 0);
    let said = host(folder.path(), &["export", "cal.json", "--fmu", "doggy.fmu"], 0);
    assert!(said.contains("exact        binary: for ") && said.contains("doggy.fmu: 12 states"), "{said}");

    let calibration: Calibration = serde_json::from_value(json(&at("cal.json"))).unwrap();
    let exported = Exported::of(&calibration).unwrap();
    let recording = recording::read(&at("run.mcap")).unwrap();
    let period_s = exported.calibrated.robot().sample_period_s;
    let inputs = inputs(&recording, (SECONDS / period_s).round() as usize + 1);
    write_table(&at("inputs.csv"), &inputs, period_s);
    std::fs::write(at("play.py"), PLAY).unwrap();
    let output = python
        .current_dir(folder.path())
        .args(["play.py", "doggy.fmu", "inputs.csv", &format!("{period_s}"), SOLVER_RTOL])
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{said}");
    let output = String::from_utf8(output.stdout).unwrap();
    let mut lines = output.lines();
    let named = exported.states.iter().map(|state| format!("x.{}", state.name));
    let named: Vec<String> = named.chain(exported.readings.iter().map(|channel| channel.name.clone())).collect();
    assert_eq!(lines.next().unwrap(), named.join(" "));
    let rows: Vec<Vec<f64>> =
        lines.map(|line| line.split_whitespace().map(|word| word.parse().unwrap()).collect()).collect();
    assert_eq!(rows.len(), 2 * inputs.len());
    let (co_simulation, model_exchange) = rows.split_at(inputs.len());

    let (by_steps, finely, by_half) =
        (played(&exported, &inputs, 1), played(&exported, &inputs, PARTS), played(&exported, &inputs, PARTS / 2));
    let farthest = by_steps.iter().map(|row| row[0].abs()).fold(0.0, f64::max);
    assert!(farthest > 0.05, "it stands: {farthest}");
    let (steps, solved, converged) =
        (apart(co_simulation, &by_steps), apart(model_exchange, &finely), apart(&by_half, &finely));
    println!(
        "in FMPy over {SECONDS} s: co-simulation {steps:.1e} from the estimator's steps, model exchange by CVode {solved:.1e} from its right-hand side (converged to {converged:.1e})"
    );
    assert!(converged <= 0.1 * RTOL, "{converged:e}");
    assert!(steps <= RTOL && solved <= RTOL, "{steps:e}, {solved:e}");
}
