//! What a filter's update and prediction do to the covariance P, in four lanes at once. P is symmetric and stored whole, row by row.

use std::f64::consts::TAU;

use solve::simd::{LANES, Quad, Simd, Wide, Work};

/// Readings taken in one by one: state and covariance after them.
pub(super) struct TakeIn<'a> {
    pub x: &'a mut [Quad],
    pub p: &'a mut [Quad],
    /// Each reading, NaN for none, and its standard deviation.
    pub readings: (&'a [f64], &'a [f64]),
    /// What the model says of each, and the gradient by the state.
    pub predicted: (&'a [Quad], &'a [Quad]),
    /// As long as the state.
    pub room: (&'a mut [Quad], &'a mut [Quad]),
}

impl Work for TakeIn<'_> {
    /// Σ ν²/S and Σ ln 2πS, ν the difference to the prediction, S its variance.
    type Output = [Quad; 2];

    #[inline(always)]
    fn run<V: Simd>(self, simd: V) -> [Quad; 2] {
        let TakeIn { x, p, readings: (z, sigma), predicted: (outputs, rows), room: (gain, change) } = self;
        let n = x.len();
        change.fill(Quad::default());
        let (mut squares, mut logs) = (Wide::splat(simd, 0.0), [0.0; LANES]);
        for i in 0..z.len() {
            if z[i].is_nan() {
                continue;
            }
            let row = &rows[i * n..(i + 1) * n];
            gain.fill(Quad::default());
            let (mut variance, mut expected) =
                (Wide::splat(simd, sigma[i] * sigma[i]), Wide::load(simd, &outputs[i].0));
            for b in 0..n {
                // Most readings see one component or few.
                if row[b] == Quad::default() {
                    continue;
                }
                let slope = Wide::load(simd, &row[b].0);
                expected = slope.mul_add(Wide::load(simd, &change[b].0), expected);
                let of_b = &p[b * n..(b + 1) * n];
                for a in 0..n {
                    gain[a].0 = slope.mul_add(Wide::load(simd, &of_b[a].0), Wide::load(simd, &gain[a].0)).to_array();
                }
            }
            for a in 0..n {
                variance = Wide::load(simd, &row[a].0).mul_add(Wide::load(simd, &gain[a].0), variance);
            }
            let innovation = Wide::splat(simd, z[i]) - expected;
            let share = innovation / variance;
            squares = innovation.mul_add(share, squares);
            let of_variance = variance.to_array();
            for lane in 0..LANES {
                logs[lane] += (TAU * of_variance[lane]).ln();
            }
            for b in 0..n {
                let of_gain = Wide::load(simd, &gain[b].0);
                change[b].0 = share.mul_add(of_gain, Wide::load(simd, &change[b].0)).to_array();
                let less = -(of_gain / variance);
                let of_b = &mut p[b * n..(b + 1) * n];
                for a in 0..n {
                    of_b[a].0 = less.mul_add(Wide::load(simd, &gain[a].0), Wide::load(simd, &of_b[a].0)).to_array();
                }
            }
        }
        for i in 0..n {
            x[i].0 = (Wide::load(simd, &x[i].0) + Wide::load(simd, &change[i].0)).to_array();
        }
        [Quad(squares.to_array()), Quad(logs)]
    }
}

/// `P ← F P Fᵀ`.
pub(super) struct Carry<'a> {
    /// F, row by row.
    pub jacobian: &'a [Quad],
    pub p: &'a mut [Quad],
    /// As large as P.
    pub product: &'a mut [Quad],
}

