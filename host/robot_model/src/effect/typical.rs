//! Parameters of effects: their roles and typical sizes.
//!
//! A typical size is log-normal: |value| / scale has a median, and one standard deviation is so many decades. The scale is a
//! quantity of the robot and its motion ([`Scale`], [`RobotScales`]), so that one median holds for robots of any size.
//!
//! How the numbers were chosen:
//! * The median is the middle of the range met on real machines, on the logarithmic scale, in shares of the scale on Doggy.
//! * Both ends of the range met lie one to one and a half standard deviations away from the median.
//! * The decades are more where the scale says little about a parameter (a mass that a robot carries), and less where physics
//!   sets a limit (a share of friction that cannot exceed 1).
//!
//! Doggy's scales on a calibration motion: torque RMS 40 N m, speed RMS 0.75 rad/s, friction 2 N m, stiffness 400 N m/rad,
//! supply 32 V, outermost body 1.15 kg, gyro sigma 1.7 mrad/s, sample period 1 ms.

use serde::Serialize;

use super::{Effect, base_bearing, structure_mode};
use crate::model::law::Of;
use crate::robot::{InputUnit, JointKind, Robot, Symbol};

/// What a parameter says about its effect.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Role {
    /// How much of the effect there is; 0 is none of it.
    Size,
    /// The same by a number that is smaller where the effect is stronger: a ceiling, a range, a stiffness, the place of a stop.
    InverseSize,
    /// How the effect goes: a time constant, a speed, a phase.
    Shape,
    /// A number that a law needs and that says nothing about the robot: a rounding, the bending of a bristle.
    Nuisance,
    /// A number that is another one in each recording: a phase to an encoder's zero, the time of an event, a drift.
    PerRecording,
}

impl Role {
    /// Whether it says how much of the effect there is.
    pub const fn is_size(self) -> bool {
        matches!(self, Role::Size | Role::InverseSize)
    }
}

/// What a median is a share of.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Scale {
    /// One of the parameter's unit.
    Si,
    /// 1 rad, or 1 rad/s; at a joint that slides, half of its travel instead of a radian.
    Radian,
    /// RMS of the motor's torque, N m.
    TorqueRms,
    /// 1 / (torque RMS), 1/(N m).
    PerTorqueRms,
    /// Torque RMS a radian, N m/rad.
    TorqueRmsPerRadian,
    /// Torque RMS / speed RMS, N m s/rad.
    TorqueRmsPerSpeed,
    /// Torque RMS / (speed RMS)², N m s²/rad².
    TorqueRmsPerSpeedSquared,
    /// Coulomb friction μ, but at least 2 % of the torque RMS, N m.
    Friction,
    /// Stiffness k_s of the transmission, N m/rad.
    Stiffness,
    /// k_s / w² of the windup w = torque RMS / k_s, N m/rad³.
    StiffnessPerWindupSquared,
    /// Supply voltage / the largest torque RMS of all motors, V/(N m).
    SupplyPerTorqueRms,
    /// Mass of the outermost body, but at least a tenth of all moving bodies, kg.
    BodyMass,
    /// Inertia of the whole robot about x or y of its base, kg m²; a median of k is (2π f)², one of d is 2 ζ 2π f.
    BaseInertia,
    /// The same of the outer half of the outermost body.
    OuterInertia,
    /// Standard deviation of one reading of a gyro, rad/s.
    GyroSigma,
    /// Sample period, s.
    SamplePeriod,
}

impl Scale {
    /// In words; empty for the unit itself.
    pub const fn words(self) -> &'static str {
        match self {
            Scale::Si | Scale::Radian => "",
            Scale::TorqueRms => "torque RMS",
            Scale::PerTorqueRms => "1/(torque RMS)",
            Scale::TorqueRmsPerRadian => "torque RMS / rad",
            Scale::TorqueRmsPerSpeed => "torque RMS / speed RMS",
            Scale::TorqueRmsPerSpeedSquared => "torque RMS / (speed RMS)²",
            Scale::Friction => "friction μ",
            Scale::Stiffness => "stiffness k_s",
            Scale::StiffnessPerWindupSquared => "k_s / (torque RMS / k_s)²",
            Scale::SupplyPerTorqueRms => "supply voltage / largest torque RMS",
            Scale::BodyMass => "mass of the outermost body",
            Scale::BaseInertia => "inertia about the base",
            Scale::OuterInertia => "inertia of the outer half",
            Scale::GyroSigma => "gyro sigma",
            Scale::SamplePeriod => "sample period",
        }
    }
}

