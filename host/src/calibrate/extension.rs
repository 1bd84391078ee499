//! A base model extended by effects: which laws, and where their search starts.

use std::sync::Arc;

use nalgebra::{Matrix3, Vector3};

use super::point::Point;
use super::start::{self, Shared};
use super::trimmed::Trimmed;
use super::{Assumptions, CalibrateError, Fit, Noise, Preset, Problem, Series, observability, own_states};
use crate::effect::{CATALOGUE, Effect, EffectError};
use crate::model::law::{Form, Law};
use crate::model::{Integrator, Layout, Model};
use crate::robot::Robot;
use solve::levenberg::{self, Settings, total_cost};

/// Iterations that alternatives of a law get before the best goes on alone, and so many where there are many of them.
const TRIAL_ITERATIONS: usize = 2;
const MANY: (usize, usize) = (4, 1);

/// Laws in the catalogue's order.
type Laws = Vec<Arc<dyn Law>>;

/// The effects of these ids in the catalogue's order, each once.
pub(super) fn effects<S: AsRef<str>>(ids: &[S]) -> Result<Vec<&'static Effect>, EffectError> {
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
        let sharp: Laws = alternatives.iter().filter_map(|law| law.sharp()).collect();
        alternatives.extend(sharp);
        let place = alternatives.iter().position(suits).unwrap_or(0);
        Ok(alternatives.swap_remove(place))
    });
    chosen.collect()
}

/// The laws of these effects: of alternatives those that explain the recording best after a few iterations from `from`. Events start from what the
/// greater part of the recording shows, where that is told beside them.
pub(super) fn choose_laws(
    robot: &Robot,
    series: &Series,
    effects: &[&'static Effect],
    from: &Fit,
    settings: &Settings,
) -> Result<(Laws, Option<Trimmed>), CalibrateError> {
    let mut alternatives = effects.iter().map(|effect| effect.laws(robot)).collect::<Result<Vec<_>, _>>()?;
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
    let known = || trimmed.as_ref().map_or_else(|| known(from), Trimmed::known);
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
            let start = warm_start(&problem, robot, series, &known(), &settings);
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
pub(super) fn assumptions(laws: &[Arc<dyn Law>], preset: Preset) -> Assumptions {
    Assumptions { integrator: integrator(laws, preset), ..preset.assumptions() }
}

/// The problem of an extended model under the noise of `from`, with the integration that the laws want. What `from` takes an event for is no noise
/// of anything else: then the preset's.
pub(super) fn problem<'m>(model: &'m Model, robot: &Robot, series: &'m Series, from: &Fit) -> Problem<'m> {
    let assumptions = assumptions(model.laws(), from.calibration.preset);
    let assumed = Noise::assumed(robot, model, series, &assumptions);
    let mut problem = Problem::new(model, robot, series, assumptions);
    if model.laws().iter().any(|law| law.is_event()) {
        return problem;
    }
    problem.set_noise(from.noise.carried(&from.layout, model.layout(), assumed));
    problem
}

/// A value by its name among results.
pub(super) type ByName<'a> = Box<dyn Fn(&str) -> Option<f64> + 'a>;

/// What is known before a search: the end of another one, with fewer laws, more or others.
pub(super) struct Known<'a> {
    /// Results of the dynamics by name.
    pub value: ByName<'a>,
    /// Of every gyro.
    pub rotations: Vec<Matrix3<f64>>,
    /// `[recording][gyro]`; of other recordings where their number differs.
    pub biases: Vec<Vec<Vector3<f64>>>,
    /// States of the same samples; none where they are others.
    pub states: &'a [f64],
    /// What their components are.
    pub layout: &'a Layout,
    /// The laws whose own states are among them; none where they are not told.
    pub laws: &'a [Arc<dyn Law>],
    /// See [`Trial::block_weights`](super::Trial::block_weights).
    pub block_weights: &'a [f64],
}

/// What a fit knows.
pub(super) fn known(fit: &Fit) -> Known<'_> {
    let calibration = &fit.calibration;
    let gyros = calibration.rotations.len();
    let rotations = (0..gyros).map(|gyro| {
        let rows = calibration.rotations.get(&format!("imu{}", gyro + 1));
        rows.map_or_else(Matrix3::identity, |rows| Matrix3::from_fn(|i, j| rows[i][j]))
    });
    let bias = |recording: usize, gyro: usize| {
        Vector3::from_fn(|axis, _| {
            let name = format!("bias{}[{}]", gyro + 1, ["x", "y", "z"][axis]);
            let own = calibration.parameter(&format!("{name}@{}", recording + 1));
            own.or_else(|| calibration.parameter(&name)).map_or(f64::NAN, |parameter| parameter.estimate)
        })
    };
    let recordings = 0..calibration.recordings.len();
    Known {
        value: Box::new(|name| calibration.parameter(name).map(|parameter| parameter.estimate)),
        rotations: rotations.collect(),
        biases: recordings.map(|recording| (0..gyros).map(|gyro| bias(recording, gyro)).collect()).collect(),
        states: &fit.states,
        layout: &fit.layout,
        laws: &[],
        block_weights: &[],
    }
}

