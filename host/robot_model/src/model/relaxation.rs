//! States that relax towards what the others make, `T ẏ = w − y`, over one step: exactly, however short T is.
//!
//! A method's own weights carry `1 − x + x²/2 − …` of y over a step h, x = h/T, which below a sample period has little to do with e⁻ˣ. But w is a
//! smooth function of the state, and known at the method's stages; through its values at the step's begin, middle and end goes a parabola, and with σ = s/h
//!
//! ```text
//! y(h) = e⁻ˣ y + Σ b w        I₀ = 1 − e⁻ˣ,  I₁ = 1 − I₀/x,  I₂ = 1 − 2 I₁/x:  ∫ σⁿ e^(−(h−s)/T) ds/T
//!
//! b:   begin  I₀ − 3 I₁ + 2 I₂      middle  4 I₁ − 4 I₂      end  2 I₂ − I₁
//! ```
//! A method of one stage knows w at the begin only and holds it.

/// Stages of a method at most.
pub(super) const MOST_STAGES: usize = 4;

/// One such state, and its step as far as the method's stages are taken.
#[derive(Debug, Clone, Copy)]
pub(super) struct Relaxation {
    /// The component of the state.
    pub(super) state: usize,
    /// The column of ln T.
    column: usize,
    time_constant_s: f64,
    /// e⁻ˣ, and by ln T.
    pub(super) carried: [f64; 2],
    /// b of every stage, and by ln T.
    pub(super) weights: [[f64; 2]; MOST_STAGES],
    /// y after the step.
    pub(super) next: f64,
}

impl Relaxation {
    /// State component `state` from `y` on, over `duration_s` by a method of so many stages (one or four); ln T is column `column` of the derivatives.
    pub(super) fn begin(
        (state, column): (usize, usize),
        time_constant_s: f64,
        y: f64,
        duration_s: f64,
        stages: usize,
    ) -> Self {
        let x = duration_s / time_constant_s;
        if x == 0.0 {
            // A step of no length, as that of a lane that stands still; the quotients below would be 0/0.
            let weights = [[0.0; 2]; MOST_STAGES];
            return Relaxation { state, column, time_constant_s, carried: [1.0, 0.0], weights, next: y };
        }
        let carried = (-x).exp();
        // By x: e⁻ˣ falls with itself, the others by the rule of quotients; and dx/d ln T = −x.
        let (i0, by0) = (-(-x).exp_m1(), carried);
        let (i1, by1) = (1.0 - i0 / x, (i0 / x - by0) / x);
        let (i2, by2) = (1.0 - 2.0 * i1 / x, 2.0 * (i1 / x - by1) / x);
        let of = |c0: f64, c1: f64, c2: f64| [c0 * i0 + c1 * i1 + c2 * i2, -x * (c0 * by0 + c1 * by1 + c2 * by2)];
        let mut weights = [[0.0; 2]; MOST_STAGES];
        if stages == 1 {
            weights[0] = of(1.0, 0.0, 0.0);
        } else {
            // Two stages look at the middle.
            let middle = of(0.0, 2.0, -2.0);
            weights = [of(1.0, -3.0, 2.0), middle, middle, of(0.0, -1.0, 2.0)];
        }
        Relaxation { state, column, time_constant_s, carried: [carried, x * carried], weights, next: carried * y }
    }

    /// Takes in a stage: y there, and ẏ.
    pub(super) fn take(&mut self, stage: usize, y: f64, rate: f64) {
        self.next += self.weights[stage][0] * (self.time_constant_s * rate + y);
    }

    /// Begins the derivatives of a step from y.
    pub(super) fn begin_slopes(&self, y: f64, row: &mut [f64]) {
        row.fill(0.0);
        row[self.state] = self.carried[0];
        row[self.column] = self.carried[1] * y;
    }

