//! The structured elimination against a dense one, on small random problems.

use nalgebra::{DMatrix, DVector};
use rand::{RngExt, SeedableRng, rngs::StdRng};

use super::border::Border;
use super::factor::Factor;
use super::levenberg::{Settings, Status, minimise};
use super::{LeastSquares, Shape, Stage, Step};

/// ∂r/∂x, ∂r/∂p, r.
type RandomRow = (Vec<f64>, Vec<f64>, f64);
/// ∂φ/∂x, ∂φ/∂p, φ − x', weight.
type RandomStep = (Vec<f64>, Vec<f64>, f64, f64);

/// Random linear rows and transitions, some links broken.
struct Random {
    n: usize,
    m: usize,
    leading: usize,
    sensed: usize,
    rows: Vec<Vec<RandomRow>>,
    transitions: Vec<Option<Vec<RandomStep>>>,
    border: (Vec<f64>, f64),
}

impl Random {
    fn new(seed: u64, stages: usize, n: usize, m: usize, weight: f64) -> Self {
        let mut rng = StdRng::seed_from_u64(seed);
        let mut vector = |len: usize| -> Vec<f64> { (0..len).map(|_| rng.random_range(-1.0..1.0)).collect() };
        // Transitions leave some of the shared unknowns out, sensor rows the others and some states, unit rows all but one.
        let (leading, sensed) = (m - m / 3, n - n / 2);
        let row = |i: usize, mut row: RandomRow| {
            match reach(i, n) {
                Reach::All => {}
                Reach::Sensor => {
                    row.0[sensed..].fill(0.0);
                    row.1[..leading].fill(0.0);
                }
                Reach::Unit => {
                    (0..n).filter(|j| *j != i % n).for_each(|j| row.0[j] = 0.0);
                    row.1.fill(0.0);
                }
            }
            row
        };
        let rows = (0..stages)
            .map(|_| (0..2 * n + 1).map(|i| row(i, (vector(n), vector(m), vector(1)[0]))).collect())
            .collect();
        let transitions = (0..stages)
            .map(|k| {
                (k + 1 < stages && k != stages / 3).then(|| {
                    let step = |_| {
                        let mut step = (vector(n), vector(m), vector(1)[0], weight * (1.5 + vector(1)[0]));
                        step.1[leading..].fill(0.0);
                        step
                    };
                    (0..n).map(step).collect()
                })
            })
            .collect();
        Random { n, m, leading, sensed, rows, transitions, border: (vector(m), vector(1)[0]) }
    }

    /// All whitened rows as a dense Jacobian and residual at the point zero.
    fn dense(&self) -> (DMatrix<f64>, DVector<f64>) {
        let unknowns = self.rows.len() * self.n + self.m;
        let mut jacobian: Vec<Vec<f64>> = Vec::new();
        let mut residual = Vec::new();
        let shared = self.rows.len() * self.n;
        for (k, rows) in self.rows.iter().enumerate() {
            for (x, p, r) in rows {
                let mut row = vec![0.0; unknowns];
                row[k * self.n..(k + 1) * self.n].copy_from_slice(x);
                row[shared..].copy_from_slice(p);
                jacobian.push(row);
                residual.push(*r);
            }
            for (i, (x, p, r, w)) in self.transitions[k].iter().flatten().enumerate() {
                let mut row = vec![0.0; unknowns];
                for (a, b) in row[k * self.n..].iter_mut().zip(x) {
                    *a = w * b;
                }
                row[(k + 1) * self.n + i] = -w;
                for (a, b) in row[shared..].iter_mut().zip(p) {
                    *a = w * b;
                }
                jacobian.push(row);
                residual.push(w * r);
            }
        }
        let mut row = vec![0.0; unknowns];
        row[shared..].copy_from_slice(&self.border.0);
        jacobian.push(row);
        residual.push(self.border.1);
        let jacobian = DMatrix::from_fn(jacobian.len(), unknowns, |i, j| jacobian[i][j]);
        (jacobian, DVector::from_vec(residual))
    }
}

impl Random {
    fn reach(&self, i: usize) -> Reach {
        reach(i, self.n)
    }

    fn stage_cost(&self, point: &Step, k: usize) -> f64 {
        let state = &point.states[k * self.n..(k + 1) * self.n];
        let rows = self.rows[k].iter().map(|(x, p, r)| r + dot(x, state) + dot(p, &point.border));
        let links = self.transitions[k].iter().flatten().enumerate().map(|(i, (x, p, r, w))| {
            w * (r + dot(x, state) + dot(p, &point.border) - point.states[(k + 1) * self.n + i])
        });
        rows.chain(links).map(|r| 0.5 * r * r).sum()
    }
}

/// What row i of a stage of n unknowns touches.
enum Reach {
    All,
    Sensor,
    Unit,
}

