//! A plan as users read it: the motion, what it is expected to tell, what it asks of the robot; each beside the preset.

use serde::{Deserialize, Serialize};

use super::choice::{Criterion, Merit, Yardstick};
use super::trial::{Conduct, Trial};
use super::{Bench, Block, PlanError, Seen, rehearse_likely};
use crate::calibrate::information::{About, Information, Informed};
use crate::recording::Recording;
use crate::robot::JointKind;

/// A planned motion.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Plan {
    /// Name of the robot.
    pub robot: String,
    /// Whether the robot was calibrated before; if not, its start values may be off by a factor of two.
    pub calibrated: bool,
    /// Decides what was tried.
    pub seed: u64,
    /// What the motion was chosen by.
    pub criterion: Criterion,
    /// Whether it was to show the dynamic parameters.
    pub for_parameters: bool,
    /// Ids of the effects that it was to show; of several, to tell from one another.
    pub effects: Vec<String>,
    /// Whether nothing better than the preset calibration motion was found: then it is the motion.
    pub is_preset: bool,
    /// Whether the search was made to its end. If not, the same seed may give another motion.
    pub complete: bool,
    /// Blocks that were tried.
    pub blocks_tried: usize,
    /// Robots on which the motion was tried whole.
    pub robots: usize,
    /// Robots drawn on which the preset is stopped by a watch, left out.
    pub robots_left_out: usize,
    /// Mean length over the robots, s.
    pub duration_s: f64,
    /// The same of the preset, s.
    pub preset_duration_s: f64,
    /// Segments of the motion.
    pub segments: usize,
    /// Blocks of the motion; none if it is the preset.
    pub blocks: Vec<Block>,
    /// Geometric mean over the robots of the criterion's error as a part of the preset's.
    pub error_ratio: f64,
    /// The same on the robot where it is largest.
    pub worst_error_ratio: f64,
    /// Every parameter of the robot.
    pub parameters: Vec<ExpectedError>,
    /// Sizes of the effects, with all parameters and all other sizes free: the value is the typical one, and its square over that of the error is the information that
    /// tells the effect from the others.
    pub sizes: Vec<ExpectedError>,
    /// What the motion asks of every joint, the largest over the robots.
    pub joints: Vec<JointDemand>,
    /// Largest part of its bound that a watch of the firmware reached, on any robot.
    pub watch: f64,
    /// The same of the preset.
    pub preset_watch: f64,
    /// The motion file.
    #[serde(skip)]
    pub motion_toml: String,
    /// The motion as the likeliest robot plays it.
    #[serde(skip)]
    pub recording: Option<Recording>,
}

/// What is expected to become known of one parameter.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ExpectedError {
    /// Name, as in results.
    pub name: String,
    /// Unit.
    pub unit: String,
    /// Its likeliest value before the motion.
    pub value: f64,
    /// Expected standard error if that is its value; null where the motion does not determine it.
    pub std_error: Option<f64>,
    /// The same by the preset.
    pub preset_std_error: Option<f64>,
    /// Mean over the robots of the expected error as a part of the preset's, geometric; null for gyros. An information is its inverse square.
    pub ratio: Option<f64>,
    /// The same on the robot where it is largest.
    pub worst_ratio: Option<f64>,
    /// Smallest and largest expected relative error over the robots; null for gyros.
    pub relative_error: Option<[f64; 2]>,
}

/// What a motion asks of a joint.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct JointDemand {
    /// Name.
    pub joint: String,
    /// Unit of positions.
    pub unit: String,
    /// Peak speed, unit/s.
    pub speed: f64,
    /// The same in the preset.
    pub preset_speed: f64,
    /// Peak torque of the motor on the link side, N m or N.
    pub motor_torque: f64,
    /// The same in the preset.
    pub preset_motor_torque: f64,
    /// Peak torque of the transmission, N m or N.
    pub transmission_torque: f64,
    /// The same in the preset.
    pub preset_transmission_torque: f64,
    /// Lowest and highest position.
    pub travel: [f64; 2],
    /// The same in the preset.
    pub preset_travel: [f64; 2],
    /// Root mean square of the duty, a fraction.
    pub duty_rms: f64,
    /// The same in the preset.
    pub preset_duty_rms: f64,
}

