//! `host robot`: the built-in descriptions, a start for an own one, and one stored on a device.

use std::path::PathBuf;

use super::{Exit, Failure, NewFile, Ui, push, robot_failure};
use crate::robot::Robot;

/// List, show or begin robot descriptions, or store one on a device
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(subcommand)]
    what: What,
}

#[derive(Debug, clap::Subcommand)]
enum What {
    /// Name the robots that are built in
    List,
    /// Print a description
    Show {
        /// A built-in name or a description file
        #[arg(value_name = "ROBOT")]
        robot: String,
    },
    /// Write a commented description to start from
    New {
        /// Name of the robot
        #[arg(value_name = "NAME")]
        name: String,
        /// The file [default: NAME.toml]
        #[arg(short, long, value_name = "FILE.toml")]
        output: Option<PathBuf>,
        /// Replace the file if it exists
        #[arg(long)]
        force: bool,
    },
    Push(push::Args),
}

/// Prints to stdout, or writes the file.
pub fn run(args: Args, ui: &Ui) -> Result<Exit, Failure> {
    match args.what {
        What::List => {
            for name in Robot::builtin_names() {
                let robot = Robot::builtin(name).map_err(Failure::fault)?;
                ui.print(&format!("{name:<12} {}\n", robot.description))?;
            }
        }
        What::Show { robot } => {
            let robot = Robot::load(&robot).map_err(robot_failure)?;
            ui.print(robot.toml())?;
        }
        What::New { name, output, force } => {
            let text = Robot::template(&name)
                .map_err(|error| Failure::usage(error).advice("choose another name, as in my_robot"))?;
            let path = output.unwrap_or_else(|| PathBuf::from(format!("{name}.toml")));
            NewFile::claim(&path, force)?.finish_with(text.as_bytes())?;
            ui.say(format_args!("{}: fill it in; `host robot show {0}` checks it", path.display()));
        }
        What::Push(args) => return push::run(args, ui),
    }
    Ok(Exit::Ok)
}
