//! Vectors of x86-64 with AVX2 and FMA, one register each; through `pulp`, whose token proves that the machine has them.

use pulp::x86::V3;
use pulp::{cast, f64x4};

use super::{LANES, Simd, Work};

/// A work with its token.
pub(super) struct With<W>(pub W, pub V3);

impl<W: Work> pulp::NullaryFnOnce for With<W> {
    type Output = W::Output;
    #[inline(always)]
    fn call(self) -> W::Output {
        self.0.run(self.1)
    }
}

impl Simd for V3 {
    type Vector = f64x4;
    #[inline(always)]
    fn splat(self, value: f64) -> f64x4 {
        self.splat_f64x4(value)
    }
    #[inline(always)]
    fn load(self, values: &[f64; LANES]) -> f64x4 {
        cast(*values)
    }
    #[inline(always)]
    fn store(self, vector: f64x4) -> [f64; LANES] {
        cast(vector)
    }
    #[inline(always)]
    fn load_single(self, values: &[f32; LANES]) -> f64x4 {
        self.convert_f32x4_to_f64x4(cast(*values))
    }
    #[inline(always)]
    fn store_single(self, vector: f64x4) -> [f32; LANES] {
        cast(self.convert_f64x4_to_f32x4(vector))
    }
    #[inline(always)]
    fn add(self, a: f64x4, b: f64x4) -> f64x4 {
        self.add_f64x4(a, b)
    }
    #[inline(always)]
    fn sub(self, a: f64x4, b: f64x4) -> f64x4 {
        self.sub_f64x4(a, b)
    }
    #[inline(always)]
    fn mul(self, a: f64x4, b: f64x4) -> f64x4 {
        self.mul_f64x4(a, b)
    }
    #[inline(always)]
    fn div(self, a: f64x4, b: f64x4) -> f64x4 {
        self.div_f64x4(a, b)
    }
    #[inline(always)]
    fn mul_add(self, a: f64x4, b: f64x4, c: f64x4) -> f64x4 {
        self.mul_add_f64x4(a, b, c)
    }
    #[inline(always)]
    fn mul_sub_from(self, a: f64x4, b: f64x4, c: f64x4) -> f64x4 {
        self.negate_mul_add_f64x4(a, b, c)
    }
    #[inline(always)]
    fn sqrt(self, a: f64x4) -> f64x4 {
        self.sqrt_f64x4(a)
    }
    #[inline(always)]
    fn round(self, a: f64x4) -> f64x4 {
        self.round_f64x4(a)
    }
    #[inline(always)]
    fn transpose(self, [a, b, c, d]: [f64x4; LANES]) -> [f64x4; LANES] {
        let avx = self.avx;
        let [a, b, c, d] = [a, b, c, d].map(cast);
        // a0 b0 a2 b2, a1 b1 a3 b3, …
        let (even, odd) = (avx._mm256_unpacklo_pd(a, b), avx._mm256_unpackhi_pd(a, b));
        let (even_below, odd_below) = (avx._mm256_unpacklo_pd(c, d), avx._mm256_unpackhi_pd(c, d));
        [
            cast(avx._mm256_permute2f128_pd::<0x20>(even, even_below)),
            cast(avx._mm256_permute2f128_pd::<0x20>(odd, odd_below)),
            cast(avx._mm256_permute2f128_pd::<0x31>(even, even_below)),
            cast(avx._mm256_permute2f128_pd::<0x31>(odd, odd_below)),
        ]
    }
    #[inline(always)]
    fn apart<W: Work>(self, work: W) -> W::Output {
        self.vectorize(With(work, self))
    }
}
