//! Failures of the library as the exceptions of `flexcal.errors`.

use std::error::Error;

use host::failure::{Failure, Kind};
use pyo3::prelude::*;

/// The exception for a failure: its cause with all causes behind it, and its advice.
pub fn raise(py: Python<'_>, failure: &Failure) -> PyErr {
    let mut message = failure.to_string();
    let mut cause = failure.source();
    while let Some(deeper) = cause {
        message = format!("{message}: {deeper}");
        cause = deeper.source();
    }
    let name = match failure.kind() {
        Kind::Fault => "InternalError",
        Kind::Usage => "UsageError",
        Kind::Device => "DeviceError",
        Kind::Data => "DataError",
        Kind::NoConvergence => "NoConvergenceError",
    };
    let exception = py
        .import("flexcal.errors")
        .and_then(|errors| errors.getattr(name))
        .and_then(|class| class.call1((message, failure.help())));
    match exception {
        Ok(exception) => PyErr::from_value(exception),
        Err(error) => error,
    }
}

/// `?` from the library's results.
pub trait OrRaise<T> {
    /// The value, or the failure as an exception.
    fn or_raise(self, py: Python<'_>) -> PyResult<T>;
}

impl<T> OrRaise<T> for Result<T, Failure> {
    fn or_raise(self, py: Python<'_>) -> PyResult<T> {
        self.map_err(|failure| raise(py, &failure))
    }
}
