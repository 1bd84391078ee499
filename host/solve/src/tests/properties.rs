//! What the elimination must do whatever the problem: sizes of every kernel, gaps, stages that only their neighbours determine, weights over
//! twelve decades, directions that are held.
//!
//! The reference is dense. Rounding is judged by what a stable elimination owes: with d = √diag H, the matrix that it solves exactly may be off by a few
//! ε dᵢ dⱼ, whatever the units. So the residual of the normal equations is bounded outright (6e-16 was the worst measured), and
//! what is compared with the dense solution may be off by that times the condition κ of H in those units.

use nalgebra::{DMatrix, DVector};
use proptest::prelude::*;
use proptest::test_runner::RngSeed;

use super::random::{Random, Spec, zero};
use crate::Step;
use crate::border::Border;
use crate::factor::Factor;

/// Bound of rounding errors, for matrices of these sizes.
pub const ROUNDING: f64 = 2e-14;
/// Conditions from which on nothing can be compared.
pub const WORST_CONDITION: f64 = 1e12;

pub fn config(cases: u32) -> ProptestConfig {
    ProptestConfig { rng_seed: RngSeed::Fixed(4), failure_persistence: None, ..ProptestConfig::with_cases(cases) }
}

/// A random problem of a size that can be solved densely.
pub fn spec() -> impl Strategy<Value = Spec> {
    let sizes = (1usize..=36, 0usize..=25, 1usize..=13, any::<u64>());
    let scales = (-2.0..3.0, prop::array::uniform3(-2.0..2.0), prop_oneof![Just(0.0), Just(6.0)]);
    let gaps = (prop::collection::vec(0usize..13, 0..4), prop::collection::vec(0usize..13, 0..3));
    let leading = 0usize..=25;
    (sizes, scales, gaps, leading).prop_map(
        |((n, m, stages, seed), (weight, decades, units), (breaks, quiet), leading)| {
            // Large blocks make short chains, so that the dense solution stays cheap.
            let stages = stages.min(150 / n).max(1);
            let linked = |k: usize| k + 1 < stages && !breaks.contains(&k);
            let mut quiet: Vec<usize> =
                quiet.into_iter().filter(|&k| k < stages && (linked(k) || k > 0 && linked(k - 1))).collect();
            quiet.sort_unstable();
            // Two neighbours without rows, or a run that has none, would be undetermined.
            quiet.dedup_by(|a, b| *a - *b < 3);
            if stages < 3 {
                quiet.clear();
            }
            let (weight, leading) = (10f64.powf(weight), Some(leading.min(m)));
            Spec { seed, stages, n, m, leading, weight, decades, units, breaks, quiet, dependent: false }
        },
    )
}

/// The normal equations, dense.
pub struct Dense {
    pub jacobian: DMatrix<f64>,
    pub residual: DVector<f64>,
    /// H and its scale d, and the condition of H in units of d.
    pub normal: DMatrix<f64>,
    pub scale: DVector<f64>,
    pub condition: f64,
}

impl Dense {
    pub fn of(problem: &Random) -> Self {
        let (jacobian, residual) = problem.dense();
        let normal = jacobian.transpose() * &jacobian;
        let scale = normal.diagonal().map(|v| v.max(f64::MIN_POSITIVE).sqrt());
        let eigenvalues = scaled(&normal, &scale).symmetric_eigenvalues();
        let condition = eigenvalues.max() / eigenvalues.min().max(f64::MIN_POSITIVE);
        Dense { jacobian, residual, normal, scale, condition }
    }

    /// The residual of the normal equations at a step, and the sizes of what is summed up in it.
    fn left_over(&self, step: &DVector<f64>) -> (f64, f64) {
        let right = self.jacobian.transpose() * &self.residual;
        let left = (&self.normal * step + &right).component_div(&self.scale);
        (left.norm(), step.component_mul(&self.scale).norm() + right.component_div(&self.scale).norm())
    }

    /// H⁻¹ v, solved in units of d.
    pub fn solve(&self, v: &DMatrix<f64>) -> DMatrix<f64> {
        solve(&self.normal, &self.scale, v)
    }

    /// H_xx⁻¹ v.
    pub fn solve_states(&self, v: &DMatrix<f64>) -> DMatrix<f64> {
        let n = v.nrows();
        solve(&self.normal.view((0, 0), (n, n)).into_owned(), &self.scale.rows(0, n).into_owned(), v)
    }

