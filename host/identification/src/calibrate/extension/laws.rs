//! A base model extended by effects: which laws, and the problem that they make.

use std::sync::Arc;

use super::trimmed::Trimmed;
use super::warm_start;
use crate::calibrate::data::series::Series;
use crate::calibrate::error::CalibrateError;
use crate::calibrate::identifiability::observability;
use crate::calibrate::residuals::noise::Noise;
use crate::calibrate::residuals::preset::Assumptions;
use crate::calibrate::residuals::preset::Preset;
use crate::calibrate::residuals::problem::Problem;
use crate::calibrate::result::fitted::Fit;
use crate::effect::{CATALOGUE, Effect, EffectError};
use crate::model::law::{Form, Law, Readings};
use crate::model::{Integrator, Model};
use crate::robot::Robot;
use solve::LeastSquares;
use solve::levenberg::{self, Settings};

/// Iterations that alternatives of a law get before the best goes on alone, and so many where there are many of them.
const TRIAL_ITERATIONS: usize = 2;
const MANY: (usize, usize) = (4, 1);

/// Laws in the catalogue's order.
type Laws = Vec<Arc<dyn Law>>;

/// The effects of these ids in the catalogue's order, each once.
pub(crate) fn effects<S: AsRef<str>>(ids: &[S]) -> Result<Vec<&'static Effect>, EffectError> {
    for id in ids {
        Effect::by_id(id.as_ref())?;
    }
    Ok(CATALOGUE.into_iter().filter(|effect| ids.iter().any(|id| id.as_ref() == effect.id)).collect())
}

/// The integration that the laws want.
pub(crate) fn integrator(laws: &[Arc<dyn Law>], preset: Preset) -> Integrator {
    let euler = laws.iter().any(|law| law.euler());
    if euler { Integrator::Euler } else { preset.assumptions().integrator }
}

/// The laws with which results of a calibration were found: `value` gives results by name.
pub(crate) fn laws_of<S: AsRef<str>>(
    robot: &Robot,
    ids: &[S],
    value: impl Fn(&str) -> Option<f64>,
) -> Result<Laws, EffectError> {
    let suits = |law: &Arc<dyn Law>| {
        law.parameters().results.iter().all(|result| match result.form {
            Form::Chosen(chosen) => value(&result.name).is_none_or(|told| told == chosen),
            // An alternative on another joint has other names.
            _ => value(&result.name).is_some(),
        })
    };
    let chosen = effects(ids)?.into_iter().map(|effect| {
        let mut alternatives = effect.laws(robot)?;
        let others: Laws = alternatives.iter().filter_map(|law| law.other_shape()).collect();
        alternatives.extend(others);
        // Of shapes that suit, the one with most results: the others leave some of them unsaid.
        let suited = (0..alternatives.len()).filter(|place| suits(&alternatives[*place]));
        let place = suited.rev().max_by_key(|place| alternatives[*place].parameters().results.len()).unwrap_or(0);
        Ok(alternatives.swap_remove(place))
    });
    chosen.collect()
}

/// The laws of an effect from all its starts, those that readings show where they show some.
///
/// # Errors
/// An effect that the robot cannot have.
pub(crate) fn laws_for(effect: &Effect, robot: &Robot, readings: &Readings) -> Result<Laws, EffectError> {
    let laws = effect.laws(robot)?;
    let shown = laws[0].starts_by_readings(readings);
    Ok(if shown.is_empty() { laws } else { shown })
}

