//! The structured elimination against a dense one, on small random problems.

mod columns;
mod kernels;
mod overshoot;
mod properties;
mod random;

use nalgebra::{DMatrix, DVector};

use self::random::{Random, Spec, dot, zero};
use super::border::Border;
use super::factor::{self, Factor, StageFactor};
use super::levenberg::{Settings, Status, minimise};
use super::{LeastSquares, Precision, Step};

/// Relative error of a well-scaled step in single precision, whose rounding is 6e-8: it may lose two digits.
const SINGLE: f64 = 1e-5;

fn assert_close(a: f64, b: f64, rtol: f64, atol: f64, what: &str) {
    assert!((a - b).abs() <= atol + rtol * b.abs(), "{what}: {a:e} against {b:e}");
}

#[test]
fn elimination_equals_the_dense_solution() {
    // The normal equations square the condition number: 7e-6 was measured at weight 1e5, less than 1e-9 elsewhere; unknowns are of order one.
    for (seed, (stages, n, m, weight, rtol, leading)) in [
        (7, 4, 3, 1.0, 1e-9, 2),
        (9, 12, 24, 1.0, 1e-9, 16),
        (6, 3, 5, 1e5, 2e-5, 4),
        (12, 13, 1, 1e3, 1e-7, 1),
        (8, 2, 0, 1.0, 1e-9, 0),
        (5, 17, 30, 10.0, 1e-9, 20),
        (9, 5, 8, 1.0, 1e-9, 8),
        (7, 12, 12, 1.0, 1e-9, 0),
        (9, 36, 25, 1.0, 1e-9, 17),
    ]
    .into_iter()
    .enumerate()
    {
        let spec = Spec { seed: seed as u64, stages, n, m, weight, leading: Some(leading), ..Spec::default() };
        let problem = Random::of(&Spec { breaks: vec![stages / 3], ..spec });
        let point = zero(&problem);
        let (jacobian, residual) = problem.dense();
        let normal = jacobian.transpose() * &jacobian;
        // Orthogonal, so that the reference does not square the condition number.
        let qr = jacobian.clone().qr();
        let dense = -qr.r().solve_upper_triangular(&(qr.q().transpose() * &residual)).unwrap();
        let mut factor = Factor::new(&problem).unwrap();
        for threads in [1, 2] {
            factor.factorise(&problem, &point, 0.0, threads).unwrap();
            let (schur, gradient) = factor.schur();
            let border = Border::new(&schur, &gradient, &[]);
            let (shared, _) = border.step(0.0).unwrap();
            let mut step = Step::default();
            factor.back_substitute(&shared, threads, &mut step);
            let all: Vec<f64> = step.states.iter().chain(&step.border).copied().collect();
            for (i, (a, b)) in all.iter().zip(dense.iter()).enumerate() {
                assert_close(*a, *b, rtol, rtol, &format!("seed {seed}, unknown {i}"));
            }
            let covariance = border.covariance().unwrap();
            let inverse = normal.clone().cholesky().unwrap().inverse();
            for i in 0..m {
                let at = stages * n + i;
                assert_close(covariance[(i, i)], inverse[(at, at)], 10.0 * rtol, 1e-12, "variance");
            }
            let left = 2.0 * {
                let mut moved = point.clone();
                problem.retract(&point, &step, &mut moved);
                super::levenberg::total_cost(&problem, &moved, threads)
            };
            let (m, g) = (m, DVector::from_vec(gradient.clone()));
            let promised = 0.5 * (factor.eliminated_square_sum() - left);
            if m > 0 {
                assert_close(promised, -0.5 * g.dot(&DVector::from_vec(shared.clone())), 10.0 * rtol, 1e-9, "decrease");
            }
        }
    }
}

#[test]
fn a_linear_problem_is_solved_in_two_iterations_whatever_the_threads() {
    let problem = Random::new(5, 40, 5, 6, 3.0);
    let solve = |threads| {
        let settings = Settings { threads, initial_damping: 0.0, ..Settings::default() };
        minimise(&problem, zero(&problem), &[], &settings, |_, _| {}).unwrap()
    };
    let (one, two) = (solve(1), solve(2));
    assert_eq!(one.status, Status::Converged);
    assert!(one.iterations.len() <= 2, "{:?}", one.iterations);
    assert_eq!(one.point, two.point, "bit for bit");
    assert_eq!(one.cost.to_bits(), two.cost.to_bits());
}

#[test]
fn the_border_alone_is_that_of_the_whole_factor() {
    let problem = Random::new(13, 23, 7, 9, 3.0);
    let point = zero(&problem);
    let mut factor = Factor::new(&problem).unwrap();
    factor.factorise(&problem, &point, 0.0, 2).unwrap();
    assert_eq!(factor::reduced(&problem, &point, 2).unwrap(), factor.schur(), "bit for bit");
}

#[test]
fn the_memory_of_a_factor_that_is_gone_leaves_no_trace() {
    let problem = Random::new(17, 40, 12, 24, 3.0);
    let point = zero(&problem);
    let solve = || {
        let mut factor = Factor::with_precision(&problem, Precision::Single).unwrap();
        factor.factorise(&problem, &point, 0.0, 2).unwrap();
        let (schur, gradient) = factor.schur();
        let (shared, _) = Border::new(&schur, &gradient, &[]).step(0.0).unwrap();
        let mut step = Step::default();
        factor.back_substitute(&shared, 2, &mut step);
        step.states
    };
    let fresh = solve();
    super::store::spoil_spare();
    assert_eq!(solve(), fresh, "bit for bit");
}

