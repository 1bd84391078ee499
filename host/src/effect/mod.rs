//! The catalogue of effects that a robot may have beyond the base model: one file each, one line in [`CATALOGUE`].
//!
//! A plant walks the line
//!
//! ```text
//! duty → supply voltage → motor torque → friction → transmission torque → link torques → accelerations → sensors
//! ```
//!
//! and asks every effect it has at the quantities that an effect may change ([`Physics`]); an effect that has nothing
//! to say leaves them as they are. A plant's effect is written to the physics, not to what an estimator can fit.

use rand::{Rng, RngExt};
use serde::Serialize;

use crate::robot::{Robot, Vector3};

pub(crate) mod backlash;
pub(crate) mod base_bearing;
mod error;
pub(crate) mod gyro_lag;
#[cfg(test)]
mod tests;
pub(crate) mod voltage_sag;

pub use error::EffectError;

/// Every effect there is.
pub const CATALOGUE: [&Effect; 4] = [&base_bearing::EFFECT, &backlash::EFFECT, &voltage_sag::EFFECT, &gyro_lag::EFFECT];

/// An entry of the catalogue.
#[derive(Debug)]
pub struct Effect {
    /// The id on the command line and in results.
    pub id: &'static str,
    /// What it is, in a few words.
    pub title: &'static str,
    /// The law.
    pub equation: &'static str,
    /// What it adds.
    pub parameters: &'static [EffectParameter],
    /// What else looks like it.
    pub confounded_with: &'static str,
    /// One paragraph for people.
    pub about: &'static str,
    /// Makes one for a robot.
    make: fn(&Robot, Size, &mut dyn Rng) -> Result<Hidden, EffectError>,
}

/// A parameter of an effect.
#[derive(Debug)]
pub struct EffectParameter {
    /// Name, as `k[x,y]` or `h[i]` (one a joint).
    pub name: &'static str,
    /// Unit.
    pub unit: &'static str,
    /// The sizes called small, medium and large, and the range met on real machines.
    pub sizes: &'static str,
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
    /// The first parameter of the effect has this value, in its unit, on every axis.
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

/// What an effect does to the quantities of the equations. Each method's default leaves them as they are.
pub trait Physics: Send + std::fmt::Debug {
    /// Passive joints through the origin of the base frame, before the robot's first.
    fn base_joints(&self) -> &[PassiveJoint] {
        &[]
    }

    /// Supply voltage, V; `supply_v` is what it is without this effect.
    fn supply_v(&self, _drive: &Drive<'_>, supply_v: f64) -> f64 {
        supply_v
    }

    /// Torque of joint `joint`'s transmission, N m, positive when it pulls the motor forwards; `torque` is what it is
    /// without this effect.
    fn transmission_torque(&self, _joint: usize, _belt: &Belt, torque: f64) -> f64 {
        torque
    }

    /// How many states of its own it has; they are zero while the robot rests.
    fn states(&self) -> usize {
        0
    }

    /// Rates of its own states. `gyro_rates`: angular rate at every gyro in sensor axes, rad/s.
    fn state_rates(&self, _own: &[f64], _gyro_rates: &[Vector3], _out: &mut [f64]) {}

    /// What gyro `gyro` sees, rad/s in sensor axes; `rate` is what it sees without this effect.
    fn gyro_rate(&self, _own: &[f64], _gyro: usize, rate: Vector3) -> Vector3 {
        rate
    }
}

/// A joint without motor: a spring and a damper.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PassiveJoint {
    /// Unit vector in base axes.
    pub axis: Vector3,
    /// Stiffness, N m/rad.
    pub stiffness: f64,
    /// Damping, N m s/rad.
    pub damping: f64,
}

/// Motors at one moment; one value a joint.
#[derive(Debug, Clone, Copy)]
pub struct Drive<'a> {
    /// Duty, −1 … 1.
    pub duty: &'a [f64],
    /// Motor speed θ̇ on the link side of the gear, rad/s.
    pub speed: &'a [f64],
    /// Torque per volt, N m/V.
    pub k_pwm: &'a [f64],
    /// Torque per speed, N m s/rad.
    pub k_mi: &'a [f64],
}

/// A transmission at one moment.
#[derive(Debug, Clone, Copy)]
pub struct Belt {
    /// q − θ, rad.
    pub wind: f64,
    /// q̇ − θ̇, rad/s.
    pub wind_rate: f64,
    /// Stiffness, N m/rad.
    pub k_s: f64,
    /// Damping, N m s/rad.
    pub d_s: f64,
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
        (self.make)(robot, size, rng)
    }
}

impl Size {
    /// From `small`, `medium`, `large` or a number.
    ///
    /// # Errors
    /// [`EffectError::Size`] for anything else.
    pub fn parse(effect: &'static str, text: &str) -> Result<Self, EffectError> {
        match text {
            "small" => Ok(Self::Small),
            "medium" => Ok(Self::Medium),
            "large" => Ok(Self::Large),
            _ => text.parse().map(Self::Exact).map_err(|_| EffectError::Size { effect, size: text.to_owned() }),
        }
    }

    /// One value: that of the name, within ±15 %, or the exact one.
    fn draw(self, [small, medium, large]: [f64; 3], rng: &mut dyn Rng) -> f64 {
        let nominal = match self {
            Self::Small => small,
            Self::Medium => medium,
            Self::Large => large,
            Self::Exact(value) => return value,
        };
        nominal * rng.random_range(0.85..1.15)
    }
}
