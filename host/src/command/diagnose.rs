//! `host diagnose`: what the model gets wrong, by name, and what knowing it brings.

use std::path::PathBuf;

use super::calibrate::calibrate_failure;
use super::{Exit, Failure, FitnessArgs, ResultArgs, Ui, read_failure, robot_failure};
use crate::diagnose::{self, DiagnoseError, Diagnosis, Gain, Options, Verdict};
use crate::robot::Robot;
use crate::recording::Recording;
use crate::{recording, report};

/// Show what the model gets wrong, name the cause, measure what knowing it brings
///
/// Calibrates the base model, says whether it fits, and tries every effect of the catalogue on what it leaves unexplained. What predicts blocks of time that no
/// fit has seen is named. The gain is measured on another motion, or on the last third of each recording.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The recordings to explain, of one robot
    #[arg(value_name = "RUN", required = true)]
    recordings: Vec<PathBuf>,
    /// Another motion of the same robot, to measure the gain on
    #[arg(long, value_name = "RUN2")]
    holdout: Option<PathBuf>,
    /// The robot, a built-in name or a file, instead of the one in the recording
    #[arg(long, value_name = "R")]
    robot: Option<String>,
    /// Leave this effect out of the catalogue. Can be given several times
    #[arg(long, value_name = "ID")]
    without: Vec<String>,
    #[command(flatten)]
    fitness: FitnessArgs,
    #[command(flatten)]
    result: ResultArgs,
}

/// Reads, diagnoses, writes the result, prints the findings.
pub fn run(args: Args, ui: &Ui) -> Result<Exit, Failure> {
    let outputs = args.result.claim()?;
    let other = args.robot.as_deref().map(Robot::load).transpose().map_err(robot_failure)?;
    let runs: Vec<Recording> = args.recordings.iter().map(|path| recording::read(path)).collect::<Result<_, _>>().map_err(read_failure)?;
    let holdout = args.holdout.as_deref().map(recording::read).transpose().map_err(read_failure)?;
    for recording in runs.iter().chain(&holdout) {
        args.fitness.look(recording, recording.source.path.display(), ui)?;
    }
    let robot = other.or_else(|| runs.first().map(|run| run.robot.clone()));
    let robot = robot.ok_or_else(|| Failure::usage("no recording was given"))?;
    let progress = ui.busy("reading");
    let options = Options { without: args.without, ..Options::default() };
    let runs: Vec<&Recording> = runs.iter().collect();
    let diagnosis = diagnose::diagnose(&robot, &runs, holdout.as_ref(), &options, &|step| progress.stage(step))
        .map_err(diagnose_failure)?;
    drop(progress);
    print(ui, &diagnosis);
    outputs.finish(ui, &diagnosis, || report::diagnosis::page(&diagnosis).to_html())?;
    Ok(exit(diagnosis.verdict))
}

/// The exit code of a verdict.
fn exit(verdict: Verdict) -> Exit {
    match verdict {
        Verdict::None => Exit::Ok,
        Verdict::Named => Exit::Named,
        Verdict::Unknown => Exit::Unknown,
        Verdict::NotSeparable => Exit::NotSeparable,
    }
}

/// A recording that cannot be diagnosed.
pub(super) fn diagnose_failure(error: DiagnoseError) -> Failure {
    match error {
        DiagnoseError::Calibrate(error) => calibrate_failure(error),
        DiagnoseError::Effect(error) => Failure::usage(error).advice("`host effects` prints the catalogue"),
    }
}

/// The findings for people.
pub(super) fn print(ui: &Ui, diagnosis: &Diagnosis) {
    ui.say(&diagnosis.summary);
    for finding in &diagnosis.findings {
        ui.say(format_args!(
            "{}: {} of what the base model leaves unexplained, p {:.1e}{}",
            finding.effect,
            gain_in_words(&finding.cv_gain),
            finding.p_value,
            finding.holdout_gain.as_ref().map_or_else(String::new, |gain| {
                format!("; on the other motion the error is {} less", gain_in_words(gain))
            })
        ));
        for p in &finding.parameters {
            let error = p.std_error.map_or_else(String::new, |error| format!(" ± {error:.2e}"));
            ui.say(format_args!("    {:<28} {:>12.6}{error} {}", p.name, p.estimate, p.unit));
        }
        if let Some(acts_like) = &finding.acts_like {
            ui.say(format_args!("    {acts_like}"));
        }
        if !finding.flags.is_empty() {
            let flags: Vec<&str> = finding.flags.iter().map(|flag| flag.words()).collect();
            ui.say(format_args!("    {}", flags.join("; ")));
        }
        if !finding.aliases.is_empty() {
            ui.say(format_args!("    this motion cannot tell it from {}", finding.aliases.join(", ")));
        }
    }
    for rejected in &diagnosis.rejected {
        ui.say(format_args!("rejected: {}: {}", rejected.effect, rejected.why));
    }
    if let Some(all) = &diagnosis.holdout_gain {
        for horizon in &all.by_horizon {
            ui.say(format_args!("all sensors, {:>5} s ahead on the other motion: error {} less", horizon.horizon_s, gain_in_words(&horizon.gain)));
        }
    }
    if let Some(finding) = diagnosis.findings.first() {
        for gain in finding.gain.iter().filter(|gain| gain.horizon_s == 0.5) {
            let interval = gain.ci95.map_or_else(String::new, |[low, high]| format!(" [{:.0}, {:.0}]", 100.0 * low, 100.0 * high));
            ui.say(format_args!(
                "    error 500 ms ahead, {:<18} {:.3e} before, {:.3e} after: {:.0} % less{interval}",
                gain.channel,
                gain.rmse_base,
                gain.rmse_extended,
                100.0 * gain.gain,
            ));
        }
    }
    for defect in diagnosis.unexplained.places.iter().take(3) {
        let axis = defect.axis.map_or_else(String::new, |axis| format!(" of joint {axis}"));
        ui.say(format_args!(
            "left over: {:.0} % as a function of {}{axis}",
            100.0 * defect.share,
            defect.argument.replace('_', " ")
        ));
    }
}

/// A share with its interval, in per cent.
fn gain_in_words(gain: &Gain) -> String {
    let interval = gain.ci95.map_or_else(String::new, |[low, high]| format!(" [{:.0}, {:.0}]", 100.0 * low, 100.0 * high));
    format!("{:.0} %{interval}", 100.0 * gain.share)
}
