//! The rows of the problem against central differences, on a short made-up series.

use rand::{RngExt, SeedableRng, rngs::StdRng};

use super::data::series::Series;
use super::identifiability::observability::comparable_misalignments;
use super::initial_guess::start;
use super::residuals::point::Point;
use super::residuals::preset::Preset;
use super::residuals::problem::Problem;
use crate::model::Model;
use crate::robot::Robot;
use solve::{BATCH, LeastSquares, Stage, Step};

/// Doggy with a gyro that is read late, so that rows depend on the accelerations too.
fn robot() -> Robot {
    let text = include_str!("../../../robot_model/src/robot/builtin/doggy.toml");
    assert!(text.contains("sigma_rad_s = 1.745e-3"));
    let late = if text.contains("offset_us") {
        text.to_string()
    } else {
        text.replace("sigma_rad_s = 1.745e-3", "sigma_rad_s = 1.745e-3\noffset_us = 200")
    };
    Robot::parse(&late).unwrap()
}

fn random_point<'m>(model: &'m Model, robot: &Robot, series: &Series, seed: u64) -> Point<'m> {
    let mut rng = StdRng::seed_from_u64(seed);
    let mut point = start::start(model, robot, series).point;
    for x in &mut point.states {
        *x += rng.random_range(-0.3..0.3);
    }
    point
}

/// All whitened rows of the stages of the batch that stage k is in, `[∂r/∂x | ∂r/∂p | r]`, and those of the transition at its end.
fn rows<'m>(problem: &Problem<'m>, point: &Point<'m>, k: usize) -> (Vec<Vec<f64>>, Vec<Vec<f64>>) {
    let shape = problem.shape();
    let first = k / BATCH * BATCH;
    let mut batch = vec![Stage::empty(shape); BATCH.min(shape.stages - first)];
    problem.linearise(point, first, &mut problem.scratch(), &mut batch);
    let stage = &batch[k - first];
    (stage.dense_rows(), stage.dense_transition())
}

/// All whitened residuals of stage k, in the order of its rows.
fn residuals<'m>(problem: &Problem<'m>, point: &Point<'m>, k: usize) -> Vec<f64> {
    rows(problem, point, k).0.into_iter().filter_map(|row| row.last().copied()).collect()
}

#[test]
fn four_stages_at_once_are_those_of_the_generic_walk() {
    let robot = Robot::builtin("doggy").unwrap();
    let model = Model::new(&robot);
    // A batch and a half; a gap, readings that are missing, and a rest.
    let mut series = Series::made_up(&robot, 7, 3);
    series.spoil(&[(1, 4), (2, 0), (4, 7)], 2);
    for preset in [Preset::Default, Preset::Paper] {
        let fast = Problem::new(&model, &robot, &series, preset.assumptions());
        assert!(fast.fast.is_some(), "doggy is covered");
        let generic = Problem::new(&model, &robot, &series, preset.assumptions()).generic();
        let point = random_point(&model, &robot, &series, 5);
        for k in 0..7 {
            let (fast_rows, fast_step) = rows(&fast, &point, k);
            let (slow_rows, step) = rows(&generic, &point, k);
            assert_eq!((fast_rows.len(), fast_step.len()), (slow_rows.len(), step.len()), "{preset:?}, stage {k}");
            assert_eq!(step.is_empty(), k == 2 || k == 6);
            for (found, expected) in fast_rows.iter().zip(&slow_rows).chain(fast_step.iter().zip(&step)) {
                let largest = expected.iter().fold(0.0f64, |a, b| a.max(b.abs()));
                for (column, (found, expected)) in found.iter().zip(expected).enumerate() {
                    // rtol 1e-12 of the row's largest entry
                    let off = (found - expected).abs();
                    assert!(off <= 1e-12 * largest, "{preset:?}, stage {k}, {column}: {found} against {expected}");
                }
            }
        }
        let count: usize = (0..7).map(|k| rows(&generic, &point, k)).map(|(rows, step)| rows.len() + step.len()).sum();
        assert_eq!(fast.row_count(&point), count, "{preset:?}");
        let cost = |problem: &Problem<'_>| problem.cost(&point, 0..7, &mut problem.scratch());
        let (found, expected) = (cost(&fast), cost(&generic));
        assert!((found / expected - 1.0).abs() < 1e-12, "{preset:?}: cost {found} against {expected}");
        let squares = (0..7).flat_map(|k| {
            let (rows, step) = rows(&fast, &point, k);
            rows.into_iter().chain(step).map(|row| row[row.len() - 1].powi(2))
        });
        assert!((0.5 * squares.sum::<f64>() / found - 1.0).abs() < 1e-12, "{preset:?}: the cost is that of the rows");
    }
}

