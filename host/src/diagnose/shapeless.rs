//! Laws without a shape: any smooth curve of one argument on one equation. What a named law must hold its own against.
//!
//! ```text
//! τ(x) = Σ c_i B(w(x)/h − i)      B: cubic B-spline,  w(x) = arsinh(x / x₀) x₀: knots are close to each other where x is small
//! ```
//! A curve that explains much more than any name does is a cause without a name.

use crate::acts_on_joints;
use crate::model::Quantity;
use crate::model::law::{At, Hook, Law, Of, Parameters};

/// Coefficients of a curve.
pub const COEFFICIENTS: usize = 8;

/// x₀ as a share of the largest |x|; arguments that have no place of their own at zero are not bent.
const BEND: f64 = 0.1;

/// What a curve is a function of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Argument {
    /// θ̇.
    MotorSpeed,
    /// θ.
    MotorAngle,
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
}

impl Argument {
    /// As in results.
    pub fn name(self) -> &'static str {
        match self {
            Argument::MotorSpeed => "motor_speed",
            Argument::MotorAngle => "motor_angle",
            Argument::LinkSpeed => "link_speed",
            Argument::LinkAngle => "link_angle",
            Argument::Windup => "windup",
            Argument::WindupRate => "windup_rate",
            Argument::DrivingTorque => "driving_torque",
            Argument::Time => "time",
        }
    }

    /// Its unit for a revolute joint.
    pub fn unit(self) -> &'static str {
        match self {
            Argument::MotorSpeed | Argument::LinkSpeed | Argument::WindupRate => "rad/s",
            Argument::MotorAngle | Argument::LinkAngle | Argument::Windup => "rad",
            Argument::DrivingTorque => "N m",
            Argument::Time => "s",
        }
    }

    fn bends(self) -> bool {
        !matches!(self, Argument::MotorAngle | Argument::LinkAngle | Argument::Time)
    }

    fn of<T: Quantity>(self, at: &At<'_, T>) -> T {
        match self {
            Argument::MotorSpeed => at.thetad,
            Argument::MotorAngle => at.theta,
            Argument::LinkSpeed => at.qd,
            Argument::LinkAngle => at.q,
            Argument::Windup => at.wind(),
            Argument::WindupRate => at.wind_rate(),
            Argument::DrivingTorque => at.driving,
            Argument::Time => T::from(at.time_s),
        }
    }
}

/// The knots of one curve.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Knots {
    argument: Argument,
    range: [f64; 2],
    /// x₀; no bend where it is infinite.
    bend: f64,
    first: f64,
    spacing: f64,
}

impl Knots {
    /// Knots for x in `range`.
    pub fn over(argument: Argument, range: [f64; 2]) -> Self {
        let largest = range[0].abs().max(range[1].abs()).max(1e-12);
        let bend = if argument.bends() { BEND * largest } else { f64::INFINITY };
        let mut knots = Knots { argument, range, bend, first: 0.0, spacing: 1.0 };
        let (low, high) = (knots.bent(range[0]).0, knots.bent(range[1]).0);
        // So many coefficients leave three fewer intervals.
        knots.spacing = ((high - low) / (COEFFICIENTS - 3) as f64).max(1e-12);
        knots.first = low;
        knots
    }

    /// What the knots cover.
    pub fn range(&self) -> [f64; 2] {
        self.range
    }

    /// w(x) and its slope.
    fn bent(&self, x: f64) -> (f64, f64) {
        if self.bend.is_infinite() {
            return (x, 1.0);
        }
        let share = x / self.bend;
        (self.bend * share.asinh(), 1.0 / (1.0 + share * share).sqrt())
    }

    /// The curve at x.
    pub fn value(&self, coefficients: &[f64], x: f64) -> f64 {
        self.basis(x).into_iter().map(|(i, value, _)| coefficients[i] * value).sum()
    }

