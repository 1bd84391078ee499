//! Least squares that equations which are missed by far do not draw: Tukey's bisquare by iterated weights, after Huber's, which have one minimum.
//!
//! A measured machine meets what no model knows: it is pushed by hand, it hits something, a torque reads a spike. Such equations are few and far away; squares
//! would give them the whole fit. Equations of one joint share a scale, 1.4826 times the median of what is left.

use nalgebra::{DMatrix, DVector};

/// What an equation counts for by what is left of it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Loss {
    /// Its square: the recipe of the field.
    Squares,
    /// Nothing beyond 4.685 scales.
    Bisquare,
}

/// Constants of 95 % efficiency under the normal distribution (Huber 1964; Beaton and Tukey 1974).
const HUBER: f64 = 1.345;
const BISQUARE: f64 = 4.685;
/// Median of |x| under the normal distribution to the standard deviation.
const NORMAL: f64 = 1.4826;
/// Rounds of Huber's weights, then of the bisquare's.
const ROUNDS: [usize; 2] = [15, 25];
/// Blocks of time, as many as a calibration has for its scatter.
const BLOCKS: usize = 30;
/// Relative change of the solution at which rounds end.
const STILL: f64 = 1e-5;

/// 1.4826 median |x|: the standard deviation of normal values, whatever a few of them are.
pub fn scale(values: &[f64]) -> f64 {
    let mut sizes: Vec<f64> = values.iter().map(|value| value.abs()).collect();
    if sizes.is_empty() {
        return 0.0;
    }
    let middle = sizes.len() / 2;
    NORMAL * *sizes.select_nth_unstable_by(middle, f64::total_cmp).1
}

/// The solution of weighted equations by their normal matrix, whose eigenvalues below `least_share` of the largest count for nothing.
fn weighted_solution(
    columns: &DMatrix<f64>,
    residual: &DVector<f64>,
    roots: &DVector<f64>,
    least_share: f64,
) -> Option<DVector<f64>> {
    let mut weighted = columns.clone();
    weighted.column_iter_mut().for_each(|mut column| column.component_mul_assign(roots));
    let right = weighted.tr_mul(&roots.component_mul(residual));
    let eigen = weighted.tr_mul(&weighted).try_symmetric_eigen(f64::EPSILON, 0)?;
    let least = least_share * eigen.eigenvalues.max();
    let along = eigen.eigenvectors.tr_mul(&right);
    let along = along.zip_map(&eigen.eigenvalues, |along, value| if value > least { along / value } else { 0.0 });
    Some(eigen.eigenvectors * along)
}

/// Square roots of the weights of equations of which `columns` leave `residual`, `groups` of so many rows each sharing a scale. None where there is nothing to
/// down-weight, or the weights leave no solution.
pub(super) fn root_weights(
    columns: &DMatrix<f64>,
    residual: &DVector<f64>,
    groups: &[usize],
    least_share: f64,
) -> Option<DVector<f64>> {
    let rows = residual.len();
    let mut roots = DVector::from_element(rows, 1.0);
    let mut last: Option<DVector<f64>> = None;
    for (rounds, weight) in ROUNDS.into_iter().zip([huber as fn(f64) -> f64, bisquare]) {
        for _ in 0..rounds {
            let solution = weighted_solution(columns, residual, &roots, least_share)?;
            let left = residual - columns * &solution;
            let mut first = 0;
            for group in groups {
                let scale = scale(&left.as_slice()[first..first + group]);
                for i in first..first + group {
                    roots[i] = if scale > 0.0 { weight(left[i] / scale).sqrt() } else { 1.0 };
                }
                first += group;
            }
            let still = last.as_ref().is_some_and(|last| (&solution - last).norm() <= STILL * solution.norm());
            last = Some(solution);
            if still {
                break;
            }
        }
    }
    Some(roots)
}

/// Σ s_b s_bᵀ over blocks of rows that follow each other, s_b = Xᵀ r of a block: what takes the place of Xᵀ X σ² in a covariance where what is left lasts longer
/// than a row (Liang and Zeger 1986). `groups` of so many rows each have the same blocks of time.
pub(super) fn between_blocks(columns: &DMatrix<f64>, left: &DVector<f64>, groups: &[usize]) -> DMatrix<f64> {
    let unknowns = columns.ncols();
    let mut sums = DMatrix::zeros(unknowns, unknowns);
    for block in 0..BLOCKS {
        let mut gradient = DVector::zeros(unknowns);
        let mut first = 0;
        for group in groups {
            for i in first + block * group / BLOCKS..first + (block + 1) * group / BLOCKS {
                gradient += left[i] * columns.row(i).transpose();
            }
            first += group;
        }
        sums += &gradient * gradient.transpose();
    }
    sums * (BLOCKS as f64 / (BLOCKS - 1) as f64)
}

fn huber(missed: f64) -> f64 {
    if missed.abs() <= HUBER { 1.0 } else { HUBER / missed.abs() }
}

fn bisquare(missed: f64) -> f64 {
    let share = missed / BISQUARE;
    if share.abs() < 1.0 { (1.0 - share * share).powi(2) } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A line y = 2 + 3 x with noise of 0.1, of which a tenth lies 50 below it, all at one end.
    #[test]
    fn a_tenth_of_the_equations_far_away_does_not_draw_the_line() {
        let noise = |k: usize| 0.1 * (12.0f64).sqrt() * (((k * 7919) % 1000) as f64 / 1000.0 - 0.5);
        let x: Vec<f64> = (0..1000).map(|k| k as f64 / 1000.0).collect();
        let columns = DMatrix::from_fn(1000, 2, |i, j| if j == 0 { 1.0 } else { x[i] });
        let residual = DVector::from_fn(1000, |i, _| 2.0 + 3.0 * x[i] + noise(i) - if i >= 900 { 50.0 } else { 0.0 });
        let roots = root_weights(&columns, &residual, &[1000], 1e-6).unwrap();
        let weighted = DMatrix::from_fn(1000, 2, |i, j| roots[i] * columns[(i, j)]);
        let found = weighted.svd(true, true).solve(&roots.component_mul(&residual), 1e-9).unwrap();
        // atol: three standard errors of 900 points, 0.1 / √900 of the level and √12 times as much of the slope.
        assert!((found[0] - 2.0).abs() < 0.02 && (found[1] - 3.0).abs() < 0.04, "{found}");
        assert!(roots.rows(900, 100).max() == 0.0, "what lies 50 away counts for nothing");
    }

    #[test]
    fn the_scale_is_the_deviation_of_normal_values_and_does_not_see_a_few_far_ones() {
        let mut values: Vec<f64> = (0..1001).map(|k| f64::from(k) / 500.0 - 1.0).collect();
        // Half of |x| of a uniform value between −1 and 1 lies below 0.5.
        assert!((scale(&values) - 1.4826 * 0.5).abs() < 2e-3);
        values[..50].fill(1e9);
        assert!(scale(&values) < 1.4826 * 0.56);
        assert_eq!(scale(&[]), 0.0);
    }
}
