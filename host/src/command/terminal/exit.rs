//! How a verb ends: the exit code, and a failure as a terminal shows it.

use std::fmt;
use std::process::ExitCode;

use crate::failure::{Failure, Kind};

/// The end of the help text: other programs are written against these numbers.
pub const HELP: &str = "\
Exit codes: 0 ok, 1 a fault of the program, 2 usage, 3 device or I/O, 4 data unusable, 5 no convergence;
diagnose: 0 nothing found, 10 named, 11 unknown cause, 12 not separable with this motion;
demo: 13 the estimates do not meet the truth; ended by Ctrl-C: 0 of simulate and watch, 3 of record and bringup,
which stop the robot, 130 of the others.";

/// What the process answers to its caller. The numbers are a public interface and never change.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub enum Exit {
    /// All went well.
    Ok = 0,
    /// A fault of the program itself.
    Fault = 1,
    /// The command line asks for something that does not exist or must not happen (an existing file, say).
    Usage = 2,
    /// A device or a file could not be opened, read or written.
    Device = 3,
    /// The data was read and cannot be used.
    Data = 4,
    /// The solver ended without an answer.
    NoConvergence = 5,
    /// diagnose: the model lacks something, and here is its name.
    Named = 10,
    /// diagnose: the model lacks something that the catalogue has no name for.
    Unknown = 11,
    /// diagnose: several names fit, and this motion cannot tell which.
    NotSeparable = 12,
    /// demo: the estimates do not meet the truth.
    NotFound = 13,
}

impl From<Exit> for ExitCode {
    fn from(exit: Exit) -> Self {
        ExitCode::from(exit as u8)
    }
}

impl From<Kind> for Exit {
    fn from(kind: Kind) -> Self {
        match kind {
            Kind::Fault => Self::Fault,
            Kind::Usage => Self::Usage,
            Kind::Device => Self::Device,
            Kind::Data => Self::Data,
            Kind::NoConvergence => Self::NoConvergence,
        }
    }
}

impl Failure {
    /// The exit code.
    pub fn exit(&self) -> Exit {
        self.kind().into()
    }
}

impl miette::Diagnostic for Failure {
    fn help<'a>(&'a self) -> Option<Box<dyn fmt::Display + 'a>> {
        self.help().map(|advice| Box::new(advice) as Box<dyn fmt::Display>)
    }
}
