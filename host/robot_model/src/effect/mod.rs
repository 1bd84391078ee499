//! The catalogue of effects that a robot may have beyond the base model: one file each, one line in [`CATALOGUE`].
//!
//! A plant walks the line
//!
//! ```text
//! duty → supply voltage → motor torque → transmission torque → friction → link loads → accelerations → sensors
//! ```
//!
//! and asks every effect it has at the quantities that an effect may change ([`Physics`]); an effect that has nothing
//! to say leaves them as they are. A plant's effect is written to the physics, not to what an estimator can fit.

use std::sync::Arc;

use rand::{Rng, RngExt};
use serde::{Deserialize, Serialize};

use crate::model::law::Law;
use crate::robot::Robot;

mod draw;
mod error;
mod past;
mod physics;
mod surrogate;
#[cfg(test)]
mod tests;
mod typical;

mod asymmetric_friction;
mod backlash;
mod base_bearing;
mod belt_hardening;
mod belt_hysteresis;
mod belt_slack_side;
mod belt_tooth_skip;
mod cable_spring;
mod cogging;
mod coriolis;
mod current_limit;
mod electrical_lag;
mod encoder_eccentricity;
mod encoder_lag;
mod end_stop;
mod friction_drift;
mod friction_slope;
mod gravity_residual;
mod gyro_bias_drift;
mod gyro_clipping;
mod gyro_lag;
mod gyro_scale;
mod input_delay;
mod integrator_error;
mod link_friction;
mod link_inertia;
mod load_friction;
mod motor_mismatch;
mod position_friction;
mod pwm_dead_zone;
mod quadratic_drag;
mod stribeck;
mod structure_mode;
mod torque_offset;
mod viscous_friction;
mod voltage_sag;

pub use error::EffectError;
pub use past::Past;
pub use physics::{Drive, Line, Moment, PassiveJoint, Physics, Structure};
pub use typical::{EffectParameter, JointScales, RobotScales, Role, Scale, Typical};

/// Effects of sizes that are told, in place of drawn ones.
pub mod of_size {
    pub use super::backlash::gaps;
    pub use super::base_bearing::bearing;
    pub use super::belt_tooth_skip::skip;
    pub use super::voltage_sag::sag;
}

/// Every effect there is, in the order in which a plant asks them: along the line, and a delay before what it delays.
pub const CATALOGUE: [&Effect; 36] = [
    &input_delay::EFFECT,
    &pwm_dead_zone::EFFECT,
    &voltage_sag::EFFECT,
    &electrical_lag::EFFECT,
    &current_limit::EFFECT,
    &motor_mismatch::EFFECT,
    &cogging::EFFECT,
    &torque_offset::EFFECT,
    &backlash::EFFECT,
    &belt_hardening::EFFECT,
    &belt_slack_side::EFFECT,
    &belt_hysteresis::EFFECT,
    &belt_tooth_skip::EFFECT,
    &viscous_friction::EFFECT,
    &friction_slope::EFFECT,
    &stribeck::EFFECT,
    &asymmetric_friction::EFFECT,
    &load_friction::EFFECT,
    &position_friction::EFFECT,
    &friction_drift::EFFECT,
    &link_friction::EFFECT,
    &quadratic_drag::EFFECT,
    &gravity_residual::EFFECT,
    &cable_spring::EFFECT,
    &end_stop::EFFECT,
    &coriolis::EFFECT,
    &link_inertia::EFFECT,
    &base_bearing::EFFECT,
    &structure_mode::EFFECT,
    &gyro_scale::EFFECT,
    &gyro_lag::EFFECT,
    &gyro_bias_drift::EFFECT,
    &gyro_clipping::EFFECT,
    &encoder_lag::EFFECT,
    &encoder_eccentricity::EFFECT,
    &integrator_error::EFFECT,
];

/// An entry of the catalogue.
#[derive(Debug, Serialize)]
pub struct Effect {
    /// The id on the command line and in results.
    pub id: &'static str,
    /// Which equation it stands in.
    pub row: Row,
    /// What it is, in a few words.
    pub title: &'static str,
    /// The law.
    pub equation: &'static str,
    /// What it adds.
    pub parameters: &'static [EffectParameter],
    /// What its laws tell besides; no plant has a truth for them.
    pub nuisances: &'static [EffectParameter],
    /// What else looks like it: ids of the catalogue, and parameters of the base model.
    pub confounded_with: &'static [&'static str],
    /// One paragraph for people.
    pub about: &'static str,
    /// Makes one for a robot.
    #[serde(skip)]
    make: fn(&Robot, Size, &mut dyn Rng) -> Result<Hidden, EffectError>,
    /// Makes its laws for a robot.
    #[serde(skip)]
    laws: fn(&Robot) -> surrogate::Laws,
}

