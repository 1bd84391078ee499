//! The robot's observer on a recording: the same filter, in the same precision, that runs on the device.
//!
//! ```text
//! CAL.json ─▶ Exported ─▶ Numbers (table, noise) ─┬─▶ bytes (`host export --observer`)
//! recording ── readings, inputs as they act ──────┴─▶ run (observer::Observer<f32>) ─▶ Estimates ─▶ consistency ─▶ Observation
//!                                                          truth of a simulated robot ──────────────┘
//! ```
//! A filter tells how well it knows its state. Whether that is true is asked in two ways (Y. Bar-Shalom, X. R. Li, T. Kirubarajan, *Estimation with
//! Applications to Tracking and Navigation*, 2001, section 5.4): the normalised innovation squared (NIS) compares readings with their predictions, and
//! the normalised estimation error squared (NEES) the state with the true one, where that is known. Both are χ² if the filter is right, so that
//! 95 % of them lie between the 2.5th and the 97.5th percentile.

mod bytes;
mod consistency;
mod result;
mod run;
mod settings;
mod table;
#[cfg(test)]
mod tests;
mod truth;

pub use bytes::BytesError;
pub use consistency::Consistency;
pub use result::{Error, Event, Observation, RecordingObserved, StateEstimate, Status};
pub use run::{Estimates, SETTLING_S};
pub use table::Numbers;
pub use truth::{Truth, TruthError};

pub use observer::Sensors;

use crate::calibrate::Calibration;
use crate::export::{ExportError, Exported};
use crate::recording::Recording;
use crate::verify::{self, VerifyError};

/// Why there is no observer of a calibration, or none on a recording.
#[derive(Debug, thiserror::Error)]
pub enum ObserveError {
    /// The model cannot be written down.
    #[error(transparent)]
    Export(#[from] ExportError),
    /// The recording is none of this robot.
    #[error(transparent)]
    Recording(#[from] VerifyError),
    /// Euler steps.
    #[error(
        "the calibration's steps are explicit Euler's, whose error is in its damping; an observer integrates the equations themselves: calibrate with --preset default"
    )]
    Euler,
    /// Noise that the calibration does not tell.
    #[error("the calibration does not tell the noise `{name}`: calibrate again")]
    MissingNoise {
        /// Which.
        name: String,
    },
    /// More than a table can hold.
    #[error("the model has more operations than a table has places for (65,535): calibrate with fewer extensions")]
    Large,
    /// The table that was made is refused by the observer.
    #[error("the observer refuses its table: {0}")]
    Table(#[from] observer::TableError),
    /// The settings are.
    #[error("the observer refuses its settings: {0}")]
    Settings(#[from] observer::ObserverError),
    /// No tick at which a filter can start.
    #[error("no tick of the recording has a reading of every position: there is nothing to start from")]
    NoStart,
    /// A truth of another recording.
    #[error(transparent)]
    Truth(#[from] TruthError),
}

/// Runs the observer of a calibration on a recording. `step` is told what begins.
///
/// # Errors
/// [`ObserveError`].
pub fn observe(
    calibration: &Calibration,
    recording: &Recording,
    sensors: Sensors,
    truth: Option<&Truth>,
    step: impl Fn(&'static str),
) -> Result<(Observation, Estimates), ObserveError> {
    let exported = Exported::of(calibration)?;
    verify::check(&exported.calibrated, recording)?;
    step("writing the model down");
    let numbers = Numbers::of(&exported)?;
    let names = result::names(&exported);
    let truth = truth.map(|truth| truth.of(recording, &names)).transpose()?;
    step("observing");
    let inputs = exported.calibrated.inputs_as_they_act(&recording.duty, &recording.segments());
    let estimates = run::run(&numbers, recording, &inputs, sensors, truth.as_ref())?;
    let observation = Observation::of(calibration, recording, (sensors, &numbers), names, (&estimates, truth.as_ref()));
    Ok((observation, estimates))
}
