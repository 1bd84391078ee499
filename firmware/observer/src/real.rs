//! Real numbers of either precision with the few functions that the model needs, without the standard library, which `no_std` programs do not have.
//!
//! Sine and cosine are those of angles up to some hundred thousand radians. Errors are a few units in the last place.

use core::ops::{Add, AddAssign, Div, Mul, Neg, Sub};

/// A real number: `f64` or `f32`.
pub trait Real:
    Copy
    + PartialOrd
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
    + AddAssign
{
    /// π/2 in parts of few digits.
    const HALF_PI: [f64; 3];
    /// ln 2 in parts of few digits.
    const LN_2: [f64; 2];
    /// Least and largest exponent of e that is a number.
    const EXP_RANGE: [f64; 2];

    /// The number nearest to this one.
    fn of(number: f64) -> Self;
    /// The integer nearest to it, of those that are small enough.
    fn round(self) -> i32;
    /// 2 to this power, of normal numbers.
    fn power_of_two(exponent: i32) -> Self;
    /// A positive number as m 2ᵉ, 1 ≤ m < 2.
    fn split(self) -> (Self, i32);

    /// Whether it is no number.
    fn is_nan(self) -> bool {
        self.partial_cmp(&self).is_none()
    }

    /// |x|.
    fn abs(self) -> Self {
        if self < Self::of(0.0) { -self } else { self }
    }

    /// sin x.
    fn sin(self) -> Self {
        let (quarter, rest) = quarters(self);
        match quarter {
            0 => sine(rest),
            1 => cosine(rest),
            2 => -sine(rest),
            _ => -cosine(rest),
        }
    }

    /// cos x.
    fn cos(self) -> Self {
        let (quarter, rest) = quarters(self);
        match quarter {
            0 => cosine(rest),
            1 => -sine(rest),
            2 => -cosine(rest),
            _ => sine(rest),
        }
    }

    /// eˣ.
    fn exp(self) -> Self {
        let [least, largest] = Self::EXP_RANGE;
        if self < Self::of(least) {
            return Self::of(0.0);
        }
        if self > Self::of(largest) {
            return Self::of(f64::INFINITY);
        }
        let power = (self * Self::of(core::f64::consts::LOG2_E)).round();
        let whole = Self::of(f64::from(power));
        let rest = self - whole * Self::of(Self::LN_2[0]) - whole * Self::of(Self::LN_2[1]);
        // Taylor's series to the fourteenth term: 1e-17 is left at ½ ln 2.
        let mut sum = Self::of(1.0);
        for n in (1..14).rev() {
            sum = Self::of(1.0) + sum * rest / Self::of(f64::from(n));
        }
        let half = power / 2;
        sum * Self::power_of_two(half) * Self::power_of_two(power - half)
    }

    /// Natural logarithm.
    fn ln(self) -> Self {
        let (zero, infinite) = (Self::of(0.0), Self::of(f64::INFINITY));
        if self <= zero || self >= infinite || self.is_nan() {
            return if self == zero {
                -infinite
            } else if self > zero {
                self
            } else {
                Self::of(f64::NAN)
            };
        }
        let (mut mantissa, mut power) = self.split();
        if mantissa > Self::of(core::f64::consts::SQRT_2) {
            (mantissa, power) = (mantissa * Self::of(0.5), power + 1);
        }
        let (f, whole) = (mantissa - Self::of(1.0), Self::of(f64::from(power)));
        // ln (1 + f) = 2 artanh s, s = f / (2 + f), |s| < 0.172.
        let s = f / (Self::of(2.0) + f);
        let z = s * s;
        let mut sum = zero;
        for n in (1..12).rev() {
            sum = z * (Self::of(1.0 / f64::from(2 * n + 1)) + sum);
        }
        let two_s = s + s;
        whole * Self::of(Self::LN_2[0]) + (two_s + (two_s * sum + whole * Self::of(Self::LN_2[1])))
    }

    /// tanh x.
    fn tanh(self) -> Self {
        let number = Self::of;
        let size = self.abs();
        if size < number(0.25) {
            // Lambert's continued fraction to the sixth term.
            let z = self * self;
            let above = number(10395.0) + z * (number(1260.0) + z * number(21.0));
            return self * above / (number(10395.0) + z * (number(4725.0) + z * (number(210.0) + z)));
        }
        let e = (-(size + size)).exp();
        let value = (number(1.0) - e) / (number(1.0) + e);
        if self < number(0.0) { -value } else { value }
    }

    /// √x.
    fn sqrt(self) -> Self {
        let (zero, infinite) = (Self::of(0.0), Self::of(f64::INFINITY));
        if self <= zero || self >= infinite || self.is_nan() {
            return if self < zero { Self::of(f64::NAN) } else { self };
        }
        let (mantissa, power) = self.split();
        let odd = power & 1;
        let m = if odd == 1 { mantissa + mantissa } else { mantissa };
        // Newton's method from a chord of 1 ≤ m < 4: each step doubles the digits.
        let mut root = Self::of(0.69) + m * Self::of(0.34);
        for _ in 0..5 {
            root = (root + m / root) * Self::of(0.5);
        }
        root * Self::power_of_two((power - odd) / 2)
    }
}

