//! The scalar of the laws: a number, or a number with its derivatives by what a law depends on.

use super::elementary;
use crate::robot::chain::{Arithmetic, Lanes};

/// So many widths from its corner a ramp is a line.
pub(in crate::model) const FAR_FROM_CORNER: f64 = 40.0;

/// A scalar with a value: a number, or one with its derivatives.
pub trait Number: Arithmetic {
    /// The value without derivatives.
    fn re(self) -> f64;

    /// f(self) of a function whose value and slope here are known.
    fn through(self, value: f64, slope: f64) -> Self;

    /// self / divisor.
    fn over(self, divisor: Self) -> Self;
}

/// What the laws of joints and sensors need of their scalar: every [`Number`] has it, and so has an [`Expression`](super::expression::Expression), which has no value.
pub trait Quantity: Arithmetic {
    /// 1/x.
    fn recip(self) -> Self;

    /// self / divisor.
    fn over(self, divisor: Self) -> Self;

    /// |x|.
    fn abs(self) -> Self;

    /// eˣ.
    fn exp(self) -> Self;

    /// ln x.
    fn ln(self) -> Self;

    /// tanh x.
    fn tanh(self) -> Self;

    /// max(x, 0) with a corner rounded over ± `width`: w ln(1 + e^(x/w)). Its slope is the logistic function. Nothing at all where it is below the
    /// digits of a number of the corner's size: a slope of 1e-40 is still one to a search.
    fn ramp(self, width: f64) -> Self;

    /// The slope of [`ramp`](Self::ramp): 0 below, 1 above.
    fn step(self, width: f64) -> Self;

    /// `then` where this is above zero, else `otherwise`.
    fn where_positive(self, then: Self, otherwise: Self) -> Self;
}

impl<N: Number> Quantity for N {
    #[inline(always)]
    fn recip(self) -> Self {
        let value = self.re().recip();
        self.through(value, -value * value)
    }

    #[inline(always)]
    fn over(self, divisor: Self) -> Self {
        Number::over(self, divisor)
    }

    #[inline(always)]
    fn abs(self) -> Self {
        self.through(self.re().abs(), if self.re() < 0.0 { -1.0 } else { 1.0 })
    }

    #[inline(always)]
    fn exp(self) -> Self {
        let value = self.re().exp();
        self.through(value, value)
    }

    #[inline(always)]
    fn ln(self) -> Self {
        self.through(self.re().ln(), self.re().recip())
    }

    #[inline(always)]
    fn tanh(self) -> Self {
        let value = elementary::tanh(self.re());
        self.through(value, 1.0 - value * value)
    }

    #[inline(always)]
    fn ramp(self, width: f64) -> Self {
        let a = self.re() / width;
        let e = if a.abs() > FAR_FROM_CORNER { 0.0 } else { (-a.abs()).exp() };
        let slope = if a < 0.0 { e / (1.0 + e) } else { 1.0 / (1.0 + e) };
        self.through(width * (a.max(0.0) + elementary::ln_of_one_and(e)), slope)
    }

    #[inline(always)]
    fn step(self, width: f64) -> Self {
        let value = 0.5 + 0.5 * elementary::tanh(0.5 * self.re() / width);
        self.through(value, value * (1.0 - value) / width)
    }

    #[inline(always)]
    fn where_positive(self, then: Self, otherwise: Self) -> Self {
        if self.re() > 0.0 { then } else { otherwise }
    }
}

impl Number for f64 {
    #[inline(always)]
    fn re(self) -> f64 {
        self
    }

    #[inline(always)]
    fn through(self, value: f64, _slope: f64) -> Self {
        value
    }

    #[inline(always)]
    fn over(self, divisor: Self) -> Self {
        self / divisor
    }
}

impl<const N: usize> Number for Lanes<N> {
    #[inline(always)]
    fn re(self) -> f64 {
        self.re
    }

    #[inline(always)]
    fn through(self, value: f64, slope: f64) -> Self {
        self.map(value, |own| own * slope)
    }

    #[inline(always)]
    fn over(self, divisor: Self) -> Self {
        let value = self.re / divisor.re;
        self.zip(divisor, value, |own, by| (own - value * by) / divisor.re)
    }
}

/// `value` as the variable of lane `lane`.
#[inline(always)]
pub fn variable<const N: usize>(value: f64, lane: usize) -> Lanes<N> {
    let mut lanes = Lanes::from(value);
    lanes.slope[lane] = 1.0;
    lanes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slopes_are_those_of_differences() {
        type One = Lanes<1>;
        type Function = fn(One) -> One;
        let functions: [(&str, Function); 8] = [
            ("recip", Quantity::recip),
            ("abs", Quantity::abs),
            ("exp", Quantity::exp),
            ("tanh", Quantity::tanh),
            ("ramp", |x| x.ramp(0.3)),
            ("step", |x| x.step(0.3)),
            ("ln", |x| Quantity::ln(Quantity::abs(x))),
            ("over", |x| Quantity::over(x + One::from(0.3), x)),
        ];
        for (name, f) in functions {
            for x in [-1.7, -0.2, 0.1, 0.9, 2.5] {
                let value = |x: f64| f(One::from(x)).re;
                let expected = (value(x + 1e-6) - value(x - 1e-6)) / 2e-6;
                let found = f(variable(x, 0)).slope[0];
                // rtol and atol 1e-8: second differences of 1e-6
                assert!((found - expected).abs() < 1e-8 * (1.0 + expected.abs()), "{name}({x}): {found}, {expected}");
            }
        }
    }

    #[test]
    fn a_ramp_is_finite_far_away_and_odd_parts_cancel() {
        assert_eq!(Quantity::ramp(-1e6, 1e-3), 0.0);
        assert_eq!(Quantity::ramp(1e6, 1e-3), 1e6);
        let far = variable::<1>(-0.05, 0).ramp(1e-3);
        assert_eq!((far.re, far.slope[0]), (0.0, 0.0));
        for x in [-0.4, -1e-4, 0.0, 2e-4, 0.3] {
            assert!((Quantity::ramp(x, 1e-3) - Quantity::ramp(-x, 1e-3) - x).abs() < 1e-15);
        }
    }
}
