//! Why something that a user asked for was not done: what kind of failure it is, its cause, and what the user can do about it.
//!
//! The rooms below have typed errors of their own. Here they become one type for whoever faces the user: the command line ends with the exit code of
//! the [`Kind`], the Python package raises its exception.

mod errors;

use std::error::Error;
use std::fmt;

pub use errors::{
    calibrate_failure, calibration_failure, diagnose_failure, export_failure, observe_failure, read_failure,
    robot_failure, simulate_failure, table_failure, unfit, verify_failure,
};

/// What kind of failure it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// A fault of the program itself.
    Fault,
    /// What was asked for does not exist or must not happen (an existing file, say).
    Usage,
    /// A device or a file could not be opened, read or written.
    Device,
    /// The data was read and cannot be used.
    Data,
    /// The solver ended without an answer.
    NoConvergence,
}

/// Why something failed: a kind, the cause (with its own causes), and what the user can do.
///
/// Made from a typed error by the constructor that names the kind: `Failure::data(error).advice("…")`.
#[derive(Debug)]
pub struct Failure {
    kind: Kind,
    cause: Box<dyn Error + Send + Sync>,
    advice: Option<String>,
}

impl Failure {
    /// A failure of the given kind; `cause` is a typed error or a text.
    pub fn new(kind: Kind, cause: impl Into<Box<dyn Error + Send + Sync>>) -> Self {
        Self { kind, cause: cause.into(), advice: None }
    }

    /// A fault of the program itself.
    pub fn fault(cause: impl Into<Box<dyn Error + Send + Sync>>) -> Self {
        Self::new(Kind::Fault, cause).advice("this is a bug: please report it with the command line and the text above")
    }

    /// What cannot or must not be done was asked for.
    pub fn usage(cause: impl Into<Box<dyn Error + Send + Sync>>) -> Self {
        Self::new(Kind::Usage, cause)
    }

    /// A device or file could not be opened, read or written.
    pub fn device(cause: impl Into<Box<dyn Error + Send + Sync>>) -> Self {
        Self::new(Kind::Device, cause)
    }

    /// The data cannot be used.
    pub fn data(cause: impl Into<Box<dyn Error + Send + Sync>>) -> Self {
        Self::new(Kind::Data, cause)
    }

    /// The solver ended without an answer.
    pub fn no_convergence(cause: impl Into<Box<dyn Error + Send + Sync>>) -> Self {
        Self::new(Kind::NoConvergence, cause)
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

    /// What kind of failure it is.
    pub fn kind(&self) -> Kind {
        self.kind
    }

    /// What the user can do, if anything is known.
    pub fn help(&self) -> Option<&str> {
        self.advice.as_deref()
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