/// The laws of these effects: of alternatives those that explain the recording best after a few iterations from `from`. Events start from what the
/// greater part of the recording shows, where that is told beside them.
pub(crate) fn choose_laws(
    robot: &Robot,
    series: &Series,
    effects: &[&'static Effect],
    from: &Fit,
    settings: &Settings,
) -> Result<(Laws, Option<Trimmed>), CalibrateError> {
    let readings = series.readings();
    let mut alternatives =
        effects.iter().map(|effect| laws_for(effect, robot, &readings)).collect::<Result<Vec<_>, _>>()?;
    let mut trimmed = None;
    // What several recordings show follows on no single clock.
    if alternatives.iter().any(|alternatives| alternatives[0].is_event()) && series.recordings.len() == 1 {
        trimmed = Trimmed::of(robot, series, settings)?;
    }
    let mut seen = false;
    for alternatives in &mut alternatives {
        let starts = trimmed.as_ref().map_or_else(Vec::new, |trimmed| alternatives[0].starts(&trimmed.clues));
        if !starts.is_empty() {
            (*alternatives, seen) = (starts, true);
        }
    }
    let trimmed = trimmed.filter(|_| seen);
    let known = || trimmed.as_ref().map_or_else(|| warm_start::known(from), Trimmed::known);
    let mut laws: Laws = alternatives.iter().map(|alternatives| alternatives[0].clone()).collect();
    for (place, alternatives) in alternatives.into_iter().enumerate().filter(|(_, all)| all.len() > 1) {
        let iterations = if alternatives.len() > MANY.0 { MANY.1 } else { TRIAL_ITERATIONS };
        let settings = Settings { max_iterations: iterations, ..settings.clone() };
        let mut least = f64::INFINITY;
        for alternative in alternatives {
            let mut trial = laws.clone();
            trial[place] = alternative;
            let model = Model::extended(robot, trial.clone())?;
            let problem = problem(&model, robot, series, from);
            let held = observability::structural(&model, robot, problem.border());
            let held: Vec<_> = held.into_iter().map(|held| held.direction).collect();
            let start = warm_start::warm_start(&problem, robot, series, &known(), &settings);
            // One that leads the search astray is not the best one.
            let Ok(solution) = levenberg::minimise(&problem, start, &held, &settings, |_, _| {}) else { continue };
            if solution.cost < least {
                least = solution.cost;
                laws = trial;
            }
        }
    }
    Ok((laws, trimmed))
}

/// The preset's assumptions with the integration that the laws want.
pub(crate) fn assumptions(laws: &[Arc<dyn Law>], preset: Preset) -> Assumptions {
    Assumptions { integrator: integrator(laws, preset), ..preset.assumptions() }
}

/// The problem of an extended model under the noise of `from`, with the integration that the laws want. What `from` takes an event for is no noise
/// of anything else: then the preset's.
pub(crate) fn problem<'m>(model: &'m Model, robot: &Robot, series: &'m Series, from: &Fit) -> Problem<'m> {
    let assumptions = assumptions(model.laws(), from.calibration.preset);
    let assumed = Noise::assumed(robot, model, series, &assumptions);
    let mut problem = Problem::new(model, robot, series, assumptions);
    if model.laws().iter().any(|law| law.is_event()) {
        return problem;
    }
    problem.set_noise(from.noise.carried(&from.layout, model.layout(), assumed));
    problem
}

impl Fit {
    /// ½ Σ r² of every sample at the end of the search, under the noise that was found.
    ///
    /// # Errors
    /// A model that cannot be built.
    pub fn costs(&self, robot: &Robot, settings: &Settings) -> Result<Vec<f64>, CalibrateError> {
        let model = Model::new(robot);
        let mut problem = problem(&model, robot, &self.series, self);
        let point = warm_start::warm_start(&problem, robot, &self.series, &warm_start::known(self), settings);
        problem.shift_readings(&point.z);
        let mut scratch = problem.scratch();
        Ok((0..self.series.stages()).map(|k| problem.cost(&point, k..k + 1, &mut scratch)).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_laws_of_a_calibration_have_the_corners_that_were_fitted() {
        let robot = Robot::builtin("doggy").unwrap();
        for (id, corner, told) in [
            ("end_stop", "end_stop.corner", 1e-4),
            ("end_stop", "end_stop.corner", 1e-3),
            ("belt_tooth_skip", "belt_tooth_skip.width", 1e-4),
            ("belt_tooth_skip", "belt_tooth_skip.width", 2e-3),
        ] {
            // Of a skip on the second joint.
            let value = |name: &str| match name {
                _ if name == corner => Some(told),
                _ if name.starts_with("belt_tooth_skip") => name.ends_with("[2]").then_some(0.5),
                _ => Some(0.5),
            };
            let laws = laws_of(&robot, &[id], value).unwrap();
            let results = &laws[0].parameters().results;
            let has = |name: &str| results.iter().any(|result| result.name == name);
            let found = results.iter().find(|result| result.name == corner).map(|result| result.form.clone());
            assert!(matches!(found, Some(Form::Chosen(value)) if value == told), "{corner} of {told}: {results:?}");
            assert!(id == "end_stop" || has("belt_tooth_skip.step[2]"), "{results:?}");
        }
    }

    #[test]
    fn a_calibration_read_again_has_the_shape_that_says_all_its_results() {
        let robot = Robot::builtin("doggy").unwrap();
        let count = |told: &[&str]| {
            let value = |name: &str| told.iter().any(|symbol| name.contains(symbol)).then_some(1.0);
            laws_of(&robot, &["cable_spring"], value).unwrap()[0].parameters().results.len()
        };
        assert_eq!(count(&["k_c"]), 3);
        assert_eq!(count(&["k_c", "preload"]), 6);
    }
}
