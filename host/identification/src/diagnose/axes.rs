//! Which results belong to an effect, and the joints in which it shows.

use super::scores::block_scores::LawScore;
use crate::calibrate::{Trial, TrialValue};
use crate::effect::Effect;
use crate::model::law::{Law, Of};

/// Standard errors from which on a joint's parameter shows, and share of the largest one below which it does not matter.
const SHOWN: (f64, f64) = (3.0, 0.05);

/// Whether a result is a parameter of this effect.
pub fn is_of(effect: &Effect, name: &str) -> bool {
    name.strip_prefix(effect.id).is_some_and(|rest| rest.starts_with('.'))
}

/// Whether a result is a size of this effect.
pub fn is_size(effect: &Effect, name: &str) -> bool {
    effect.parameter(name).is_some_and(|parameter| parameter.role.is_size())
}

/// The joint (1-based) that a result's name ends in.
pub fn joint_of(name: &str) -> Option<usize> {
    name.split_once('[')?.1.strip_suffix(']')?.parse().ok()
}

/// The joints (1-based) in whose sizes an effect shows. Empty for effects that are no joint's.
pub fn axes(effect: &Effect, trial: &Trial) -> Vec<usize> {
    let sizes: Vec<(usize, &TrialValue)> = trial
        .values
        .iter()
        .filter(|value| is_of(effect, &value.name) && is_size(effect, &value.name))
        .filter_map(|value| Some((joint_of(&value.name)?, value)))
        .collect();
    let significance = |value: &TrialValue| value.std_error.map_or(0.0, |error| value.estimate.abs() / error);
    let largest =
        |unit: &str| sizes.iter().filter(|(_, v)| v.unit == unit).map(|(_, v)| v.estimate.abs()).fold(0.0, f64::max);
    let shows =
        |value: &TrialValue| significance(value) > SHOWN.0 && value.estimate.abs() > SHOWN.1 * largest(value.unit);
    let mut axes: Vec<usize> = sizes.iter().filter(|(_, value)| shows(value)).map(|(joint, _)| *joint).collect();
    axes.sort_unstable();
    axes.dedup();
    axes
}

/// The joints (1-based) in whose coordinates the score of a law shows.
pub fn axes_of_step(law: &dyn Law, score: &LawScore) -> Vec<usize> {
    let coordinates = &law.parameters().coordinates;
    let first = score.z.len() - coordinates.len();
    let joint = |of: Of| if let Of::Joint(joint) = of { Some(joint + 1) } else { None };
    let shown = coordinates.iter().zip(&score.z[first..]).filter(|(_, z)| z.abs() > SHOWN.0);
    let mut axes: Vec<usize> = shown.filter_map(|(coordinate, _)| joint(coordinate.of)).collect();
    axes.sort_unstable();
    axes.dedup();
    axes
}

/// The joints (1-based) that a law has coordinates of.
pub fn axes_of_joints(law: &dyn Law) -> Vec<usize> {
    let joints = law.parameters().coordinates.iter().filter_map(|coordinate| match coordinate.of {
        Of::Joint(joint) => Some(joint + 1),
        _ => None,
    });
    let mut axes: Vec<usize> = joints.collect();
    axes.dedup();
    axes
}