/// Which equation is concerned.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Row {
    /// M(q) q̈ = …
    Link,
    /// b θ̈ = …
    Motor,
    /// What a sensor reads.
    Sensor,
    /// When something happens.
    Timing,
}

/// How strong an effect is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Size {
    /// Just worth knowing.
    Small,
    /// As on many machines.
    Medium,
    /// Nobody could overlook it.
    Large,
    /// Between the names and beyond them, by the logarithm: −1 is small, 0 medium, 1 large.
    Level(f64),
    /// The first parameter of the effect has this value, in its unit, on every axis (where axes must differ, the
    /// largest).
    Exact(f64),
}

/// An effect inside a plant, with the truth about it.
#[derive(Debug)]
pub struct Hidden {
    /// The id in the catalogue.
    pub id: &'static str,
    /// Its parameters.
    pub values: Vec<TrueValue>,
    /// Its physics.
    pub physics: Box<dyn Physics>,
}

/// A number that is true of a simulated robot.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TrueValue {
    /// Name in results, as `k_s[2]` or `base_bearing.k[x]`.
    pub name: String,
    /// Unit.
    pub unit: &'static str,
    /// Value.
    pub value: f64,
}

impl Effect {
    /// The effect with this id.
    ///
    /// # Errors
    /// [`EffectError::Unknown`] with the known ids.
    pub fn by_id(id: &str) -> Result<&'static Self, EffectError> {
        let found = CATALOGUE.into_iter().find(|effect| effect.id == id);
        found.ok_or_else(|| EffectError::unknown(id, CATALOGUE.map(|effect| effect.id)))
    }

    /// Makes one for a robot. A named size is drawn within ±15 % on every axis.
    ///
    /// # Errors
    /// [`EffectError`] if this robot cannot have it, or the size makes no sense.
    pub fn hide_in(&self, robot: &Robot, size: Size, rng: &mut dyn Rng) -> Result<Hidden, EffectError> {
        if let Size::Exact(value) = size
            && !(value.is_finite() && value > 0.0)
        {
            return Err(EffectError::Size { effect: self.id, size: value.to_string() });
        }
        if let Size::Level(level) = size
            && !level.is_finite()
        {
            return Err(EffectError::Size { effect: self.id, size: format!("level {level}") });
        }
        (self.make)(robot, size, rng)
    }

    /// Its law for an estimator: alternatives that start elsewhere or have another shape, the usual one first.
    ///
    /// # Errors
    /// [`EffectError::Unsuited`] if this robot cannot have it, or no motion could show it.
    pub fn laws(&self, robot: &Robot) -> Result<Vec<Arc<dyn Law>>, EffectError> {
        (self.laws)(robot)
    }
}

impl Size {
    /// From `small`, `medium`, `large`, a level as `@-1.5`, or a number.
    ///
    /// # Errors
    /// [`EffectError::Size`] for anything else.
    pub fn parse(effect: &'static str, text: &str) -> Result<Self, EffectError> {
        match text {
            "small" => Ok(Self::Small),
            "medium" => Ok(Self::Medium),
            "large" => Ok(Self::Large),
            _ => match text.strip_prefix('@') {
                Some(level) => level.parse().map(Self::Level),
                None => text.parse().map(Self::Exact),
            }
            .map_err(|_| EffectError::Size { effect, size: text.to_owned() }),
        }
    }

    /// One value: that of the name, within ±15 %, or the exact one.
    fn draw(self, [small, medium, large]: [f64; 3], rng: &mut dyn Rng) -> f64 {
        let nominal = match self {
            Self::Small => small,
            Self::Medium => medium,
            Self::Large => large,
            Self::Level(level) => medium * (if level < 0.0 { medium / small } else { large / medium }).powf(level),
            Self::Exact(value) => return value,
        };
        nominal * rng.random_range(0.85..1.15)
    }
}
