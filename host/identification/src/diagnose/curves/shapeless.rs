//! Laws without a shape: any curve of one argument on one torque, smooth ([`spline`]) or rippled ([`Waves`]).

use super::spline::{self, Knots};
use super::waves::Waves;
use crate::model::law::{At, Hook, Law, Of, Parameters};
use crate::model::{Number, Quantity};
use robot_model::acts_on_joints;

/// What a curve is a function of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Argument {
    /// θ̇.
    MotorSpeed,
    /// θ.
    MotorAngle,
    /// n_G θ, the angle of the motor's own shaft.
    MotorPhase,
    /// q̇.
    LinkSpeed,
    /// q.
    LinkAngle,
    /// q − θ.
    Windup,
    /// q̇ − θ̇.
    WindupRate,
    /// k_pwm U u, the torque at standstill.
    DrivingTorque,
    /// Time since the start.
    Time,
    /// What a gyro's axis reads itself.
    Rate,
}

impl Argument {
    /// As in results.
    pub fn name(self) -> &'static str {
        match self {
            Argument::MotorSpeed => "motor_speed",
            Argument::MotorAngle => "motor_angle",
            Argument::MotorPhase => "motor_phase",
            Argument::LinkSpeed => "link_speed",
            Argument::LinkAngle => "link_angle",
            Argument::Windup => "windup",
            Argument::WindupRate => "windup_rate",
            Argument::DrivingTorque => "driving_torque",
            Argument::Time => "time",
            Argument::Rate => "rate",
        }
    }

    /// Its unit for a revolute joint.
    pub fn unit(self) -> &'static str {
        match self {
            Argument::MotorSpeed | Argument::LinkSpeed | Argument::WindupRate | Argument::Rate => "rad/s",
            Argument::MotorAngle | Argument::MotorPhase | Argument::LinkAngle | Argument::Windup => "rad",
            Argument::DrivingTorque => "N m",
            Argument::Time => "s",
        }
    }

    /// Whether zero is a place of its own for it.
    pub fn bends(self) -> bool {
        !matches!(self, Argument::MotorAngle | Argument::MotorPhase | Argument::LinkAngle | Argument::Time)
    }

    fn of<T: Quantity>(self, at: &At<'_, T>, gear: f64) -> T {
        match self {
            Argument::MotorSpeed => at.thetad,
            Argument::MotorAngle => at.theta,
            Argument::MotorPhase => at.theta * gear,
            Argument::LinkSpeed => at.qd,
            Argument::LinkAngle => at.q,
            Argument::Windup => at.wind(),
            Argument::WindupRate => at.wind_rate(),
            Argument::DrivingTorque => at.driving,
            Argument::Time => at.time_s,
            // Joints read no gyro.
            Argument::Rate => T::from(0.0),
        }
    }
}

/// How a curve is made up, linearly in its coefficients.
#[derive(Debug, Clone, PartialEq)]
pub enum Shape {
    /// Smooth over a range.
    Spline(Knots),
    /// Waves of a turn.
    Ripple(Waves),
}

/// The curve of one joint.
#[derive(Debug, Clone, PartialEq)]
pub struct Curve {
    /// What it is a function of.
    pub argument: Argument,
    /// Turns of the joint's motor for one of the link.
    pub gear: f64,
    /// How.
    pub shape: Shape,
}

impl Curve {
    /// How many coefficients it has.
    pub fn coefficients(&self) -> usize {
        match &self.shape {
            Shape::Spline(_) => spline::COEFFICIENTS,
            Shape::Ripple(waves) => waves.coefficients(),
        }
    }

    /// The part of the argument's range that it covers.
    pub fn range(&self) -> [f64; 2] {
        match &self.shape {
            Shape::Spline(knots) => knots.range(),
            Shape::Ripple(waves) => waves.range(),
        }
    }

    /// The curve at x.
    pub fn value(&self, coefficients: &[f64], x: f64) -> f64 {
        let mut sum = 0.0;
        self.each(x, |i, value, _| sum += coefficients[i] * value);
        sum
    }

    /// The functions that its coefficients multiply, as (index, value, slope), but for those that are zero at x.
    #[inline(always)]
    pub(super) fn each(&self, x: f64, mut f: impl FnMut(usize, f64, f64)) {
        match &self.shape {
            Shape::Spline(knots) => {
                for (i, value, slope) in knots.basis(x) {
                    f(i, value, slope);
                }
            }
            Shape::Ripple(waves) => waves.each(x, f),
        }
    }
}

/// A curve of the same argument for each of some joints, added to one quantity.
#[derive(Debug, Clone)]
pub struct Shapeless {
    parameters: Parameters,
    hooks: &'static [Hook],
    /// Of each joint that has one.
    curves: Vec<Option<Curve>>,
}

/// The id under which coefficients stand among results.
pub const ID: &str = "shapeless";

impl Shapeless {
    /// Curves on the quantity of `hook`, one for each joint that has one.
    pub fn new(hook: Hook, curves: Vec<Option<Curve>>) -> Self {
        let mut parameters = Parameters::new(ID);
        for (joint, curve) in curves.iter().enumerate() {
            for i in 0..curve.as_ref().map_or(0, Curve::coefficients) {
                parameters.plain(&format!("c{i}"), "N m", Of::Joint(joint), 0.0);
            }
        }
        let hooks: &'static [Hook] = match hook {
            Hook::MotorTorque => &[Hook::MotorTorque],
            Hook::Transmission => &[Hook::Transmission],
            Hook::LinkLoad => &[Hook::LinkLoad],
            _ => &[Hook::Friction],
        };
        Shapeless { parameters, hooks, curves }
    }

    #[inline(always)]
    fn act<T: Number>(&self, _hook: Hook, at: &At<'_, T>, torque: T) -> T {
        let Some(curve) = &self.curves[at.joint] else { return torque };
        let x = curve.argument.of(at, curve.gear);
        let mut sum = torque;
        curve.each(x.re(), |i, value, slope| sum += at.parameters[i] * x.through(value, slope));
        sum
    }
}

impl Law for Shapeless {
    fn parameters(&self) -> &Parameters {
        &self.parameters
    }

    fn hooks(&self) -> &'static [Hook] {
        self.hooks
    }

    fn local(&self, joint: usize) -> Vec<usize> {
        if self.curves[joint].is_none() {
            return Vec::new();
        }
        self.parameters.of(|of| of == Of::Joint(joint))
    }

    acts_on_joints!(numbers);
}