    /// The Gauss–Newton step by an orthogonal factorisation, which does not square the condition.
    fn step(&self) -> DVector<f64> {
        let mut jacobian = self.jacobian.clone();
        for (mut column, d) in jacobian.column_iter_mut().zip(self.scale.iter()) {
            column /= *d;
        }
        let qr = jacobian.qr();
        let step = -qr.r().solve_upper_triangular(&(qr.q().transpose() * &self.residual)).expect("full rank");
        step.component_div(&self.scale)
    }

    /// How far a Schur complement of the last m unknowns is off, row-major, in units of the diagonal.
    fn off(&self, information: &[f64], m: usize) -> f64 {
        let expected = self.schur(m);
        let shared = self.scale.rows(self.scale.len() - m, m);
        let off = |i: usize, j: usize| (information[i * m + j] - expected[(i, j)]).abs() / (shared[i] * shared[j]);
        // NaN counts as far off.
        let entries = (0..m * m).map(|at| off(at / m, at % m));
        entries.fold(0.0, |worst: f64, off| worst.max(if off.is_nan() { f64::INFINITY } else { off }))
    }

    /// Schur complement of the last m unknowns.
    pub fn schur(&self, m: usize) -> DMatrix<f64> {
        let (whole, n) = (self.normal.nrows(), self.normal.nrows() - m);
        let coupling = self.normal.view((0, n), (n, m)).into_owned();
        self.normal.view((n, n), (whole - n, whole - n)) - coupling.transpose() * self.solve_states(&coupling)
    }
}

/// A in units of d.
pub fn scaled(a: &DMatrix<f64>, d: &DVector<f64>) -> DMatrix<f64> {
    DMatrix::from_fn(a.nrows(), a.ncols(), |i, j| a[(i, j)] / (d[i] * d[j]))
}

/// A⁻¹ v, solved in units of d.
pub fn solve(a: &DMatrix<f64>, d: &DVector<f64>, v: &DMatrix<f64>) -> DMatrix<f64> {
    let by_rows = |v: &DMatrix<f64>| DMatrix::from_fn(v.nrows(), v.ncols(), |i, j| v[(i, j)] / d[i]);
    by_rows(&scaled(a, d).cholesky().expect("checked by its condition").solve(&by_rows(v)))
}

pub fn factorised(problem: &Random, threads: usize) -> Factor {
    let mut factor = Factor::new(problem).unwrap();
    factor.factorise(problem, &zero(problem), 0.0, threads).unwrap();
    factor
}

/// The whole step that goes with a step of the shared unknowns.
fn stepped(factor: &Factor, shared: &[f64], threads: usize) -> DVector<f64> {
    let mut step = Step::default();
    factor.back_substitute(shared, threads, &mut step);
    DVector::from_iterator(step.states.len() + step.border.len(), step.states.iter().chain(&step.border).copied())
}

