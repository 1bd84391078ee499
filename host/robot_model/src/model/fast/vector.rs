//! Vectors of three dimensions whose components are four samples wide.

use crate::robot::{Matrix3, Vector3};
use solve::simd::{Simd, Wide};

pub(super) type Vector<S> = [Wide<S>; 3];

#[inline(always)]
pub(super) fn zero<S: Simd>(simd: S) -> Vector<S> {
    [Wide::splat(simd, 0.0); 3]
}

#[inline(always)]
pub(super) fn constant<S: Simd>(simd: S, v: Vector3) -> Vector<S> {
    [Wide::splat(simd, v[0]), Wide::splat(simd, v[1]), Wide::splat(simd, v[2])]
}

#[inline(always)]
pub(super) fn add<S: Simd>(a: Vector<S>, b: Vector<S>) -> Vector<S> {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

#[inline(always)]
pub(super) fn sub<S: Simd>(a: Vector<S>, b: Vector<S>) -> Vector<S> {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// a + s b.
#[inline(always)]
pub(super) fn add_scaled<S: Simd>(a: Vector<S>, s: Wide<S>, b: Vector<S>) -> Vector<S> {
    [s.mul_add(b[0], a[0]), s.mul_add(b[1], a[1]), s.mul_add(b[2], a[2])]
}

#[inline(always)]
pub(super) fn scale<S: Simd>(a: Vector<S>, s: Wide<S>) -> Vector<S> {
    [a[0] * s, a[1] * s, a[2] * s]
}

#[inline(always)]
pub(super) fn dot<S: Simd>(a: Vector<S>, b: Vector<S>) -> Wide<S> {
    a[0].mul_add(b[0], a[1].mul_add(b[1], a[2] * b[2]))
}

#[inline(always)]
pub(super) fn cross<S: Simd>(a: Vector<S>, b: Vector<S>) -> Vector<S> {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// Σ c[i] axes[i], with constants c.
#[inline(always)]
pub(super) fn combine<S: Simd>(axes: &[Vector<S>; 3], c: [f64; 3]) -> Vector<S> {
    let mut sum = scale(axes[0], Wide::splat(axes[0][0].simd, c[0]));
    sum = add_scaled(sum, Wide::splat(sum[0].simd, c[1]), axes[1]);
    add_scaled(sum, Wide::splat(sum[0].simd, c[2]), axes[2])
}

/// mᵀ v with a constant m.
#[inline(always)]
pub(super) fn apply_transposed<S: Simd>(m: &Matrix3, v: Vector<S>) -> Vector<S> {
    let mut out = v;
    for (i, out) in out.iter_mut().enumerate() {
        *out = v[0] * m[0][i] + v[1] * m[1][i] + v[2] * m[2][i];
    }
    out
}
