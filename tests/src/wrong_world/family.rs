//! The four families of robots: descriptions, motions, effects, outsiders and classes of equivalent names.

use std::ops::Range;

use host::robot::Robot;
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

use super::motion::{Followed, Motion, Stages, Tuning};
use super::outsider::OutsiderKind;

/// A family.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Family {
    /// Three elastic joints, duties, motor encoders, two gyros.
    Doggy,
    /// One rigid joint with an encoder: a pendulum, or a carriage where the seed is odd.
    Rigid,
    /// One elastic joint with an encoder on either side, driven by a current.
    Elastic2,
    /// An arm with currents and motor encoders: four rigid joints, or three elastic ones where the seed is odd.
    Arm,
}

/// The effects that are hidden in Doggy.
const OF_DOGGY: [&str; 29] = [
    "base_bearing",
    "viscous_friction",
    "stribeck",
    "asymmetric_friction",
    "link_friction",
    "load_friction",
    "position_friction",
    "friction_drift",
    "cogging",
    "torque_offset",
    "backlash",
    "belt_hardening",
    "belt_slack_side",
    "belt_hysteresis",
    "gravity_residual",
    "cable_spring",
    "coriolis",
    "link_inertia",
    "motor_mismatch",
    "voltage_sag",
    "pwm_dead_zone",
    "electrical_lag",
    "input_delay",
    "gyro_lag",
    "gyro_scale",
    "gyro_bias_drift",
    "gyro_clipping",
    "encoder_eccentricity",
    "encoder_lag",
];
/// Beyond them, in Doggy alone.
const DOGGY_TOO: [&str; 1] = ["quadratic_drag"];

/// Effects of a rigid joint that slides.
const OF_CARRIAGE: [&str; 9] = [
    "stribeck",
    "asymmetric_friction",
    "friction_drift",
    "cogging",
    "torque_offset",
    "quadratic_drag",
    "electrical_lag",
    "input_delay",
    "encoder_lag",
];
/// Beyond them, of one that turns.
const OF_PENDULUM: [&str; 2] = ["position_friction", "encoder_eccentricity"];
/// Beyond those of a pendulum, of an elastic joint.
const OF_ELASTIC: [&str; 7] = [
    "link_friction",
    "load_friction",
    "backlash",
    "belt_hardening",
    "belt_slack_side",
    "belt_hysteresis",
    "cable_spring",
];

/// Effects that are never traces: one has no size, the other is an error of the file already.
const NEVER_A_TRACE: [&str; 2] = ["coriolis", "link_inertia"];