proptest! {
    #![proptest_config(config(96))]

    #[test]
    fn steps_and_schur_complements_are_those_of_the_dense_matrix(spec in spec(), threads in 1usize..=2) {
        let problem = Random::of(&spec);
        let dense = Dense::of(&problem);
        prop_assume!(dense.condition < WORST_CONDITION);
        let factor = factorised(&problem, threads);
        let (information, gradient) = factor.schur();
        let m = spec.m;
        let off = dense.off(&information, m);
        prop_assert!(off <= ROUNDING * dense.condition, "S off by {off:e} of its diagonal");
        let border = Border::new(&information, &gradient, &[]);
        let (beta, _) = border.step(0.0).unwrap();
        let step = stepped(&factor, &beta, threads);

        let (left, size) = dense.left_over(&step);
        prop_assert!(left <= ROUNDING * size, "H δ + g = {left:e} of {size:e}");

        let expected = dense.step();
        let off = (&step - &expected).component_mul(&dense.scale).norm();
        let size = expected.component_mul(&dense.scale).norm();
        prop_assert!(off <= ROUNDING * dense.condition * size, "δ off by {off:e} of {size:e}, κ {:e}", dense.condition);
    }

    #[test]
    fn damped_states_are_those_of_the_damped_matrix(spec in spec(), threads in 1usize..=2) {
        const DAMPING: f64 = 0.3;
        let problem = Random::of(&spec);
        let mut dense = Dense::of(&problem);
        prop_assume!(dense.condition < WORST_CONDITION);
        let m = spec.m;
        for i in 0..dense.scale.len() - m {
            dense.normal[(i, i)] *= 1.0 + DAMPING;
        }
        let mut factor = Factor::new(&problem).unwrap();
        factor.factorise(&problem, &zero(&problem), DAMPING, threads).unwrap();
        let (information, gradient) = factor.schur();
        let off = dense.off(&information, m);
        prop_assert!(off <= ROUNDING * dense.condition, "S off by {off:e} of its diagonal");
        let (beta, _) = Border::new(&information, &gradient, &[]).step(0.0).unwrap();
        let (left, size) = dense.left_over(&stepped(&factor, &beta, threads));
        prop_assert!(left <= ROUNDING * size, "H δ + g = {left:e} of {size:e}");
    }

    #[test]
    fn an_old_factor_takes_in_the_residuals_of_another_point(spec in spec(), threads in 1usize..=2) {
        let problem = Random::of(&spec);
        let mut dense = Dense::of(&problem);
        prop_assume!(dense.condition < WORST_CONDITION);
        // The matrix of a linear problem is the same everywhere: under it the step from elsewhere is exact as well.
        let mut factor = factorised(&problem, threads);
        let (information, _) = factor.schur();
        let mut elsewhere = zero(&problem);
        let unknowns = elsewhere.states.iter_mut().chain(&mut elsewhere.border).zip(dense.scale.iter());
        unknowns.enumerate().for_each(|(i, (x, d))| *x = (i as f64).sin() / d);
        let x: Vec<f64> = elsewhere.states.iter().chain(&elsewhere.border).copied().collect();
        dense.residual += &dense.jacobian * DVector::from_vec(x);
        factor.renew(&problem, &elsewhere, threads);

        let (same, gradient) = factor.schur();
        prop_assert_eq!(&same, &information, "bit for bit");
        let (beta, _) = Border::new(&information, &gradient, &[]).step(0.0).unwrap();
        let step = stepped(&factor, &beta, threads);
        let (left, size) = dense.left_over(&step);
        prop_assert!(left <= ROUNDING * size, "H δ + g = {left:e} of {size:e}");

        let mut new = Factor::new(&problem).unwrap();
        new.factorise(&problem, &elsewhere, 0.0, threads).unwrap();
        let (squares, expected) = (factor.eliminated_square_sum(), new.eliminated_square_sum());
        let size = dense.residual.norm_squared();
        prop_assert!((squares - expected).abs() <= ROUNDING * size, "{squares:e} against {expected:e} of {size:e}");
    }

    #[test]
    fn a_direction_that_no_row_sees_is_held_and_the_rest_is_solved(spec in spec(), threads in 1usize..=2) {
        prop_assume!(spec.m >= 3 && spec.units == 0.0);
        let leading = spec.leading.map(|leading| leading.max(1));
        let problem = Random::of(&Spec { dependent: true, leading, ..spec.clone() });
        let m = spec.m;
        let dense = Dense::of(&problem);
        // Whether everything else is determined.
        let mut values = scaled(&dense.normal, &dense.scale).symmetric_eigenvalues().as_slice().to_vec();
        values.sort_by(f64::total_cmp);
        prop_assume!(values[1] * WORST_CONDITION > values[values.len() - 1]);
        let factor = factorised(&problem, threads);
        let (information, gradient) = factor.schur();
        let mut unseen = vec![0.0; m];
        (unseen[0], unseen[m - 1]) = (2.0, -1.0);
        let border = Border::new(&information, &gradient, &[unseen.clone()]);
        let (beta, _) = border.step(0.0).unwrap();
        let step = stepped(&factor, &beta, threads);

        // Any of the minima has the same residuals; the others are reached along the direction that is held.
        let (left, size) = dense.left_over(&step);
        prop_assert!(left <= ROUNDING * size, "H δ + g = {left:e} of {size:e}");

        // Covariance: that of the free directions, none along the held one in units of the conditional deviations.
        let covariance = border.covariance().unwrap();
        let metric = DVector::from_fn(m, |i, _| information[i * m + i].max(0.0));
        let along = DVector::from_row_slice(&unseen).component_mul(&metric);
        let deviation = (&covariance * &along).component_mul(&metric.map(f64::sqrt)).norm();
        prop_assert!(deviation <= 1e-7 * along.norm() / metric.max().sqrt(), "covariance along it: {deviation:e}");
    }
}
