//! `host ports`: the serial ports there are, and who answers at them.

use serde::Serialize;

use super::connection::BAUDS;
use crate::command::{Exit, Failure, Ui, json};
use crate::link::{self, LinkError, Options, printable};

/// List serial ports and mark those where a robot answers
///
/// Each port is opened for a moment and asked who is there; a robot that moves goes on moving.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Bits per second at which to ask
    #[arg(long, value_name = "BAUD", default_value_t = protocol::budget::BAUD, value_parser = clap::value_parser!(u32).range(BAUDS))]
    baud: u32,
    /// Print the list as JSON to stdout
    #[arg(long)]
    json: bool,
}

/// A port as it is listed.
#[derive(Debug, Serialize)]
struct Listed {
    path: String,
    about: String,
    /// Who answered.
    robot: Option<String>,
    firmware_version: Option<String>,
    protocol_version: Option<u16>,
    /// Whether this program can record from it.
    usable: bool,
    /// What was seen, for people.
    note: String,
}

/// Asks every port and prints a line for each.
pub fn run(args: Args, ui: &Ui) -> Result<Exit, Failure> {
    let ports = link::list().map_err(Failure::device)?;
    let progress = ui.progress("asking", ports.len() as u64);
    let options = Options { baud: args.baud, greetings: 3, ..Options::default() };
    let mut listed = Vec::new();
    for (port, done) in ports.into_iter().zip(1..) {
        progress.note(port.path.as_str());
        listed.push(ask(port, &options));
        progress.at(done);
    }
    drop(progress);
    if args.json {
        ui.print(&json(&listed)?)?;
    } else if listed.is_empty() {
        ui.say("no serial port found; a simulated robot is `host record --port sim:`");
    } else {
        for port in &listed {
            let mark = if port.usable { '*' } else { ' ' };
            ui.print(&format!("{mark} {:<16} {:<40} {}\n", port.path, port.about, port.note))?;
        }
    }
    Ok(Exit::Ok)
}

fn ask(port: link::PortInfo, options: &Options) -> Listed {
    let answer = link::probe(&port.path, options);
    let (identity, usable, note) = match answer {
        Ok(hello) => {
            let identity = hello.identity;
            let note = format!("{}, firmware {}", printable(&identity.robot), printable(&identity.firmware_version));
            (Some(identity), true, note)
        }
        Err(LinkError::Version { theirs, .. }) => {
            let (robot, firmware) = (printable(&theirs.robot), printable(&theirs.firmware_version));
            let note = format!("{robot}, firmware {firmware} of another version");
            (Some(*theirs), false, note)
        }
        Err(LinkError::NoAnswer { bytes: 0, .. }) => (None, false, "silent".to_owned()),
        Err(LinkError::NoAnswer { .. }) => (None, false, "something else talks there".to_owned()),
        Err(error) => {
            let cause = std::error::Error::source(&error).map(|source| format!(": {source}"));
            (None, false, format!("{error}{}", cause.unwrap_or_default()))
        }
    };
    Listed {
        path: port.path,
        about: port.about,
        robot: identity.as_ref().map(|i| printable(&i.robot)),
        firmware_version: identity.as_ref().map(|i| printable(&i.firmware_version)),
        protocol_version: identity.map(|i| i.protocol_version),
        usable,
        note,
    }
}
