//! What is looked at before any long work on a recording: units, signs, columns, rate, dead sensors.

use crate::calibrate;
use crate::command::{Failure, Ui};
use crate::failure::unfit;
use crate::recording::{Recording, check};

/// To be flattened into the `Args` of a verb that draws conclusions from recordings.
#[derive(Debug, Clone, Copy, clap::Args)]
pub struct FitnessArgs {
    /// Go on though units, signs, columns, rate or sensors look wrong
    #[arg(long)]
    pub unchecked: bool,
}

impl FitnessArgs {
    /// Refuses a recording whose results would be worthless; with `--unchecked` it only says so.
    pub fn look(self, recording: &Recording, name: impl std::fmt::Display, ui: &Ui) -> Result<(), Failure> {
        let obstacles = calibrate::obstacles(recording);
        let Some(first) = obstacles.first() else { return Ok(()) };
        for finding in obstacles.iter().skip(usize::from(!self.unchecked)) {
            say(finding, ui);
        }
        if self.unchecked {
            return Ok(());
        }
        Err(unfit(name, first).advice(format!("{}\nif it is right as it is, add --unchecked", first.advice)))
    }
}

/// Says what is wrong with a recording that is only to be kept; whether anything is.
pub fn warn(recording: &Recording, ui: &Ui) -> bool {
    let obstacles = check::obstacles(recording);
    for finding in &obstacles {
        say(finding, ui);
    }
    !obstacles.is_empty()
}

fn say(finding: &check::Finding, ui: &Ui) {
    ui.say(format_args!("{}: {}\n    {}", finding.severity.name(), finding.told(), finding.advice));
}