fn reach(i: usize, n: usize) -> Reach {
    match i {
        i if i <= n => Reach::All,
        i if i % 2 == 0 => Reach::Sensor,
        _ => Reach::Unit,
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

impl LeastSquares for Random {
    type Point = Step;
    type Scratch = ();
    fn scratch(&self) {}
    fn shape(&self) -> Shape {
        Shape { stages: self.rows.len(), stage: self.n, border: self.m, leading: self.leading, sensed: self.sensed }
    }
    fn linearise(&self, point: &Step, first: usize, _: &mut (), batch: &mut [Stage]) {
        for (k, stage) in (first..).zip(batch) {
            stage.clear();
            let state = &point.states[k * self.n..(k + 1) * self.n];
            for (i, (x, p, r)) in self.rows[k].iter().enumerate() {
                let residual = r + dot(x, state) + dot(p, &point.border);
                match self.reach(i) {
                    Reach::Unit => stage.unit_row(i % self.n, x[i % self.n], residual),
                    Reach::Sensor => fill(stage.sensor_row(residual), 1.0, &x[..self.sensed], p, self.leading),
                    Reach::All => fill(stage.row(residual), 1.0, x, p, 0),
                }
            }
            for (i, (x, p, r, w)) in self.transitions[k].iter().flatten().enumerate() {
                let defect = r + dot(x, state) + dot(p, &point.border) - point.states[(k + 1) * self.n + i];
                fill(stage.transition_row(i, *w, w * defect), *w, x, &p[..self.leading], 0);
            }
        }
    }
    fn border_rows(&self, point: &Step, stage: &mut Stage) {
        let row = stage.row(self.border.1 + dot(&self.border.0, &point.border));
        fill(row, 1.0, &[], &self.border.0, 0);
    }
    fn border_cost(&self, point: &Step) -> f64 {
        0.5 * (self.border.1 + dot(&self.border.0, &point.border)).powi(2)
    }
    fn cost(&self, point: &Step, stages: std::ops::Range<usize>, _: &mut ()) -> f64 {
        stages.map(|k| self.stage_cost(point, k)).sum()
    }
    fn retract(&self, point: &Step, step: &Step, to: &mut Step) {
        let add = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a + b).collect();
        *to = Step { states: add(&point.states, &step.states), border: add(&point.border, &step.border) };
    }
}

/// Adds whitened slopes to a row; shared unknowns before `first` are known to be zero there.
fn fill(mut row: super::Row<'_>, weight: f64, x: &[f64], p: &[f64], first: usize) {
    for (i, x) in x.iter().enumerate() {
        row.add_state(i, weight * x);
    }
    for (j, p) in p.iter().enumerate().skip(first) {
        row.add_shared(j, weight * p);
    }
}

fn zero(problem: &Random) -> Step {
    Step { states: vec![0.0; problem.rows.len() * problem.n], border: vec![0.0; problem.m] }
}

fn assert_close(a: f64, b: f64, rtol: f64, atol: f64, what: &str) {
    assert!((a - b).abs() <= atol + rtol * b.abs(), "{what}: {a:e} against {b:e}");
}

#[test]
fn elimination_equals_the_dense_solution() {
    // The normal equations square the condition number: 7e-6 was measured at weight 1e5, less than 1e-9 elsewhere; unknowns are of order one.
    for (seed, (stages, n, m, weight, rtol)) in [
        (7, 4, 3, 1.0, 1e-9),
        (9, 12, 24, 1.0, 1e-9),
        (6, 3, 5, 1e5, 2e-5),
        (12, 13, 1, 1e3, 1e-7),
        (8, 2, 0, 1.0, 1e-9),
        (5, 17, 30, 10.0, 1e-9),
    ]
    .into_iter()
    .enumerate()
    {
        let problem = Random::new(seed as u64, stages, n, m, weight);
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
fn a_held_direction_is_not_moved_and_has_no_variance() {
    let problem = Random::new(11, 10, 4, 4, 1.0);
    let held = vec![1.0, -2.0, 0.0, 0.5];
    let settings = Settings::default();
    let solution = minimise(&problem, zero(&problem), std::slice::from_ref(&held), &settings, |_, _| {}).unwrap();
    // The held direction is kept in units of the conditional deviations: no step has a component along it there.
    let (schur, gradient) = solution.factor.schur();
    let border = Border::new(&schur, &gradient, std::slice::from_ref(&held));
    let covariance = border.covariance().unwrap();
    let information = DMatrix::from_row_slice(4, 4, &schur);
    let metric = DVector::from_fn(4, |i, _| information[(i, i)]);
    let along = DVector::from_vec(held).component_mul(&metric);
    assert_close((along.transpose() * &covariance * &along)[0], 0.0, 0.0, 1e-9, "variance along the held direction");
    assert!(covariance.trace() > 0.0);
}

#[test]
fn a_direction_of_which_only_rounding_speaks_can_be_held() {
    let border = Border::new(&[1e-25, 0.0, 0.0, 4.0], &[1e-20, 2.0], &[vec![1.0, 0.0]]);
    assert!(border.touches_held(0) && !border.touches_held(1));
    let (step, _) = border.step(0.0).unwrap();
    assert_eq!(step, [0.0, -0.5]);
    assert_eq!(border.covariance().unwrap()[(0, 0)], 0.0);
}

#[test]
fn an_undetermined_shared_unknown_is_found() {
    let mut problem = Random::new(3, 12, 3, 4, 1.0);
    for (_, p, _) in problem.rows.iter_mut().flatten() {
        p[2] = 2.0 * p[1];
    }
    for (_, p, _, _) in problem.transitions.iter_mut().flatten().flatten() {
        p[2] = 2.0 * p[1];
    }
    problem.border.0[2] = 2.0 * problem.border.0[1];
    let mut factor = Factor::new(&problem).unwrap();
    factor.factorise(&problem, &zero(&problem), 0.0, 2).unwrap();
    let (schur, gradient) = factor.schur();
    let mut border = Border::new(&schur, &gradient, &[]);
    let weak = border.weak_directions(1e-9);
    assert_eq!(weak.len(), 1, "{weak:?}");
    let direction = border.in_own_units(&weak[0]);
    assert_close(direction[2] / direction[1], -0.5, 1e-6, 0.0, "the combination that the data cannot see");
    border.hold(&direction);
    assert!(border.weak_directions(1e-9).is_empty());
    assert!(border.touches_held(1) && border.touches_held(2) && !border.touches_held(0));
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
