//! Laws that the catalogue does not contain.

use serde::{Deserialize, Serialize};

use super::effect::Size;

/// A law outside of the catalogue, with its numbers. Joints are 0-based.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Outsider {
    /// μ of one motor varies with the position of another joint: μ max(0.1, 1 + slope q).
    FrictionByPosition {
        /// Whose friction.
        joint: usize,
        /// Whose position.
        of: usize,
        /// 1/rad.
        slope: f64,
    },
    /// A share of one input reaches another motor, too.
    InputLeak {
        /// Whose input.
        from: usize,
        /// Which motor.
        to: usize,
        /// The share.
        share: f64,
    },
    /// μ of one motor grows with the speed of another: μ (1 + slope |θ̇|).
    FrictionBySpeed {
        /// Whose friction.
        joint: usize,
        /// Whose speed.
        of: usize,
        /// s/rad.
        slope: f64,
    },
    /// The larger the torque, the later it comes: a first-order lag of T₀ |τ| / τ_rms.
    LateByLoad {
        /// Which motor.
        joint: usize,
        /// T₀ / τ_rms, s/(N m).
        lag_per_torque: f64,
    },
    /// A part of the viscous friction follows the speed late.
    FrictionLag {
        /// Which motor.
        joint: usize,
        /// That part, N m s/rad.
        viscous: f64,
        /// By a first-order lag, s.
        lag_s: f64,
    },
    /// The motor's torque fades as its winding warms up: gain / (1 + h), ḣ = rate (τ/τ_rms)².
    HeatFade {
        /// Which motor.
        joint: usize,
        /// 1/(s (N m)²).
        rate: f64,
    },
    /// The stiffness of a transmission ripples with the link's angle: k_s (1 + share sin(waves q)).
    StiffnessRipple {
        /// Which joint.
        joint: usize,
        /// The share.
        share: f64,
        /// Waves a turn of the link.
        waves: f64,
    },
    /// A share of the torque of one transmission pulls at another link.
    BeltPull {
        /// Whose transmission.
        from: usize,
        /// Which link.
        to: usize,
        /// The share.
        share: f64,
    },
}

/// Which of the laws.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum OutsiderKind {
    /// [`Outsider::FrictionByPosition`].
    FrictionByPosition,
    /// [`Outsider::InputLeak`].
    InputLeak,
    /// [`Outsider::FrictionBySpeed`].
    FrictionBySpeed,
    /// [`Outsider::LateByLoad`].
    LateByLoad,
    /// [`Outsider::FrictionLag`].
    FrictionLag,
    /// [`Outsider::HeatFade`].
    HeatFade,
    /// [`Outsider::StiffnessRipple`].
    StiffnessRipple,
    /// [`Outsider::BeltPull`].
    BeltPull,
}

/// Statistics of a joint in the motion without effects. Sizes are relative to them.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Usage {
    /// RMS of the input, in its unit.
    pub input: f64,
    /// RMS of the motor torque, N m.
    pub torque: f64,
    /// Largest motor torque, N m.
    pub torque_peak: f64,
    /// RMS of the motor speed, rad/s.
    pub speed: f64,
    /// RMS of the position, rad.
    pub position: f64,
    /// Largest windup, rad.
    pub windup: f64,
    /// RMS of the transmitted torque, N m.
    pub transmitted: f64,
}

impl OutsiderKind {
    /// As on the command line and in the results.
    pub fn name(self) -> String {
        serde_json::to_value(self).ok().and_then(|value| value.as_str().map(str::to_owned)).unwrap_or_default()
    }

    /// The law in a size, on the last joint and the one before it (or the first).
    pub fn make(self, size: Size, usage: &[Usage]) -> Outsider {
        let last = usage.len() - 1;
        let joint = last.saturating_sub(1);
        let [of, from, to] = [last, 0, last];
        let share = |[weak, medium, large]: [f64; 3]| size.of([weak, medium, large]);
        match self {
            Self::FrictionByPosition => {
                Outsider::FrictionByPosition { joint, of, slope: share([0.4, 1.0, 2.0]) / usage[of].position }
            }
            Self::InputLeak => Outsider::InputLeak { from, to, share: share([0.02, 0.06, 0.15]) },
            Self::FrictionBySpeed => {
                Outsider::FrictionBySpeed { joint, of, slope: share([0.3, 1.0, 2.5]) / usage[of].speed }
            }
            Self::LateByLoad => {
                Outsider::LateByLoad { joint, lag_per_torque: share([0.6e-3, 2e-3, 5e-3]) / usage[joint].torque }
            }
            Self::FrictionLag => Outsider::FrictionLag {
                joint,
                viscous: share([0.05, 0.15, 0.4]) * usage[joint].torque / usage[joint].speed,
                lag_s: 0.04,
            },
            Self::HeatFade => {
                Outsider::HeatFade { joint, rate: share([2e-3, 6e-3, 15e-3]) / usage[joint].torque.powi(2) }
            }
            Self::StiffnessRipple => Outsider::StiffnessRipple {
                joint,
                share: share([0.05, 0.15, 0.35]),
                waves: 2.0 / usage[joint].position,
            },
            Self::BeltPull => Outsider::BeltPull { from, to, share: share([0.01, 0.03, 0.1]) },
        }
    }

    /// The joint (0-based) whose equation it stands in, by which an `unknown` is at the right place.
    pub fn joint(self, joints: usize) -> usize {
        match self {
            Self::InputLeak | Self::BeltPull => joints - 1,
            _ => (joints - 1).saturating_sub(1),
        }
    }
}
