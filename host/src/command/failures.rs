//! Typed errors of the rooms below as failures of a verb: exit code and advice.

use super::{Exit, Failure};
use crate::recording::ReadError;
use crate::recording::import::TableError;
use crate::robot::RobotError;

/// A recording that could not be read.
pub(super) fn read_failure(error: ReadError) -> Failure {
    let (exit, advice) = (of(error.is_io()), error.advice());
    Failure::new(exit, error).advice(advice)
}

/// A table that could not be read.
pub(super) fn table_failure(error: TableError) -> Failure {
    let (exit, advice) = (of(error.is_io()), error.advice());
    Failure::new(exit, error).advice(advice)
}

/// A robot that does not exist, or a description that is refused.
pub(super) fn robot_failure(error: RobotError) -> Failure {
    let (exit, advice) = match &error {
        RobotError::Read { .. } => (Exit::Device, "check the path and that you may read the file"),
        RobotError::UnknownRobot { .. } => {
            (Exit::Usage, "give a built-in name (host robot list) or the path of a description file")
        }
        _ => (Exit::Data, "correct the robot file at that place; `host robot show doggy` prints a whole one"),
    };
    Failure::new(exit, error).advice(advice)
}

fn of(is_io: bool) -> Exit {
    if is_io { Exit::Device } else { Exit::Data }
}
