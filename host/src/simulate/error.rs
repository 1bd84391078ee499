//! Why a robot cannot be simulated.

use crate::effect::EffectError;
use crate::robot::RobotError;

/// Why a robot cannot be simulated.
#[derive(Debug, thiserror::Error)]
pub enum SimulateError {
    /// The description.
    #[error(transparent)]
    Robot(#[from] RobotError),
    /// An effect.
    #[error(transparent)]
    Effect(#[from] EffectError),
    /// An option that does not exist.
    #[error(
        "a simulated port has no option `{key}`; there are robot, seed, effect, hide, process_noise, pace, fault, mistake, gyros, truth, flash"
    )]
    UnknownOption {
        /// What was given.
        key: String,
    },
    /// An option whose value is not understood.
    #[error("option {key}: `{value}` is not {wanted}")]
    Option {
        /// Which.
        key: String,
        /// What was given.
        value: String,
        /// What is.
        wanted: &'static str,
    },
    /// The firmware cannot run this robot.
    #[error("this robot cannot be simulated: {reason}")]
    Unsuited {
        /// What the firmware lacks.
        reason: String,
    },
    /// A text that is not a motion, or one that this robot cannot play.
    #[error("the motion cannot be played: {said}")]
    Motion {
        /// What is wrong with it.
        said: String,
    },
    /// A driver did not find its part as it must be.
    #[error("the firmware could not set up a gyro: {said}")]
    Gyro {
        /// The driver's words.
        said: String,
    },
    /// A microcontroller that runs no further.
    #[error("the microcontroller stopped: {said}")]
    Machine {
        /// What is known of it.
        said: String,
    },
    /// The file of the board's flash.
    #[error("the file of the simulated flash: {0}")]
    Flash(std::io::Error),
    /// The pseudo-terminal.
    #[error("the simulated serial port: {0}")]
    Port(#[from] std::io::Error),
    /// The simulation ended by a fault of the program.
    #[error("the simulation ended unexpectedly")]
    Died,
}

impl SimulateError {
    pub(super) fn option(key: &str, value: &str, wanted: &'static str) -> Self {
        Self::Option { key: key.to_owned(), value: value.to_owned(), wanted }
    }
}
