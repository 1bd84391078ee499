//! `host demo`: the whole way on a simulated robot, no hardware and no question asked. Something is hidden in it, and has to be found.

use std::path::{Path, PathBuf};
use std::process::Command;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::calibrate::print_table;
use super::diagnose::print as print_findings;
use super::{Exit, Failure, NewFile, Ui, json, read_failure, robot_failure};
use crate::calibrate::{Calibration, comparable_truth, foresight};
use crate::diagnose::{Options as How, Verdict, diagnose};
use crate::effect::{Effect, Size, TrueValue};
use crate::failure::{diagnose_failure, simulate_failure, verify_failure};
use crate::recording::check::check;
use crate::recording::{self, Recording};
use crate::report;
use crate::robot::Robot;
use crate::simulate::{EffectChoice, Options, Simulator};
use crate::verify;

/// Show the whole way on a simulated robot: record, check, calibrate, diagnose, verify
///
/// A simulated Doggy with parameters of its own, and with something that the model does not know, moves through the calibration motion and
/// another one behind a pseudo-terminal and is recorded from there as a real one would be. Ends with the table of truth, start and
/// estimate, and with what was hidden and whether it was found.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Folder for the recordings, results and the page [default: demo, or demo-2, demo-3 … if that exists]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Decides the true parameters, the noise and what is hidden
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Write the page here instead of into the folder
    #[arg(long, value_name = "OUT.html")]
    report: Option<PathBuf>,
    /// Replace files that exist
    #[arg(long)]
    force: bool,
}

/// The robot of the demonstration.
const ROBOT: &str = "doggy";

/// What may be hidden in it: effects of every part of the robot.
const HIDDEN: [&str; 6] = ["base_bearing", "voltage_sag", "gravity_residual", "cogging", "belt_hardening", "coriolis"];

/// A dynamic parameter farther from its truth than this was not found.
const WORST_SHARE: f64 = 0.01;

/// Simulates, records twice, checks, calibrates, diagnoses, verifies, compares with the truth.
pub fn run(args: Args, ui: &Ui) -> Result<Exit, Failure> {
    let folder = folder(args.out.as_deref())?;
    let robot = Robot::load(ROBOT).map_err(robot_failure)?;
    let page_path = args.report.unwrap_or_else(|| folder.join("demo.html"));
    let page_file = NewFile::claim(&page_path, args.force)?;
    let cal_file = NewFile::claim(&folder.join("calibration.json"), args.force)?;
    let diag_file = NewFile::claim(&folder.join("diagnosis.json"), args.force)?;

    ui.say(format_args!("1. A simulated {ROBOT}, seed {}, behind a pseudo-terminal, with something inside", args.seed));
    let hidden = hidden(args.seed)?;
    let choice = EffectChoice { effect: hidden, size: Size::Medium };
    let options = Options { seed: args.seed, effects: vec![choice], ..Options::new(robot.clone()) };
    let simulator = Simulator::start(&options).map_err(simulate_failure)?;
    let inside: Vec<TrueValue> = simulator.effects().iter().flat_map(|effect| effect.parameters.clone()).collect();
    let mut truth = comparable_truth(&robot, simulator.truth());
    truth.extend(inside.iter().cloned());
    ui.say("2. Recording the calibration motion and another one");
    let calibration_run = record(simulator.path(), "calibration", true, &folder, args.force)?;
    let validation_run = record(simulator.path(), "validation", false, &folder, args.force)?;
    simulator.finish().map_err(simulate_failure)?;

    ui.say("3. Checking");
    let mut checked = check(&calibration_run);
    foresight::look(&calibration_run, &mut checked);
    for finding in &checked.findings {
        ui.say(format_args!("{}: {}", finding.severity.name(), finding.message));
    }
    if !checked.usable {
        return Err(Failure::data("the recording of the simulated robot is not fit for calibration"));
    }
    ui.say("fit for calibration");
    ui.say("4. Calibrating, and looking for what the model lacks");
    let progress = ui.busy("calibrating");
    let diagnosis =
        diagnose(&robot, &[&calibration_run], Some(&validation_run), &How::default(), &|step| progress.stage(step))
            .map_err(diagnose_failure)?;
    drop(progress);
    let calibration = &diagnosis.extended;
    print_table(ui, calibration);
    print_findings(ui, &diagnosis);
    ui.say("5. Predicting the other motion");
    let progress = ui.busy("reading");
    let (verification, traces) =
        verify::verify(calibration, &validation_run, |step| progress.stage(step)).map_err(verify_failure)?;
    drop(progress);
    super::verify::print_table(ui, &verification);

    ui.say("6. Against the truth");
    let worst = compare(ui, calibration, &truth);
    ui.say(format_args!("the parameter farthest from its truth is {:.4} % off", 100.0 * worst));
    ui.say(format_args!("hidden was {} ({})", hidden.id, hidden.title));
    for value in &inside {
        ui.say(format_args!("    {:<28} {:>12.6} {}", value.name, value.value, value.unit));
    }
    let named: Vec<&str> = diagnosis.findings.iter().map(|finding| finding.effect.as_str()).collect();
    let is_found = diagnosis.verdict == Verdict::Named && named == [hidden.id];
    ui.say(if is_found { "found: that, and nothing else" } else { "found: something else, see above" });

    cal_file.finish_with(json(calibration)?.as_bytes())?;
    diag_file.finish_with(json(&diagnosis)?.as_bytes())?;
    let page = report::demo::page(&diagnosis, &truth, &validation_run, &verification, &traces).to_html();
    page_file.finish_with(page.as_bytes())?;
    ui.say(format_args!("the page: {}", page_path.display()));
    Ok(match calibration.status.is_usable() {
        true if is_found && worst < WORST_SHARE => Exit::Ok,
        true => Exit::NotFound,
        false => Exit::NoConvergence,
    })
}