/// A log-normal distribution of |value| / scale.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Typical {
    /// Median, as a share of the scale.
    pub median: f64,
    /// One standard deviation, decades.
    pub decades: f64,
    /// The scale.
    pub of: Scale,
}

impl Typical {
    /// How far a value is from the median to either side, in standard deviations: |log₁₀(|value| / (median · scale))| / decades.
    ///
    /// 0 for a value of 0, which is no effect at all. Infinite where the value is not finite, or the scale not finite and positive.
    pub fn decades_off(&self, value: f64, scale: f64) -> f64 {
        if value == 0.0 {
            return 0.0;
        }
        let off = (value.abs() / (self.median * scale)).log10().abs() / self.decades;
        if off.is_nan() { f64::INFINITY } else { off }
    }
}

/// A parameter of an effect.
#[derive(Debug, Serialize)]
pub struct EffectParameter {
    /// Name, as `k[x,y]`, `h[i]` (one a joint), `T[gyro]` or `a[gyro.axis]`.
    pub name: &'static str,
    /// Unit.
    pub unit: &'static str,
    /// The sizes called small, medium and large on Doggy, and the range met on real machines.
    pub sizes: &'static str,
    /// What it says about the effect.
    pub role: Role,
    /// The key of the robot file whose number it stands in place of, and starts from; empty where there is none.
    pub in_place_of: &'static str,
    /// Its typical size; none where any value is as likely as another, as for phases and whole numbers.
    pub typical: Option<Typical>,
}

impl EffectParameter {
    const fn new(role: Role, name: &'static str, unit: &'static str) -> Self {
        EffectParameter { name, unit, sizes: "", role, in_place_of: "", typical: None }
    }

    /// How much of the effect there is.
    pub(super) const fn size(name: &'static str, unit: &'static str) -> Self {
        Self::new(Role::Size, name, unit)
    }

    /// The same by a number that is smaller where the effect is stronger.
    pub(super) const fn inverse_size(name: &'static str, unit: &'static str) -> Self {
        Self::new(Role::InverseSize, name, unit)
    }

    /// How the effect goes.
    pub(super) const fn shape(name: &'static str, unit: &'static str) -> Self {
        Self::new(Role::Shape, name, unit)
    }

    /// What a law needs and what says nothing about the robot.
    pub(super) const fn nuisance(name: &'static str, unit: &'static str) -> Self {
        Self::new(Role::Nuisance, name, unit)
    }

    /// Another one in each recording.
    pub(super) const fn own_to_recording(name: &'static str, unit: &'static str) -> Self {
        Self::new(Role::PerRecording, name, unit)
    }

    /// With its sizes in words.
    pub(super) const fn sizes(mut self, sizes: &'static str) -> Self {
        self.sizes = sizes;
        self
    }

    /// In place of a number of the robot file, which it starts from.
    pub(super) const fn in_place_of(mut self, key: &'static str) -> Self {
        self.in_place_of = key;
        self
    }

    /// With this typical size.
    pub(super) const fn typically(mut self, median: f64, decades: f64, of: Scale) -> Self {
        self.typical = Some(Typical { median, decades, of });
        self
    }

    /// The name without its index, as `k`, `h`, `T`, `a`.
    pub fn symbol(&self) -> &'static str {
        self.name.split_once('[').map_or(self.name, |(symbol, _)| symbol)
    }

    /// What `index` of a result's name means, as `2`, `x` or `1.z`; none if this parameter has no such index.
    fn place(&self, index: &str) -> Option<Of> {
        let ordinal = |text: &str| text.parse::<usize>().ok()?.checked_sub(1);
        let axis = |text: &str| ["x", "y", "z"].iter().position(|axis| *axis == text);
        match &self.name[self.symbol().len()..] {
            "" => index.is_empty().then_some(Of::All),
            "[i]" => ordinal(index).map(Of::Joint),
            "[gyro]" => ordinal(index).map(Of::Gyro),
            "[gyro.axis]" => {
                let (gyro, along) = index.split_once('.')?;
                Some(Of::GyroAxis(ordinal(gyro)?, axis(along)?))
            }
            "[x,y]" => axis(index).map(Of::Axis),
            _ => None,
        }
    }
}

