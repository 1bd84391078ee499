//! `host import`: a table or a ROS 2 bag becomes a recording.

use std::path::PathBuf;

use crate::command::arguments::Choice;
use crate::command::{Exit, Failure, NewFile, Ui, fitness, robot_failure, table_failure};
use crate::recording::import::{self, EmptyInputs};
use crate::recording::mcap;
use crate::robot::Robot;

/// Turn a CSV table or a ROS 2 bag into a recording
///
/// One row a tick: t_us (or t_s), u1..un, then the robot's channels by name (theta1, g1x, …) in rad and rad/s on the
/// link side of the gear. A missing tick is a missing row, an empty field a sensor without a reading. `.csv.gz` is read
/// as well. Tables with other names and units need a section [import] in the robot file: `host robot new` writes one
/// with all it can say. Rows are taken at their own stamps, even or not. Of a bag (MCAP) the joint states are read: the joint
/// `elbow` has the columns elbow.position, elbow.velocity and elbow.effort. What looks wrong in units, signs or columns is said at once; the recording is made all the
/// same, and refused where results would be drawn from it.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The table or bag
    #[arg(value_name = "DATA.csv|BAG.mcap")]
    table: PathBuf,
    /// The robot: a built-in name or a description file
    #[arg(long, value_name = "ROBOT", default_value = "doggy")]
    robot: String,
    /// The recording to make
    #[arg(short, long, value_name = "RUN.mcap")]
    output: PathBuf,
    /// What the input is in rows that have none, where inputs and sensors stand in different rows
    #[arg(long, value_enum, value_name = "HOW")]
    inputs: Option<Choice<EmptyInputs>>,
    /// Replace the recording if it exists
    #[arg(long)]
    force: bool,
}

/// Reads the table, writes the recording, says what is in it.
pub fn run(args: Args, ui: &Ui) -> Result<Exit, Failure> {
    let robot = Robot::load(&args.robot).map_err(robot_failure)?;
    let file = NewFile::claim(&args.output, args.force)?;
    let reading = ui.busy("reading");
    let import::Imported { recording, ignored, notes } =
        import::read(&args.table, &robot, args.inputs.map(|inputs| inputs.0)).map_err(table_failure)?;
    reading.stage("writing");
    mcap::write(file, &recording).map_err(Failure::device)?.finish()?;
    drop(reading);
    for note in notes {
        ui.say(note);
    }
    if !ignored.is_empty() {
        ui.say(format_args!("not read, as the robot file does not name them: {}", ignored.join(", ")));
    }
    ui.say(format_args!("{}: {}", args.output.display(), recording.summary()));
    if fitness::warn(&recording, ui) {
        ui.say("as it stands, this recording will be refused by check, calibrate, diagnose and verify");
    }
    Ok(Exit::Ok)
}
