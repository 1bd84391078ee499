//! Small random problems that can be written down densely.

use nalgebra::{DMatrix, DVector};
use rand::{RngExt, SeedableRng, rngs::StdRng};

use super::super::{LeastSquares, Row, Shape, Stage, Step};

/// ∂r/∂x, ∂r/∂p, r.
type RandomRow = (Vec<f64>, Vec<f64>, f64);
/// ∂φ/∂x, ∂φ/∂p, φ − x', weight.
type RandomStep = (Vec<f64>, Vec<f64>, f64, f64);

/// What a random problem is like.
#[derive(Debug, Clone, Default)]
pub struct Spec {
    pub seed: u64,
    pub stages: usize,
    /// Unknowns of a stage, and of the border.
    pub n: usize,
    pub m: usize,
    /// Typical weight of transitions.
    pub weight: f64,
    /// Powers of ten of the weights of rows by their reach: all, sensor, unit.
    pub decades: [f64; 3],
    /// The units of all unknowns are spread over 10^±units.
    pub units: f64,
    /// Stages without a transition; the last one has none anyway.
    pub breaks: Vec<usize>,
    /// Stages without rows of their own.
    pub quiet: Vec<usize>,
    /// Makes all slopes by the last shared unknown twice those by the first.
    pub dependent: bool,
    /// How many of the shared unknowns, the first ones, transitions touch: two thirds of them where nothing is said. Sensor rows touch the others.
    pub leading: Option<usize>,
}

/// Random linear rows and transitions, some links broken.
pub struct Random {
    pub n: usize,
    pub m: usize,
    leading: usize,
    sensed: usize,
    pub rows: Vec<Vec<RandomRow>>,
    pub transitions: Vec<Option<Vec<RandomStep>>>,
    pub border: (Vec<f64>, f64),
}

impl Random {
    /// A well-scaled problem with one break.
    pub fn new(seed: u64, stages: usize, n: usize, m: usize, weight: f64) -> Self {
        Random::of(&Spec { seed, stages, n, m, weight, breaks: vec![stages / 3], ..Spec::default() })
    }

    pub fn of(spec: &Spec) -> Self {
        let Spec { seed, stages, n, m, weight, .. } = *spec;
        let mut rng = StdRng::seed_from_u64(seed);
        let mut vector = |len: usize| -> Vec<f64> { (0..len).map(|_| rng.random_range(-1.0..1.0)).collect() };
        // Transitions leave some of the shared unknowns out, sensor rows the others and some states, unit rows all but one.
        let (leading, sensed) = (spec.leading.unwrap_or(m - m / 3), n - n / 2);
        let row = |i: usize, mut row: RandomRow| {
            let reach = reach(i, n);
            match reach {
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
            let scale = 10f64.powf(spec.decades[reach as usize]);
            row.0.iter_mut().chain(&mut row.1).for_each(|slope| *slope *= scale);
            row.2 *= scale;
            row
        };
        let rows = (0..stages)
            .map(|_| (0..2 * n + 1).map(|i| row(i, (vector(n), vector(m), vector(1)[0]))).collect())
            .collect();
        let transitions = (0..stages)
            .map(|k| {
                (k + 1 < stages && !spec.breaks.contains(&k)).then(|| {
                    let step = |_| {
                        let mut step = (vector(n), vector(m), vector(1)[0], weight * (1.5 + vector(1)[0]));
                        step.1[leading..].fill(0.0);
                        step
                    };
                    (0..n).map(step).collect()
                })
            })
            .collect();
        let border = (vector(m), vector(1)[0]);
        let (own, shared) = (vector(n), vector(m));
        let mut problem = Random { n, m, leading, sensed, rows, transitions, border };
        for k in &spec.quiet {
            problem.rows[*k].clear();
        }
        if spec.dependent {
            problem.make_dependent(0, m - 1);
        }
        let unit = |share: &f64| 10f64.powf(spec.units * share);
        problem.change_units(&own.iter().map(unit).collect::<Vec<_>>(), &shared.iter().map(unit).collect::<Vec<_>>());
        problem
    }

    /// The same problem in other units of a stage's unknowns and the shared ones.
    fn change_units(&mut self, own: &[f64], shared: &[f64]) {
        let scale = |slopes: &mut [f64], by: &[f64]| slopes.iter_mut().zip(by).for_each(|(slope, by)| *slope *= by);
        for (x, p, _) in self.rows.iter_mut().flatten() {
            scale(x, own);
            scale(p, shared);
        }
        for steps in self.transitions.iter_mut().flatten() {
            for ((x, p, r, w), unit) in steps.iter_mut().zip(own) {
                scale(x, own);
                scale(p, shared);
                x.iter_mut().chain(p).chain([r]).for_each(|value| *value /= unit);
                *w *= unit;
            }
        }
        scale(&mut self.border.0, shared);
    }

    /// Makes all slopes by shared unknown `to` twice those by `from`: what rows leave out of one they leave out of the other.
    pub fn make_dependent(&mut self, from: usize, to: usize) {
        let leading = self.leading;
        let couple = |p: &mut Vec<f64>| p[to] = 2.0 * p[from];
        assert!(from < leading && to < self.m);
        // Rows that do not reach `from` must not reach `to`.
        self.rows.iter_mut().flatten().for_each(|row| couple(&mut row.1));
        if to < leading {
            self.transitions.iter_mut().flatten().flatten().for_each(|step| couple(&mut step.1));
        } else {
            self.transitions.iter_mut().flatten().flatten().for_each(|step| step.1[from] = 0.0);
        }
        couple(&mut self.border.0);
    }

    /// All whitened rows as a dense Jacobian and residual at the point zero, in the order of stages: rows, then transitions; the border's last.
    pub fn dense(&self) -> (DMatrix<f64>, DVector<f64>) {
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

    /// What row i of a stage reaches.
    pub fn reach(&self, i: usize) -> Reach {
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
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Reach {
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

pub(super) fn dot(a: &[f64], b: &[f64]) -> f64 {
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
fn fill(mut row: Row<'_>, weight: f64, x: &[f64], p: &[f64], first: usize) {
    for (i, x) in x.iter().enumerate() {
        row.add_state(i, weight * x);
    }
    for (j, p) in p.iter().enumerate().skip(first) {
        row.add_shared(j, weight * p);
    }
}

/// The point at which [`Random::dense`] is true.
pub fn zero(problem: &Random) -> Step {
    Step { states: vec![0.0; problem.rows.len() * problem.n], border: vec![0.0; problem.m] }
}
