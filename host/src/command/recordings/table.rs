//! `host table`: many calibrations merged.

use std::path::PathBuf;

use crate::calibrate::Calibration;
use crate::command::arguments::Choice;
use crate::command::{Exit, Failure, NewFile, ResultArgs, Ui};
use crate::fleet::{By, Fleet};
use crate::report;

/// Merge calibrations of many recordings and robots into one table
///
/// Calibrations of one robot get weighted means (by their covariances) and a test whether they agree; robots of one kind
/// are compared in the same way, with the spread between them. Files that are no usable calibration are left out and named.
/// host/doc/fleet.md shows a whole fleet calibrated by one process a recording.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Results of `host calibrate`
    #[arg(value_name = "CAL.json", required = true)]
    calibrations: Vec<PathBuf>,
    /// What makes a group: the robot's name, or the folder of the result (one folder a robot)
    #[arg(long, value_enum, default_value_t = Choice(By::Robot))]
    by: Choice<By>,
    /// Write the table, a row a calibration, group and fleet
    #[arg(long, value_name = "OUT.csv")]
    csv: Option<PathBuf>,
    /// Write the table, a row a parameter, as Markdown
    #[arg(long, value_name = "OUT.md")]
    markdown: Option<PathBuf>,
    #[command(flatten)]
    result: ResultArgs,
}

/// Reads, merges, writes.
pub fn run(args: Args, ui: &Ui) -> Result<Exit, Failure> {
    let claim = |path: &Option<PathBuf>| path.as_deref().map(|p| NewFile::claim(p, args.result.force)).transpose();
    let (csv, markdown) = (claim(&args.csv)?, claim(&args.markdown)?);
    let outputs = args.result.claim()?;
    let mut files = Vec::with_capacity(args.calibrations.len());
    for path in args.calibrations {
        let text = std::fs::read(&path)
            .map_err(|error| Failure::device(format!("cannot read the calibration {}: {error}", path.display())))?;
        let read =
            serde_json::from_slice::<Calibration>(&text).map_err(|error| format!("it is not a calibration: {error}"));
        files.push((path, read));
    }
    let fleet = Fleet::new(files, args.by.0);
    let text = report::fleet::markdown(&fleet);
    ui.say(&text);
    if fleet.groups.is_empty() {
        return Err(Failure::data("none of these files is a usable calibration")
            .advice("give the files that `host calibrate … -o CAL.json` wrote"));
    }
    if let Some(file) = csv {
        file.finish_with(&report::fleet::csv(&fleet).map_err(Failure::fault)?)?;
    }
    if let Some(file) = markdown {
        file.finish_with(text.as_bytes())?;
    }
    outputs.finish(ui, &fleet, || report::fleet::page(&fleet).to_html())?;
    Ok(Exit::Ok)
}