    /// [`take`](Self::take) of the derivatives; `by_y` are those of y at the stage, `by_rate` those of ẏ.
    pub(super) fn take_slopes(
        &self,
        stage: usize,
        (y, by_y): (f64, &[f64]),
        (rate, by_rate): (f64, &[f64]),
        row: &mut [f64],
    ) {
        let ([weight, by_log], t) = (self.weights[stage], self.time_constant_s);
        for ((to, by_y), by_rate) in row.iter_mut().zip(by_y).zip(by_rate) {
            *to += weight * (t * by_rate + by_y);
        }
        row[self.column] += weight * t * rate + by_log * (t * rate + y);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// y after a step towards the parabola w = c₀ + c₁ σ + c₂ σ².
    fn step(x: f64, y: f64, c: [f64; 3]) -> f64 {
        let mut relaxation = Relaxation::begin((0, 1), 1.0 / x, y, 1.0, 4);
        for (stage, sigma) in [0.0, 0.5, 0.5, 1.0].into_iter().enumerate() {
            let w = c[0] + sigma * (c[1] + sigma * c[2]);
            // Whatever y is taken for at the stage.
            relaxation.take(stage, 0.3, (w - 0.3) * x);
        }
        relaxation.next
    }

    #[test]
    fn a_parabola_is_followed_exactly_however_short_the_time_constant() {
        let c = [0.7, -1.3, 2.1];
        for x in [0.02, 0.3, 1.0, 5.0, 100.0] {
            // The solution of T ẏ = w − y by undetermined coefficients, with h = 1: w − T ẇ + T² ẅ and what of the start dies away.
            let t: f64 = 1.0 / x;
            let particular = |s: f64| c[0] + s * (c[1] + s * c[2]) - t * (c[1] + 2.0 * c[2] * s) + t * t * 2.0 * c[2];
            let expected = particular(1.0) + (0.4 - particular(0.0)) * (-x).exp();
            // rtol 1e-11 of T²: what cancels there
            let found = step(x, 0.4, c);
            assert!((found - expected).abs() <= 1e-11 * (1.0 + t * t), "{x}: {found} {expected}");
        }
    }

    #[test]
    fn a_step_of_no_length_changes_nothing() {
        let mut relaxation = Relaxation::begin((0, 1), 1e-3, 0.4, 0.0, 4);
        let mut row = [f64::NAN; 2];
        relaxation.begin_slopes(0.4, &mut row);
        for stage in 0..4 {
            relaxation.take(stage, 0.4, 7.0);
            relaxation.take_slopes(stage, (0.4, &[1.0, 0.0]), (7.0, &[-1e3, 2.0]), &mut row);
        }
        assert_eq!((relaxation.next, row), (0.4, [1.0, 0.0]));
    }

    #[test]
    fn derivatives_are_those_of_differences() {
        let (y, rates, ys) = (0.4, [3.0, -2.0, 1.5, 0.7], [0.4, 0.5, 0.45, 0.6]);
        for stages in [1, 4] {
            for log in [-9.0_f64, -7.0, -4.0] {
                let run = |log: f64| {
                    let mut relaxation = Relaxation::begin((0, 1), log.exp(), y, 1e-3, stages);
                    (0..stages).for_each(|stage| relaxation.take(stage, ys[stage], rates[stage]));
                    relaxation
                };
                let mut row = [f64::NAN; 2];
                run(log).begin_slopes(y, &mut row);
                // Rates and stages that do not depend on ln T.
                (0..stages).for_each(|stage| {
                    run(log).take_slopes(stage, (ys[stage], &[0.0; 2]), (rates[stage], &[0.0; 2]), &mut row);
                });
                let expected = (run(log + 1e-5).next - run(log - 1e-5).next) / 2e-5;
                // rtol 1e-6: differences; atol 1e-9: what cancels where T is eighteen steps
                assert!(
                    (row[1] - expected).abs() <= 1e-6 * expected.abs() + 1e-9,
                    "{stages} {log}: {} {expected}",
                    row[1]
                );
                assert!((row[0] - (-1e-3 / log.exp()).exp()).abs() < 1e-15);
            }
        }
    }
}
