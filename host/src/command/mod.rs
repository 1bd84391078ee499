//! The verbs of the command line, one file each: parse, call, print. No arithmetic here.
//!
//! A verb is a module with `Args` (clap; its doc comment is the help) and
//! `pub fn run(args: Args, ui: &Ui) -> Result<Exit, Failure>`. To add one:
//!
//! 1. `mod verb;` below or in a folder,
//! 2. `Verb(verb::Args)` in `Verb`,
//! 3. `Verb::Verb(args) => verb::run(args, &ui)` in [`main`].
//!
//! | folder | what is there |
//! |---|---|
//! | `device` | verbs that speak to a device, and the connection that they share |
//! | `recordings` | verbs that read and write tables and recordings |
//! | here | verbs about models: calibrate, verify, diagnose, plan, export … |
//! | `terminal` | what every verb shares: [`Exit`] (how it ends), [`Ui`] (text, progress, log: stderr only; stdout carries results), `interrupt` (Ctrl-C), [`NewFile`], [`LiveFile`] and [`ResultArgs`] (files that are never overwritten unasked) |
//! | `arguments` | arguments of several verbs, and what the library's enums are called on the command line |

mod arguments;
mod calibrate;
mod completions;
mod demo;
mod device;
mod diagnose;
mod effects;
mod export;
mod observe;
mod plan;
mod recordings;
mod robot;
mod terminal;
mod verify;

use std::process::ExitCode;

use clap::{CommandFactory, Parser, Subcommand};

use crate::failure::{Failure, read_failure, robot_failure, table_failure};
use arguments::fitness;
pub use arguments::fitness::FitnessArgs;
use device::{bringup, ports, push, record, simulate, watch};
use recordings::{check, import, repair, table};
pub use terminal::exit::Exit;
use terminal::output::json;
pub use terminal::output::{LiveFile, NewFile, Outputs, ResultArgs};
pub use terminal::ui::{Progress, Ui};
use terminal::{exit, interrupt, ui};

/// Calibrates flexible-joint robots: records a motion, fits the elastic-joint model, verifies it on another motion.
#[derive(Debug, Parser)]
#[command(name = "host", version, propagate_version = true, after_help = exit::HELP)]
struct Cli {
    #[command(flatten)]
    ui: ui::Args,
    #[command(subcommand)]
    verb: Verb,
}

#[derive(Debug, Subcommand)]
enum Verb {
    Ports(ports::Args),
    Simulate(simulate::Args),
    Plan(plan::Args),
    Watch(watch::Args),
    Bringup(bringup::Args),
    Record(record::Args),
    Demo(demo::Args),
    Import(import::Args),
    Check(check::Args),
    Calibrate(calibrate::Args),
    Verify(verify::Args),
    Observe(observe::Args),
    Table(table::Args),
    Diagnose(diagnose::Args),
    Export(export::Args),
    Repair(repair::Args),
    Robot(robot::Args),
    Effects(effects::Args),
    Completions(completions::Args),
}

/// Runs the verb that the command line names, prints its failure and gives its exit code.
///
/// A panic anywhere inside is a fault of the program: it is caught here and ends with [`Exit::Fault`].
pub fn main() -> ExitCode {
    let cli = Cli::parse(); // ends the process with code 2 if the line is not understood
    let ui = Ui::new(&cli.ui);
    interrupt::listen();
    let ended = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| match cli.verb {
        Verb::Ports(args) => ports::run(args, &ui),
        Verb::Simulate(args) => simulate::run(args, &ui),
        Verb::Plan(args) => plan::run(args, &ui),
        Verb::Bringup(args) => bringup::run(args, &ui),
        Verb::Watch(args) => watch::run(args, &ui),
        Verb::Record(args) => record::run(args, &ui),
        Verb::Demo(args) => demo::run(args, &ui),
        Verb::Import(args) => import::run(args, &ui),
        Verb::Check(args) => check::run(args, &ui),
        Verb::Calibrate(args) => calibrate::run(args, &ui),
        Verb::Verify(args) => verify::run(args, &ui),
        Verb::Observe(args) => observe::run(args, &ui),
        Verb::Table(args) => table::run(args, &ui),
        Verb::Diagnose(args) => diagnose::run(args, &ui),
        Verb::Export(args) => export::run(args, &ui),
        Verb::Repair(args) => repair::run(args, &ui),
        Verb::Robot(args) => robot::run(args, &ui),
        Verb::Effects(args) => effects::run(args, &ui),
        Verb::Completions(args) => completions::run(args, &ui),
    }));
    let exit = match ended {
        Ok(Ok(exit)) => exit,
        Ok(Err(failure)) => {
            let exit = failure.exit();
            ui.failure(failure);
            exit
        }
        Err(_) => {
            ui.failure(Failure::fault("the program met a state that should be impossible (see above)"));
            Exit::Fault
        }
    };
    exit.into()
}

/// The whole command line as clap sees it.
fn command_line() -> clap::Command {
    Cli::command()
}

#[cfg(test)]
mod tests {
    #[test]
    fn the_command_line_is_consistent() {
        super::command_line().debug_assert();
    }
}