/// Where the search of an extended model starts: shared unknowns of the same name keep their values, states are those that are known where
/// they suit better than a fresh guess. States that laws bring and that nothing is known of are those to which the others lead.
pub(super) fn warm_start<'m>(
    problem: &Problem<'m>,
    robot: &Robot,
    series: &Series,
    from: &Known<'_>,
    settings: &Settings,
) -> Point<'m> {
    let model = problem.model;
    let mut fresh = start::with_states(model, series, shared(model, robot, series, from));
    let layout = model.layout();
    own_states::follow(problem, &mut fresh, &layout.own().collect::<Vec<_>>(), settings.threads);
    if from.states.len() != series.stages() * from.layout.size() {
        return fresh;
    }
    let known = known_components(model, from);
    let mut kept = fresh.clone();
    for (to, states) in kept.states.chunks_exact_mut(layout.size()).zip(from.states.chunks_exact(from.layout.size())) {
        for (component, of_known) in &known {
            to[*component] = states[*of_known];
        }
    }
    let unknown: Vec<usize> = layout.own().filter(|own| known.iter().all(|(component, _)| component != own)).collect();
    own_states::follow(problem, &mut kept, &unknown, settings.threads);
    let better = total_cost(problem, &kept, settings.threads) <= total_cost(problem, &fresh, settings.threads);
    if better { kept } else { fresh }
}

/// Components of a model's state that mean the same among those that are known, each with its place there.
fn known_components(model: &Model, from: &Known<'_>) -> Vec<(usize, usize)> {
    let (to, known) = (model.layout(), from.layout);
    let mut components = Vec::new();
    for joint in 0..to.joints().min(known.joints()) {
        for of in [Layout::q, Layout::qd, Layout::theta, Layout::thetad] {
            components.push((of(to, joint), of(known, joint)));
        }
        components.extend(to.input(joint).zip(known.input(joint)));
    }
    // Passive joints are told apart by nothing but their number.
    if to.passive().eq(known.passive()) {
        let passive = to.passive().flat_map(|i| [(i, i), (to.chain() + i, known.chain() + i)]);
        components.extend(passive);
    }
    let is_same = |law: &Arc<dyn Law>, other: &Arc<dyn Law>| Arc::ptr_eq(law, other);
    let mut own = known.own();
    for law in from.laws {
        let count = model.own_states_of(&**law);
        let there: Vec<usize> = own.by_ref().take(count).collect();
        if let Some(place) = model.laws().iter().position(|other| is_same(other, law)) {
            let before: usize = model.laws()[..place].iter().map(|other| model.own_states_of(&**other)).sum();
            components.extend(to.own().skip(before).zip(there));
        }
    }
    components
}

/// The shared unknowns of another model: what it did not have starts where the model says.
pub(super) fn shared(model: &Model, robot: &Robot, series: &Series, from: &Known<'_>) -> Shared {
    let start = start::shared(model, robot, series);
    let coordinates = model.coordinates();
    let mut physical = coordinates.to_physical(&start.z);
    for (value, (name, _)) in physical.iter_mut().zip(coordinates.names()) {
        *value = (from.value)(name).unwrap_or(*value);
    }
    let rotations = if from.rotations.len() == start.rotations.len() { &from.rotations } else { &start.rotations };
    let mut biases = start.biases;
    if from.biases.len() == biases.len() {
        for (bias, known) in biases.iter_mut().flatten().zip(from.biases.iter().flatten()) {
            if known.iter().all(|value| value.is_finite()) {
                *bias = *known;
            }
        }
    }
    Shared { z: coordinates.from_physical(&physical), rotations: rotations.clone(), biases }
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
}
