//! Recordings as tables: the way in and out for other programs.
//!
//! ```text
//!   # comment lines may stand anywhere
//!   t_us,u1,u2,u3,theta1,theta2,theta3,g1x,g1y,g1z,g2x,g2y,g2z
//!   1790148,0.0000,0.0000,0.0000,0.02551,0.00904,0.00743,0.051,-0.001,-0.022,0.048,0.000,-0.015
//! ```
//!
//! One row a tick. `t_us` is whole microseconds, `t_s` (seconds) is accepted instead. Then the input of each joint,
//! which holds until the next row, and the robot's channels by their names; columns are found by name, in any order.
//! A missing tick is a missing row. An empty field is a sensor without a valid reading in that tick. Gzip is told by
//! its first bytes.
//!
//! Tables of other programs have other names and units: the section `[import]` of the robot file says which column is
//! what, and what one of its numbers is in SI ([`crate::robot::Import`]). Columns that it does not name are passed over.
//!
//! What a table cannot carry (motion, phases, flags, balance, handshake) is lost by an export.

mod error;
mod header;
#[cfg(test)]
mod mapping_tests;
mod rate;
mod read;
#[cfg(test)]
mod tests;
mod write;

pub use error::{TableError, What};
pub use read::{Table, parse, read};
pub use write::write;
