//! What parameters of laws can be in a robot: which law of a fit left its ranges, and where it did.
//!
//! ```text
//!      low                     high
//! ──────┼───────────────────────┼──────▶ estimate
//!    ◀──┤                       ├──▶
//!    slack: three standard errors, or a twentieth of the largest of its kind
//! ```
//!
//! What the search holds back at its bounds, though the recording tells its size well enough, would be out of its range farther on.

use std::sync::Arc;

use crate::model::law::{Form, Law, LawResult, Parameters};

/// Of a kind of parameter, what is little beside the largest.
const LITTLE: f64 = 0.05;

/// A standard error that tells a size, as a share of the range's width.
const TELLS: f64 = 0.25;
/// The width of the range of a logarithm that has no lower end.
const DECADES: f64 = 7.0;

/// Name, estimate, standard error.
pub(super) type Value<'v> = (&'v str, f64, Option<f64>);

/// A law's coordinate that a fit led out of its range.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Beyond {
    /// The law, by its place.
    pub law: usize,
    /// Result of it.
    pub name: String,
    /// Coordinate of the law; none where the result is not one itself.
    pub coordinate: Option<usize>,
    /// The end of the range that it passed.
    pub end: f64,
}

/// What no robot can have among the results of these laws.
pub(super) fn beyond<'v>(laws: &[Arc<dyn Law>], values: impl Iterator<Item = Value<'v>> + Clone) -> Vec<Beyond> {
    let kind = |name: &str| name.split_once('[').map_or(name, |(kind, _)| kind).to_string();
    let mut all = Vec::new();
    for (law, parameters) in laws.iter().map(|law| law.parameters()).enumerate() {
        for result in &parameters.results {
            let Some((_, estimate, std_error)) = values.clone().find(|(name, ..)| *name == result.name) else {
                continue;
            };
            let alike = values.clone().filter(|(name, ..)| kind(name) == kind(&result.name));
            let largest = alike.map(|(_, estimate, _)| estimate.abs()).fold(0.0, f64::max);
            let slack = (3.0 * std_error.unwrap_or(0.0)).max(LITTLE * largest);
            let [low, high] = result.range;
            let held_back = is_held_back(parameters, result, estimate, std_error);
            if estimate.is_finite() && (low - slack..=high + slack).contains(&estimate) && !held_back {
                continue;
            }
            let coordinate = match result.form {
                Form::Is(i) | Form::Exp(i) => Some(i),
                _ => None,
            };
            // A number that is none comes back at the end that is one.
            let end = if estimate > high || !low.is_finite() { high } else { low };
            all.push(Beyond { law, name: result.name.clone(), coordinate, end });
        }
    }
    all
}

/// Whether a search ended at its bound for this result, which it could tell.
fn is_held_back(parameters: &Parameters, result: &LawResult, estimate: f64, std_error: Option<f64>) -> bool {
    let Some(std_error) = std_error else { return false };
    let [low, high] = result.range;
    let (at, error, width, coordinate) = match result.form {
        Form::Is(i) => (estimate, std_error, high - low, i),
        Form::Exp(i) => (estimate.ln(), std_error / estimate, (high / low.max(0.0)).ln().min(DECADES), i),
        _ => return false,
    };
    let Some((_, [least, most])) = parameters.bounds().find(|(bounded, _)| *bounded == coordinate) else {
        return false;
    };
    let little = 1e-6 * width;
    let at_least = at <= least + little && result.finest.is_none();
    (at_least || at >= most - little) && error < TELLS * width
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::Effect;
    use crate::robot::Robot;

    #[test]
    fn the_law_that_no_robot_can_have_is_told_from_the_others() {
        let robot = Robot::builtin("doggy").unwrap();
        let law = |id| Effect::by_id(id).unwrap().laws(&robot).unwrap().swap_remove(0);
        let laws = [law("backlash"), law("belt_hysteresis")];
        let with = |k1: f64, std_error: f64| {
            let values = [("backlash.h[1]", 0.004, 1e-5), ("belt_hysteresis.k1[1]", k1, std_error)];
            beyond(&laws, values.iter().map(|(name, value, error)| (*name, *value, Some(*error))))
        };
        // A stiffness may not be negative by more than three standard errors.
        assert_eq!(with(50.0, 1.0), []);
        assert_eq!(with(-2.9, 1.0), []);
        let at_zero = Beyond { law: 1, name: "belt_hysteresis.k1[1]".into(), coordinate: Some(0), end: 0.0 };
        assert_eq!(with(-3.1, 1.0), std::slice::from_ref(&at_zero));
        assert_eq!(with(f64::NAN, 1.0), [at_zero]);
        // At the search's bound of 1 s: where k1 is nothing τ may be anything, else it would go on.
        let tau = |std_error: f64| {
            let values = [("belt_hysteresis.tau[1]", 1.0, Some(std_error))];
            beyond(&laws, values.into_iter()).len()
        };
        assert_eq!([tau(0.4), tau(1.4), tau(1.7)], [1, 1, 0]);
        let others = [("backlash.h[1]", 0.3, None), ("belt_hysteresis.tau[2]", f64::INFINITY, None)];
        let ends: Vec<_> =
            beyond(&laws, others.into_iter()).into_iter().map(|b| (b.law, b.coordinate, b.end)).collect();
        assert_eq!(ends, [(0, Some(0), 0.1), (1, Some(4), 0.5)]);
    }
}