#[test]
fn steps_in_single_precision_are_off_by_its_rounding_and_the_border_not_at_all() {
    let problem = Random::new(17, 40, 12, 24, 3.0);
    let point = zero(&problem);
    let solve = |precision| {
        let mut factor = Factor::with_precision(&problem, precision).unwrap();
        factor.factorise(&problem, &point, 0.0, 2).unwrap();
        let (schur, gradient) = factor.schur();
        let (shared, _) = Border::new(&schur, &gradient, &[]).step(0.0).unwrap();
        let mut step = Step::default();
        factor.back_substitute(&shared, 2, &mut step);
        (schur, DVector::from_vec(step.states))
    };
    let ((schur, double), (same, single)) = (solve(Precision::Double), solve(Precision::Single));
    assert_eq!(schur, same, "bit for bit");
    let off = (&single - &double).norm() / double.norm();
    assert!(off > 1e-10 && off < SINGLE, "{off:e}");
}

#[test]
fn the_factor_of_a_stage_gives_its_step_and_its_place_in_the_chain() {
    let (n, m) = (5, 7);
    let problem = Random::new(21, 19, n, m, 3.0);
    let mut factor = Factor::new(&problem).unwrap();
    factor.factorise(&problem, &zero(&problem), 0.0, 2).unwrap();
    let shared: Vec<f64> = (0..m).map(|j| 0.3 * j as f64 - 1.0).collect();
    let mut step = Step::default();
    factor.back_substitute(&shared, 2, &mut step);
    let mut stage = StageFactor::default();
    let mut ends = 0;
    for k in 0..factor.stages() {
        factor.stage(k, &mut stage);
        let own = &step.states[k * n..][..n];
        let neighbour = factor.neighbour(k);
        ends += usize::from(neighbour.is_none());
        let other = neighbour.map_or(vec![0.0; n], |other| step.states[other * n..][..n].to_vec());
        for i in 0..n {
            // U x + Y x' + Z p + y = 0
            let left = dot(&stage.u[i * n..][..n], own) + dot(&stage.y[i * n..][..n], &other);
            let sum = left + dot(&stage.z[i * m..][..m], &shared) + stage.right[i];
            assert_close(sum, 0.0, 0.0, 1e-10, &format!("stage {k}, row {i}"));
            assert!(stage.u[i * n..][..i].iter().all(|u| *u == 0.0) && stage.u[i * n + i] > 0.0);
        }
    }
    assert_eq!(ends, 1);
}

#[test]
fn a_held_direction_is_not_moved_and_has_no_variance() {
    let problem = Random::new(11, 10, 4, 4, 1.0);
    let held = vec![1.0, -2.0, 0.0, 0.5];
    let settings = Settings::default();
    let solution = minimise(&problem, zero(&problem), std::slice::from_ref(&held), &settings, |_, _| {}).unwrap();
    // The held direction is kept in units of the conditional deviations: no step has a component along it there.
    let (schur, gradient) = (&solution.information, &solution.gradient);
    let border = Border::new(schur, gradient, std::slice::from_ref(&held));
    let covariance = border.covariance().unwrap();
    let information = DMatrix::from_row_slice(4, 4, schur);
    let metric = DVector::from_fn(4, |i, _| information[(i, i)]);
    let along = DVector::from_vec(held).component_mul(&metric);
    assert_close((along.transpose() * &covariance * &along)[0], 0.0, 0.0, 1e-9, "variance along the held direction");
    assert!(covariance.trace() > 0.0);
}

#[test]
fn a_direction_of_which_only_rounding_speaks_can_be_held() {
    let border = Border::new(&[1e-25, 0.0, 0.0, 4.0], &[1e-20, 2.0], &[vec![1.0, 0.0]]);
    let (step, _) = border.step(0.0).unwrap();
    assert_eq!(step, [0.0, -0.5]);
    assert_eq!(border.covariance().unwrap()[(0, 0)], 0.0);
}

#[test]
fn what_two_columns_say_alike_is_held_and_the_rest_is_told() {
    // The sum of two unknowns, and a third one.
    let schur = [4.0, 4.0, 0.0, 4.0, 4.0, 0.0, 0.0, 0.0, 1.0];
    let mut border = Border::new(&schur, &[2.0, 2.0, 1.0], &[]);
    assert!(border.covariance().is_none());
    border.hold_undetermined();
    let covariance = border.covariance().unwrap();
    let sum = covariance[(0, 0)] + 2.0 * covariance[(0, 1)] + covariance[(1, 1)];
    assert_close(sum, 0.25, 1e-12, 0.0, "variance of the sum");
    assert_close(covariance[(2, 2)], 1.0, 1e-12, 0.0, "variance of the third");
    let (step, _) = border.step(0.0).unwrap();
    assert_close(step[0] + step[1], -0.5, 1e-12, 0.0, "step of the sum");
    // What is determined stays free.
    let mut regular = Border::new(&[4.0, 1.0, 1.0, 2.0], &[0.0, 0.0], &[]);
    let before = regular.covariance().unwrap();
    regular.hold_undetermined();
    assert_eq!(regular.covariance().unwrap(), before);
}

#[test]
fn a_stage_without_information_is_reported() {
    let mut problem = Random::new(4, 9, 3, 2, 1.0);
    problem.rows[2].clear();
    problem.transitions[1] = None;
    problem.transitions[2] = None;
    let mut factor = Factor::new(&problem).unwrap();
    let singular = factor.factorise(&problem, &zero(&problem), 0.0, 2).unwrap_err();
    assert_eq!(singular.stage, 2);
}
