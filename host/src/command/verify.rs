//! `host verify`: how well a calibrated model predicts a recording.

use std::path::{Path, PathBuf};

use super::{Exit, Failure, FitnessArgs, Outputs, ResultArgs, Ui, read_failure};
use crate::calibrate::Calibration;
use crate::failure::{calibration_failure, verify_failure};
use crate::recording::{self, Recording};
use crate::report;
use crate::verify::torque::TorqueVerification;
use crate::verify::{self, Fit, Verification};

/// Predict a recording by a calibrated model
///
/// Free run from the first state over the whole recording with the recorded input, and windowed predictions 10, 100,
/// 500 and 2000 ms ahead from states that only past readings give. Give a recording that the calibration has not seen:
/// that is what tells a good model from a good fit.
///
/// `--metric torque` asks another question of a rigid robot: how much of its motors' torque the model explains along filtered differences of the
/// positions, with the calibrated parameters and with those that the recipe of inverse dynamics finds from the same torques.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The calibration
    #[arg(value_name = "CAL.json")]
    calibration: PathBuf,
    /// The recording to predict
    #[arg(value_name = "RUN")]
    recording: PathBuf,
    /// What is compared
    #[arg(long, value_enum, default_value = "prediction")]
    metric: Metric,
    /// With --metric torque: the recording on which the recipe finds its parameters, if not RUN itself
    #[arg(long, value_name = "RUN0")]
    identify_on: Option<PathBuf>,
    /// With --metric torque: corner of the low-pass of positions, Hz; if it is not given, the highest whose motion explains the torques
    #[arg(long, value_name = "HZ")]
    corner: Option<f64>,
    #[command(flatten)]
    fitness: FitnessArgs,
    #[command(flatten)]
    result: ResultArgs,
}

/// What is compared with a recording.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum Metric {
    /// Readings some time ahead, and a free run
    Prediction,
    /// Torques of a rigid robot by inverse dynamics
    Torque,
}

/// Reads, compares, writes the result, prints its table.
pub fn run(args: Args, ui: &Ui) -> Result<Exit, Failure> {
    match args.metric {
        Metric::Prediction if args.identify_on.is_some() => {
            return Err(Failure::usage("--identify-on belongs to --metric torque"));
        }
        Metric::Prediction if args.corner.is_some() => {
            return Err(Failure::usage("--corner belongs to --metric torque"));
        }
        Metric::Torque if args.corner.is_some_and(|hz| !(hz > 0.0 && hz.is_finite())) => {
            return Err(Failure::usage("--corner takes a positive number of Hz"));
        }
        Metric::Torque if args.result.report.is_some() => {
            return Err(Failure::usage("--metric torque has no page; leave --report out"));
        }
        _ => {}
    }
    let outputs = args.result.claim()?;
    let calibration = read_calibration(&args.calibration)?;
    let recording = recording::read(&args.recording).map_err(read_failure)?;
    let other = args.identify_on.as_deref().map(recording::read).transpose().map_err(read_failure)?;
    for recording in [&recording].into_iter().chain(&other) {
        args.fitness.look(recording, recording.source.path.display(), ui)?;
    }
    match args.metric {
        Metric::Prediction => {
            let fit = predict(&calibration, &recording, outputs, ui)?;
            if fit == Fit::DoesNotFit && !args.fitness.unchecked {
                return Ok(Exit::Data);
            }
        }
        Metric::Torque => {
            let identified_on = other.as_ref().unwrap_or(&recording);
            compare_torques(&calibration, &recording, (identified_on, args.corner), outputs, ui)?;
        }
    }
    Ok(Exit::Ok)
}

fn predict(calibration: &Calibration, recording: &Recording, outputs: Outputs, ui: &Ui) -> Result<Fit, Failure> {
    let progress = ui.busy("reading");
    let (verification, traces) =
        verify::verify(calibration, recording, |step| progress.stage(step)).map_err(verify_failure)?;
    drop(progress);
    print_table(ui, &verification);
    outputs.finish(ui, &verification, || report::verification::page(&verification, recording, &traces).to_html())?;
    Ok(verification.status)
}

