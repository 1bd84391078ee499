//! The calibration: residuals of a recording under a model, solved jointly for all states of all samples and the shared parameters.
//!
//! ```text
//! Recording ─▶ data (one chain, broken at gaps) ─▶ initial_guess ─▶ residuals ─▶ search ─▶ noise_estimate ─▶ search ─▶ result
//!                                                                                │                                    │
//!                                                             identifiability ───┴──── extension ◀────────────────────┘
//! ```
//! `fit` is the pipeline, `extension` starts where a fit ended, `scatter` tells the errors of coloured residuals.

pub(crate) mod data;
mod error;
#[cfg(test)]
mod extended_tests;
pub(crate) mod extension;
mod fit;
pub mod foresight;
mod identifiability;
pub mod information;
mod initial_guess;
mod noise_estimate;
mod requirements;
mod residuals;
mod result;
mod scatter;
mod search;
#[cfg(test)]
mod tests;

pub use data::series::Series;
pub use error::CalibrateError;
pub use extension::bench::{Bench, SavingEffort};
pub use extension::blocks::{BlockFit, BlockScores, LawBlock, ParameterAt, Quadratic};
pub(crate) use extension::laws::laws_for;
pub use extension::trial::{JointState, Trial, TrialValue};
pub use extension::trimmed::Trimmed;
pub use fit::{calibrate, calibrate_extended, extend, extend_as, fit};
pub use identifiability::observability::{Unobservable, comparable_truth};
pub use requirements::{FEWEST_SAMPLES, obstacles};
pub use residuals::noise::Noise;
pub(crate) use residuals::noise::{of_inputs, process_names};
pub use residuals::point::{BorderLayout, Point};
pub use residuals::preset::{Assumptions, GyroRows, InitialNoise, Method, NoiseSource, Preset, ProcessNoise};
pub use residuals::problem::Problem;
pub use result::calibration::{
    BlockScatter, Calibration, ChannelFit, ChannelNoise, Correlation, Covariance, ParameterEstimate, RecordingUsed,
    Seconds, Status,
};
pub use result::fitted::Fit;
