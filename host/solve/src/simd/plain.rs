//! Vectors of any machine.

use super::{LANES, Simd, Work};

/// Any machine: arrays.
#[derive(Debug, Clone, Copy)]
pub struct Plain;

impl Plain {
    #[inline(always)]
    fn zip(a: [f64; LANES], b: [f64; LANES], f: impl Fn(f64, f64) -> f64) -> [f64; LANES] {
        std::array::from_fn(|i| f(a[i], b[i]))
    }
}

impl Simd for Plain {
    type Vector = [f64; LANES];
    #[inline(always)]
    fn splat(self, value: f64) -> Self::Vector {
        [value; LANES]
    }
    #[inline(always)]
    fn load(self, values: &[f64; LANES]) -> Self::Vector {
        *values
    }
    #[inline(always)]
    fn store(self, vector: Self::Vector) -> [f64; LANES] {
        vector
    }
    #[inline(always)]
    fn load_single(self, values: &[f32; LANES]) -> Self::Vector {
        values.map(f64::from)
    }
    #[inline(always)]
    fn store_single(self, vector: Self::Vector) -> [f32; LANES] {
        vector.map(|value| value as f32)
    }
    #[inline(always)]
    fn add(self, a: Self::Vector, b: Self::Vector) -> Self::Vector {
        Self::zip(a, b, |a, b| a + b)
    }
    #[inline(always)]
    fn sub(self, a: Self::Vector, b: Self::Vector) -> Self::Vector {
        Self::zip(a, b, |a, b| a - b)
    }
    #[inline(always)]
    fn mul(self, a: Self::Vector, b: Self::Vector) -> Self::Vector {
        Self::zip(a, b, |a, b| a * b)
    }
    #[inline(always)]
    fn div(self, a: Self::Vector, b: Self::Vector) -> Self::Vector {
        Self::zip(a, b, |a, b| a / b)
    }
    #[inline(always)]
    fn mul_add(self, a: Self::Vector, b: Self::Vector, c: Self::Vector) -> Self::Vector {
        // NEON's multiply-add is always fused; where it is no instruction, the fused form is a slow library call.
        let fused = cfg!(target_arch = "aarch64");
        std::array::from_fn(|i| if fused { a[i].mul_add(b[i], c[i]) } else { a[i] * b[i] + c[i] })
    }
    #[inline(always)]
    fn mul_sub_from(self, a: Self::Vector, b: Self::Vector, c: Self::Vector) -> Self::Vector {
        self.mul_add(a.map(|a| -a), b, c)
    }
    #[inline(always)]
    fn sqrt(self, a: Self::Vector) -> Self::Vector {
        a.map(f64::sqrt)
    }
    #[inline(always)]
    fn round(self, a: Self::Vector) -> Self::Vector {
        a.map(f64::round_ties_even)
    }
    #[inline(always)]
    fn transpose(self, rows: [Self::Vector; LANES]) -> [Self::Vector; LANES] {
        std::array::from_fn(|i| std::array::from_fn(|j| rows[j][i]))
    }
    #[inline(always)]
    fn apart<W: Work>(self, work: W) -> W::Output {
        work.run(self)
    }
}