/// The scales of a joint.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct JointScales {
    /// RMS of the motor's torque over the motion, on the link side of the gear, N m or N.
    pub torque_rms: f64,
    /// RMS of the motor's speed over the motion, on the link side of the gear, rad/s or m/s.
    pub speed_rms: f64,
    /// Coulomb friction, as described or estimated, N m or N; 0 if there is none.
    pub friction: f64,
    /// Stiffness of the transmission, N m/rad or N/m; 0 where it is rigid.
    pub stiffness: f64,
    /// What stands for a radian: 1 where the joint turns, half of the travel in m where it slides.
    pub radian: f64,
}

/// The scales of one robot on one motion, from which typical sizes follow.
///
/// A scale that is not known is 0 or none: nothing is implausible by it.
#[derive(Debug, Clone, PartialEq)]
pub struct RobotScales {
    /// Of every joint.
    pub joints: Vec<JointScales>,
    /// Supply voltage, V; 0 where no duty drives the motors.
    pub supply_v: f64,
    /// Mass of the outermost body, kg.
    pub outermost_kg: f64,
    /// Mass of all moving bodies, kg.
    pub moving_kg: f64,
    /// Inertia of the whole robot about x and y of its base in the marked pose, kg m².
    pub base_inertia_kg_m2: Option<[f64; 2]>,
    /// Inertia of the outer half of the outermost body about x and y of the base, through the last joint, kg m².
    pub outer_inertia_kg_m2: Option<[f64; 2]>,
    /// Standard deviation of one reading of every gyro, rad/s.
    pub gyro_sigma_rad_s: Vec<f64>,
    /// Sample period, s.
    pub sample_period_s: f64,
}

/// Friction is taken for at least this share of the torque RMS.
const LEAST_FRICTION: f64 = 0.02;
/// The outermost body is taken for at least this share of all moving mass: a tool flange carries more than its own mass.
const LEAST_OUTERMOST: f64 = 0.1;

impl RobotScales {
    /// Those of a robot whose motors have these RMS of torque and speed, one a joint, on the link side of the gear (N m and rad/s, or N and m/s).
    /// Friction and stiffness are the start values of the description.
    pub fn of(robot: &Robot, torque_rms: &[f64], speed_rms: &[f64]) -> Self {
        let start = |symbol, joint| robot.joint_parameter(symbol, joint).map_or(0.0, |spec| spec.value.start);
        let joint = |(index, joint): (usize, &crate::robot::Joint)| JointScales {
            torque_rms: torque_rms.get(index).copied().unwrap_or(0.0),
            speed_rms: speed_rms.get(index).copied().unwrap_or(0.0),
            friction: start(Symbol::Mu, index),
            stiffness: start(Symbol::KS, index),
            radian: match joint.kind {
                JointKind::Revolute => 1.0,
                JointKind::Prismatic => 0.5 * (joint.limits[1] - joint.limits[0]),
            },
        };
        RobotScales {
            joints: robot.joints.iter().enumerate().map(joint).collect(),
            supply_v: if robot.input.unit == InputUnit::Duty { robot.input.scale } else { 0.0 },
            outermost_kg: robot.joints.last().map_or(0.0, |joint| joint.body.mass_kg),
            moving_kg: robot.joints.iter().map(|joint| joint.body.mass_kg).sum(),
            base_inertia_kg_m2: base_bearing::inertia(robot).ok(),
            outer_inertia_kg_m2: structure_mode::outer_part(robot).ok().map(|(.., inertia)| inertia),
            gyro_sigma_rad_s: robot.gyros().map(|gyro| gyro.sigma_rad_s).collect(),
            sample_period_s: robot.sample_period_s,
        }
    }

