//! `host robot push`: a robot's description into the flash of a device.

use protocol::{Description, Hello, Refusal};
use serde::Serialize;

use super::connection::{Connection, link_failure};
use crate::command::{Exit, Failure, Ui, interrupt, json, robot_failure};
use crate::failure::simulate_failure;
use crate::link::{self, LinkError, printable};
use crate::robot::Robot;
use crate::simulate::{SimulateError, description};

/// Store a robot's description on its device, which runs it from its next start on
///
/// Limits, counts, gears, mountings of gyros and what the drives bear become the firmware's: one image serves all robots
/// with the motors and sensors of its board. The device checks the description and keeps it in its flash, in two copies, so
/// that a loss of power leaves the old or the new one. Nothing moves. Refused while a motion runs or a fault is latched.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// A description file or a built-in name
    #[arg(value_name = "ROBOT")]
    robot: String,
    #[command(flatten)]
    connection: Connection,
    /// Clear the fault of an emergency stop: it is released, and nobody is in reach of the robot
    #[arg(long)]
    clear_stop: bool,
    /// Print what was stored as JSON to stdout
    #[arg(long)]
    json: bool,
}

/// What was stored.
#[derive(Debug, Serialize)]
struct Pushed {
    robot: String,
    /// Number of the stored description.
    sequence: u32,
    /// CRC-32 over it.
    crc: u32,
    /// It runs already; otherwise from the next start on.
    runs: bool,
    /// What is otherwise than in the description that runs.
    changes: Vec<Change>,
}

/// A figure of the handshake that the new description changes.
#[derive(Debug, Serialize)]
struct Change {
    what: String,
    from: String,
    to: String,
}

/// Checks, sends, reads back and compares.
pub fn run(args: Args, ui: &Ui) -> Result<Exit, Failure> {
    let robot = Robot::load(&args.robot).map_err(robot_failure)?;
    let wanted = description(&robot).map_err(|error| match error {
        SimulateError::Unsuited { reason } => cannot_run(&robot, &reason),
        error => simulate_failure(error),
    })?;
    let simulated = args.connection.simulated(false)?;
    let mut device = args.connection.open_for_requests(simulated.as_ref(), ui)?;
    let before = device.hello().clone();
    let (name, version) = (printable(&before.identity.robot), printable(&before.identity.firmware_version));
    let runs = link::runs(&before);
    ui.say(format_args!("{}: {name}, firmware {version}, runs {}", args.connection.port, runs.which));
    if let Some(other) = runs.other {
        ui.say(other);
    }
    link::fits(&before, &wanted).map_err(|error| cannot_run(&robot, &error))?;
    if args.clear_stop {
        device.clear_stop().map_err(link_failure)?;
    }
    device.settle().map_err(link_failure)?;
    let storing = ui.busy("storing");
    let outcome = device.push(&wanted).map_err(push_failure);
    drop(storing);
    let after = device.hello().clone();
    drop(device);
    interrupt::instead(|| interrupt::leave(interrupt::INTERRUPTED));
    if let Some((simulator, ..)) = simulated {
        simulator.finish().map_err(simulate_failure)?;
    }
    outcome?;

    let Some(stored) = after.description.stored.filter(|stored| stored.crc() == wanted.crc()) else {
        let said = format!("the handshake tells another description than was sent (CRC-32 {:08x})", wanted.crc());
        return Err(Failure::device(said).advice("try again; if it fails again, the flash of the device is worn out"));
    };
    let runs = after.description.running == Some(stored);
    let changes = changes(&before, &wanted);
    for Change { what, from, to } in &changes {
        ui.say(format_args!("  {what}: {from} -> {to}"));
    }
    let kept = if before.description.stored == Some(stored) { "was stored already" } else { "is stored" };
    let begins = if runs { "it runs" } else { "it runs from the next start on: switch the device off and on" };
    let (sequence, crc) = (stored.sequence, stored.crc());
    ui.say(format_args!("{} {kept} as description {sequence} (CRC-32 {crc:08x}); {begins}", robot.name));
    if args.json {
        ui.print(&json(&Pushed { robot: robot.name.clone(), sequence, crc, runs, changes })?)?;
    }
    Ok(Exit::Ok)
}

/// What the handshake tells otherwise than the new description. Limits and duties it does not tell.
fn changes(before: &Hello, new: &Description) -> Vec<Change> {
    let mut changes = Vec::new();
    let mut compare = |what: String, from: String, to: String| {
        if from != to {
            changes.push(Change { what, from, to });
        }
    };
    compare("robot".to_owned(), printable(&before.identity.robot), printable(&new.robot));
    for (index, (old, new)) in (1..).zip(before.encoders.iter().zip(&new.encoders)) {
        compare(
            format!("encoder {index}, counts per turn"),
            old.counts_per_turn.to_string(),
            new.counts_per_turn.to_string(),
        );
        compare(format!("encoder {index}, gear"), old.gear.to_string(), new.gear.to_string());
    }
    compare("gyros".to_owned(), before.gyros.len().to_string(), new.gyros.len().to_string());
    for (index, (old, new)) in (1..).zip(before.gyros.iter().zip(&new.gyros)) {
        compare(format!("gyro {index}, on the body of joint"), (old.body + 1).to_string(), (new.body + 1).to_string());
    }
    changes
}

/// A robot that is none for the firmware.
fn cannot_run(robot: &Robot, why: &dyn std::fmt::Display) -> Failure {
    Failure::data(format!("the firmware cannot run {}: {why}", robot.name))
        .advice("change the robot's file, or use a board that has what the robot needs")
}

/// A description that the device did not take.
fn push_failure(error: LinkError) -> Failure {
    let unsuited = matches!(&error, LinkError::Refused { refusal, .. } if matches!(**refusal, Refusal::Description(_)));
    let advice = error.advice();
    if unsuited { Failure::data(error).advice(advice) } else { link_failure(error) }
}
