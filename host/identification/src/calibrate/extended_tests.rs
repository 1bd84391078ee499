//! The laws of the whole catalogue inside the estimator: slopes against differences, and nothing where their parameters are null.

use rand::{RngExt, SeedableRng, rngs::StdRng};

use super::data::series::Series;
use super::extension::laws;
use super::initial_guess::start;
use super::residuals::preset::Preset;
use super::residuals::problem::Problem;
use crate::effect::{CATALOGUE, Effect, EffectError};
use crate::model::Model;
use crate::robot::Robot;
use solve::{LeastSquares, Stage, Step};

/// Effects that are nothing at the start values of their laws, beside a word of what makes that so.
const NULL_AT_START: [&str; 21] = [
    "input_delay",
    "pwm_dead_zone",
    "voltage_sag",
    "motor_mismatch",
    "cogging",
    "torque_offset",
    "belt_hardening",
    "belt_slack_side",
    "belt_tooth_skip",
    "viscous_friction",
    "asymmetric_friction",
    "load_friction",
    "position_friction",
    "friction_drift",
    "link_friction",
    "quadratic_drag",
    "gravity_residual",
    "cable_spring",
    "coriolis",
    "link_inertia",
    "gyro_bias_drift",
];

/// All whitened rows of stage k, its transition behind them: `[∂r/∂x | ∂r/∂p | r]`.
fn rows<'m>(problem: &Problem<'m>, point: &super::residuals::point::Point<'m>, k: usize) -> Vec<Vec<f64>> {
    let mut batch = vec![Stage::empty(problem.shape()); 4];
    problem.linearise(point, k / 4 * 4, &mut problem.scratch(), &mut batch);
    let mut rows = batch[k % 4].dense_rows();
    rows.extend(batch[k % 4].dense_transition());
    rows
}

fn with_law(robot: &Robot, effect: &Effect) -> Option<Model> {
    let law = effect.laws(robot).ok()?.swap_remove(0);
    Some(Model::extended(robot, vec![law]).unwrap())
}

/// The model with the first and with the last of the law's alternatives.
fn with_ends(robot: &Robot, effect: &Effect) -> Vec<Model> {
    let mut laws = effect.laws(robot).unwrap_or_default();
    let last = if laws.len() > 1 { laws.pop() } else { None };
    laws.truncate(1);
    laws.extend(last);
    laws.into_iter().map(|law| Model::extended(robot, vec![law]).unwrap()).collect()
}

#[test]
fn rows_under_every_law_have_the_slopes_of_differences() {
    for robot in ["doggy", "one_joint", "emps"].map(|name| Robot::builtin(name).unwrap()) {
        let mut suited = 0;
        for (effect, model) in
            CATALOGUE.iter().flat_map(|effect| with_ends(&robot, effect).into_iter().map(move |model| (effect, model)))
        {
            suited += 1;
            let series = Series::made_up(&robot, 12, 3);
            let assumptions = laws::assumptions(model.laws(), Preset::Default);
            let mut problem = Problem::new(&model, &robot, &series, assumptions);
            let mut shared = start::shared(&model, &robot, &series);
            let mut rng = StdRng::seed_from_u64(3);
            let base = model.coordinates().iter().count();
            for z in &mut shared.z[base..] {
                // Off null and off kinks: the delay of a sample and a half, gaps of milliradians.
                *z += if *z == 0.0 { rng.random_range(1.2e-3..1.8e-3) } else { 0.1 * rng.random_range(-1.0..1.0) };
            }
            for (coordinate, [low, high]) in model.coordinates().bounds() {
                // Where a search may go: a step from outside would begin with one to there.
                if !(low..high).contains(&shared.z[coordinate]) {
                    shared.z[coordinate] = low + 0.6 * (high - low);
                }
            }
            problem.shift_readings(&shared.z);
            let mut point = start::with_states(&model, &series, shared);
            point.states.iter_mut().for_each(|x| *x += rng.random_range(-0.3..0.3));
            let (n, m) = (problem.shape().stage, problem.shape().border);
            let k = 5;
            let slopes = rows(&problem, &point, k);
            assert!(slopes.len() > n, "{}: {} rows", effect.id, slopes.len());
            for column in 0..n + m {
                let by =
                    if column < n { 1e-7 } else { 1e-7 * point.z.get(column - n).map_or(1.0, |z| z.abs().max(1e-3)) };
                let moved = |sign: f64| {
                    let mut step = Step { states: vec![0.0; problem.shape().stages * n], border: vec![0.0; m] };
                    if column < n {
                        step.states[k * n + column] = sign * by;
                    } else {
                        step.border[column - n] = sign * by;
                    }
                    let mut to = point.clone();
                    problem.retract(&point, &step, &mut to);
                    rows(&problem, &to, k)
                };
                for (row, (plus, minus)) in moved(1.0).iter().zip(&moved(-1.0)).enumerate() {
                    let expected = (plus[n + m] - minus[n + m]) / (2.0 * by);
                    let found = slopes[row][column];
                    let largest = slopes[row][..n].iter().fold(0.0f64, |a, b| a.max(b.abs()));
                    // What rounding leaves of residuals of 1e6 σ in a difference, and 1e-4 of the value for what is not linear in it.
                    let rounding = 1e-15 * plus[n + m].abs().max(largest) / by;
                    let tolerance = 1e-4 * expected.abs() + 10.0 * rounding + 1e-7 * largest;
                    assert!(
                        (found - expected).abs() <= tolerance,
                        "{} on {}: row {row}, column {column} of {n} + {m}: {found:e} against {expected:e} ± {tolerance:e}",
                        effect.id,
                        robot.name
                    );
                }
            }
        }
        let least = if robot.name == "emps" { 8 } else { 15 };
        assert!(suited >= least, "{}: {suited} effects", robot.name);
    }
}