impl Family {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Doggy, Self::Rigid, Self::Elastic2, Self::Arm];

    /// As on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Doggy => "doggy",
            Self::Rigid => "rigid",
            Self::Elastic2 => "elastic2",
            Self::Arm => "arm",
        }
    }

    /// By its name.
    pub fn parse(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|family| family.name() == name)
    }

    /// The description of a seed's robot.
    ///
    /// # Panics
    /// If a description of this folder is not valid.
    pub fn robot(self, seed: u64) -> Robot {
        let is_odd = !seed.is_multiple_of(2);
        let parsed = match self {
            Self::Doggy => Robot::builtin("doggy"),
            Self::Rigid if is_odd => Robot::parse(include_str!("robots/carriage.toml")),
            Self::Rigid => Robot::parse(include_str!("robots/pendulum.toml")),
            Self::Elastic2 => Robot::parse(include_str!("robots/gear.toml")),
            Self::Arm if is_odd => Robot::parse(include_str!("robots/arm_elastic.toml")),
            Self::Arm => Robot::parse(include_str!("robots/arm_rigid.toml")),
        };
        parsed.expect("the descriptions of this folder are valid")
    }

    /// A motion for its robot.
    pub fn motion(self, robot: &Robot, rng: &mut ChaCha8Rng) -> Motion {
        let axis = |inertia, bandwidth, limit, amplitude, hertz| Tuning { inertia, bandwidth, limit, amplitude, hertz };
        let tunings = match robot.name.as_str() {
            "pendulum" => vec![axis(0.16, 30.0, 8.0, 1.2, 2.5)],
            "carriage" => vec![axis(80.0, 30.0, 600.0, 0.15, 1.5)],
            "gear" => vec![axis(0.16, 18.0, 12.0, 1.0, 3.0)],
            "arm4" => vec![
                axis(0.33, 20.0, 15.0, 0.8, 1.5),
                axis(0.32, 20.0, 15.0, 0.5, 1.5),
                axis(0.14, 22.0, 10.0, 0.7, 2.0),
                axis(0.05, 25.0, 5.0, 0.9, 2.5),
            ],
            "arm3" => {
                vec![
                    axis(0.21, 12.0, 25.0, 0.35, 5.0),
                    axis(0.2, 12.0, 25.0, 0.3, 5.0),
                    axis(0.08, 14.0, 15.0, 0.35, 6.0),
                ]
            }
            _ => return Motion::Stages(Stages::draw(robot, rng)),
        };
        Motion::Followed(Followed::draw(robot, DURATION_S, &tunings, rng))
    }

    /// Ids of the effects that can be hidden in a seed's robot.
    pub fn effects(self, seed: u64) -> Vec<&'static str> {
        let is_odd = !seed.is_multiple_of(2);
        let of_turning = || [&OF_CARRIAGE[..], &OF_PENDULUM[..]].concat();
        match self {
            Self::Doggy => [&OF_DOGGY[..], &DOGGY_TOO[..]].concat(),
            Self::Rigid if is_odd => OF_CARRIAGE.to_vec(),
            Self::Rigid => of_turning(),
            Self::Elastic2 => [&of_turning()[..], &OF_ELASTIC, &["link_inertia"]].concat(),
            Self::Arm if is_odd => [&of_turning()[..], &OF_ELASTIC, &["gravity_residual", "link_inertia"]].concat(),
            Self::Arm => [&of_turning()[..], &["gravity_residual", "link_inertia"]].concat(),
        }
    }

    /// Whether an effect may be in the background, at trace size.
    pub fn may_be_trace(id: &str) -> bool {
        !NEVER_A_TRACE.contains(&id)
    }

    /// Outsiders of a seed's robot.
    pub fn outsiders(self, seed: u64) -> Vec<OutsiderKind> {
        use OutsiderKind::{
            BeltPull, FrictionByPosition, FrictionBySpeed, FrictionLag, HeatFade, InputLeak, LateByLoad,
            StiffnessRipple,
        };
        match self {
            Self::Doggy => vec![FrictionByPosition, InputLeak, FrictionBySpeed, BeltPull, LateByLoad],
            Self::Rigid => vec![LateByLoad, FrictionLag, HeatFade],
            Self::Elastic2 => vec![StiffnessRipple, FrictionLag, LateByLoad, HeatFade],
            Self::Arm if seed.is_multiple_of(2) => vec![FrictionByPosition, InputLeak, FrictionBySpeed, LateByLoad],
            Self::Arm => vec![FrictionByPosition, InputLeak, FrictionBySpeed, StiffnessRipple],
        }
    }

    /// Classes of names that are equivalent on these robots:
    ///
    /// * One encoder a joint and no back-EMF: encoder lag, input delay and electrical lag are the same lag between input and reading.
    /// * Two encoders a joint and no back-EMF: input delay and electrical lag are the same lag of the torque.
    /// * Balanced joints: a gravity residual and a cable spring differ in the cubic term of the sine only.
    pub fn classes(self) -> &'static [&'static [&'static str]] {
        match self {
            Self::Doggy => &[&["gravity_residual", "cable_spring"]],
            Self::Rigid => &[&["input_delay", "electrical_lag", "encoder_lag"]],
            Self::Arm => &[&["input_delay", "electrical_lag", "encoder_lag"], &["gravity_residual", "cable_spring"]],
            Self::Elastic2 => &[&["input_delay", "electrical_lag"]],
        }
    }

    /// Errors that every file of the family has. Findings of these names are not false, and they are passed over in the count of first findings.
    pub fn faults_of_the_file(self) -> &'static [&'static str] {
        match self {
            // b takes up the body's inertia, and the first moment is estimated.
            Self::Rigid => &[],
            Self::Doggy | Self::Elastic2 | Self::Arm => &["link_inertia"],
        }
    }

    /// Half gaps of worn transmissions, rad.
    pub fn gaps(self) -> [f64; 3] {
        match self {
            Self::Doggy => [2e-3, 8e-3, 20e-3],
            _ => [0.5e-3, 1.5e-3, 4e-3],
        }
    }

    /// RMS of the input noise as a share of the input's RMS. A commanded duty has none.
    pub fn input_noise(self) -> Option<Range<f64>> {
        match self {
            Self::Doggy => None,
            Self::Rigid => Some(2e-3..2e-2),
            Self::Elastic2 | Self::Arm => Some(1e-3..5e-3),
        }
    }

    /// The number of the family among the streams of randomness.
    pub fn stream(self) -> u64 {
        self as u64
    }
}

/// Length of the motions that follow a reference, s.
const DURATION_S: f64 = 20.0;
