//! Vectors and rotations of three dimensions over any scalar: plain arrays, no heap.

use std::ops::{Add, AddAssign, Mul, Neg, Sub, SubAssign};

use num_dual::DualNum;

/// A vector of three components.
pub type Vector3 = [f64; 3];
/// A 3×3 matrix by rows.
pub type Matrix3 = [[f64; 3]; 3];

/// The scalar of the equations: `f64`, or a dual number that carries derivatives along.
pub trait Scalar: DualNum<Primitive = f64> + Copy {}
impl<T: DualNum<Primitive = f64> + Copy> Scalar for T {}

/// What a chain needs of its scalar: every [`Scalar`] has it, and so has [`Lanes`](super::chain::Lanes).
pub trait Arithmetic:
    Copy
    + From<f64>
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Mul<f64, Output = Self>
    + Neg<Output = Self>
    + AddAssign
    + SubAssign
{
    /// Sine and cosine.
    fn sin_cos(self) -> (Self, Self);
}

impl<T: Scalar> Arithmetic for T {
    #[inline(always)]
    fn sin_cos(self) -> (Self, Self) {
        DualNum::sin_cos(&self)
    }
}

pub(super) const IDENTITY: Matrix3 = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

#[inline(always)]
pub(super) fn add<T: Arithmetic>(a: [T; 3], b: [T; 3]) -> [T; 3] {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

#[inline(always)]
pub(super) fn scale<T: Arithmetic>(a: [T; 3], s: T) -> [T; 3] {
    [a[0] * s, a[1] * s, a[2] * s]
}

#[inline(always)]
pub(super) fn dot<T: Arithmetic>(a: [T; 3], b: [T; 3]) -> T {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[inline(always)]
pub(super) fn cross<T: Arithmetic>(a: [T; 3], b: [T; 3]) -> [T; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// a × b with a constant b.
#[inline(always)]
pub(super) fn cross_constant<T: Arithmetic>(a: [T; 3], b: Vector3) -> [T; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// a · b with a constant b.
#[inline(always)]
fn dot_constant<T: Arithmetic>(a: [T; 3], b: Vector3) -> T {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// m v with a constant m.
#[inline(always)]
pub(super) fn apply<T: Arithmetic>(m: &Matrix3, v: [T; 3]) -> [T; 3] {
    // The standard library's maps of arrays are not inlined everywhere.
    [dot_constant(v, m[0]), dot_constant(v, m[1]), dot_constant(v, m[2])]
}

/// mᵀ v with a constant m.
#[inline(always)]
pub(super) fn apply_transposed<T: Arithmetic>(m: &Matrix3, v: [T; 3]) -> [T; 3] {
    apply(&transpose(m), v)
}

#[inline(always)]
pub(super) fn constant<T: Arithmetic>(v: Vector3) -> [T; 3] {
    v.map(T::from)
}

#[inline(always)]
pub(super) fn transpose(m: &Matrix3) -> Matrix3 {
    let [[a, b, c], [d, e, f], [g, h, i]] = *m;
    [[a, d, g], [b, e, h], [c, f, i]]
}

pub(super) fn product(a: &Matrix3, b: &Matrix3) -> Matrix3 {
    std::array::from_fn(|i| std::array::from_fn(|j| (0..3).map(|k| a[i][k] * b[k][j]).sum()))
}

pub(super) fn determinant(m: &Matrix3) -> f64 {
    dot(m[0], cross(m[1], m[2]))
}

pub(super) fn norm(v: Vector3) -> f64 {
    dot(v, v).sqrt()
}

pub(super) fn normalised(v: Vector3) -> Vector3 {
    scale(v, 1.0 / norm(v))
}

/// The rotation whose third column is the unit vector `z`: takes vectors from axes whose z lies along it.
pub(super) fn axes_with_z_along(z: Vector3) -> Matrix3 {
    // The coordinate axis least along z is the safest to build x from.
    let least = (0..3).min_by(|&i, &j| z[i].abs().total_cmp(&z[j].abs())).unwrap_or(0);
    let y = normalised(cross(z, IDENTITY[least]));
    let x = cross(y, z);
    transpose(&[x, y, z])
}
