//! A calibrated model for other tools: one model, written down once, and every file made from it.
//!
//! ```text
//! CAL.json ─▶ Exported ─┬─▶ robot file                         the same program's next --robot
//!                       ├─▶ Program (traced) ─┬─▶ C ─▶ FMU     co-simulation and model exchange
//!                       │                     └─▶ Rust         ẋ, readings, Jacobians, a step
//!                       ├─▶ MJCF
//!                       └─▶ URDF
//! ```
//! A [`Program`] is what the model's own equations write down when they run on expressions in place of numbers, so that there is no second copy of
//! them. Every file begins with where it comes from and ends its head with its [`Loss`]es.

mod exported;
mod fmu;
mod loss;
mod machine;
mod mjcf;
mod program;
mod robot_file;
#[cfg(test)]
pub(crate) mod tests;
mod urdf;
mod xml;

pub use exported::{Exported, Parameter, Place, Quantity};
pub use fmu::fmu;
pub use loss::{Kept, Loss};
pub use mjcf::mjcf;
pub use program::{CFiles, Program, Sizes, c, rust};
pub use robot_file::robot_file;
pub use urdf::urdf;

use crate::verify::VerifyError;

/// Why a model cannot be exported.
#[derive(Debug, thiserror::Error)]
pub enum ExportError {
    /// The calibration.
    #[error(transparent)]
    Calibration(#[from] VerifyError),
    /// A law that looks at values.
    #[error("a law of this model cannot be written down as a formula: calibrate without --extend of it")]
    Untraceable,
    /// The robot description inside the calibration.
    #[error("the robot description inside the calibration cannot take the calibrated values: {message}")]
    Description {
        /// What is wrong.
        message: String,
    },
    /// An archive.
    #[error("the archive cannot be made: {message}")]
    Archive {
        /// What is wrong.
        message: String,
    },
}
