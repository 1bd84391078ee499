//! `host verify`: how well a calibrated model predicts a recording.

use std::path::{Path, PathBuf};

use super::{Exit, Failure, ResultArgs, Ui, read_failure};
use crate::calibrate::Calibration;
use crate::verify::{self, Verification, VerifyError};
use crate::{recording, report};

/// Predict a recording by a calibrated model
///
/// Free run from the first state over the whole recording with the recorded input, and windowed predictions 10, 100,
/// 500 and 2000 ms ahead from states that only past readings give. Give a recording that the calibration has not seen:
/// that is what tells a good model from a good fit.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The calibration
    #[arg(value_name = "CAL.json")]
    calibration: PathBuf,
    /// The recording to predict
    #[arg(value_name = "RUN")]
    recording: PathBuf,
    #[command(flatten)]
    result: ResultArgs,
}

/// Reads, predicts, writes the result, prints the table of horizons.
pub fn run(args: Args, ui: &Ui) -> Result<Exit, Failure> {
    let outputs = args.result.claim()?;
    let calibration = read_calibration(&args.calibration)?;
    let recording = recording::read(&args.recording).map_err(read_failure)?;
    let progress = ui.busy("reading");
    let (verification, traces) =
        verify::verify(&calibration, &recording, |step| progress.stage(step)).map_err(verify_failure)?;
    drop(progress);
    print_table(ui, &verification);
    outputs.finish(ui, &verification, || report::verification::page(&verification, &recording, &traces).to_html())?;
    Ok(Exit::Ok)
}

/// Reads a calibration result.
pub(super) fn read_calibration(path: &Path) -> Result<Calibration, Failure> {
    let text = std::fs::read_to_string(path)
        .map_err(|error| Failure::device(format!("cannot read the calibration {}: {error}", path.display())))?;
    serde_json::from_str(&text).map_err(|error| {
        Failure::data(format!("{} is not a calibration: {error}", path.display()))
            .advice("give the file that `host calibrate … -o CAL.json` wrote")
    })
}

/// A recording that cannot be predicted.
pub(super) fn verify_failure(error: VerifyError) -> Failure {
    let failure = Failure::data(error.to_string());
    match error {
        VerifyError::DifferentRobot { .. } | VerifyError::DifferentChannels { .. } => {
            failure.advice("`host calibrate` a recording of this robot first")
        }
        VerifyError::TooShort { .. } => failure.advice("record a whole motion"),
        VerifyError::MissingParameter { .. }
        | VerifyError::Robot(_)
        | VerifyError::Effect(_)
        | VerifyError::Model(_) => {
            failure.advice("the calibration was written by another version or edited: calibrate again")
        }
    }
}

fn cell(rmse_sigma: f64) -> String {
    if rmse_sigma.is_nan() { format!("{:>11}", "–") } else { format!("{rmse_sigma:>11.3}") }
}

/// The horizons as a table for people: RMSE in sigmas of each sensor.
pub(super) fn print_table(ui: &Ui, verification: &Verification) {
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