#[test]
fn rows_of_both_presets_have_the_slopes_of_differences() {
    let robot = robot();
    rows_have_the_slopes_of_differences(&robot, &Series::made_up(&robot, 6, 3), &[Preset::Default, Preset::Paper]);
}

/// Before and after their stages, with lags that are estimated.
#[test]
fn rows_of_gyros_with_instants_have_the_slopes_of_differences() {
    let robot = Robot::builtin("doggy").unwrap().with_free_lags();
    let series = Series::made_up(&robot, 6, 3).with_instants(|k, gyro| [-2e-4, 5e-4][(k + gyro) % 2]);
    rows_have_the_slopes_of_differences(&robot, &series, &[Preset::Default]);
}

fn rows_have_the_slopes_of_differences(robot: &Robot, series: &Series, presets: &[Preset]) {
    let model = Model::new(robot);
    for &preset in presets {
        let problem = Problem::new(&model, robot, series, preset.assumptions());
        let point = random_point(&model, robot, series, 8);
        let (n, m) = (problem.shape().stage, problem.shape().border);
        // Stage 0 has input zero and the paper's bias rows; stage 3 has input.
        for k in [0, 3] {
            let (slopes, _) = rows(&problem, &point, k);
            let count = residuals(&problem, &point, k).len();
            assert!(count >= 7, "{preset:?}: {count} rows");
            for column in 0..n + m {
                let moved = |sign: f64| {
                    let mut step = Step { states: vec![0.0; problem.shape().stages * n], border: vec![0.0; m] };
                    let by = sign * 1e-6;
                    if column < n {
                        step.states[k * n + column] = by;
                    } else {
                        step.border[column - n] = by;
                    }
                    let mut to = point.clone();
                    problem.retract(&point, &step, &mut to);
                    residuals(&problem, &to, k)
                };
                for (row, (plus, minus)) in moved(1.0).iter().zip(moved(-1.0)).enumerate() {
                    let expected = (plus - minus) / 2e-6;
                    let found = slopes[row][column];
                    // Weights reach 1.4e4 a radian; residuals of 1e5 σ lose 1e-11 of themselves over 2e-6.
                    let tolerance = 1e-5 * expected.abs() + 2e-2;
                    assert!(
                        (found - expected).abs() < tolerance,
                        "{preset:?}, stage {k}, row {row}, column {column}: {found} against {expected}"
                    );
                }
            }
        }
    }
}

#[test]
fn a_turn_that_the_build_hides_is_taken_out_of_a_known_misalignment() {
    let robot = Robot::builtin("doggy").unwrap();
    let [first, second] = comparable_misalignments(&robot, &[[0.02, -0.03, 0.05], [0.01, 0.02, -0.03]])[..] else {
        panic!("doggy has two gyros")
    };
    assert!(first[2].abs() < 1e-12, "{first:?}");
    // The axis as gyro 1 sees it stays where it was: x and y change in second order only.
    assert!((first[0] - 0.02).abs() < 1e-3 && (first[1] + 0.03).abs() < 1e-3, "{first:?}");
    for (a, b) in second.iter().zip([0.01, 0.02, -0.03]) {
        assert!((a - b).abs() < 1e-12, "gyro 2 sees all turns: {second:?}");
    }
}

#[test]
fn an_excerpt_is_the_rest_and_windows_of_the_motion() {
    let series = Series::made_up(&robot(), 3000, 200);
    let part = series.excerpt(800, 8).unwrap();
    // The start of the rest and eight windows of 100 samples, each a run of its own.
    assert_eq!((part.stages(), part.segments.len(), part.rest[0].clone()), (900, 9, 0..100));
    assert_eq!((part.recordings.len(), part.recordings[0].clone()), (1, 0..900));
    assert_eq!((part.measured(0), part.measured(899)), (series.measured(0), series.measured(2999)));
    assert!(part.segments.iter().all(|run| part.duration_s(run.end - 1).is_nan() && part.starts_run(run.start)));
    assert!(series.excerpt(1001, 8).is_none(), "more than a third");
}
