//! The filter against what is known of it: textbook covariances, the Riccati equation, its own double precision, χ² of simulated robots.

mod factor;
mod flow;
mod joint;
mod linear;
mod tape;
mod watchdog;

use std::vec::Vec;

use rand::{SeedableRng, rngs::StdRng};
use rand_distr::{Distribution, StandardNormal};

/// Normal numbers from a seed.
struct Normal(StdRng);

impl Normal {
    fn of(seed: u64) -> Self {
        Normal(StdRng::seed_from_u64(seed))
    }

    fn next(&mut self) -> f64 {
        StandardNormal.sample(&mut self.0)
    }
}

/// Square matrices by rows, in double precision.
type Matrix = Vec<Vec<f64>>;

fn matrix(n: usize, mut entry: impl FnMut(usize, usize) -> f64) -> Matrix {
    (0..n).map(|i| (0..n).map(|j| entry(i, j)).collect()).collect()
}

fn product(a: &Matrix, b: &Matrix) -> Matrix {
    matrix(a.len(), |i, j| (0..a.len()).map(|k| a[i][k] * b[k][j]).sum())
}

fn transposed(a: &Matrix) -> Matrix {
    matrix(a.len(), |i, j| a[j][i])
}

/// P after a reading with gradient h and variance r, P − P hᵀ h P / S; and S.
fn after_reading(p: &Matrix, h: &[f64], r: f64) -> (Matrix, f64) {
    let n = p.len();
    let gain: Vec<f64> = (0..n).map(|i| (0..n).map(|k| p[i][k] * h[k]).sum()).collect();
    let s = r + (0..n).map(|i| h[i] * gain[i]).sum::<f64>();
    (matrix(n, |i, j| p[i][j] - gain[i] * gain[j] / s), s)
}

/// Φ P Φᵀ + Q.
fn after_step(p: &Matrix, phi: &Matrix, q: &[f64]) -> Matrix {
    let carried = product(&product(phi, p), &transposed(phi));
    matrix(p.len(), |i, j| carried[i][j] + if i == j { q[i] } else { 0.0 })
}