    /// The four splines that are not zero at x, as (index, value, slope). Beyond the ends a curve goes on as at the end.
    fn basis(&self, x: f64) -> [(usize, f64, f64); 4] {
        let (w, slope) = self.bent(x);
        let last = (COEFFICIENTS - 3) as f64;
        let place = (w - self.first) / self.spacing;
        let inside = place.clamp(0.0, last);
        let slope = if place == inside { slope / self.spacing } else { 0.0 };
        let interval = (inside.floor() as usize).min(COEFFICIENTS - 4);
        let t = inside - interval as f64;
        let (t2, t3, s) = (t * t, t * t * t, 1.0 - t);
        let values = [s * s * s, 3.0 * t3 - 6.0 * t2 + 4.0, -3.0 * t3 + 3.0 * t2 + 3.0 * t + 1.0, t3];
        let slopes = [-3.0 * s * s, 9.0 * t2 - 12.0 * t, -9.0 * t2 + 6.0 * t + 3.0, 3.0 * t2];
        [0, 1, 2, 3].map(|i| (interval + i, values[i] / 6.0, slopes[i] / 6.0 * slope))
    }
}

/// A curve of the same argument for each of some joints, added to one quantity.
#[derive(Debug, Clone)]
pub struct Shapeless {
    parameters: Parameters,
    hooks: &'static [Hook],
    /// Of each joint that has a curve.
    knots: Vec<Option<Knots>>,
}

/// The id under which coefficients stand among results.
pub const ID: &str = "shapeless";

impl Shapeless {
    /// Curves on the quantity of `hook`, one for each joint with knots.
    pub fn new(hook: Hook, knots: Vec<Option<Knots>>) -> Self {
        let mut parameters = Parameters::new(ID);
        for joint in (0..knots.len()).filter(|&joint| knots[joint].is_some()) {
            for i in 0..COEFFICIENTS {
                parameters.plain(&format!("c{i}"), "N m", Of::Joint(joint), 0.0);
            }
        }
        let hooks: &'static [Hook] = match hook {
            Hook::MotorTorque => &[Hook::MotorTorque],
            Hook::Transmission => &[Hook::Transmission],
            Hook::LinkLoad => &[Hook::LinkLoad],
            _ => &[Hook::Friction],
        };
        Shapeless { parameters, hooks, knots }
    }

    fn act<T: Quantity>(&self, _hook: Hook, at: &At<'_, T>, torque: T) -> T {
        let Some(knots) = self.knots[at.joint] else { return torque };
        let x = knots.argument.of(at);
        let curve = knots
            .basis(x.re())
            .into_iter()
            .fold(T::from(0.0), |sum, (i, value, slope)| sum + at.parameters[i] * x.through(value, slope));
        torque + curve
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
        if self.knots[joint].is_none() {
            return Vec::new();
        }
        self.parameters.of(|of| of == Of::Joint(joint))
    }

    acts_on_joints!();
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn splines_add_up_to_one_and_have_the_slopes_of_differences() {
        for knots in [Knots::over(Argument::MotorSpeed, [-4.0, 5.0]), Knots::over(Argument::LinkAngle, [-0.3, 0.6])] {
            for x in [-0.29, -0.1, 0.0, 1e-3, 0.2, 0.55] {
                let sum: f64 = knots.basis(x).iter().map(|(_, value, _)| value).sum();
                assert!((sum - 1.0).abs() < 1e-14, "{sum}");
                let coefficients: Vec<f64> = (0..COEFFICIENTS).map(|i| (i as f64 * 1.7).sin()).collect();
                let slope: f64 = knots.basis(x).iter().map(|(i, _, slope)| coefficients[*i] * slope).sum();
                let by = 1e-6;
                let expected = (knots.value(&coefficients, x + by) - knots.value(&coefficients, x - by)) / (2.0 * by);
                assert!((slope - expected).abs() < 1e-6 * (1.0 + expected.abs()), "{x}: {slope} and {expected}");
            }
        }
    }

    #[test]
    fn a_curve_goes_on_level_beyond_its_ends() {
        let knots = Knots::over(Argument::Time, [0.0, 10.0]);
        let coefficients = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0];
        assert_eq!(knots.value(&coefficients, 12.0), knots.value(&coefficients, 10.0));
        assert!((knots.value(&coefficients, 5.0) - 4.5).abs() < 1e-12, "a straight line is met exactly");
    }
}