    /// A scale in SI units for what belongs to `place`. For what belongs to everything it is the largest of all joints, gyros or axes.
    /// None where the robot has no such scale.
    pub fn scale(&self, scale: Scale, place: Of) -> Option<f64> {
        let of_joint = |joint: &JointScales| match scale {
            Scale::Radian => joint.radian,
            Scale::TorqueRms => joint.torque_rms,
            Scale::PerTorqueRms => joint.torque_rms.recip(),
            Scale::TorqueRmsPerRadian => joint.torque_rms / joint.radian,
            Scale::TorqueRmsPerSpeed => joint.torque_rms / joint.speed_rms,
            Scale::TorqueRmsPerSpeedSquared => joint.torque_rms / joint.speed_rms.powi(2),
            Scale::Friction => joint.friction.max(LEAST_FRICTION * joint.torque_rms),
            Scale::Stiffness => joint.stiffness,
            Scale::StiffnessPerWindupSquared => joint.stiffness.powi(3) / joint.torque_rms.powi(2),
            _ => f64::NAN,
        };
        let largest = |values: &[f64]| values.iter().copied().filter(|value| value.is_finite()).reduce(f64::max);
        let one_or_largest = |values: &[f64]| match place {
            Of::All => largest(values),
            Of::Joint(i) | Of::Gyro(i) | Of::GyroAxis(i, _) | Of::Axis(i) => values.get(i).copied(),
        };
        let found = match scale {
            Scale::Si => Some(1.0),
            Scale::SamplePeriod => Some(self.sample_period_s),
            Scale::BodyMass => Some(self.outermost_kg.max(LEAST_OUTERMOST * self.moving_kg)),
            Scale::SupplyPerTorqueRms => {
                largest(&self.joints.iter().map(|joint| joint.torque_rms).collect::<Vec<f64>>())
                    .map(|rms| self.supply_v / rms)
            }
            Scale::GyroSigma => one_or_largest(&self.gyro_sigma_rad_s),
            Scale::BaseInertia => self.base_inertia_kg_m2.and_then(|inertia| one_or_largest(&inertia)),
            Scale::OuterInertia => self.outer_inertia_kg_m2.and_then(|inertia| one_or_largest(&inertia)),
            _ => one_or_largest(&self.joints.iter().map(of_joint).collect::<Vec<f64>>()),
        };
        found.filter(|scale| scale.is_finite() && *scale > 0.0)
    }
}

impl Effect {
    /// The parameter of which a result tells, as `link_inertia.m` or `cogging.A[2]`; nuisances as well.
    pub fn parameter(&self, result_name: &str) -> Option<&EffectParameter> {
        self.placed(result_name).map(|(parameter, _)| parameter)
    }

    /// The robot file's own key and number that a result stands in place of; none where it stands for nothing there.
    pub fn in_robot_file(&self, robot: &Robot, result_name: &str) -> Option<(&'static str, f64)> {
        let key = self.parameter(result_name).map(|parameter| parameter.in_place_of).filter(|key| !key.is_empty())?;
        let law = self.laws(robot).ok()?.into_iter().next()?;
        let start: Vec<f64> = law.parameters().coordinates.iter().map(|coordinate| coordinate.start).collect();
        let result = law.parameters().results.iter().find(|result| result.name == result_name)?;
        Some((key, result.form.value(&start).0))
    }

    /// The scale of a result, in SI units; none for results that have no typical size, or where the robot has no such scale.
    pub fn scale(&self, result_name: &str, scales: &RobotScales) -> Option<f64> {
        let (parameter, place) = self.placed(result_name)?;
        scales.scale(parameter.typical?.of, place)
    }

    /// How far a value lies beyond its typical size, in standard deviations on the logarithmic scale.
    ///
    /// * A [`Role::Size`] counts above its median only: a small size is a small effect.
    /// * A [`Role::InverseSize`] counts below its median only, and is infinite at 0.
    /// * A [`Role::Shape`] counts to both sides.
    /// * Nuisances, what is own to each recording, what has no typical size and names that the effect does not have are never
    ///   implausible: 0.
    ///
    /// A value that is not finite is infinitely implausible where it counts at all.
    pub fn implausibility(&self, result_name: &str, value: f64, scales: &RobotScales) -> f64 {
        let Some((parameter, place)) = self.placed(result_name) else { return 0.0 };
        let Some(typical) = parameter.typical else { return 0.0 };
        let Some(scale) = scales.scale(typical.of, place) else { return 0.0 };
        let is_above = value.abs() > typical.median * scale;
        let counts = match parameter.role {
            Role::Size => is_above,
            Role::InverseSize if value == 0.0 => return f64::INFINITY,
            Role::InverseSize => !is_above,
            Role::Shape => true,
            Role::Nuisance | Role::PerRecording => return 0.0,
        };
        if counts || !value.is_finite() { typical.decades_off(value, scale) } else { 0.0 }
    }

    /// The parameter of a result, and what the result belongs to.
    fn placed(&self, result_name: &str) -> Option<(&EffectParameter, Of)> {
        let name = result_name.strip_prefix(self.id)?.strip_prefix('.')?;
        let (symbol, index) = match name.split_once('[') {
            Some((symbol, index)) => (symbol, index.strip_suffix(']').filter(|index| !index.is_empty())?),
            None => (name, ""),
        };
        let parameter = self.parameters.iter().chain(self.nuisances).find(|parameter| parameter.symbol() == symbol)?;
        Some((parameter, parameter.place(index)?))
    }
}
