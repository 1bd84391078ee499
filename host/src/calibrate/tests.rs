//! The rows of the problem against central differences, on a short made-up series.

use rand::{RngExt, SeedableRng, rngs::StdRng};

use super::series::Series;
use super::{Point, Preset, Problem, comparable_misalignments, start};
use crate::model::Model;
use crate::robot::Robot;
use crate::solve::{LeastSquares, Step};

/// Doggy with a gyro that is read late, so that rows depend on the accelerations too.
fn robot() -> Robot {
    let text = include_str!("../robot/builtin/doggy.toml");
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
    let mut point = start::start(model, robot, series);
    for x in &mut point.states {
        *x += rng.random_range(-0.3..0.3);
    }
    point
}

/// All whitened residuals of stage k, in the order of its rows.
fn residuals<'m>(problem: &Problem<'m>, point: &Point<'m>, k: usize) -> Vec<f64> {
    let mut list = Vec::new();
    problem.sensor_rows(point, k, &mut problem.scratch(), false, &mut |row| list.push(row.weight * row.residual));
    list
}

#[test]
fn rows_of_both_presets_have_the_slopes_of_differences() {
    let robot = robot();
    let model = Model::new(&robot);
    let series = Series::made_up(&robot, 6, 3);
    for preset in [Preset::Default, Preset::Paper] {
        let problem = Problem::new(&model, &robot, &series, preset.assumptions());
        let point = random_point(&model, &robot, &series, 8);
        let (n, m) = (problem.stage_size(), problem.border_size());
        // Stage 0 has input zero and the paper's bias rows; stage 3 has input.
        for k in [0, 3] {
            let slopes = problem.dense_rows(&point, k);
            let count = residuals(&problem, &point, k).len();
            assert!(count >= 7, "{preset:?}: {count} rows");
            for column in 0..n + m {
                let moved = |sign: f64| {
                    let mut step = Step { states: vec![0.0; problem.stages() * n], border: vec![0.0; m] };
                    let by = sign * 1e-6;
                    if column < n {
                        step.states[k * n + column] = by;
                    } else {
                        step.border[column - n] = by;
                    }
                    residuals(&problem, &problem.retract(&point, &step), k)
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
