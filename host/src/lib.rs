//! Calibration of flexible-joint robots: record a motion, calibrate the elastic-joint model, verify it on another motion.
//!
//! Data runs one way: serial line → [`link`] → [`recording`] → [`calibrate`] (residuals of the [`model`], solved by
//! the crate [`solve`]) → results → [`report`]. Imports run downward in the list below; there are no cycles.
#![forbid(unsafe_code)]

pub mod command;
pub mod failure;
pub mod report;

pub mod diagnose;
pub mod observe;
pub mod plan;

pub mod export;
pub mod fleet;
pub mod verify;

pub mod bringup;
pub mod watch;

pub mod calibrate;
pub mod link;
pub mod simulate;

pub mod inverse_dynamics;

pub mod effect;
pub mod model;
pub mod recording;

pub mod robot;
