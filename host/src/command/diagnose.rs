//! `host diagnose`: what the model gets wrong, by name, and what knowing it brings.

use std::path::PathBuf;

use super::calibrate::calibrate_failure;
use super::verify::verify_failure;
use super::{Exit, Failure, FitnessArgs, ResultArgs, Ui, read_failure, robot_failure};
use crate::diagnose::{self, DiagnoseError, Diagnosis, Options, Verdict};
use crate::robot::Robot;
use crate::{recording, report};

/// Show what the model gets wrong, name the cause, measure what knowing it brings
///
/// Calibrates the base model, tries every effect of the catalogue on what it leaves unexplained, and holds the best name against curves
/// without a shape. The gain is measured on a second recording, or on the last third of the first.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The recording to explain
    #[arg(value_name = "RUN")]
    recording: PathBuf,
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
    let run = recording::read(&args.recording).map_err(read_failure)?;
    let holdout = args.holdout.as_deref().map(recording::read).transpose().map_err(read_failure)?;
    for recording in [&run].into_iter().chain(&holdout) {
        args.fitness.look(recording, recording.source.path.display(), ui)?;
    }
    let robot = other.unwrap_or_else(|| run.robot.clone());
    let progress = ui.busy("reading");
    let options = Options { without: args.without, ..Options::default() };
    let diagnosis = diagnose::diagnose(&robot, &run, holdout.as_ref(), &options, &|step| progress.stage(step))
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
        DiagnoseError::Verify(error) => verify_failure(error),
        DiagnoseError::Effect(error) => Failure::usage(error).advice("`host effects` prints the catalogue"),
    }
}

/// The findings for people.
pub(super) fn print(ui: &Ui, diagnosis: &Diagnosis) {
    ui.say(&diagnosis.summary);
    for finding in &diagnosis.findings {
        ui.say(format_args!(
            "{}: {:.0} % of what the base model leaves unexplained, p {:.1e}",
            finding.effect,
            100.0 * finding.explained_excess,
            finding.p_value
        ));
        for p in &finding.parameters {
            let error = p.std_error.map_or_else(String::new, |error| format!(" ± {error:.2e}"));
            ui.say(format_args!("    {:<28} {:>12.6}{error} {}", p.name, p.estimate, p.unit));
        }
        if !finding.aliases.is_empty() {
            ui.say(format_args!("    this motion cannot tell it from {}", finding.aliases.join(", ")));
        }
    }
    if let Some(finding) = diagnosis.findings.first() {
        for gain in finding.gain.iter().filter(|gain| gain.horizon_s == 0.5) {
            ui.say(format_args!(
                "    error 500 ms ahead, {:<18} {:.3e} before, {:.3e} after: {:.0} % less [{:.0}, {:.0}]",
                gain.channel,
                gain.gain.rmse_base,
                gain.gain.rmse_extended,
                100.0 * gain.gain.gain,
                100.0 * gain.gain.ci95[0],
                100.0 * gain.gain.ci95[1]
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
