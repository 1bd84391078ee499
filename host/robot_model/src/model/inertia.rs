//! The joint-space inertia, factorised.

use crate::robot::chain::MAX_JOINTS;

/// Cholesky factor of the joint-space inertia, n × n by rows, reciprocals on the diagonal.
///
/// A pivot that is not positive (a trial b < 0 of a rigid joint) gives NaN accelerations: the solver rejects such a step.
pub(super) struct Inertia([f64; MAX_JOINTS * MAX_JOINTS]);

impl Inertia {
    // In place of a call: returned by value, it would be copied as a whole, however few joints there are.
    #[inline(always)]
    pub(super) fn factorise(n: usize, mut a: [f64; MAX_JOINTS * MAX_JOINTS]) -> Self {
        for i in 0..n {
            for j in 0..=i {
                let mut sum = a[i * n + j];
                for k in 0..j {
                    sum -= a[i * n + k] * a[j * n + k];
                }
                a[i * n + j] = if i == j { sum.sqrt().recip() } else { sum * a[j * n + j] };
            }
        }
        Inertia(a)
    }

    /// Solves A x = x in place.
    #[inline]
    pub(super) fn solve(&self, n: usize, x: &mut [f64; MAX_JOINTS]) {
        let l = &self.0;
        for i in 0..n {
            for k in 0..i {
                x[i] -= l[i * n + k] * x[k];
            }
            x[i] *= l[i * n + i];
        }
        for i in (0..n).rev() {
            for k in i + 1..n {
                x[i] -= l[k * n + i] * x[k];
            }
            x[i] *= l[i * n + i];
        }
    }

    /// Solves A X = X in place for n rows of `columns` values.
    pub(super) fn solve_rows(&self, n: usize, x: &mut [f64], columns: usize) {
        let l = &self.0;
        for i in 0..n {
            for k in 0..i {
                subtract_row(x, columns, i, k, l[i * n + k]);
            }
            scale_row(x, columns, i, l[i * n + i]);
        }
        for i in (0..n).rev() {
            for k in i + 1..n {
                subtract_row(x, columns, i, k, l[k * n + i]);
            }
            scale_row(x, columns, i, l[i * n + i]);
        }
    }
}

/// Row i loses `factor` times row k.
fn subtract_row(x: &mut [f64], columns: usize, i: usize, k: usize, factor: f64) {
    let (low, high) = x.split_at_mut(i.max(k) * columns);
    let (row_i, row_k) = if i > k {
        (&mut high[..columns], &low[k * columns..][..columns])
    } else {
        (&mut low[i * columns..][..columns], &high[..columns])
    };
    for (a, b) in row_i.iter_mut().zip(row_k) {
        *a -= factor * b;
    }
}

fn scale_row(x: &mut [f64], columns: usize, i: usize, factor: f64) {
    for a in &mut x[i * columns..(i + 1) * columns] {
        *a *= factor;
    }
}