/// The result of a search.
pub(super) fn plan(
    bench: &Bench<'_>,
    yardstick: &Yardstick,
    seen: Seen<'_>,
    (blocks_tried, complete): (usize, bool),
) -> Result<Plan, PlanError> {
    let belief = bench.belief;
    let played = rehearse_likely(bench, seen.motion)?;
    let told = |trials: &[Trial]| -> Option<Told> {
        let information = yardstick.told(trials)?;
        let merits = information.iter().map(|told| Merit::of(told, yardstick.goal)).collect::<Option<Vec<_>>>()?;
        let errors = information.iter().map(Information::errors).collect::<Option<Vec<_>>>()?;
        Some(Told { merits, likely: information.into_iter().next()?, errors })
    };
    let (after, reference) = (told(seen.trials), told(&bench.preset_trials));
    let (Some(after), Some(reference)) = (after, reference) else { return Err(PlanError::NoneKeepsLimits) };
    let gains: Vec<f64> = after.merits.iter().zip(&reference.merits).map(|(a, b)| a.score - b.score).collect();
    let mean_s =
        |trials: &[Trial]| trials.iter().map(|t| t.conduct.duration_s).sum::<f64>() / trials.len().max(1) as f64;
    let watch = |trials: &[Trial]| trials.iter().fold(0.0_f64, |most, trial| most.max(trial.conduct.watch));
    Ok(Plan {
        robot: belief.robot.name.clone(),
        calibrated: belief.is_calibrated(),
        seed: bench.settings.seed,
        criterion: yardstick.goal.criterion,
        for_parameters: yardstick.goal.parameters,
        effects: bench.settings.effects.iter().map(|effect| effect.id.to_owned()).collect(),
        is_preset: seen.is_preset,
        complete,
        blocks_tried,
        robots: bench.robots.len(),
        robots_left_out: bench.left_out,
        duration_s: mean_s(seen.trials),
        preset_duration_s: mean_s(&bench.preset_trials),
        segments: seen.motion.segments.len(),
        blocks: seen.blocks.to_vec(),
        error_ratio: (gains.iter().sum::<f64>() / gains.len() as f64).exp(),
        worst_error_ratio: gains.iter().fold(f64::NEG_INFINITY, |most, gain| most.max(*gain)).exp(),
        parameters: expected(&after, &reference, |about| !matches!(about, About::LawSize | About::LawShape)),
        sizes: expected(&after, &reference, |about| matches!(about, About::LawSize)),
        joints: demands(bench, seen.trials),
        watch: watch(seen.trials),
        preset_watch: watch(&bench.preset_trials),
        motion_toml: toml::to_string(seen.motion)
            .map_err(|error| PlanError::Simulate(crate::simulate::SimulateError::Motion { said: error.to_string() }))?,
        recording: Some(played.recording),
    })
}

/// A parameter whose expected error is a larger part of its size is not determined: its 95 % interval reaches the size itself.
const UNDETERMINED: f64 = 0.5;

/// What a motion tells, with what was known before.
struct Told {
    /// By robot.
    merits: Vec<Merit>,
    /// Of the likeliest robot.
    likely: Information,
    /// Expected errors by robot, the likeliest first, in units of the sizes.
    errors: Vec<Vec<f64>>,
}

impl Told {
    fn std_error(&self, parameter: usize) -> Option<f64> {
        let error = self.errors[0][parameter];
        let determined = error < UNDETERMINED && !self.likely.is_hidden(parameter);
        determined.then(|| error * self.likely.parameters[parameter].size)
    }
}

/// Of the parameters that `wanted` says.
fn expected(after: &Told, reference: &Told, wanted: impl Fn(About) -> bool) -> Vec<ExpectedError> {
    let is_told = |(i, parameter): &(usize, &Informed)| wanted(parameter.about) && !after.likely.is_hidden(*i);
    let parameters = after.likely.parameters.iter().enumerate().filter(is_told);
    let parameter = |(i, parameter): (usize, &Informed)| {
        let errors = |told: &Told| told.errors.iter().map(|errors| errors[i]).collect::<Vec<f64>>();
        let is_dynamic = !matches!(parameter.about, About::Mounting | About::Bias);
        let both = is_dynamic.then(|| (errors(after), errors(reference)));
        let ratios = both.as_ref().map(|(a, b)| a.iter().zip(b).map(|(a, b)| a / b).collect::<Vec<f64>>());
        let largest = |values: &[f64]| values.iter().fold(0.0_f64, |most, value| most.max(*value));
        let mean = |ratios: &Vec<f64>| (ratios.iter().map(|ratio| ratio.ln()).sum::<f64>() / ratios.len() as f64).exp();
        ExpectedError {
            name: parameter.name.clone(),
            unit: parameter.unit.to_owned(),
            value: parameter.value,
            std_error: after.std_error(i),
            preset_std_error: reference.std_error(i),
            ratio: ratios.as_ref().map(mean),
            worst_ratio: ratios.as_deref().map(largest),
            relative_error: both.map(|(errors, _)| {
                [errors.iter().fold(f64::INFINITY, |least, error| least.min(*error)), largest(&errors)]
            }),
        }
    };
    parameters.map(parameter).collect()
}

fn demands(bench: &Bench<'_>, trials: &[Trial]) -> Vec<JointDemand> {
    let robot = &bench.belief.robot;
    let demand = |(j, joint): (usize, &crate::robot::Joint)| {
        let largest = |trials: &[Trial], of: &dyn Fn(&Conduct) -> f64| {
            trials.iter().fold(f64::NEG_INFINITY, |most, trial| most.max(of(&trial.conduct)))
        };
        let both = |of: &dyn Fn(&Conduct) -> f64| (largest(trials, of), largest(&bench.preset_trials, of));
        let (speed, preset_speed) = both(&|c| c.joints[j].speed);
        let (motor_torque, preset_motor_torque) = both(&|c| c.joints[j].motor_torque);
        let (transmission_torque, preset_transmission_torque) = both(&|c| c.joints[j].transmission_torque);
        let (duty_rms, preset_duty_rms) = both(&|c| (c.joints[j].duty_squared_s / c.duration_s).sqrt());
        let (lowest, preset_lowest) = both(&|c| -c.joints[j].travel[0]);
        let (highest, preset_highest) = both(&|c| c.joints[j].travel[1]);
        JointDemand {
            joint: joint.name.clone(),
            unit: if joint.kind == JointKind::Revolute { "rad" } else { "m" }.to_owned(),
            speed,
            preset_speed,
            motor_torque,
            preset_motor_torque,
            transmission_torque,
            preset_transmission_torque,
            travel: [-lowest, highest],
            preset_travel: [-preset_lowest, preset_highest],
            duty_rms,
            preset_duty_rms,
        }
    };
    robot.joints.iter().enumerate().map(demand).collect()
}
