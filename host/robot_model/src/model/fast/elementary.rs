//! Sine, cosine and the friction's sigmoid of four numbers at once.
//!
//! Polynomials on a reduced argument, as in fdlibm; within 2 ulp of the scalar functions for angles below 1e5 rad.

// The constants are the published ones, digit by digit.
#![allow(clippy::excessive_precision)]

use solve::simd::{LANES, Simd, Wide};

/// Σ c[i] xⁱ.
#[inline(always)]
fn polynomial<S: Simd, const N: usize>(x: Wide<S>, c: [f64; N]) -> Wide<S> {
    let mut sum = Wide::splat(x.simd, c[N - 1]);
    for i in (0..N - 1).rev() {
        sum = sum.mul_add(x, Wide::splat(x.simd, c[i]));
    }
    sum
}

/// π/2 in three parts of 33 bits and the rest.
const HALF_PI: [f64; 3] = [1.570_796_326_734_125_614_17, 6.077_100_506_506_192_249e-11, 2.022_266_248_795_950_63e-21];

/// (sin x, cos x).
#[inline(always)]
pub fn sin_cos<S: Simd>(x: Wide<S>) -> (Wide<S>, Wide<S>) {
    let quarter = (x * std::f64::consts::FRAC_2_PI).round();
    let mut r = x;
    for part in HALF_PI {
        r = (-quarter).mul_add(Wide::splat(x.simd, part), r);
    }
    let z = r * r;
    let s = polynomial(
        z,
        [
            -1.666_666_666_666_663_24e-1,
            8.333_333_333_322_489_46e-3,
            -1.984_126_982_985_795e-4,
            2.755_731_370_707_006_77e-6,
            -2.505_076_025_340_686_34e-8,
            1.589_690_995_211_550_1e-10,
        ],
    );
    let s = (s * z).mul_add(r, r);
    let c = polynomial(
        z,
        [
            4.166_666_666_666_660_19e-2,
            -1.388_888_888_887_410_96e-3,
            2.480_158_728_947_673e-5,
            -2.755_731_435_139_066_33e-7,
            2.087_572_321_298_175e-9,
            -1.135_964_755_778_819_5e-11,
        ],
    );
    let c = (c * z).mul_add(z, Wide::splat(x.simd, 1.0) - z * 0.5);
    // Quarter turns: 0 (s, c), 1 (c, −s), 2 (−s, −c), 3 (−c, s). Joints seldom turn that far: most of the time nothing is to do.
    let quarter = quarter.to_array();
    if quarter == [0.0; LANES] {
        return (s, c);
    }
    let (mut s, mut c) = (s.to_array(), c.to_array());
    for i in 0..LANES {
        (s[i], c[i]) = match quarter[i].rem_euclid(4.0) as u8 {
            0 => (s[i], c[i]),
            1 => (c[i], -s[i]),
            2 => (-s[i], -c[i]),
            _ => (-c[i], s[i]),
        };
    }
    (Wide::load(x.simd, &s), Wide::load(x.simd, &c))
}

/// exp x for −700 ≤ x ≤ 0.
#[inline(always)]
fn exp_of_negative<S: Simd>(x: Wide<S>) -> Wide<S> {
    let simd = x.simd;
    let n = (x * std::f64::consts::LOG2_E).round();
    let r = (-n).mul_add(Wide::splat(simd, 6.931_471_803_691_238_164_9e-1), x);
    let r = (-n).mul_add(Wide::splat(simd, 1.908_214_929_270_587_7e-10), r);
    let p = polynomial(
        r,
        [
            1.0,
            1.0,
            1.0 / 2.0,
            1.0 / 6.0,
            1.0 / 24.0,
            1.0 / 120.0,
            1.0 / 720.0,
            1.0 / 5040.0,
            1.0 / 40320.0,
            1.0 / 362_880.0,
            1.0 / 3_628_800.0,
            1.0 / 39_916_800.0,
            1.0 / 479_001_600.0,
        ],
    );
    // 1.5 · 2⁵²: adding it leaves the integer n in the low bits.
    let shifted = (n + 6_755_399_441_055_744.0).to_array();
    let mut power = [0.0; LANES];
    for i in 0..LANES {
        power[i] = f64::from_bits(shifted[i].to_bits().wrapping_add(1023) << 52);
    }
    p * Wide::load(simd, &power)
}

/// The sigmoid of friction, 2 (1/(1+exp(−a)) − ½), and its derivative by a.
#[inline(always)]
pub fn sigmoid<S: Simd>(a: Wide<S>) -> (Wide<S>, Wide<S>) {
    let simd = a.simd;
    let (mut minus, mut sign) = (a.to_array(), [1.0; LANES]);
    for i in 0..LANES {
        if minus[i] > 0.0 {
            minus[i] = -minus[i];
        } else {
            sign[i] = -1.0;
        }
        // Where the sigmoid is one to the last digit; not a number stays what it is.
        if minus[i] < -700.0 {
            minus[i] = -700.0;
        }
    }
    let e = exp_of_negative(Wide::load(simd, &minus));
    let one = Wide::splat(simd, 1.0);
    let inverse = one / (one + e);
    ((one - e) * inverse * Wide::load(simd, &sign), e * 2.0 * inverse * inverse)
}

#[cfg(test)]
mod tests {
    use super::*;
    use solve::simd::{Plain, Work, vectorised};

    /// The functions under test, on every instruction set.
    struct Both([f64; LANES]);
    impl Work for Both {
        type Output = [[f64; LANES]; 4];
        #[inline(always)]
        fn run<S: Simd>(self, simd: S) -> Self::Output {
            let x = Wide::load(simd, &self.0);
            let ((s, c), (g, d)) = (sin_cos(x), sigmoid(x));
            [s.to_array(), c.to_array(), g.to_array(), d.to_array()]
        }
    }

    #[test]
    fn they_are_those_of_the_standard_library() {
        for i in -4000..4000 {
            let x = [1e-3 * f64::from(i), 0.37 * f64::from(i), f64::from(i) * 23.0, f64::from(i).powi(3) * 1e-9];
            for found in [vectorised(Both(x)), Both(x).run(Plain)] {
                for (lane, x) in x.into_iter().enumerate() {
                    let expected = [x.sin(), x.cos(), (0.5 * x).tanh(), 0.5 / (0.5 * x).cosh().powi(2)];
                    for (f, (found, expected)) in found.iter().zip(expected).enumerate() {
                        // atol: 2 ulp of one
                        let off = (found[lane] - expected).abs();
                        assert!(off <= 5e-16, "function {f} of {x}: {} against {expected}", found[lane]);
                    }
                }
            }
        }
        assert!(vectorised(Both([f64::NAN; LANES])).iter().flatten().all(|v| v.is_nan()));
    }
}
