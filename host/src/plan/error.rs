//! Why there is no plan, and what the user can do.

use crate::calibrate::CalibrateError;
use crate::effect::EffectError;
use crate::simulate::SimulateError;

/// Why there is no plan.
#[derive(Debug, thiserror::Error)]
pub enum PlanError {
    /// The firmware cannot drive the robot.
    #[error("the firmware cannot drive this robot: {reason}")]
    Unsuited {
        /// What it lacks.
        reason: String,
    },
    /// A length into which nothing fits.
    #[error("a motion of {length_s:.1} s is too short: rest, a move and the way back take {least_s:.1} s")]
    TooShort {
        /// What was asked for.
        length_s: f64,
        /// What is needed.
        least_s: f64,
    },
    /// Most robots that it may be are stopped by their firmware in the preset motion.
    #[error("the preset calibration motion is stopped on {stopped} of {drawn} robots that it may be ({how})")]
    PresetStopped {
        /// Robots.
        stopped: usize,
        /// Of so many.
        drawn: usize,
        /// How the last one ended.
        how: String,
    },
    /// Nothing was found that keeps the limits on every robot, and the preset is too long or does not either.
    #[error("no motion was found that keeps the limits on every robot that it may be")]
    NoneKeepsLimits,
    /// Interrupted, or out of time, before there was a plan.
    #[error("the time was over before there was a plan")]
    NoTime,
    /// An effect that the robot cannot have.
    #[error(transparent)]
    Effect(#[from] EffectError),
    /// An effect that no motion can be planned for.
    #[error("no motion can be planned for {effect}: {reason}")]
    NotForPlans {
        /// Its id.
        effect: &'static str,
        /// Why.
        reason: &'static str,
    },
    /// What a motion tells cannot be judged.
    #[error(transparent)]
    Calibrate(#[from] CalibrateError),
    /// The simulation.
    #[error(transparent)]
    Simulate(SimulateError),
}

impl PlanError {
    /// What the user can do.
    pub fn advice(&self) -> &'static str {
        match self {
            Self::Unsuited { .. } => {
                "plans are for robots that the firmware drives: duty as input, 1 ms a sample, encoders on all motors"
            }
            Self::TooShort { .. } => "give a longer --length",
            Self::PresetStopped { .. } => {
                "correct the start values of the robot file, or record a short motion, calibrate, and plan from CAL.json"
            }
            Self::NoneKeepsLimits => {
                "give a longer --length, a higher --duty, or plan from a calibration, which is less uncertain"
            }
            Self::NoTime => "give a longer --time-limit",
            Self::Effect(_) | Self::NotForPlans { .. } => "`host effects` lists the effects; plan for another one",
            Self::Calibrate(_) => "see the robot file: `host robot show doggy` prints a whole one",
            Self::Simulate(_) => "see the robot file: `host simulate --robot FILE` must start with it",
        }
    }
}
