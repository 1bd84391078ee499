//! A dual number with a few derivatives side by side, as plain arrays that the compiler vectorises.
//!
//! [`num_dual`]'s vectors keep their derivatives behind an `Option`; in a chain of products the branches cost four times
//! what the arithmetic does.

use std::ops::{Add, AddAssign, Mul, Neg, Sub, SubAssign};

use super::Arithmetic;

/// `re + Σ slope[k] ε_k` with `ε_k ε_l = 0`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lanes<const N: usize> {
    /// Value.
    pub re: f64,
    /// Derivatives.
    pub slope: [f64; N],
}

impl<const N: usize> From<f64> for Lanes<N> {
    #[inline(always)]
    fn from(re: f64) -> Self {
        Self { re, slope: [0.0; N] }
    }
}

impl<const N: usize> Lanes<N> {
    #[inline(always)]
    pub(crate) fn map(self, re: f64, slope: impl Fn(f64) -> f64) -> Self {
        let mut slopes = [0.0; N];
        for k in 0..N {
            slopes[k] = slope(self.slope[k]);
        }
        Self { re, slope: slopes }
    }

    #[inline(always)]
    pub(crate) fn zip(self, other: Self, re: f64, slope: impl Fn(f64, f64) -> f64) -> Self {
        // The standard library's maps of arrays are not inlined everywhere, and only what is gets vectors.
        let mut slopes = [0.0; N];
        for k in 0..N {
            slopes[k] = slope(self.slope[k], other.slope[k]);
        }
        Self { re, slope: slopes }
    }
}

impl<const N: usize> Add for Lanes<N> {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        self.zip(other, self.re + other.re, |a, b| a + b)
    }
}

impl<const N: usize> Sub for Lanes<N> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        self.zip(other, self.re - other.re, |a, b| a - b)
    }
}

// The product rule is a sum.
#[allow(clippy::suspicious_arithmetic_impl)]
impl<const N: usize> Mul for Lanes<N> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        self.zip(other, self.re * other.re, |a, b| a * other.re + b * self.re)
    }
}

impl<const N: usize> Mul<f64> for Lanes<N> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, factor: f64) -> Self {
        self.map(self.re * factor, |a| a * factor)
    }
}

impl<const N: usize> Neg for Lanes<N> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        self.map(-self.re, |a| -a)
    }
}

impl<const N: usize> AddAssign for Lanes<N> {
    #[inline(always)]
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl<const N: usize> SubAssign for Lanes<N> {
    #[inline(always)]
    fn sub_assign(&mut self, other: Self) {
        *self = *self - other;
    }
}

impl<const N: usize> Arithmetic for Lanes<N> {
    #[inline(always)]
    fn sin_cos(self) -> (Self, Self) {
        let (sin, cos) = self.re.sin_cos();
        (self.map(sin, |a| a * cos), self.map(cos, |a| a * -sin))
    }
}
