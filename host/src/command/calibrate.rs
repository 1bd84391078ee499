//! `host calibrate`: parameters from recordings.

use std::path::PathBuf;

use super::{Exit, Failure, FitnessArgs, ResultArgs, Ui, read_failure, robot_failure};
use crate::calibrate::{Calibration, Method, NoiseSource, Preset, Status, calibrate_extended};
use crate::command::arguments::Choice;
use crate::failure::calibrate_failure;
use crate::recording::{self, Recording};
use crate::report;
use crate::robot::Robot;
use solve::levenberg::{Iteration, Settings};

/// Calibrate the elastic-joint model on one or more recordings
///
/// All states of all samples and the shared parameters are estimated together by least squares. Ticks that are missing
/// break the chain of states; nothing is interpolated. Several recordings share all parameters but the gyros' biases.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Recordings of one robot
    #[arg(value_name = "RUN", required = true)]
    recordings: Vec<PathBuf>,
    /// Another description of the robot than the one in the recording: a built-in name or a file
    #[arg(long, value_name = "ROBOT")]
    robot: Option<String>,
    /// Assumptions: `default`, or `paper` to reproduce the paper with its biases
    #[arg(long, value_enum, default_value_t = Choice(Preset::Default))]
    preset: Choice<Preset>,
    /// Noise of sensors and model steps: from the recording itself (`default` does so), or as the robot file and the preset say (`paper`,
    /// and robots whose file says what is unmodelled)
    #[arg(long, value_enum)]
    noise: Option<Choice<NoiseSource>>,
    /// Extend the base model by this effect; `host effects` lists them. Can be given several times
    #[arg(long = "extend", value_name = "ID")]
    extensions: Vec<String>,
    #[command(flatten)]
    fitness: FitnessArgs,
    #[command(flatten)]
    result: ResultArgs,
}

/// Reads, calibrates, writes the result, prints the table of parameters.
pub fn run(args: Args, ui: &Ui) -> Result<Exit, Failure> {
    let outputs = args.result.claim()?;
    let other = args.robot.as_deref().map(Robot::load).transpose().map_err(robot_failure)?;
    let recordings = args
        .recordings
        .iter()
        .map(|path| recording::read(path).map_err(|error| read_failure(error).about(path.display())))
        .collect::<Result<Vec<Recording>, _>>()?;
    let recordings: Vec<&Recording> = recordings.iter().collect();
    // clap asks for at least one recording
    let robot = other.map_or_else(|| recordings[0].robot.clone(), |other| recordings[0].suited(other));
    for recording in &recordings {
        for damage in &recording.damage {
            ui.say(format_args!("{}: {damage}", recording.source.path.display()));
        }
        args.fitness.look(recording, recording.source.path.display(), ui)?;
    }
    let method = Method::suited(args.preset.0, &robot);
    let method = Method { noise: args.noise.map_or(method.noise, |noise| noise.0), ..method };
    let calibration = solve_extended(&robot, &recordings, method, &args.extensions, ui)?;
    print_table(ui, &calibration);
    let mut page = report::calibration::page(&calibration);
    if args.preset.0 == Preset::Paper && args.result.report.is_some() {
        // The page shows what the paper's assumptions cost.
        let default = solve(&robot, &recordings, Method::suited(Preset::Default, &robot), ui)?;
        page.push(report::calibration::paper_beside_default(&default, &calibration, robot.sample_period_s));
    }
    outputs.finish(ui, &calibration, || page.to_html())?;
    Ok(match calibration.status {
        Status::DoesNotFit if args.fitness.unchecked => Exit::Ok,
        Status::DoesNotFit => Exit::Data,
        status if status.is_usable() => Exit::Ok,
        _ => Exit::NoConvergence,
    })
}

/// Calibrates with a progress line.
pub(super) fn solve(
    robot: &Robot,
    recordings: &[&Recording],
    method: impl Into<Method>,
    ui: &Ui,
) -> Result<Calibration, Failure> {
    solve_extended(robot, recordings, method.into(), &[], ui)
}

/// Calibrates the base model, and from there the extended one.
fn solve_extended(
    robot: &Robot,
    recordings: &[&Recording],
    method: Method,
    extensions: &[String],
    ui: &Ui,
) -> Result<Calibration, Failure> {
    let progress = ui.busy("calibrating");
    let note = |iteration: usize, state: &Iteration| {
        progress.note(format!("iteration {iteration}, cost {:.6e}", state.cost));
        tracing::debug!(iteration, cost = state.cost, damping = state.damping, trials = state.trials);
    };
    let settings = Settings::default();
    calibrate_extended(robot, recordings, method, extensions, &settings, note).map_err(calibrate_failure)
}

/// What does not fit, and the parameters as a table for people.
pub(super) fn print_table(ui: &Ui, calibration: &Calibration) {
    if !calibration.misfit.is_empty() {
        ui.say(format_args!("does not fit: {}", calibration.misfit.join("; ")));
    }
    ui.say(format_args!("{:<12} {:>12} {:>14} {:>12}  unit", "parameter", "initial", "estimate", "± error"));
    for p in &calibration.parameters {
        let error = p.std_error.map_or("not shown".to_string(), |error| format!("{error:.2e}"));
        ui.say(format_args!("{:<12} {:>12.6} {:>14.6} {:>12}  {}", p.name, p.initial, p.estimate, error, p.unit));
    }
    for direction in &calibration.unobservable {
        let names: Vec<_> = direction.direction.iter().map(|(name, share)| format!("{share:+.2} {name}")).collect();
        ui.say(format_args!("not observable: {} ({})", names.join(" "), direction.reason));
    }
    for noise in calibration.noise.iter().filter(|noise| noise.left_out > 0) {
        let reads = if noise.left_out == 1 { "reading" } else { "readings" };
        ui.say(format_args!("left out as outliers: {} {reads} of {}", noise.left_out, noise.channel));
    }
    let status = match calibration.status {
        Status::Converged => "converged",
        Status::Almost => "almost converged",
        Status::NoProgress => "no progress: the estimates are not a minimum",
        Status::IterationLimit => "iteration limit reached: the estimates are not a minimum",
        Status::Unidentifiable => "converged; some parameters cannot be told from this motion",
        Status::DoesNotFit => "converged, but the model does not fit",
    };
    for note in &calibration.notes {
        ui.say(format_args!("note: {note}"));
    }
    if let Some(scatter) = calibration.scatter.filter(|scatter| scatter.coloured) {
        ui.say(format_args!(
            "what the model leaves is no white noise (between {} blocks of time it scatters {:.1} times as much): errors are those of the scatter",
            scatter.blocks,
            scatter.ratio.sqrt()
        ));
    }
    ui.say(format_args!(
        "{status} after {} iterations in {:.1} s, cost {:.6e} at {:.3e} degrees of freedom",
        calibration.iterations, calibration.seconds.total, calibration.cost, calibration.dof
    ));
}