#[test]
fn four_stages_at_once_are_those_of_the_generic_walk_under_every_law_that_the_kernel_covers() {
    let robot = Robot::builtin("doggy").unwrap();
    let mut series = Series::made_up(&robot, 8, 3);
    series.spoil(&[(1, 4), (4, 7)], 2);
    let pairs = [
        ["voltage_sag", "asymmetric_friction"],
        ["base_bearing", "structure_mode"],
        ["base_bearing", "asymmetric_friction"],
        ["voltage_sag", "structure_mode"],
        ["belt_hysteresis", "gyro_lag"],
        ["electrical_lag", "base_bearing"],
    ];
    let pairs = pairs.map(|pair| pair.map(|id| Effect::by_id(id).unwrap()).to_vec());
    let alone = CATALOGUE.into_iter().map(|effect| vec![effect]);
    let mut covered = Vec::new();
    for effects in alone.chain(pairs) {
        let ids: Vec<&str> = effects.iter().map(|effect| effect.id).collect();
        let Ok(laws) =
            effects.iter().map(|effect| Ok(effect.laws(&robot)?.swap_remove(0))).collect::<Result<_, EffectError>>()
        else {
            continue;
        };
        let model = Model::extended(&robot, laws).unwrap();
        for preset in [Preset::Default, Preset::Paper] {
            let assumptions = || laws::assumptions(model.laws(), preset);
            let fast = Problem::new(&model, &robot, &series, assumptions());
            if fast.fast.is_none() {
                assert!(effects.len() == 1, "{ids:?} is not covered");
                continue;
            }
            let generic = Problem::new(&model, &robot, &series, assumptions()).generic();
            let name = format!("{} {preset:?}", ids.join(" + "));
            let mut shared = start::shared(&model, &robot, &series);
            let mut rng = StdRng::seed_from_u64(6);
            shared.z.iter_mut().for_each(|z| *z += 0.01 * rng.random_range(-1.0..1.0));
            let mut point = start::with_states(&model, &series, shared);
            point.states.iter_mut().for_each(|x| *x += rng.random_range(-0.3..0.3));
            for k in 0..8 {
                let (found, expected) = (rows(&fast, &point, k), rows(&generic, &point, k));
                assert_eq!(found.len(), expected.len(), "{name}, stage {k}");
                for (found, expected) in found.iter().zip(&expected) {
                    let largest = expected.iter().fold(0.0f64, |a, b| a.max(b.abs()));
                    for (column, (found, expected)) in found.iter().zip(expected).enumerate() {
                        // rtol 1e-11 of the row's largest entry
                        let off = (found - expected).abs();
                        assert!(off <= 1e-11 * largest, "{name}, stage {k}, {column}: {found} against {expected}");
                    }
                }
            }
            let cost = |problem: &Problem<'_>| problem.cost(&point, 0..8, &mut problem.scratch());
            let (found, expected) = (cost(&fast), cost(&generic));
            assert!((found / expected - 1.0).abs() < 1e-11, "{name}: cost {found} against {expected}");
            covered.push(name);
        }
    }
    eprintln!("covered: {}", covered.join(", "));
    // Measured: 33 laws and the six pairs, by both presets.
    assert!(covered.len() >= 78, "{} {covered:?}", covered.len());
}

#[test]
fn null_parameters_give_the_base_model_to_the_last_digits() {
    let robot = Robot::builtin("doggy").unwrap();
    let base = Model::new(&robot);
    let series = Series::made_up(&robot, 6, 3);
    let mut rng = StdRng::seed_from_u64(4);
    let x: Vec<f64> = (0..base.layout().size()).map(|_| rng.random_range(-0.3..0.3)).collect();
    let z = base.coordinates().start();
    let mut expected = vec![0.0; x.len()];
    base.at(&z).derivative(&x, series.input(4), &mut expected);
    for id in NULL_AT_START {
        let model = with_law(&robot, Effect::by_id(id).unwrap()).unwrap();
        assert_eq!(model.layout(), base.layout(), "{id}");
        let mut found = vec![0.0; x.len()];
        model.at(&model.coordinates().start()).derivative(&x, series.input(4), &mut found);
        for (found, expected) in found.iter().zip(&expected) {
            // rtol 1e-12, atol 1e-12 rad/s²: the order of multiplications differs
            assert!((found - expected).abs() < 1e-12 * (1.0 + expected.abs()), "{id}: {found} against {expected}");
        }
    }
    // A gap of no width is no gap.
    let model = with_law(&robot, Effect::by_id("backlash").unwrap()).unwrap();
    let mut z = model.coordinates().start();
    z[base.coordinates().len()..].fill(0.0);
    let mut found = vec![0.0; x.len()];
    model.at(&z).derivative(&x, series.input(4), &mut found);
    for (found, expected) in found.iter().zip(&expected) {
        assert!((found - expected).abs() < 1e-10 * (1.0 + expected.abs()), "backlash: {found} against {expected}");
    }
}
