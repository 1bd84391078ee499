//! Four `f64` side by side: the vectors of the elimination's kernels and of the base model's fast kernel.
//!
//! A [`Simd`] is a token that proves at run time what the machine has; [`vectorised`] picks the best one and runs a [`Work`] compiled
//! for it. On x86-64 with AVX2 and FMA a vector is one register (through `pulp`, so that no `unsafe` is needed here); elsewhere it is a
//! plain array that the compiler does what it can with. Results differ between the two by rounding only: one fuses multiply-adds.
//!
//! Everything that runs inside a work must be `#[inline(always)]`: only what is inlined is compiled for the chosen instruction set.

use std::ops::{Add, AddAssign, Div, Mul, Neg, Sub, SubAssign};

/// Values in a vector.
pub const LANES: usize = 4;

/// Storage of a vector in memory, aligned so that loading it never touches two cache lines.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[repr(C, align(32))]
pub struct Quad(pub [f64; LANES]);

/// The operations on vectors of four, by a token of the instruction set.
pub trait Simd: Copy + Send + Sync {
    /// The vector in registers.
    type Vector: Copy;
    /// The same value in all lanes.
    fn splat(self, value: f64) -> Self::Vector;
    /// From memory.
    fn load(self, values: &[f64; LANES]) -> Self::Vector;
    /// To memory.
    fn store(self, vector: Self::Vector) -> [f64; LANES];
    /// a + b.
    fn add(self, a: Self::Vector, b: Self::Vector) -> Self::Vector;
    /// a − b.
    fn sub(self, a: Self::Vector, b: Self::Vector) -> Self::Vector;
    /// a b.
    fn mul(self, a: Self::Vector, b: Self::Vector) -> Self::Vector;
    /// a / b.
    fn div(self, a: Self::Vector, b: Self::Vector) -> Self::Vector;
    /// a b + c.
    fn mul_add(self, a: Self::Vector, b: Self::Vector, c: Self::Vector) -> Self::Vector;
    /// c − a b.
    fn mul_sub_from(self, a: Self::Vector, b: Self::Vector, c: Self::Vector) -> Self::Vector;
    /// √a.
    fn sqrt(self, a: Self::Vector) -> Self::Vector;
    /// The nearest integers.
    fn round(self, a: Self::Vector) -> Self::Vector;
    /// The transpose of a 4×4 block.
    fn transpose(self, rows: [Self::Vector; LANES]) -> [Self::Vector; LANES];
}

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
}

#[cfg(target_arch = "x86_64")]
impl Simd for pulp::x86::V3 {
    type Vector = pulp::f64x4;
    #[inline(always)]
    fn splat(self, value: f64) -> Self::Vector {
        self.splat_f64x4(value)
    }
    #[inline(always)]
    fn load(self, values: &[f64; LANES]) -> Self::Vector {
        pulp::cast(*values)
    }
    #[inline(always)]
    fn store(self, vector: Self::Vector) -> [f64; LANES] {
        pulp::cast(vector)
    }
    #[inline(always)]
    fn add(self, a: Self::Vector, b: Self::Vector) -> Self::Vector {
        self.add_f64x4(a, b)
    }
    #[inline(always)]
    fn sub(self, a: Self::Vector, b: Self::Vector) -> Self::Vector {
        self.sub_f64x4(a, b)
    }
    #[inline(always)]
    fn mul(self, a: Self::Vector, b: Self::Vector) -> Self::Vector {
        self.mul_f64x4(a, b)
    }
    #[inline(always)]
    fn div(self, a: Self::Vector, b: Self::Vector) -> Self::Vector {
        self.div_f64x4(a, b)
    }
    #[inline(always)]
    fn mul_add(self, a: Self::Vector, b: Self::Vector, c: Self::Vector) -> Self::Vector {
        self.mul_add_f64x4(a, b, c)
    }
    #[inline(always)]
    fn mul_sub_from(self, a: Self::Vector, b: Self::Vector, c: Self::Vector) -> Self::Vector {
        self.negate_mul_add_f64x4(a, b, c)
    }
    #[inline(always)]
    fn sqrt(self, a: Self::Vector) -> Self::Vector {
        self.sqrt_f64x4(a)
    }
    #[inline(always)]
    fn round(self, a: Self::Vector) -> Self::Vector {
        self.round_f64x4(a)
    }
    #[inline(always)]
    fn transpose(self, [a, b, c, d]: [Self::Vector; LANES]) -> [Self::Vector; LANES] {
        let avx = self.avx;
        let [a, b, c, d] = [a, b, c, d].map(pulp::cast);
        // a0 b0 a2 b2, a1 b1 a3 b3, …
        let (even, odd) = (avx._mm256_unpacklo_pd(a, b), avx._mm256_unpackhi_pd(a, b));
        let (even_below, odd_below) = (avx._mm256_unpacklo_pd(c, d), avx._mm256_unpackhi_pd(c, d));
        [
            pulp::cast(avx._mm256_permute2f128_pd::<0x20>(even, even_below)),
            pulp::cast(avx._mm256_permute2f128_pd::<0x20>(odd, odd_below)),
            pulp::cast(avx._mm256_permute2f128_pd::<0x31>(even, even_below)),
            pulp::cast(avx._mm256_permute2f128_pd::<0x31>(odd, odd_below)),
        ]
    }
}

/// A piece of work that is compiled for every instruction set.
pub trait Work {
    /// What the work returns.
    type Output;
    /// Does the work. Implementations mark this `#[inline(always)]`.
    fn run<S: Simd>(self, simd: S) -> Self::Output;
}

/// Runs `work` with the best instruction set that this machine has.
pub fn vectorised<W: Work>(work: W) -> W::Output {
    #[cfg(target_arch = "x86_64")]
    if let Some(v3) = pulp::x86::V3::try_new() {
        struct WithV3<W>(W, pulp::x86::V3);
        impl<W: Work> pulp::NullaryFnOnce for WithV3<W> {
            type Output = W::Output;
            #[inline(always)]
            fn call(self) -> W::Output {
                self.0.run(self.1)
            }
        }
        return pulp::Simd::vectorize(v3, WithV3(work, v3));
    }
    work.run(Plain)
}

/// Runs `f` compiled for the best instruction set that this machine has: for code that the compiler finds the vectors in itself. Only what is inlined
/// into it gains.
#[inline(always)]
pub fn compiled_for_this_machine<R>(f: impl FnOnce() -> R) -> R {
    struct Plainly<F>(F);
    impl<R, F: FnOnce() -> R> Work for Plainly<F> {
        type Output = R;
        #[inline(always)]
        fn run<S: Simd>(self, _simd: S) -> R {
            (self.0)()
        }
    }
    vectorised(Plainly(f))
}

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
