//! `host bringup`: signs, order, gears and mountings of a robot found by small moves; ends with its description.

use std::path::PathBuf;

use super::connection::{Connection, link_failure, write_truth};
use crate::bringup::{self, BringUpError, Findings, News};
use crate::command::{Exit, Failure, NewFile, Ui, interrupt, json, robot_failure};
use crate::failure::simulate_failure;
use crate::link::{Device, ScaleError, printable};
use crate::robot::Robot;

/// Find out by small moves whether a robot is wired as it should be
///
/// Each joint in turn is jogged, a little more each time, by some hundredths of a radian: keep clear of the robot, and have the emergency
/// stop at hand. Order and sign of encoders and motors, gears and counts per turn, bodies and mountings of the gyros and
/// the duty at which each joint breaks away are found, or the first contradiction is told with the wire that it is about.
/// At the end the robot's description is written, for `host robot show` and `host record --robot`.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(flatten)]
    connection: Connection,
    /// The description to begin with: a built-in name or a file [default: the one that the device names]
    #[arg(long, value_name = "ROBOT")]
    robot: Option<String>,
    /// Of the description only chain, bodies and limits are known: gears and counts per turn are the device's, mountings
    /// of gyros what the moves show
    #[arg(long)]
    blank: bool,
    /// Clear the fault of an emergency stop: it is released, and nobody is in reach of the robot
    #[arg(long)]
    clear_stop: bool,
    /// Print the findings as JSON to stdout
    #[arg(long)]
    json: bool,
    /// The description to write
    #[arg(short, long, value_name = "ROBOT.toml")]
    output: PathBuf,
    /// Replace the description if it exists
    #[arg(long)]
    force: bool,
}

/// Connects, jogs every joint, and writes the description.
pub fn run(args: Args, ui: &Ui) -> Result<Exit, Failure> {
    let file = NewFile::claim(&args.output, args.force)?;
    let named = args.robot.as_deref().map(Robot::load).transpose().map_err(robot_failure)?;
    let simulated = args.connection.simulated(args.force)?;
    let mut device = args.connection.open_for_requests(simulated.as_ref(), ui)?;
    let identity = &device.hello().identity;
    let name = printable(&identity.robot);
    ui.say(format_args!("{}: {name}, firmware {}", args.connection.port, printable(&identity.firmware_version)));
    let start = match named.or_else(|| simulated.as_ref().map(|(_, options, _)| options.robot.clone())) {
        Some(robot) => robot,
        None => Robot::builtin(&name).map_err(|error| {
            robot_failure(error).advice("name a description to begin with (--robot); `host robot new` writes one")
        })?,
    };
    let robot = if args.blank {
        let text = bringup::filled_in(start.toml(), device.hello()).map_err(robot_failure)?;
        Robot::parse(&text).map_err(robot_failure)?
    } else {
        start
    };
    if args.clear_stop {
        device.clear_stop().map_err(link_failure)?;
    }
    device.settle().map_err(link_failure)?;
    let found = find(&mut device, &robot, args.blank, ui);
    drop(device);
    interrupt::instead(|| interrupt::leave(interrupt::INTERRUPTED));
    if let Some((simulator, _, truth)) = simulated {
        let report = simulator.finish().map_err(simulate_failure)?;
        write_truth(truth, &report)?;
    }
    let findings = found.map_err(|error| bringup_failure(error, ui))?;
    let text = bringup::written(robot.toml(), &findings).map_err(robot_failure)?;
    file.finish_with(text.as_bytes())?;
    if args.json {
        ui.print(&json(&findings)?)?;
    }
    let path = args.output.display();
    ui.say(format_args!("{path}: nothing contradicts it"));
    ui.say(format_args!("hold the robot in its marked pose for `host record --robot {path} --set-zero`"));
    Ok(Exit::Ok)
}

/// The bring-up, told as it goes.
fn find(device: &mut Device, robot: &Robot, blank: bool, ui: &Ui) -> Result<Findings, BringUpError> {
    let bar = ui.busy("resting");
    let findings = bringup::bring_up(device, robot, blank, |news| match news {
        News::Jog { joint, duty } => {
            bar.stage(&robot.joints[joint].name);
            bar.note(format!("duty {duty:+.3}"));
        }
        News::Joint(found) => {
            let agreement = match found.encoder_over_gyro {
                Some(ratio) => format!("encoder over gyro {ratio:.3}"),
                None => "no gyro sees it".to_owned(),
            };
            ui.say(format_args!("{}: breaks away at a duty of {:.3}, {agreement}", found.joint, found.break_away_duty));
        }
    })?;
    for (index, gyro) in findings.gyros.iter().enumerate() {
        let turned = gyro.turned.as_ref().map_or("as described".to_owned(), |turned| format!("turned by {turned}"));
        let unknown = gyro.unknown.as_ref().map_or(String::new(), |unknown| format!("; {unknown}"));
        ui.say(format_args!("gyro {}: {turned}{unknown}", index + 1));
    }
    Ok(findings)
}

/// A bring-up that did not come to its end.
fn bringup_failure(error: BringUpError, ui: &Ui) -> Failure {
    match error {
        BringUpError::Link(error) => link_failure(error),
        BringUpError::Robot(error) => robot_failure(error),
        BringUpError::Scale(ref scale) => {
            let advice = match scale {
                ScaleError::Differs { .. } => {
                    "correct the description or the firmware's robot: both must tell the truth; --blank takes gears and counts from the device"
                }
                other => other.advice(),
            };
            Failure::data(error).advice(advice)
        }
        BringUpError::Coarse { .. } => Failure::data(error).advice("check signs by hand under `host watch`"),
        BringUpError::Contradiction(contradiction) => {
            let picture = contradiction.picture();
            if !picture.is_empty() {
                ui.say(format_args!("\n{picture}\n"));
            }
            let advice = contradiction.advice();
            Failure::data(contradiction).advice(advice)
        }
    }
}
