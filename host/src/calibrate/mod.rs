//! The calibration: residuals of a recording under a model, solved jointly for all states of all samples and the shared parameters.
//!
//! ```text
//! Recording ─▶ series (one chain, broken at gaps) ─▶ start ─▶ problem ─▶ solve::levenberg ─▶ identify ─▶ Calibration
//!                                       preset: integrator, gyro rows, noise ──┘
//! ```

mod bench;
mod blocks;
mod chained;
mod channels;
mod equilibrium;
#[cfg(test)]
mod extended_tests;
pub(crate) mod extension;
mod fit;
pub mod foresight;
mod identify;
pub mod information;
mod law_rows;
mod marginal;
mod misfit;
mod noise;
mod noise_free;
mod observability;
mod others;
mod outliers;
mod own_states;
mod point;
mod prefit;
mod preset;
mod problem;
mod reml;
mod result;
mod robot_scale;
mod row;
mod row_plan;
mod scatter;
mod scores;
mod search;
mod series;
mod stamps;
mod start;
mod summary;
#[cfg(test)]
mod tests;
mod torque_start;
mod trial;
mod trimmed;
mod triple;
mod wide;
mod windows;
mod worst;

pub use bench::Bench;
pub use blocks::{BlockFit, BlockScores, LawBlock, Quadratic};
pub use fit::{Fit, calibrate, extend, extend_as, fit};
pub use noise::Noise;
pub(crate) use noise::{of_inputs, process_names};
pub use observability::{Unobservable, comparable_truth};
pub use point::{BorderLayout, Point};
pub use preset::{Assumptions, GyroRows, InitialNoise, Method, NoiseSource, Preset, ProcessNoise};
pub use problem::Problem;
pub use result::{
    BlockScatter, Calibration, ChannelFit, ChannelNoise, Correlation, Covariance, ParameterEstimate, RecordingUsed,
    Seconds, Status,
};
pub use series::Series;
pub use trial::{JointState, Trial, TrialValue};
pub use trimmed::Trimmed;

use crate::recording::Recording;
use crate::robot::{ChannelKind, Robot};
use solve::error::SolveError;

/// Why recordings cannot be calibrated.
#[derive(Debug, thiserror::Error)]
pub enum CalibrateError {
    /// No recording.
    #[error("no recording was given")]
    NoRecording,
    /// Too short to say anything.
    #[error("{path} has {samples} samples in runs without a gap: a calibration needs at least {least}")]
    TooShort {
        /// The recording.
        path: String,
        /// Its samples.
        samples: usize,
        /// What is needed.
        least: usize,
    },
    /// Recordings of different robots.
    #[error("{path} was recorded on robot `{robot}`, the others on `{expected}`: calibrate one robot at a time")]
    DifferentRobot {
        /// The recording.
        path: String,
        /// Its robot.
        robot: String,
        /// The robot of the first one.
        expected: String,
    },
    /// A recording that does not have the columns of the description.
    #[error("{path} has the columns {found}, the description of `{robot}` wants {expected}")]
    DifferentColumns {
        /// The recording.
        path: String,
        /// Its columns.
        found: String,
        /// The robot.
        robot: String,
        /// Its columns.
        expected: String,
    },
    /// The motor encoders are the only channels that every method needs.
    #[error("joint {joint} (`{name}`) has no position sensor: its state cannot be found")]
    NoPosition {
        /// 1-based.
        joint: usize,
        /// Its name.
        name: String,
    },
    /// A model on top of which nothing can be scored.
    #[error("the shared parameters of the fitted model are not determined together: nothing can be compared with it")]
    Undetermined,
    /// The preset does not fit the robot.
    #[error(
        "the preset `paper` wants its first gyro on the body after the first joint, a revolute one, as (22) does; use the preset `default`"
    )]
    NotThePapersRobot,
    /// The rows of `paper` are those of a rigid base and of sensors as they are.
    #[error("effects extend the preset `default` only")]
    ExtendsThePaper,
    /// An effect that is not known, or that the robot cannot have.
    #[error(transparent)]
    Effect(#[from] crate::effect::EffectError),
    /// An extended model that is too large.
    #[error("the extended model does not fit: {0}")]
    Extension(#[from] crate::model::ModelError),
    /// The solver gave up.
    #[error("the least-squares problem cannot be solved: {0}")]
    Solve(#[from] SolveError),
}

/// Fewest samples of a recording.
pub const FEWEST_SAMPLES: usize = 200;

/// The columns of a table with so many inputs and these channels.
fn columns(inputs: usize, channels: &[crate::robot::Channel]) -> String {
    let inputs = (1..=inputs).map(|i| format!("u{i}"));
    inputs.chain(channels.iter().map(|channel| channel.column.clone())).collect::<Vec<_>>().join(",")
}

fn check(robot: &Robot, recordings: &[&Recording], preset: Preset) -> Result<(), CalibrateError> {
    let first = recordings.first().ok_or(CalibrateError::NoRecording)?;
    let expected = columns(robot.joints.len(), &robot.channels());
    for recording in recordings {
        let path = recording.source.path.display().to_string();
        let specs: Vec<_> = recording.channels.iter().map(|channel| channel.spec.clone()).collect();
        let found = columns(recording.duty.len(), &specs);
        if found != expected {
            let robot = robot.name.clone();
            return Err(CalibrateError::DifferentColumns { path, found, robot, expected });
        }
        let samples = series::usable_samples(recording);
        if samples < FEWEST_SAMPLES {
            return Err(CalibrateError::TooShort { path, samples, least: FEWEST_SAMPLES });
        }
        if recording.robot.name != first.robot.name {
            let (robot, expected) = (recording.robot.name.clone(), first.robot.name.clone());
            return Err(CalibrateError::DifferentRobot { path, robot, expected });
        }
    }
    let channels = robot.channels();
    let sees = |joint: usize| {
        channels.iter().any(|channel| {
            matches!(channel.kind,
                ChannelKind::MotorPosition { joint: j } | ChannelKind::LinkPosition { joint: j } if j == joint)
        })
    };
    if let Some(joint) = (0..robot.joints.len()).find(|&joint| !sees(joint)) {
        return Err(CalibrateError::NoPosition { joint: joint + 1, name: robot.joints[joint].name.clone() });
    }
    let papers_gyro = robot
        .gyros()
        .next()
        .is_none_or(|gyro| gyro.body == 0 && robot.joints[0].kind == crate::robot::JointKind::Revolute);
    if preset == Preset::Paper && !papers_gyro {
        return Err(CalibrateError::NotThePapersRobot);
    }
    Ok(())
}
