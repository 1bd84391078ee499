//! U D Uᵀ against covariances of the textbook, in both precisions.

use std::vec::Vec;

use super::{Matrix, Normal, after_reading, after_step, matrix};
use crate::{Factor, Real};

const N: usize = 7;
const MOVING: usize = 4;

/// Entries apart in shares of √(Pᵢᵢ Pⱼⱼ).
fn apart<T: Real + Into<f64>>(factor: &Factor<T, N>, p: &Matrix) -> f64 {
    let of = |i: usize, j: usize| {
        let found: f64 = factor.covariance(i, j).into();
        (found - p[i][j]).abs() / (p[i][i] * p[j][j]).sqrt()
    };
    (0..N).flat_map(|i| (0..N).map(move |j| (i, j))).map(|(i, j)| of(i, j)).fold(0.0, f64::max)
}

/// Thirty ticks of two readings and a step, components of very different size.
fn walk<T: Real + Into<f64>>() -> f64 {
    let mut normal = Normal::of(3);
    // As positions, speeds and biases differ.
    let size = [1e-4, 1e-4, 1.0, 3.0, 1e-3, 2e-2, 1e-2];
    let mut p = matrix(N, |i, j| if i == j { size[i] * size[i] } else { 0.0 });
    let mut factor = Factor::<T, N>::diagonal(size.iter().map(|size| T::of(*size)));
    let mut worst: f64 = 0.0;
    for _ in 0..30 {
        for _ in 0..2 {
            let h: Vec<f64> = size.iter().map(|size| (normal.next() / size) as f32 as f64).collect();
            let (next, s) = after_reading(&p, &h, 0.25);
            let h: Vec<T> = h.into_iter().map(T::of).collect();
            let found: f64 = (factor.variance_of(&h) + T::of(0.25)).into();
            worst = worst.max((found - s).abs() / s);
            let mut gain = [T::of(0.0); N];
            factor.take_in(T::of(0.25), &mut gain);
            p = next;
            worst = worst.max(apart(&factor, &p));
        }
        let phi = matrix(N, |i, j| {
            let own = if i == j { 1.0 } else { 0.0 };
            let other = if i < MOVING && j < MOVING { 0.1 * normal.next() * size[i] / size[j] } else { 0.0 };
            (own + other) as f32 as f64
        });
        let q = size.map(|size| 0.01 * size * size);
        p = after_step(&p, &phi, &q);
        let mut of_factor = [[T::of(0.0); N]; N];
        for i in 0..MOVING {
            for j in 0..MOVING {
                of_factor[i][j] = T::of(phi[i][j]);
            }
        }
        factor.propagate(&of_factor, MOVING, &q.map(T::of));
        (MOVING..N).for_each(|i| factor.add_variance(i, T::of(q[i])));
        worst = worst.max(apart(&factor, &p));
    }
    assert!(factor.is_sound());
    worst
}

#[test]
fn covariances_are_those_of_the_textbook() {
    let (double, single) = (walk::<f64>(), walk::<f32>());
    std::println!("apart from the textbook: f64 {double:.1e}, f32 {single:.1e}");
    assert!(double < 1e-12, "{double:e}");
    // Single precision has seven digits; thirty ticks lose two of them at most.
    assert!(single < 2e-5, "{single:e}");
}

/// A difference of variances would end at zero or below: one reading is 10⁵ times sharper than what was known.
#[test]
fn a_sharp_reading_leaves_its_own_variance() {
    let mut factor = Factor::<f32, N>::diagonal([1.0, 1.0, 1.0].into_iter());
    let sigma = 1e-5_f32;
    let h = [1.0, 1.0, 0.0];
    for _ in 0..2 {
        factor.variance_of(&h);
        factor.take_in(sigma * sigma, &mut [0.0; N]);
    }
    // Var(x₀ + x₁) after two readings is σ²/2.
    let variance = factor.variance_of(&h);
    assert!((variance / (sigma * sigma) - 0.5).abs() < 1e-4, "{variance:e}");
    assert!((factor.covariance(0, 0) - 0.5).abs() < 1e-5 && factor.is_sound());
}

#[test]
fn what_is_no_number_is_not_sound() {
    let mut factor = Factor::<f32, N>::diagonal([1.0, 2.0].into_iter());
    assert!(factor.is_sound());
    factor.propagate(&[[f32::NAN; N]; N], 2, &[0.0; N]);
    assert!(!factor.is_sound());
}
