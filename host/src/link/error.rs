//! What can go wrong with a device, each with its numbers and what to do.

use std::io;
use std::time::Duration;

use protocol::hello::{Greeting, HelloError, Identity};
use protocol::{Fault, Refusal, ResetReason};

use super::words::printable;

/// Why a device cannot be used, or not any longer.
#[derive(Debug, thiserror::Error)]
pub enum LinkError {
    /// The port cannot be opened.
    #[error("cannot open {port}")]
    Open {
        /// As the user named it.
        port: String,
        /// By the operating system.
        source: serialport::Error,
    },
    /// Nobody answers the greeting.
    #[error("{port} does not answer ({bytes} bytes came within {} s, {frames} whole and {damaged} damaged frames)", waited.as_secs_f64())]
    NoAnswer {
        /// As the user named it.
        port: String,
        /// How long it was asked.
        waited: Duration,
        /// Bytes that came meanwhile.
        bytes: u64,
        /// Whole frames among them.
        frames: u64,
        /// Damaged frames among them.
        damaged: u64,
    },
    /// The device speaks another version.
    #[error(
        "the device and this program speak different versions\n  device: protocol {}, schema {}, firmware {}, robot {}\n  host:   protocol {}, schema {}, program {}",
        theirs.protocol_version, theirs.schema_key, printable(&theirs.firmware_version), printable(&theirs.robot),
        ours.protocol_version, ours.schema_key, env!("CARGO_PKG_VERSION")
    )]
    Version {
        /// The device's.
        theirs: Box<Identity>,
        /// The program's.
        ours: Greeting,
    },
    /// The handshake contradicts itself.
    #[error("the device's handshake contradicts itself")]
    Hello(#[from] HelloError),
    /// The device does not do what it was asked for.
    #[error("the device refuses to {what}: {refusal}")]
    Refused {
        /// What it was asked for.
        what: &'static str,
        /// Its reason.
        refusal: Box<Refusal>,
    },
    /// The emergency stop was pressed, and nobody said that its fault may be cleared.
    #[error("the device's emergency stop was pressed")]
    EmergencyStop,
    /// The device answered the greeting but not this.
    #[error("no answer to \"{what}\" in {attempts} attempts over {} s", waited.as_secs_f64())]
    Unanswered {
        /// What it was asked for.
        what: &'static str,
        /// How often.
        attempts: u32,
        /// How long.
        waited: Duration,
    },
    /// Nothing is asked of a device that was told to stop.
    #[error("\"{what}\" was not sent: the device was told to stop")]
    Stopping {
        /// What it was to be asked for.
        what: &'static str,
    },
    /// The line is gone.
    #[error("{port} is gone")]
    Gone {
        /// As the user named it.
        port: String,
        /// By the operating system.
        source: io::Error,
    },
    /// The samples stay away.
    #[error("no sample for {} s", waited.as_secs_f64())]
    Silent {
        /// How long.
        waited: Duration,
    },
    /// The device started anew.
    #[error("the device restarted ({})", reason.map_or("its tick counter went back".to_owned(), |r| reset_name(r).to_owned()))]
    Restarted {
        /// If it could still tell.
        reason: Option<ResetReason>,
    },
}

/// An emergency stop is taken back by a person at the robot, never by a program.
const CLEAR_STOP: &str =
    "press the emergency stop and release it, look that nobody is in reach of the robot, and add --clear-stop";

/// The reason of a reset in words.
pub fn reset_name(reason: ResetReason) -> &'static str {
    match reason {
        ResetReason::PowerOn => "power came on",
        ResetReason::Pin => "reset pin",
        ResetReason::BrownOut => "the supply fell too low",
        ResetReason::Watchdog => "watchdog",
        ResetReason::Software => "by its own software",
        ResetReason::Panic => "panic",
        ResetReason::Unknown => "unknown reason",
    }
}

impl LinkError {
    /// What the user can do about it.
    pub fn advice(&self) -> &'static str {
        match self {
            Self::Open { source, .. } => match source.kind {
                serialport::ErrorKind::Io(io::ErrorKind::PermissionDenied) => {
                    "you may not use this port: on Debian, `sudo adduser $USER dialout` and log in again"
                }
                // The library's words for "another program holds it": the port is claimed (TIOCEXCL), or, for a user who may
                // open it all the same, locked.
                _ if source.description.contains("busy") || source.description.contains("exclusive lock") => {
                    "another program uses this port: close it"
                }
                _ => {
                    "`host ports` lists the ports there are; is the cable plugged in, and is no other program using it?"
                }
            },
            Self::NoAnswer { bytes: 0, .. } => {
                "is the robot switched on, and does its firmware run? `host ports` marks a port that answers"
            }
            Self::NoAnswer { frames: 0, .. } => {
                "bytes come, but none that this protocol knows: is it the right port, and the right --baud?"
            }
            Self::NoAnswer { .. } => "frames come but no handshake: is the line from the host to the device broken?",
            Self::Version { .. } => {
                "flash the firmware that belongs to this program, or use the program that belongs to the firmware"
            }
            Self::Hello(_) => "flash the firmware again; if it is your own, its board description is wrong",
            Self::Refused { refusal, .. } => match **refusal {
                Refusal::NotZeroed => "hold the robot in its marked pose and add --set-zero",
                Refusal::StopNotTested | Refusal::Fault(Fault::EmergencyStop) => CLEAR_STOP,
                Refusal::Fault(_) => "remove the cause; the next `host record` clears the fault",
                Refusal::Motion(_) => "change the motion file",
                Refusal::NoStore => {
                    "build the firmware for this robot: firmware/PORTING.md tells how; this one runs what is built in"
                }
                Refusal::Description(_) => "change the robot's file, or use a board that has what the robot needs",
                Refusal::StoreFailed => "try again; if it fails again, the flash of the device is worn out",
                Refusal::Late { .. } => {
                    "give a later --start-tick; the device counts from 0 when it starts, so a reset brings early ticks back"
                }
                _ => "try again",
            },
            Self::EmergencyStop => CLEAR_STOP,
            Self::Unanswered { .. } => {
                "the line from the host to the device is bad, or the firmware hangs: check the cable, reset the device"
            }
            Self::Stopping { .. } => "start again when the robot is at rest",
            Self::Gone { .. } => "check plug and cable; what was recorded until then is in the file",
            Self::Silent { .. } => "check cable and supply; what was recorded until then is in the file",
            Self::Restarted { .. } => {
                "check supply and firmware: the next handshake tells the reason; what was recorded until then is in the file"
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What the serial library says to a user (the port is claimed), and to root, who gets as far as the lock.
    #[test]
    fn a_port_that_another_program_uses_is_told_as_such() {
        let advice = |kind, description: &str| {
            let source = serialport::Error::new(kind, description);
            LinkError::Open { port: "/dev/ttyUSB0".to_owned(), source }.advice()
        };
        let busy = "another program uses this port: close it";
        assert_eq!(advice(serialport::ErrorKind::NoDevice, "Device or resource busy"), busy);
        assert_eq!(advice(serialport::ErrorKind::NoDevice, "Unable to acquire exclusive lock on serial port"), busy);
        let denied = serialport::ErrorKind::Io(io::ErrorKind::PermissionDenied);
        assert!(advice(denied, "Permission denied").contains("dialout"));
        assert!(advice(serialport::ErrorKind::NoDevice, "No such file or directory").contains("host ports"));
    }
}
