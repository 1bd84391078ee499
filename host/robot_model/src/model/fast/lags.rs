//! Gyros that lag, four samples at once: see [`relaxation`](crate::model::relaxation). What a lagging state goes towards is the rate w of its body, and nothing
//! goes by the state, so that a step is
//!
//! ```text
//! y(h) = e⁻ˣ y + Σ b w        ∂y(h) = e⁻ˣ ∂y + Σ b ∂w + ∂(e⁻ˣ) y + Σ ∂b w, the last two by ln T alone
//! ```

use super::gyro::{GyroQuads, RateSource};
use super::{Dynamics, Fast, Samples};
use crate::model::relaxation::{MOST_STAGES, Relaxation};
use solve::simd::{LANES, Quad, Simd, Wide};

/// The axes of bodies.
const BODY_AXES: crate::robot::Matrix3 = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

/// One lagging state over a step.
#[derive(Debug, Clone, Copy, Default)]
struct LaggingState {
    state: usize,
    /// The column of ln T.
    column: usize,
    /// e⁻ˣ, and b of every stage.
    carried: Quad,
    weights: [Quad; MOST_STAGES],
    /// y after the step, and its derivative by ln T at fixed y and w.
    next: Quad,
    by_log: Quad,
    /// ∂b/∂ln T of every stage.
    weights_by_log: [Quad; MOST_STAGES],
}

/// All lagging states over a step.
#[derive(Debug, Clone, Default)]
pub(super) struct Lags {
    states: Vec<LaggingState>,
}

impl Lags {
    /// At the begin of a step from `x` by a method of so many stages.
    #[inline(always)]
    pub(super) fn begin(&mut self, dynamics: &Dynamics<'_>, x: &[Quad], duration_s: &Quad, stages: usize) {
        self.states.clear();
        for lag in &dynamics.model.laws.lags {
            let (column, time_constant_s) = (dynamics.size() + lag.coordinate, dynamics.z[lag.coordinate].exp());
            for state in lag.state..lag.state + 3 {
                let mut of = LaggingState { state, column, ..LaggingState::default() };
                for lane in 0..LANES {
                    let y = x[state].0[lane];
                    let one = Relaxation::begin((state, column), time_constant_s, y, duration_s.0[lane], stages);
                    of.carried.0[lane] = one.carried[0];
                    (of.next.0[lane], of.by_log.0[lane]) = (one.next, one.carried[1] * y);
                    for (stage, [weight, by_log]) in one.weights.into_iter().enumerate() {
                        of.weights[stage].0[lane] = weight;
                        of.weights_by_log[stage].0[lane] = by_log;
                    }
                }
                self.states.push(of);
            }
        }
    }

    /// Takes in a stage; its slopes by q and q̇ go into rows of `f` by so many columns, where it is given.
    #[inline(always)]
    pub(super) fn take<S: Simd, const L: usize>(
        &mut self,
        (fast, dynamics): (&Fast, &Dynamics<'_>),
        samples: &Samples<S, L>,
        stage: usize,
        mut f: Option<(&mut [Quad], usize)>,
    ) {
        let simd = samples.simd;
        for (lag, states) in dynamics.model.laws.lags.iter().zip(self.states.chunks_exact_mut(3)) {
            let gyro = GyroQuads::of(samples, fast, lag.body, &BODY_AXES, RateSource::Base);
            for (axis, of) in states.iter_mut().enumerate() {
                let rate = gyro.rate(axis);
                let add = |to: &mut Quad, weight: &Quad| {
                    to.0 = Wide::load(simd, &weight.0).mul_add(rate, Wide::load(simd, &to.0)).to_array();
                };
                add(&mut of.next, &of.weights[stage]);
                add(&mut of.by_log, &of.weights_by_log[stage]);
                if let Some((f, columns)) = &mut f {
                    let row = &mut f[of.state * *columns..][..*columns];
                    let (by_position, by_speed) = gyro.slopes(axis);
                    for j in 0..L {
                        row[j] = Quad(by_position[j].to_array());
                        row[L + j] = Quad(by_speed[j].to_array());
                    }
                }
            }
        }
    }

    /// The states after the step.
    #[inline(always)]
    pub(super) fn put(&self, next: &mut [Quad]) {
        for of in &self.states {
            next[of.state] = of.next;
        }
    }

    /// The column c of all states at the first stage into `to`, which begins with the column: `unit` is the column of the state there.
    #[inline(always)]
    pub(super) fn begin_column<S: Simd, const L: usize>(
        &self,
        simd: S,
        (f, columns, c): (&[Quad], usize, usize),
        unit: &[Quad],
        to: &mut [Quad],
    ) {
        for of in &self.states {
            let mut sum = Wide::load(simd, &of.carried.0) * Wide::load(simd, &unit[of.state].0);
            if of.column == c {
                sum += Wide::load(simd, &of.by_log.0);
            }
            if c < 2 * L {
                let by_state = Wide::load(simd, &f[of.state * columns + c].0);
                sum = Wide::load(simd, &of.weights[0].0).mul_add(by_state, sum);
            }
            to[of.state * columns] = Quad(sum.to_array());
        }
    }

    /// Takes in a further stage, at which positions and speeds of links have these derivatives.
    #[inline(always)]
    pub(super) fn take_column<S: Simd, const L: usize>(
        &self,
        simd: S,
        (f, columns): (&[Quad], usize),
        (q, qd): (&[Wide<S>; L], &[Wide<S>; L]),
        stage: usize,
        to: &mut [Quad],
    ) {
        for of in &self.states {
            let row = &f[of.state * columns..][..2 * L];
            let mut by_state = Wide::splat(simd, 0.0);
            for j in 0..L {
                by_state = Wide::load(simd, &row[j].0).mul_add(q[j], by_state);
                by_state = Wide::load(simd, &row[L + j].0).mul_add(qd[j], by_state);
            }
            let to = &mut to[of.state * columns].0;
            *to = Wide::load(simd, &of.weights[stage].0).mul_add(by_state, Wide::load(simd, to)).to_array();
        }
    }
}
