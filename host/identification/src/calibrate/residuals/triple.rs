//! Vectors of three components, each of four samples at once.

use nalgebra::{Matrix3, Vector3};

use solve::simd::{Simd, Wide};

pub(crate) type Value<S> = Wide<S>;
pub(crate) type Triple<S> = [Value<S>; 3];

/// The rows of a matrix.
#[inline(always)]
pub(crate) fn by_rows(m: &Matrix3<f64>) -> [[f64; 3]; 3] {
    [[m.m11, m.m12, m.m13], [m.m21, m.m22, m.m23], [m.m31, m.m32, m.m33]]
}

/// The same vector in all lanes.
#[inline(always)]
pub(crate) fn splat<S: Simd>(simd: S, v: &Vector3<f64>) -> Triple<S> {
    [Value::splat(simd, v.x), Value::splat(simd, v.y), Value::splat(simd, v.z)]
}

/// a · b.
#[inline(always)]
pub(crate) fn dot<S: Simd>(a: &Triple<S>, b: &Triple<S>) -> Value<S> {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// a × b.
#[inline(always)]
pub(crate) fn cross<S: Simd>(a: &Triple<S>, b: &Triple<S>) -> Triple<S> {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// m v with a constant m.
#[inline(always)]
pub(crate) fn apply<S: Simd>(m: &[[f64; 3]; 3], v: &Triple<S>) -> Triple<S> {
    let mut out = *v;
    for (out, row) in out.iter_mut().zip(m) {
        *out = v[0] * row[0] + v[1] * row[1] + v[2] * row[2];
    }
    out
}

/// The rows of −R skew(ω) = −skew(R ω) R, with `rate` = R ω: the derivative of R ⊞ δ times ω.
#[inline(always)]
pub(crate) fn by_rotation<S: Simd>(rate: &Triple<S>, rotation: &[[f64; 3]; 3]) -> [Triple<S>; 3] {
    let mut out = [*rate; 3];
    for (axis, out) in out.iter_mut().enumerate() {
        let (next, after) = ((axis + 1) % 3, (axis + 2) % 3);
        for j in 0..3 {
            out[j] = rate[after] * rotation[next][j] - rate[next] * rotation[after][j];
        }
    }
    out
}
