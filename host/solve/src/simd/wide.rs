//! Vectors with operators.

use std::ops::{Add, AddAssign, Div, Mul, Neg, Sub, SubAssign};

use super::{LANES, Simd};

/// A vector with its token, so that formulas can be written with operators.
#[derive(Clone, Copy)]
pub struct Wide<S: Simd> {
    /// The instruction set.
    pub simd: S,
    /// The values.
    pub vector: S::Vector,
}

impl<S: Simd> Wide<S> {
    /// The same value in all lanes.
    #[inline(always)]
    pub fn splat(simd: S, value: f64) -> Self {
        Wide { simd, vector: simd.splat(value) }
    }

    /// From memory.
    #[inline(always)]
    pub fn load(simd: S, values: &[f64; LANES]) -> Self {
        Wide { simd, vector: simd.load(values) }
    }

    /// To memory.
    #[inline(always)]
    pub fn to_array(self) -> [f64; LANES] {
        self.simd.store(self.vector)
    }

    /// a b + c.
    #[inline(always)]
    pub fn mul_add(self, b: Self, c: Self) -> Self {
        Wide { vector: self.simd.mul_add(self.vector, b.vector, c.vector), ..self }
    }

    /// √a.
    #[inline(always)]
    pub fn sqrt(self) -> Self {
        Wide { vector: self.simd.sqrt(self.vector), ..self }
    }

    /// The nearest integers.
    #[inline(always)]
    pub fn round(self) -> Self {
        Wide { vector: self.simd.round(self.vector), ..self }
    }
}

macro_rules! operator {
    ($($trait:ident $name:ident),*) => {$(
        impl<S: Simd> $trait for Wide<S> {
            type Output = Self;
            #[inline(always)]
            fn $name(self, other: Self) -> Self {
                Wide { vector: self.simd.$name(self.vector, other.vector), ..self }
            }
        }
        impl<S: Simd> $trait<f64> for Wide<S> {
            type Output = Self;
            #[inline(always)]
            fn $name(self, other: f64) -> Self {
                Wide { vector: self.simd.$name(self.vector, self.simd.splat(other)), ..self }
            }
        }
    )*};
}
operator!(Add add, Sub sub, Mul mul, Div div);

impl<S: Simd> Neg for Wide<S> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Wide { vector: self.simd.sub(self.simd.splat(0.0), self.vector), ..self }
    }
}

impl<S: Simd> AddAssign for Wide<S> {
    #[inline(always)]
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl<S: Simd> SubAssign for Wide<S> {
    #[inline(always)]
    fn sub_assign(&mut self, other: Self) {
        *self = *self - other;
    }
}