fn compare_torques(
    calibration: &Calibration,
    recording: &Recording,
    (identified_on, corner_hz): (&Recording, Option<f64>),
    outputs: Outputs,
    ui: &Ui,
) -> Result<(), Failure> {
    let progress = ui.busy("comparing torques");
    let verified = verify::torque::verify(calibration, recording, identified_on, corner_hz).map_err(verify_failure)?;
    drop(progress);
    print_torques(ui, &verified);
    outputs.finish(ui, &verified, String::new)
}

/// The comparison as a table for people.
fn print_torques(ui: &Ui, verified: &TorqueVerification) {
    ui.say(format_args!("{:<28}{:>14}{:>14}{:>10}  unit", "parameter", "calibrated", "recipe", "± error"));
    for p in &verified.parameters {
        let error = p.std_error.map_or_else(|| "–".to_string(), |error| format!("{error:.2e}"));
        ui.say(format_args!("{:<28}{:>14.4}{:>14.4}{error:>10}  {}", p.name, p.calibrated, p.identified, p.unit));
    }
    for p in verified.parameters.iter().filter(|p| p.must_be_positive) {
        for (found, by) in [(p.calibrated, "the calibration"), (p.identified, "the recipe")] {
            if found <= 0.0 {
                ui.warn(
                    format_args!("{} of {by} is {found:.4} {}, which no robot has", p.name, p.unit),
                    "the motion hardly shows it, or the input has another sign or scale",
                );
            }
        }
    }
    ui.say(format_args!(
        "positions filtered at {:.1} Hz, every {} samples compared",
        verified.filter_hz, verified.decimation
    ));
    for j in &verified.joints {
        ui.say(format_args!(
            "{}: {:.2} % of a torque of {:.4} {} unexplained by the calibrated parameters, {:.2} % by those of the recipe",
            j.joint,
            100.0 * j.relative_error_calibrated,
            j.rms,
            j.unit,
            100.0 * j.relative_error_identified
        ));
    }
}

/// Reads a calibration result.
pub(super) fn read_calibration(path: &Path) -> Result<Calibration, Failure> {
    let bytes = std::fs::read(path)
        .map_err(|error| Failure::device(format!("cannot read the calibration {}: {error}", path.display())))?;
    serde_json::from_slice(&bytes).map_err(|error| calibration_failure(path.display(), &error))
}

fn cell(rmse_sigma: f64) -> String {
    if rmse_sigma.is_nan() { format!("{:>11}", "–") } else { format!("{rmse_sigma:>11.3}") }
}

/// The horizons as a table for people: RMSE in sigmas of each sensor.
pub(super) fn print_table(ui: &Ui, verification: &Verification) {
    if verification.status == Fit::DoesNotFit {
        ui.say(format_args!("does not fit: {}", verification.misfit.join("; ")));
    }
    let head: Vec<String> = verification.horizons.iter().map(|h| format!("{:>8.0} ms", h.horizon_s * 1e3)).collect();
    ui.say(format_args!("{:<18}{}   RMSE in sigmas of the sensor", "channel", head.join("")));
    let channels = verification.horizons.first().map_or(&[][..], |h| &h.channels);
    for (i, channel) in channels.iter().enumerate() {
        let row: Vec<String> = verification.horizons.iter().map(|h| cell(h.channels[i].rmse_sigma)).collect();
        ui.say(format_args!("{:<18}{}", channel.channel, row.join("")));
    }
    let windows: Vec<String> = verification.horizons.iter().map(|h| format!("{:>11}", h.windows)).collect();
    ui.say(format_args!("{:<18}{}", "windows", windows.join("")));
    if verification.recording.calibrated_on {
        ui.say("note: the model was calibrated on this recording; verify on another one as well");
    }
    if verification.free_run.pieces > 1 {
        ui.say(format_args!("note: {} gaps, the free run starts again after each", verification.recording.gaps));
    }
}
