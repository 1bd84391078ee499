//! Whether sizes are such as robots have: standard deviations on the logarithmic scale beyond what is typical. A flag on a finding, never a reason to drop one.

use super::axes::is_of;
use crate::calibrate::{Bench, Trial, TrialValue};
use crate::effect::{Effect, RobotScales};
use crate::model::law::Law;

/// Standard errors beyond a range, and share of the largest size on all joints, from which on a size is beyond it for sure.
const SURE: f64 = 3.0;
const LEFT_OVER: f64 = 0.1;

/// The scales of a robot on its recording.
#[derive(Debug, Clone)]
pub struct Plausibility {
    scales: RobotScales,
}

impl Plausibility {
    /// From the base model's states and torques on the bench.
    pub fn of(bench: &Bench<'_>, base: &Trial) -> Self {
        let stages = bench.series().stages();
        let rms = |value: &dyn Fn(usize) -> f64| {
            let squares: f64 = (0..stages).map(|k| value(k).powi(2)).filter(|square| square.is_finite()).sum();
            (squares / stages.max(1) as f64).sqrt()
        };
        let joints = 0..bench.series().joints();
        let torque: Vec<f64> = joints.clone().map(|joint| rms(&|k| bench.driving_torque(base, k, joint))).collect();
        let speed: Vec<f64> = joints.map(|joint| rms(&|k| base.joint(k, joint).thetad)).collect();
        let mut scales = RobotScales::of(bench.robot(), &torque, &speed);
        for (joint, scales) in scales.joints.iter_mut().enumerate() {
            let estimate =
                |symbol: &str| base.value(&format!("{symbol}[{}]", joint + 1)).map(|value| value.estimate.abs());
            scales.friction = estimate("mu").unwrap_or(scales.friction);
            scales.stiffness = estimate("k_s").unwrap_or(scales.stiffness);
        }
        Plausibility { scales }
    }

    /// Of a parameter of this effect.
    pub fn of_value(&self, effect: &Effect, name: &str, value: f64) -> f64 {
        effect.implausibility(name, value, &self.scales)
    }

    /// The largest of an effect's sizes and shapes in a trial.
    pub fn of_law(&self, effect: &Effect, trial: &Trial) -> f64 {
        let own = trial.values.iter().filter(|value| is_of(effect, &value.name));
        own.map(|value| self.of_value(effect, &value.name, value.estimate)).fold(0.0, f64::max)
    }

    /// A size of the law that no robot can have: beyond its range for sure, and by more than what a law leaves on one joint of what it explains on others. Such a law is the shape
    /// of something else.
    pub fn impossible<'t>(&self, effect: &Effect, law: &dyn Law, trial: &'t Trial) -> Option<&'t TrialValue> {
        let is_size = |name: &str| effect.parameter(name).is_some_and(|parameter| parameter.role.is_size());
        let sizes = || law.parameters().results.iter().filter(|result| is_size(&result.name));
        let value = |name: &str| trial.value(name);
        let largest = |unit: &str| {
            let of_unit = sizes().filter_map(|result| value(&result.name)).filter(|value| value.unit == unit);
            of_unit.map(|value| value.estimate.abs()).fold(0.0, f64::max)
        };
        sizes().find_map(|result| {
            let value = value(&result.name)?;
            let [low, high] = result.range;
            let beyond = (low - value.estimate).max(value.estimate - high);
            let sure = (SURE * value.std_error.unwrap_or(0.0)).max(LEFT_OVER * largest(value.unit));
            (beyond > sure).then_some(value)
        })
    }

    /// Whether a size of the law ends at, or beyond, the end of what a robot can have.
    pub fn is_at_boundary(&self, effect: &Effect, law: &dyn Law, trial: &Trial) -> bool {
        law.parameters().results.iter().any(|result| {
            let is_size = effect.parameter(&result.name).is_some_and(|p| p.role.is_size());
            let [low, high] = result.range;
            let Some(value) = trial.value(&result.name).filter(|_| is_size) else { return false };
            let error = value.std_error.unwrap_or(0.0);
            value.estimate <= low + error.min(1e-6 * low.abs()) && low.is_finite()
                || value.estimate >= high - error.min(1e-6 * high.abs()) && high.is_finite()
        })
    }
}
