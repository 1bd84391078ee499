//! A smooth curve of one argument: cubic splines, whose knots are close to each other where the argument is small.
//!
//! ```text
//! τ(x) = Σ c_i B(w(x)/h − i)      B: cubic B-spline,  w(x) = arsinh(x / x₀) x₀
//! ```

/// Coefficients of a curve.
pub const COEFFICIENTS: usize = 8;

/// x₀ as a share of the largest |x|.
const BEND: f64 = 0.1;

/// The knots of one curve.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Knots {
    range: [f64; 2],
    /// x₀; no bend where it is infinite.
    bend: f64,
    first: f64,
    spacing: f64,
}

impl Knots {
    /// Knots for x in `range`; arguments that have no place of their own at zero are not bent.
    pub fn over(range: [f64; 2], bends: bool) -> Self {
        let largest = range[0].abs().max(range[1].abs()).max(1e-12);
        let bend = if bends { BEND * largest } else { f64::INFINITY };
        let mut knots = Knots { range, bend, first: 0.0, spacing: 1.0 };
        let (low, high) = (knots.bent(range[0]).0, knots.bent(range[1]).0);
        // So many coefficients leave three fewer intervals.
        knots.spacing = ((high - low) / (COEFFICIENTS - 3) as f64).max(1e-12);
        knots.first = low;
        knots
    }

    /// What the knots cover.
    pub fn range(&self) -> [f64; 2] {
        self.range
    }

    /// w(x) and its slope.
    fn bent(&self, x: f64) -> (f64, f64) {
        if self.bend.is_infinite() {
            return (x, 1.0);
        }
        let share = x / self.bend;
        (self.bend * share.asinh(), 1.0 / (1.0 + share * share).sqrt())
    }

    /// The four splines that are not zero at x, as (index, value, slope). Beyond the ends a curve goes on as at the end.
    pub fn basis(&self, x: f64) -> [(usize, f64, f64); 4] {
        let (w, slope) = self.bent(x);
        let last = (COEFFICIENTS - 3) as f64;
        let place = (w - self.first) / self.spacing;
        let inside = place.clamp(0.0, last);
        let slope = if place == inside { slope / self.spacing } else { 0.0 };
        let interval = (inside.floor() as usize).min(COEFFICIENTS - 4);
        let t = inside - interval as f64;
        let (t2, t3, s) = (t * t, t * t * t, 1.0 - t);
        let values = [s * s * s, 3.0 * t3 - 6.0 * t2 + 4.0, -3.0 * t3 + 3.0 * t2 + 3.0 * t + 1.0, t3];
        let slopes = [-3.0 * s * s, 9.0 * t2 - 12.0 * t, -9.0 * t2 + 6.0 * t + 3.0, 3.0 * t2];
        [0, 1, 2, 3].map(|i| (interval + i, values[i] / 6.0, slopes[i] / 6.0 * slope))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn value(knots: &Knots, coefficients: &[f64], x: f64) -> f64 {
        knots.basis(x).into_iter().map(|(i, value, _)| coefficients[i] * value).sum()
    }

    #[test]
    fn splines_add_up_to_one_and_have_the_slopes_of_differences() {
        for knots in [Knots::over([-4.0, 5.0], true), Knots::over([-0.3, 0.6], false)] {
            for x in [-0.29, -0.1, 0.0, 1e-3, 0.2, 0.55] {
                let sum: f64 = knots.basis(x).iter().map(|(_, value, _)| value).sum();
                assert!((sum - 1.0).abs() < 1e-14, "{sum}");
                let coefficients: Vec<f64> = (0..COEFFICIENTS).map(|i| (i as f64 * 1.7).sin()).collect();
                let slope: f64 = knots.basis(x).iter().map(|(i, _, slope)| coefficients[*i] * slope).sum();
                let by = 1e-6;
                let expected =
                    (value(&knots, &coefficients, x + by) - value(&knots, &coefficients, x - by)) / (2.0 * by);
                assert!((slope - expected).abs() < 1e-6 * (1.0 + expected.abs()), "{x}: {slope} and {expected}");
            }
        }
    }

    #[test]
    fn a_curve_goes_on_level_beyond_its_ends() {
        let knots = Knots::over([0.0, 10.0], false);
        let coefficients = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0];
        assert_eq!(value(&knots, &coefficients, 12.0), value(&knots, &coefficients, 10.0));
        assert!((value(&knots, &coefficients, 5.0) - 4.5).abs() < 1e-12, "a straight line is met exactly");
    }
}
