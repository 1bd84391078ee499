//! A recording in memory (columns with units), and its files.
//!
//! ```text
//!   serial line ─▶ link ─┐ Row, Event, LossBalance            ┌─▶ RUN.mcap   (mcap::Writer, survives kill -9)
//!   DATA.csv ─▶ import ──┼──────────────▶ Recorder ─▶ Recording ─▶ DATA.csv  (csv::write)
//!   RUN.mcap ─▶ mcap ────┘                                    └─▶ check, calibrate, verify
//! ```
//!
//! Here SI begins: angles in rad on the link side of the gear with the zero position taken off, rates in rad/s, time in
//! µs of the device's clock. Sample k is what tick k read, and the input that holds from t_k to t_{k+1}. A tick that is
//! missing is missing: its number is skipped, and nothing is interpolated. Within a tick, NaN says that a sensor had no
//! valid reading.

mod columns;
#[cfg(test)]
mod fixture;
mod log;
mod recorder;
mod session;
mod wrap;

pub mod check;
pub mod csv;
pub mod import;
pub mod mcap;

use std::path::Path;

pub use columns::{Channel, NO_PHASE, Recording, Tick};
pub use log::{LogLevel, LogLine, Place};
pub use mcap::{Damage, ReadError};
pub use recorder::{Recorder, Row, RowError};
pub use session::{Event, Firmware, GyroTime, LossBalance, MotionFile, Session, Severity, Source};

/// Reads a recording made by `host record`, `import` or `repair`.
///
/// A file that was cut off is read up to its last whole chunk; what is missing stands in [`Recording::damage`].
///
/// # Errors
/// [`ReadError`], which knows what to do ([`ReadError::advice`]).
pub fn read(path: &Path) -> Result<Recording, ReadError> {
    mcap::read(path)
}

/// Lower-case hexadecimal SHA-256, as results name a recording.
pub(crate) fn sha256(bytes: &[u8]) -> String {
    use sha2::Digest;
    sha2::Sha256::digest(bytes).iter().map(|byte| format!("{byte:02x}")).collect()
}