/// The quarter turn that an angle is nearest to, and what is left, at most an eighth of a turn.
fn quarters<T: Real>(x: T) -> (i32, T) {
    let count = (x * T::of(core::f64::consts::FRAC_2_PI)).round();
    let whole = T::of(f64::from(count));
    let [a, b, c] = T::HALF_PI.map(T::of);
    (count & 3, ((x - whole * a) - whole * b) - whole * c)
}

/// sin x of an eighth of a turn at most.
fn sine<T: Real>(x: T) -> T {
    let z = x * x;
    let c = [
        -1.666_666_666_666_663_2e-1,
        8.333_333_333_322_49e-3,
        -1.984_126_982_985_795e-4,
        2.755_731_370_707_007e-6,
        -2.505_076_025_340_686_4e-8,
        1.589_690_995_211_55e-10,
    ];
    let mut sum = T::of(0.0);
    for c in c.into_iter().rev() {
        sum = T::of(c) + z * sum;
    }
    x + x * z * sum
}

/// cos x likewise.
fn cosine<T: Real>(x: T) -> T {
    let z = x * x;
    let c = [
        4.166_666_666_666_66e-2,
        -1.388_888_888_887_411e-3,
        2.480_158_728_947_673e-5,
        -2.755_731_435_139_066_3e-7,
        2.087_572_321_298_175e-9,
        -1.135_964_755_778_819_5e-11,
    ];
    let mut sum = T::of(0.0);
    for c in c.into_iter().rev() {
        sum = T::of(c) + z * sum;
    }
    let half = z * T::of(0.5);
    let whole = T::of(1.0) - half;
    // What the difference has lost, given back.
    whole + (((T::of(1.0) - whole) - half) + z * z * sum)
}

impl Real for f64 {
    const HALF_PI: [f64; 3] = [1.570_796_326_734_125_6, 6.077_100_506_303_966e-11, 2.022_266_248_795_950_6e-21];
    const LN_2: [f64; 2] = [6.931_471_803_691_238e-1, 1.908_214_929_270_587_7e-10];
    const EXP_RANGE: [f64; 2] = [-745.0, 709.78];

    fn of(number: f64) -> Self {
        number
    }

    fn round(self) -> i32 {
        (self + if self < 0.0 { -0.5 } else { 0.5 }) as i32
    }

    fn power_of_two(exponent: i32) -> Self {
        f64::from_bits(((exponent + 1023) as u64) << 52)
    }

    fn split(self) -> (Self, i32) {
        let bits = self.to_bits();
        let exponent = (bits >> 52) as i32 - 1023;
        (f64::from_bits((bits & ((1 << 52) - 1)) | (1023 << 52)), exponent)
    }
}

impl Real for f32 {
    const HALF_PI: [f64; 3] = [1.570_312_5, 4.837_512_969_970_703e-4, 7.549_789_954_891_88e-8];
    const LN_2: [f64; 2] = [0.693_359_375, -2.121_944_4e-4];
    const EXP_RANGE: [f64; 2] = [-103.0, 88.72];

    fn of(number: f64) -> Self {
        number as f32
    }

    fn round(self) -> i32 {
        (self + if self < 0.0 { -0.5 } else { 0.5 }) as i32
    }

    fn power_of_two(exponent: i32) -> Self {
        f32::from_bits(((exponent + 127) as u32) << 23)
    }

    fn split(self) -> (Self, i32) {
        let bits = self.to_bits();
        let exponent = (bits >> 23) as i32 - 127;
        (f32::from_bits((bits & ((1 << 23) - 1)) | (127 << 23)), exponent)
    }
}
