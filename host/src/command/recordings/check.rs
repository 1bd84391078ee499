//! `host check`: is this recording fit for calibration?

use std::path::PathBuf;

use crate::calibrate::foresight;
use crate::command::{Exit, Failure, ResultArgs, Ui, read_failure};
use crate::recording::{self, check};
use crate::report::check_page;

/// Tell whether a recording is fit for calibration, and what to change if not
///
/// Looks at gaps and the loss balance, the window at rest, what each joint does, saturation, timing, units and signs, and
/// foresees which parameters a calibration will be able to tell.
/// Ends with exit code 4 if the recording is unusable.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The recording
    #[arg(value_name = "RUN.mcap")]
    input: PathBuf,
    #[command(flatten)]
    result: ResultArgs,
}

/// Checks, prints the findings, writes the result.
pub fn run(args: Args, ui: &Ui) -> Result<Exit, Failure> {
    let outputs = args.result.claim()?;
    let reading = ui.busy("reading");
    let recording = recording::read(&args.input).map_err(read_failure)?;
    reading.stage("checking");
    let mut check = check::check(&recording);
    if check.usable {
        foresight::look(&recording, &mut check);
    }
    drop(reading);
    ui.say(format_args!("{}: {}", args.input.display(), recording.summary()));
    for finding in &check.findings {
        let channel = finding.channel.as_ref().map_or(String::new(), |channel| format!("{channel}: "));
        ui.say(format_args!("{}: {channel}{}\n    {}", finding.severity.name(), finding.message, finding.advice));
    }
    ui.say(if check.usable { "fit for calibration" } else { "not fit for calibration" });
    outputs.finish(ui, &check, || check_page(&recording, &check).to_html())?;
    Ok(if check.usable { Exit::Ok } else { Exit::Data })
}