/// What the seed hides.
fn hidden(seed: u64) -> Result<&'static Effect, Failure> {
    let drawn = ChaCha8Rng::seed_from_u64(seed).random_range(0..HIDDEN.len());
    Effect::by_id(HIDDEN[drawn]).map_err(Failure::fault)
}

/// The folder that was asked for, or a new one.
fn folder(wanted: Option<&Path>) -> Result<PathBuf, Failure> {
    let folder = wanted.map(Path::to_owned).unwrap_or_else(|| {
        let name = |n: u32| PathBuf::from(if n == 1 { "demo".to_string() } else { format!("demo-{n}") });
        (1..).map(name).find(|folder| !folder.exists()).unwrap_or_else(|| name(1))
    });
    std::fs::create_dir_all(&folder).map_err(|error| {
        Failure::device(format!("cannot make the folder {}: {error}", folder.display())).advice("give another --out")
    })?;
    Ok(folder)
}

/// Records a motion as a user does: with `host record`, in a process of its own. The robot starts in its marked pose, and keeps its zero
/// positions from then on.
fn record(port: &Path, motion: &str, set_zero: bool, folder: &Path, force: bool) -> Result<Recording, Failure> {
    let run = folder.join(format!("{motion}.mcap"));
    let host = std::env::current_exe().map_err(Failure::fault)?;
    let mut command = Command::new(host);
    command.arg("record").arg("--port").arg(port).args(["--motion", motion, "-o"]).arg(&run);
    if set_zero {
        command.arg("--set-zero");
    }
    if force {
        command.arg("--force");
    }
    let status = command.status().map_err(Failure::fault)?;
    if !status.success() {
        return Err(Failure::device(format!("recording the {motion} motion ended with {status}")));
    }
    recording::read(&run).map_err(read_failure)
}

/// Truth, start and estimate ± error of every parameter; gives the largest relative error of a parameter of the dynamics.
fn compare(ui: &Ui, calibration: &Calibration, truth: &[TrueValue]) -> f64 {
    let mut worst: f64 = 0.0;
    ui.say(format_args!(
        "{:<12} {:>12} {:>12} {:>14} {:>12}  unit",
        "parameter", "truth", "start", "estimate", "± error"
    ));
    for p in &calibration.parameters {
        let Some(true_value) = truth.iter().find(|value| value.name == p.name) else { continue };
        let error = p.std_error.map_or("not shown".to_string(), |error| format!("{error:.2e}"));
        ui.say(format_args!(
            "{:<12} {:>12.6} {:>12.6} {:>14.6} {:>12}  {}",
            p.name, true_value.value, p.initial, p.estimate, error, p.unit
        ));
        if !p.name.starts_with("bias") && !p.name.starts_with("R_imu") {
            worst = worst.max((p.estimate / true_value.value - 1.0).abs());
        }
    }
    worst
}
