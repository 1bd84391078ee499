//! Why a recording was not made, and what the user can do about it.

use protocol::{Fault, MotionEnd, MotionError};

use super::super::{LinkError, ScaleError};
use crate::recording::mcap::WriteError;

/// Why a recording was not made, or not to its end.
#[derive(Debug, thiserror::Error)]
pub enum CaptureError {
    /// The device or the line.
    #[error(transparent)]
    Link(#[from] LinkError),
    /// Device and description are not the same robot.
    #[error("device and robot description disagree")]
    Scale(#[from] ScaleError),
    /// The motion does not fit the robot.
    #[error("the motion \"{motion}\" does not fit the robot {robot}")]
    Motion {
        /// Its name.
        motion: String,
        /// The robot's name.
        robot: String,
        /// The rule that it breaks.
        source: MotionError,
    },
    /// The file cannot be written any more.
    #[error(transparent)]
    Write(#[from] WriteError),
    /// The motion ended before its end.
    #[error("the motion was stopped in segment {phase} of {segments}: {why}")]
    Stopped {
        /// The segment, from 1.
        phase: usize,
        /// Segments of the motion.
        segments: usize,
        /// By whom or what.
        why: String,
        /// How the device says that it ended.
        end: MotionEnd,
    },
    /// The device goes on when every segment must be over.
    #[error(
        "the motion is not over after {longest_s} s, the longest that its segments can take, and 2 s more: the device was stopped"
    )]
    Endless {
        /// What its segments can take, s.
        longest_s: f64,
    },
    /// The caller wished to stop.
    #[error("stopped by request")]
    Interrupted,
    /// An accepted start that never happened.
    #[error("the device accepted the start but does not play the motion")]
    NeverStarted,
}

impl CaptureError {
    /// What the user can do about it.
    pub fn advice(&self) -> &'static str {
        match self {
            Self::Link(error) => error.advice(),
            Self::Scale(error) => error.advice(),
            Self::Motion { .. } => "change the motion file, or name the robot that is connected with --robot",
            Self::Write(_) => "check that the disk has room; the robot was stopped",
            Self::Stopped { end: MotionEnd::Fault(Fault::HeartbeatLost), .. } => {
                "the line from the host to the device was interrupted, or this machine stood still; the file holds what \
                 was recorded until then"
            }
            Self::Stopped { end: MotionEnd::Fault(Fault::WrongWay { .. }), .. } => {
                "swap the leads of that motor or the two phases of its encoder, or give its counts per turn the other sign; \
                 the file holds what was recorded until then"
            }
            Self::Stopped { end: MotionEnd::Fault(Fault::EncoderStuck { .. }), .. } => {
                "is a wire of that encoder broken, does it belong to that motor, and is the joint free to move? The file holds \
                 what was recorded until then"
            }
            Self::Stopped { end: MotionEnd::Fault(Fault::RotationMismatch { .. }), .. } => {
                "was the robot in its marked pose when its zero was set? Check the encoders' wires, counts per turn and gears, \
                 the belts for slip, and the gyro's axes and range in the firmware's robot; the file holds what was recorded \
                 until then"
            }
            Self::Stopped { .. } => "remove the cause and record again; the file holds what was recorded until then",
            Self::Endless { .. } => {
                "is the firmware the one that belongs to this program? Reset the device and flash it again"
            }
            Self::Interrupted => "the robot was stopped; the file holds what was recorded until then",
            Self::NeverStarted => "reset the device and try again",
        }
    }
}
