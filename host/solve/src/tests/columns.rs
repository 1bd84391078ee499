//! Extra columns, log-determinant and selected inverse against the dense matrix.

use nalgebra::{DMatrix, DVector};
use proptest::prelude::*;
use rand::{RngExt, SeedableRng, rngs::StdRng};

use super::properties::{self, Dense, ROUNDING, WORST_CONDITION, config, factorised, spec};
use super::random::{Random, Reach, zero};
use crate::border::Border;
use crate::columns::{Entries, ExtraColumns, block_sums, eliminate, solve};
use crate::inverse::{log_determinant_of_states, selected_inverse};
use crate::{RowAt, Stage, Step};

/// Random columns over the rows of a problem, and over a few states directly.
struct RandomColumns {
    /// Rows of the dense Jacobian × q.
    by_row: DMatrix<f64>,
    /// Unknowns × q.
    direct: DMatrix<f64>,
    /// Index of each stage's rows in the dense Jacobian.
    rows: Vec<Vec<(RowAt, usize)>>,
    n: usize,
}

impl RandomColumns {
    fn of(problem: &Random, dense: &Dense, count: usize, seed: u64) -> Self {
        let mut rng = StdRng::seed_from_u64(seed);
        let mut next = 0;
        let mut rows = Vec::new();
        for (k, stage) in problem.rows.iter().enumerate() {
            let mut kinds = [0; 3];
            let mut own = Vec::new();
            for i in 0..stage.len() {
                let reach = problem.reach(i);
                let index = kinds[reach as usize];
                kinds[reach as usize] += 1;
                own.push(match reach {
                    Reach::All => RowAt::Other(index),
                    Reach::Sensor => RowAt::Sensor(index),
                    Reach::Unit => RowAt::Unit(index),
                });
            }
            own.extend((0..problem.transitions[k].as_ref().map_or(0, Vec::len)).map(RowAt::Transition));
            rows.push(own.into_iter().zip(next..).collect::<Vec<_>>());
            next += rows[k].len();
        }
        let (height, unknowns) = dense.jacobian.shape();
        // The border's own row, the last one, has no entries; every third column has some of the states' own.
        let by_row = DMatrix::from_fn(height, count, |i, _| {
            let value = rng.random_range(-1.0..1.0);
            if i + 1 < height && rng.random_bool(0.5) { value } else { 0.0 }
        });
        let states = unknowns - problem.m;
        let direct = DMatrix::from_fn(unknowns, count, |i, j| {
            let value = rng.random_range(-1.0..1.0) * dense.scale[i];
            if i < states && j % 3 == 0 { value } else { 0.0 }
        });
        RandomColumns { by_row, direct, rows, n: problem.n }
    }
}

impl ExtraColumns<Random> for RandomColumns {
    type Scratch = ();
    fn scratch(&self) {}
    fn count(&self) -> usize {
        self.by_row.ncols()
    }
    fn fill(&self, _: &Step, first: usize, _: &mut (), stages: &[Stage], entries: &mut [Entries]) {
        for (k, (entries, stage)) in (first..).zip(entries.iter_mut().zip(stages)) {
            assert_eq!(stage.residuals().count(), self.rows[k].len());
            for j in 0..self.count() {
                for (row, at) in &self.rows[k] {
                    entries.add(*row, j, self.by_row[(*at, j)]);
                }
                for i in (0..self.n).filter(|i| self.direct[(k * self.n + i, j)] != 0.0) {
                    entries.add_state(i, j, self.direct[(k * self.n + i, j)]);
                }
            }
        }
    }
}

