//! Tables and bags of other programs become recordings.
//!
//! ```text
//!   DATA.csv ─▶ table ─┐         ╭ join   inputs and sensors of different rows
//!   BAG.mcap ─▶ bag ───┴─▶ Rows ─┤ rate   the rows' own period, numbers of ticks, gaps    ─▶ Recording
//!                                ╰ wrap   positions that begin again after a turn
//! ```
//!
//! A table has one row a tick:
//!
//! ```text
//!   # comment lines may stand anywhere
//!   t_us,u1,u2,u3,theta1,theta2,theta3,g1x,g1y,g1z,g2x,g2y,g2z
//!   1790148,0.0000,0.0000,0.0000,0.02551,0.00904,0.00743,0.051,-0.001,-0.022,0.048,0.000,-0.015
//! ```
//!
//! `t_us` is whole microseconds, `t_s` (seconds) is accepted instead. Then the input of each joint, which holds until the
//! next row, and the robot's channels by their names; columns are found by name, in any order. A missing tick is a
//! missing row. An empty field is a sensor without a valid reading in that tick. Gzip is told by its first bytes.
//!
//! Tables of other programs have other names and units: the section `[import]` of the robot file says which column is
//! what, and what one of its numbers is in SI ([`crate::robot::Import`]). Columns that it does not name are passed over.
//! The joints of a ROS 2 bag are columns, too: see `bag`.

mod arrays;
mod bag;
#[cfg(test)]
mod bag_tests;
mod cdr;
mod error;
mod header;
mod join;
#[cfg(test)]
mod mapping_tests;
pub(super) mod rate;
mod rows;
mod samples;
mod table;
#[cfg(test)]
mod tests;

use std::path::Path;

use super::Recording;
use crate::robot::Robot;

pub use arrays::from_arrays;
pub use error::{Place, TableError, What};
pub use join::EmptyInputs;

/// What was made of a table or bag.
#[derive(Debug)]
pub struct Imported {
    /// Its samples.
    pub recording: Recording,
    /// Columns that the robot file does not name, and that were passed over.
    pub ignored: Vec<String>,
    /// What was done to the numbers beside units and signs, for people.
    pub notes: Vec<String>,
}

/// Reads the table (plain or gzip) or ROS 2 bag (MCAP) at `path` as a recording of `robot`.
///
/// `empty_inputs` says what the input is in rows that have none; without it such rows are refused.
///
/// # Errors
/// [`TableError`] with the place and what to do.
pub fn read(path: &Path, robot: &Robot, empty_inputs: Option<EmptyInputs>) -> Result<Imported, TableError> {
    let bytes = std::fs::read(path).map_err(|source| TableError::Open { path: path.to_owned(), source })?;
    parse(&bytes, robot, path, empty_inputs)
}

/// Reads from the bytes of a file; `path` is only noted as its source.
///
/// Where the robot file names columns under `[import]`, these are looked for; a table with exactly the robot's own
/// columns (an export) is read as it stands if they are not there.
///
/// # Errors
/// [`TableError`], but never [`TableError::Open`].
pub fn parse(
    bytes: &[u8],
    robot: &Robot,
    path: &Path,
    empty_inputs: Option<EmptyInputs>,
) -> Result<Imported, TableError> {
    let (rows, ignored, mut notes) = match bytes.starts_with(mcap::MAGIC) {
        true => bag::rows(bytes, robot)?,
        false => {
            let (rows, ignored) = table::rows(bytes, robot)?;
            (rows, ignored, Vec::new())
        }
    };
    let recording = samples::recording(rows, robot, bytes, path, empty_inputs, &mut notes)?;
    Ok(Imported { recording, ignored, notes })
}
