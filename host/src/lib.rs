//! Calibration of flexible-joint robots: record a motion, calibrate the elastic-joint model, verify it on another motion.
//!
//! Data runs one way: serial line → [`link`] → [`recording`] → [`calibrate`] (residuals of the [`model`], solved by
//! the crate [`solve`]) → results → [`report`]. Imports run downward in the list below; there are no cycles.
#![forbid(unsafe_code)]

pub mod command;
pub mod failure;
pub mod report;

pub mod plan;

pub mod bringup;
pub mod watch;

pub mod link;
pub mod simulate;

pub use identification::{calibrate, diagnose, export, fleet, inverse_dynamics, observe, recording, verify};
pub use robot_model::{effect, model, robot};
