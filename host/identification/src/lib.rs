//! Identification of robots with elastic joints from recordings: calibration, verification on another motion, diagnosis of what the model lacks, export.
//!
//! ```text
//! MCAP, tables, bags ─▶ recording ─▶ calibrate ─▶ verify ─▶ diagnose        export ─▶ observe        fleet
//!                                       ▲            predictions,                code, simulators,        many
//!                     inverse_dynamics ─┘            hold-out                    an observer              robots
//! ```
//!
//! * [`recording`]: a recording in memory, its files, and the checks that need no model.
//! * [`calibrate`]: all states of all samples and the parameters by one least-squares problem (the crate `solve`), its noise, what cannot be identified.
//! * [`verify`]: free run and predictions from past data only.
//! * [`diagnose`]: which law of the catalogue predicts data that no fit has seen.
//! * [`export`], [`observe`], [`fleet`]: the model for other tools, the observer on a recording, many calibrations merged.
//! * [`inverse_dynamics`]: torques of a rigid robot along filtered differences of its positions.
//!
//! # Calibrate and diagnose a recording
//!
//! ```
//! use identification::calibrate::{Preset, calibrate};
//! use identification::diagnose::{Options, diagnose};
//! use identification::recording;
//! use robot_model::robot::Robot;
//! use solve::levenberg::Settings;
//!
//! # let folder = tempfile::tempdir()?;
//! # let path = folder.path().join("run.mcap");
//! # let simulated = host::simulate::Options::parse("robot=one_joint,seed=3,effect=backlash")?;
//! # let motion = include_str!("../doc/one_joint_motion.toml");
//! # let direct = host::simulate::Direct::record(&simulated, motion)?;
//! # recording::mcap::write(std::fs::File::create(&path)?, &direct.recording)?.sync_all()?;
//! let robot = Robot::builtin("one_joint")?;
//! let run = recording::read(&path)?;
//!
//! let base = calibrate(&robot, &[&run], Preset::Default, &Settings::default(), |_, _| {})?;
//! for parameter in &base.parameters {
//!     println!("{} {:?} ± {:?} {}", parameter.name, parameter.estimate, parameter.std_error, parameter.unit);
//! }
//! assert!(base.status.is_usable());
//!
//! // The last third of the recording is what no fit sees.
//! let diagnosis = diagnose(&robot, &[&run], None, &Options::default(), &|_| {})?;
//! println!("{}", diagnosis.summary);
//! assert_eq!(diagnosis.findings[0].effect, "backlash");
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
#![forbid(unsafe_code)]

pub mod diagnose;
pub mod observe;

pub mod export;
pub mod fleet;
pub mod verify;

pub mod calibrate;

pub mod inverse_dynamics;

pub mod recording;

#[cfg(test)]
mod simulated;

pub(crate) use robot_model::{effect, model, robot};
