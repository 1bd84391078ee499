//! `host repair`: a cut-off recording made whole.

use std::path::PathBuf;

use crate::command::{Exit, Failure, NewFile, Ui, read_failure};
use crate::recording::{self, mcap};

/// Make a cut-off or damaged recording whole
///
/// Writes all samples that can be read to a new file, which any MCAP viewer opens. The old file stays as it is.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The recording
    #[arg(value_name = "RUN.mcap")]
    input: PathBuf,
    /// The whole recording to make
    #[arg(short, long, value_name = "OUT.mcap")]
    output: PathBuf,
    /// Replace the output if it exists
    #[arg(long)]
    force: bool,
}

/// Reads what can be read, writes it, says what was wrong.
pub fn run(args: Args, ui: &Ui) -> Result<Exit, Failure> {
    let file = NewFile::claim(&args.output, args.force)?;
    let reading = ui.busy("reading");
    let recording = recording::read(&args.input).map_err(read_failure)?;
    reading.stage("writing");
    mcap::write(file, &recording).map_err(Failure::device)?.finish()?;
    drop(reading);
    if recording.damage.is_empty() {
        ui.say(format_args!("{}: nothing was wrong with it", args.input.display()));
    }
    for damage in &recording.damage {
        ui.say(format_args!("{}: {damage}", args.input.display()));
    }
    ui.say(format_args!("{}: {}", args.output.display(), recording.summary()));
    Ok(Exit::Ok)
}
