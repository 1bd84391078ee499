//! `host export`: results and recordings for other tools.

use std::io::BufWriter;
use std::path::PathBuf;

use super::{Exit, Failure, NewFile, Ui, read_failure};
use crate::recording::{self, csv};

/// Write a recording for other tools
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The recording
    #[arg(value_name = "RUN.mcap")]
    input: PathBuf,
    #[command(flatten)]
    format: Format,
    /// Replace the file if it exists
    #[arg(long)]
    force: bool,
}

/// What to write; exactly one.
#[derive(Debug, clap::Args)]
#[group(required = true, multiple = false)]
struct Format {
    /// A CSV table, numbers in as many digits as they have: `host import` gives the same numbers back
    #[arg(long, value_name = "OUT.csv")]
    csv: Option<PathBuf>,
}

/// Writes the one file that was asked for.
pub fn run(args: Args, ui: &Ui) -> Result<Exit, Failure> {
    let Some(path) = args.format.csv else {
        return Err(Failure::fault("no format was given, and the command line was accepted"));
    };
    let file = NewFile::claim(&path, args.force)?;
    let reading = ui.busy("reading");
    let recording = recording::read(&args.input).map_err(read_failure)?;
    reading.stage("writing");
    let file = csv::write(BufWriter::new(file), &recording).map_err(Failure::device)?;
    file.into_inner().map_err(|error| Failure::device(error.into_error()))?.finish()?;
    drop(reading);
    for damage in &recording.damage {
        ui.say(format_args!("{}: {damage}", args.input.display()));
    }
    ui.say(format_args!("{}: {}", path.display(), recording.summary()));
    Ok(Exit::Ok)
}
