//! How a verb ends: the exit code, and a failure with its cause and what to do about it.

use std::error::Error;
use std::fmt;
use std::process::ExitCode;

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

/// Why a verb failed: an exit code, the cause (with its own causes), and what the user can do.
///
/// Made from a typed error by the constructor that names the exit code: `Failure::data(error).advice("…")`.
#[derive(Debug)]
pub struct Failure {
    exit: Exit,
    cause: Box<dyn Error + Send + Sync>,
    advice: Option<String>,
}

impl Failure {
    /// A failure with the given code; `cause` is a typed error or a text.
    pub fn new(exit: Exit, cause: impl Into<Box<dyn Error + Send + Sync>>) -> Self {
        Self { exit, cause: cause.into(), advice: None }
    }

    /// A fault of the program itself: exit code 1.
    pub fn fault(cause: impl Into<Box<dyn Error + Send + Sync>>) -> Self {
        Self::new(Exit::Fault, cause).advice("this is a bug: please report it with the command line and the text above")
    }

    /// The command line asks for what cannot or must not be done: exit code 2.
    pub fn usage(cause: impl Into<Box<dyn Error + Send + Sync>>) -> Self {
        Self::new(Exit::Usage, cause)
    }

    /// A device or file could not be opened, read or written: exit code 3.
    pub fn device(cause: impl Into<Box<dyn Error + Send + Sync>>) -> Self {
        Self::new(Exit::Device, cause)
    }

    /// The data cannot be used: exit code 4.
    pub fn data(cause: impl Into<Box<dyn Error + Send + Sync>>) -> Self {
        Self::new(Exit::Data, cause)
    }

    /// The solver ended without an answer: exit code 5.
    pub fn no_convergence(cause: impl Into<Box<dyn Error + Send + Sync>>) -> Self {
        Self::new(Exit::NoConvergence, cause)
    }

    /// The same failure with what the user can do about it.
    #[must_use]
    pub fn advice(mut self, advice: impl Into<String>) -> Self {
        self.advice = Some(advice.into());
        self
    }

    /// The same failure with the thing that it is about in front, where several were given.
    #[must_use]
    pub fn about(self, what: impl fmt::Display) -> Self {
        Self { cause: Box::new(About { what: what.to_string(), source: self.cause }), ..self }
    }

    /// The exit code.
    pub fn exit(&self) -> Exit {
        self.exit
    }
}

#[derive(Debug, thiserror::Error)]
#[error("{what} cannot be used")]
struct About {
    what: String,
    source: Box<dyn Error + Send + Sync>,
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.cause.fmt(f)
    }
}

impl Error for Failure {
    fn source(&self) -> Option<&(dyn Error + 'static)> {
        self.cause.source()
    }
}

impl miette::Diagnostic for Failure {
    fn help<'a>(&'a self) -> Option<Box<dyn fmt::Display + 'a>> {
        self.advice.as_ref().map(|advice| Box::new(advice) as Box<dyn fmt::Display>)
    }
}
