//! Why recordings cannot be calibrated.

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
    /// A recording that is given twice.
    #[error("{path} is given twice")]
    Twice {
        /// The recording.
        path: String,
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
