//! Where the search of an extended model starts: at what another search has found.

use std::sync::Arc;

use nalgebra::{Matrix3, Vector3};

use crate::calibrate::data::series::Series;
use crate::calibrate::initial_guess::own_states;
use crate::calibrate::initial_guess::start::{self, Shared};
use crate::calibrate::residuals::point::Point;
use crate::calibrate::residuals::problem::Problem;
use crate::calibrate::result::fitted::Fit;
use crate::model::law::Law;
use crate::model::{Layout, Model};
use crate::robot::Robot;
use solve::levenberg::{Settings, total_cost};

/// A value by its name among results.
pub(crate) type ByName<'a> = Box<dyn Fn(&str) -> Option<f64> + 'a>;

/// What is known before a search: the end of another one, with fewer laws, more or others.
pub(crate) struct Known<'a> {
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
    /// See [`Trial::block_weights`](super::trial::Trial::block_weights).
    pub block_weights: &'a [f64],
}

/// What a fit knows.
pub(crate) fn known(fit: &Fit) -> Known<'_> {
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
pub(crate) fn warm_start<'m>(
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
pub(crate) fn shared(model: &Model, robot: &Robot, series: &Series, from: &Known<'_>) -> Shared {
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
