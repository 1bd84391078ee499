//! `host completions`: the shell's tab completion.

use super::{Exit, Failure, Ui};

/// Print the tab completion of a shell, to be sourced by it
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The shell that will read it
    shell: clap_complete::Shell,
}

/// Prints the script to stdout.
pub fn run(args: Args, ui: &Ui) -> Result<Exit, Failure> {
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut super::command_line(), "host", &mut script);
    ui.print(&String::from_utf8_lossy(&script))?;
    Ok(Exit::Ok)
}