impl Work for Carry<'_> {
    type Output = ();

    #[inline(always)]
    fn run<V: Simd>(self, simd: V) {
        let Carry { jacobian, p, product } = self;
        let n = p.len().isqrt();
        // F P, whose rows are sums of rows of P.
        for i in 0..n {
            let row = &mut product[i * n..(i + 1) * n];
            row.fill(Quad::default());
            for k in 0..n {
                let factor = Wide::load(simd, &jacobian[i * n + k].0);
                let of_k = &p[k * n..(k + 1) * n];
                for j in 0..n {
                    row[j].0 = factor.mul_add(Wide::load(simd, &of_k[j].0), Wide::load(simd, &row[j].0)).to_array();
                }
            }
        }
        // (F P) Fᵀ above the diagonal, and below it the same.
        for i in 0..n {
            let left = &product[i * n..(i + 1) * n];
            for j in i..n {
                let right = &jacobian[j * n..(j + 1) * n];
                let (mut even, mut odd) = (Wide::splat(simd, 0.0), Wide::splat(simd, 0.0));
                for k in (0..n - n % 2).step_by(2) {
                    even = Wide::load(simd, &left[k].0).mul_add(Wide::load(simd, &right[k].0), even);
                    odd = Wide::load(simd, &left[k + 1].0).mul_add(Wide::load(simd, &right[k + 1].0), odd);
                }
                if n % 2 == 1 {
                    even = Wide::load(simd, &left[n - 1].0).mul_add(Wide::load(simd, &right[n - 1].0), even);
                }
                let sum = Quad((even + odd).to_array());
                p[i * n + j] = sum;
                p[j * n + i] = sum;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{DMatrix, DVector};
    use solve::simd::vectorised;

    use super::*;

    /// Numbers between −1 and 1 from a seed.
    fn numbers(count: usize, seed: u64) -> Vec<f64> {
        let mut state = seed;
        let mut next = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
        };
        (0..count).map(|_| next()).collect()
    }

    fn quads(lanes: &[Vec<f64>; LANES]) -> Vec<Quad> {
        (0..lanes[0].len()).map(|i| Quad(std::array::from_fn(|lane| lanes[lane][i]))).collect()
    }

    fn close(quads: &[Quad], lane: usize, expected: &[f64]) {
        for (quad, expected) in quads.iter().zip(expected) {
            assert!((quad.0[lane] - expected).abs() < 1e-12, "{} {expected}", quad.0[lane]);
        }
    }

    #[test]
    fn covariances_are_those_of_the_textbook() {
        for n in [1, 2, 5, 12] {
            let roots: [Vec<f64>; LANES] = std::array::from_fn(|lane| numbers(n * n, 1 + lane as u64));
            let before = roots.each_ref().map(|root| {
                let root = DMatrix::from_row_slice(n, n, root);
                &root * root.transpose() + DMatrix::identity(n, n)
            });
            let of_matrix = |matrix: &DMatrix<f64>| matrix.transpose().as_slice().to_vec();
            let jacobians: [Vec<f64>; LANES] = std::array::from_fn(|lane| numbers(n * n, 10 + lane as u64));
            let mut p = quads(&before.each_ref().map(of_matrix));
            let mut product = p.clone();
            vectorised(Carry { jacobian: &quads(&jacobians), p: &mut p, product: &mut product });
            for lane in 0..LANES {
                let f = DMatrix::from_row_slice(n, n, &jacobians[lane]);
                close(&p, lane, &of_matrix(&(&f * &before[lane] * f.transpose())));
            }

            // Three readings at once, of which the second is missing.
            let (z, sigma) = ([0.3, f64::NAN, -0.7], [0.1, 0.2, 0.3]);
            let rows: [Vec<f64>; LANES] = std::array::from_fn(|lane| numbers(3 * n, 20 + lane as u64));
            let outputs: [Vec<f64>; LANES] = std::array::from_fn(|lane| numbers(3, 30 + lane as u64));
            let states: [Vec<f64>; LANES] = std::array::from_fn(|lane| numbers(n, 40 + lane as u64));
            let (mut x, mut p) = (quads(&states), quads(&before.each_ref().map(of_matrix)));
            let (mut gain, mut change) = (x.clone(), x.clone());
            let [nis, logs] = vectorised(TakeIn {
                x: &mut x,
                p: &mut p,
                readings: (&z, &sigma),
                predicted: (&quads(&outputs), &quads(&rows)),
                room: (&mut gain, &mut change),
            });
            for lane in 0..LANES {
                let h = DMatrix::from_fn(2, n, |i, j| rows[lane][2 * i * n + j]);
                let noise = DMatrix::from_diagonal(&DVector::from_vec(vec![sigma[0].powi(2), sigma[2].powi(2)]));
                let s = &h * &before[lane] * h.transpose() + noise;
                let inverse = s.clone().try_inverse().unwrap();
                let innovation = DVector::from_vec(vec![z[0] - outputs[lane][0], z[2] - outputs[lane][2]]);
                let gain = &before[lane] * h.transpose() * &inverse;
                let after = DVector::from_column_slice(&states[lane]) + &gain * &innovation;
                close(&x, lane, after.as_slice());
                close(&p, lane, &of_matrix(&(&before[lane] - &gain * &h * &before[lane])));
                let expected = (innovation.transpose() * inverse * &innovation)[0];
                assert!((nis.0[lane] - expected).abs() < 1e-10 * expected, "{} {expected}", nis.0[lane]);
                let expected = (TAU * TAU * s.determinant()).ln();
                assert!((logs.0[lane] - expected).abs() < 1e-10, "{} {expected}", logs.0[lane]);
            }
        }
    }
}
