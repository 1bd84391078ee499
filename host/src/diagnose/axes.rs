//! Which results belong to an effect, and the joints in which it shows: by the parameters of a fit, or by the score of a scan.

use super::scan::Score;
use crate::calibrate::{Trial, TrialValue};
use crate::effect::Effect;
use crate::model::law::{Law, Of};

/// Parameters that say how an effect goes, not how much of it there is.
const SHAPES: [&str; 4] = [".phi", ".q0", ".tau", ".bending"];

/// Whether a result is a parameter of this effect.
pub fn is_of(effect: &Effect, name: &str) -> bool {
    name.strip_prefix(effect.id).is_some_and(|rest| rest.starts_with('.'))
}

/// The joints (1-based) in whose parameters an effect shows: more than three standard errors from nothing, and no less than a twentieth of
/// the largest. Empty for effects that are no joint's.
pub fn axes(effect: &Effect, trial: &Trial) -> Vec<usize> {
    let prefix = format!("{}.", effect.id);
    let joint = |name: &str| -> Option<usize> {
        let index = name.strip_prefix(&prefix)?.split_once('[')?.1.strip_suffix(']')?;
        index.parse().ok()
    };
    let of_joints: Vec<_> = trial
        .values
        .iter()
        .filter(|value| !SHAPES.iter().any(|shape| value.name.contains(shape)))
        .filter_map(|value| Some((joint(&value.name)?, value)))
        .collect();
    let significance = |value: &TrialValue| value.std_error.map_or(0.0, |error| value.estimate.abs() / error);
    let unit_largest = |unit: &str| {
        of_joints.iter().filter(|(_, v)| v.unit == unit).map(|(_, v)| v.estimate.abs()).fold(0.0, f64::max)
    };
    let mut axes: Vec<usize> = of_joints
        .iter()
        .filter(|(_, value)| significance(value) > 3.0 && value.estimate.abs() > 0.05 * unit_largest(value.unit))
        .map(|(joint, _)| *joint)
        .collect();
    axes.sort_unstable();
    axes.dedup();
    axes
}

/// The joints (1-based) in whose coordinates the score of a law shows.
pub fn axes_of_score(law: &dyn Law, score: &Score) -> Vec<usize> {
    let coordinates = &law.parameters().coordinates;
    let first = score.z.len() - coordinates.len();
    let mut axes: Vec<usize> = coordinates
        .iter()
        .zip(&score.z[first..])
        .filter(|(_, z)| z.abs() > 3.0)
        .filter_map(|(coordinate, _)| if let Of::Joint(joint) = coordinate.of { Some(joint + 1) } else { None })
        .collect();
    axes.sort_unstable();
    axes.dedup();
    axes
}
