//! The native part of the Python package `flexcal`: recordings, robots and the verbs of the library `host` for the interpreter.
//!
//! ```text
//! flexcal/*.py  ─▶  flexcal._native (this crate)  ─▶  host
//!   arrays, frames,      errors ─▶ exceptions
//!   pages, files         work in a thread, the interpreter free
//! ```
//! Arrays pass as the bytes of 64-bit floats, results as the text of their files, so that Python has every number that a file of the binary has. What
//! users see is in `python/flexcal/`; nothing here is meant to be called by them.

mod arrays;
mod errors;
mod recording;
mod robot;
mod verbs;
mod work;

use pyo3::prelude::*;

/// `flexcal._native`.
#[pymodule]
fn _native(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add_class::<robot::Robot>()?;
    module.add_class::<recording::Recording>()?;
    module.add_class::<verbs::Outcome>()?;
    module.add_function(wrap_pyfunction!(robot::robot_names, module)?)?;
    module.add_function(wrap_pyfunction!(verbs::calibrate, module)?)?;
    module.add_function(wrap_pyfunction!(verbs::read_calibration, module)?)?;
    module.add_function(wrap_pyfunction!(verbs::verify, module)?)?;
    module.add_function(wrap_pyfunction!(verbs::diagnose, module)?)?;
    module.add_function(wrap_pyfunction!(verbs::observe, module)?)?;
    module.add_function(wrap_pyfunction!(verbs::check, module)?)?;
    module.add_function(wrap_pyfunction!(verbs::export, module)?)?;
    Ok(())
}