proptest! {
    #![proptest_config(config(64))]

    #[test]
    fn extra_columns_are_eliminated_as_in_the_dense_matrix(
        spec in spec(), count in 0usize..=21, threads in 1usize..=2,
    ) {
        let problem = Random::of(&spec);
        let dense = Dense::of(&problem);
        prop_assume!(dense.condition < WORST_CONDITION);
        let factor = factorised(&problem, threads);
        let extra = RandomColumns::of(&problem, &dense, count, spec.seed);
        let (m, states) = (spec.m, dense.scale.len() - spec.m);

        // [x β γ] dense: the columns' gradient, Gram matrix and slope of the cost, then Schur complements.
        let v = dense.jacobian.transpose() * &extra.by_row + &extra.direct;
        let gram = extra.by_row.transpose() * &extra.by_row;
        let slope = extra.by_row.transpose() * &dense.residual;
        let right = dense.jacobian.transpose() * &dense.residual;
        let by_states = dense.solve_states(&v.rows(0, states).into_owned());
        let coupling = v.rows(states, m) - dense.normal.view((states, 0), (m, states)) * &by_states;
        let information = &gram - v.rows(0, states).transpose() * &by_states;
        let gradient = &slope - by_states.transpose() * right.rows(0, states);

        let reduced = eliminate(&problem, &zero(&problem), &factor, &extra, threads);
        // Sizes that rounding goes with: of the Gram matrix and of what is taken off it, and so on.
        let size = DVector::from_fn(count, |j, _| {
            (gram[(j, j)] + v.column(j).rows(0, states).dot(&by_states.column(j))).sqrt()
        });
        let tolerance = ROUNDING * dense.condition;
        let shared = dense.scale.rows(states, m);
        let all = dense.residual.norm();
        for j in 0..count {
            for i in 0..m {
                let off = (reduced.coupling[(i, j)] - coupling[(i, j)]) / (shared[i] * size[j]);
                prop_assert!(off.abs() <= tolerance, "S_βγ[{i},{j}] off by {off:e}");
            }
            for i in 0..count {
                let off = (reduced.information[(i, j)] - information[(i, j)]) / (size[i] * size[j]);
                prop_assert!(off.abs() <= tolerance, "S_γγ[{i},{j}] off by {off:e}");
            }
            let off = (reduced.gradient[j] - gradient[j]) / (size[j] * all);
            prop_assert!(off.abs() <= tolerance, "s_γ[{j}] off by {off:e}");
        }

        let (information, gradient) = factor.schur();
        let border = Border::new(&information, &gradient, &[]);
        let x = dense.solve(&v);
        let found = solve(&problem, &zero(&problem), &factor, &extra, &border, threads).unwrap();
        let score = reduced.score(&border, &gradient).unwrap();
        let expected = (&gram - v.transpose() * &x, &slope - x.transpose() * &right);
        for j in 0..count {
            let size_j = x.column(j).component_mul(&dense.scale).norm();
            for i in 0..dense.scale.len() {
                let value = if i < states { found.states[(i, j)] } else { found.border[(i - states, j)] };
                let off = (value - x[(i, j)]) * dense.scale[i] / size_j;
                prop_assert!(off.abs() <= tolerance, "H⁻¹ v [{i},{j}] off by {off:e}");
            }
            for i in 0..count {
                let size = (gram[(i, i)] + v.column(i).dot(&x.column(i))).sqrt()
                    * (gram[(j, j)] + v.column(j).dot(&x.column(j))).sqrt();
                let off = (score.information[(i, j)] - expected.0[(i, j)]) / size;
                prop_assert!(off.abs() <= tolerance, "information [{i},{j}] off by {off:e}");
            }
            let off = (score.gradient[j] - expected.1[j]) / (all * (gram[(j, j)] + v.column(j).dot(&x.column(j))).sqrt());
            prop_assert!(off.abs() <= tolerance, "gradient [{j}] off by {off:e}");
        }
    }

    #[test]
    fn blocks_of_the_inverse_and_its_determinant_are_those_of_the_dense_matrix(spec in spec(), threads in 1usize..=2) {
        let problem = Random::of(&spec);
        let dense = Dense::of(&problem);
        prop_assume!(dense.condition < WORST_CONDITION);
        let factor = factorised(&problem, threads);
        let (information, gradient) = factor.schur();
        let border = Border::new(&information, &gradient, &[]);
        let (n, m, unknowns) = (spec.n, spec.m, dense.scale.len());
        let inverse = dense.solve(&DMatrix::identity(unknowns, unknowns));
        let deviation = inverse.diagonal().map(f64::sqrt);

        let log_determinant = log_determinant_of_states(&factor) + border.log_determinant().unwrap();
        let eigenvalues = properties::scaled(&dense.normal, &dense.scale).symmetric_eigenvalues();
        let expected = eigenvalues.map(f64::ln).sum() + 2.0 * dense.scale.map(f64::ln).sum();
        let off = log_determinant - expected;
        prop_assert!(off.abs() <= ROUNDING * dense.condition + 1e-11, "log det {log_determinant} off by {off:e}");

        let mut visited = vec![false; spec.stages];
        let mut worst = (0.0f64, String::new());
        selected_inverse(&factor, &border.covariance().unwrap(), |blocks| {
            let k = blocks.stage;
            visited[k] = true;
            let mut look = |found: f64, i: usize, j: usize, what: &str| {
                let off = (found - inverse[(i, j)]).abs() / (deviation[i] * deviation[j]);
                if off >= worst.0 {
                    worst = (off, format!("{what} of stage {k} ({i}, {j})"));
                }
            };
            for i in 0..n {
                for j in 0..n {
                    look(blocks.own[(i, j)], k * n + i, k * n + j, "own block");
                    if let Some((p, block)) = &blocks.neighbour {
                        look(block[(i, j)], k * n + i, p * n + j, "neighbour's block");
                    }
                }
                for j in 0..m {
                    look(blocks.shared[(i, j)], k * n + i, unknowns - m + j, "border's block");
                }
            }
        });
        prop_assert!(visited.iter().all(|visited| *visited));
        prop_assert!(worst.0 <= ROUNDING * dense.condition, "{} off by {:e}", worst.1, worst.0);
    }

    #[test]
    fn sums_of_blocks_are_those_of_the_dense_matrix(
        spec in spec(), count in 0usize..=9, threads in 1usize..=2, undefined in prop::option::of(0usize..9), all in any::<bool>(),
    ) {
        let problem = Random::of(&spec);
        let dense = Dense::of(&problem);
        prop_assume!(dense.condition < WORST_CONDITION);
        let factor = factorised(&problem, threads);
        let mut extra = RandomColumns::of(&problem, &dense, count, spec.seed);
        // A block may hold a break, and a stage may be a block.
        let breaks = (1..spec.stages).filter(|k| problem.transitions[k - 1].is_none());
        let starts: Vec<usize> = std::iter::once(0).chain(breaks.filter(|k| all || k % 2 == 0)).collect();
        let undefined = undefined.filter(|j| *j < count);
        if let Some(j) = undefined {
            extra.by_row.column_mut(j).iter_mut().filter(|value| **value != 0.0).for_each(|value| *value = f64::NAN);
        }
        let (m, states, n) = (spec.m, dense.scale.len() - spec.m, spec.n);
        let size = m + 1 + count;
        let full = |_: usize, sums: &crate::columns::BlockSums<'_>| {
            let at = |i: usize, j: usize| match (i.min(j), i.max(j)) {
                (i, j) if j < m => sums.shared_information(i, j),
                (i, j) if j == m && i < m => sums.shared_gradient(i),
                (_, j) if j == m => sums.squares(),
                (i, j) if i < m => sums.coupling(i, j - m - 1),
                (i, j) if i == m => sums.gradient(j - m - 1),
                (i, j) => sums.information(i - m - 1, j - m - 1),
            };
            DMatrix::from_fn(size, size, at)
        };
        let blocks = block_sums((&problem, &zero(&problem)), &factor, &extra, &starts, threads, full);
        prop_assert_eq!(blocks.len(), starts.len());

        let tolerance = ROUNDING * dense.condition;
        for (b, found) in blocks.iter().enumerate() {
            let stages = starts[b]..starts.get(b + 1).copied().unwrap_or(spec.stages);
            let rows: Vec<usize> = extra.rows[stages.clone()].iter().flatten().map(|(_, row)| *row).collect();
            let own = dense.jacobian.columns(0, states).select_rows(&rows);
            let own = own.columns(stages.start * n, stages.len() * n).into_owned();
            // [J_β r C] of the block's rows.
            let mut wide = DMatrix::zeros(rows.len(), size);
            wide.view_mut((0, 0), (rows.len(), m)).copy_from(&dense.jacobian.columns(states, m).select_rows(&rows));
            wide.set_column(m, &dense.residual.select_rows(&rows));
            wide.view_mut((0, m + 1), (rows.len(), count)).copy_from(&extra.by_row.select_rows(&rows));
            let mut slopes = own.transpose() * &wide;
            let direct = extra.direct.rows(stages.start * n, stages.len() * n);
            let mut behind = slopes.columns_mut(m + 1, count);
            behind += &direct;
            let scale = dense.scale.rows(stages.start * n, stages.len() * n).into_owned();
            let by_states = properties::solve(&(own.transpose() * &own), &scale, &slopes);
            let gram = wide.transpose() * &wide;
            let expected = &gram - slopes.transpose() * &by_states;
            let length = |j: usize| (gram[(j, j)] + slopes.column(j).dot(&by_states.column(j))).sqrt();
            for i in 0..size {
                for j in 0..size {
                    let is_undefined = undefined.is_some_and(|u| i == m + 1 + u || j == m + 1 + u);
                    let off = found[(i, j)] - expected[(i, j)];
                    if is_undefined {
                        // A column that is not defined spoils its own sums only.
                        prop_assert!(off.is_nan() || off.abs() <= tolerance * (1.0 + length(i) * length(j)));
                    } else {
                        let size = length(i) * length(j);
                        prop_assert!(off.abs() <= tolerance * size, "block {b} [{i},{j}] off by {off:e} of {size:e}");
                    }
                }
            }
        }
    }
}
