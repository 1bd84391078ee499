//! Inner iterations: states that suit shared unknowns which a step has moved, before the step is judged.
//!
//! A step in all unknowns goes by the slopes where it starts. Where shared unknowns move far, states bend away from that line: a friction that reverses
//! at another instant has its neighbours' rows wrong by thousands of sigmas, and the search would creep by small parts of each step. With the shared
//! unknowns held, a few Gauss–Newton steps of the states alone mend that (Ruhe and Wedin 1980; the inner iterations of variable projection).

use super::{Settings, total_cost};
use crate::factor::Factor;
use crate::{LeastSquares, Step};

/// Steps of one iteration, each damped more than the one before, after which they are tried in vain.
const MOST_TRIALS: usize = 3;
/// Iterations after such a one in which they are not tried again.
const PAUSE: usize = 2;
/// A part of a step of the states whose whole is too long.
const PART: f64 = 0.3;
/// Most of them after one step.
const MOST: usize = 4;
/// They end where one changes the cost by less than this share.
const ENOUGH: f64 = 0.01;

/// What inner iterations need from one step of the search to the next.
#[derive(Debug, Default)]
pub(super) struct Inner {
    factor: Option<Factor>,
    step: Step,
    pause: usize,
    tried: usize,
    /// Factorisations so far.
    spent: usize,
}

/// What inner iterations came to.
pub(super) enum Relaxed {
    /// This cost, less than where the step started from.
    Lower(f64),
    /// More than that.
    NoLower,
    /// There was no reason to try.
    NotTried,
}

impl Inner {
    /// Another iteration of the search.
    pub(super) fn begin(&mut self) {
        self.pause = if self.tried == MOST_TRIALS { PAUSE } else { self.pause.saturating_sub(1) };
        self.tried = 0;
    }

    /// Moves the states of `trial`, whose cost is `cost`, to where they suit its shared unknowns, if that is less than `below`. `spare` is memory.
    pub(super) fn relax<P: LeastSquares>(
        &mut self,
        problem: &P,
        (trial, spare): (&mut P::Point, &mut P::Point),
        (mut cost, below): (f64, f64),
        settings: &Settings,
    ) -> Relaxed {
        if self.pause > 0 || self.tried == MOST_TRIALS || self.spent >= settings.inner_iterations {
            return Relaxed::NotTried;
        }
        let held = vec![0.0; problem.shape().border];
        if self.factor.is_none() {
            self.factor = Factor::with_precision(problem, settings.precision).ok();
        }
        let Some(factor) = self.factor.as_mut() else { return Relaxed::NotTried };
        for _ in 0..MOST {
            self.spent += 1;
            if factor.factorise(problem, trial, 0.0, settings.threads).is_err() {
                break;
            }
            factor.back_substitute(&held, settings.threads, &mut self.step);
            problem.retract(trial, &self.step, spare);
            let mut after = total_cost(problem, spare, settings.threads);
            // NaN is no less.
            if after.is_nan() || after >= cost {
                self.step.scale(PART);
                problem.retract(trial, &self.step, spare);
                after = total_cost(problem, spare, settings.threads);
            }
            if after.is_nan() || after >= cost {
                break;
            }
            std::mem::swap(trial, spare);
            let before = std::mem::replace(&mut cost, after);
            if before - after < ENOUGH * before {
                break;
            }
        }
        if cost < below {
            self.tried = 0;
            return Relaxed::Lower(cost);
        }
        self.tried += 1;
        Relaxed::NoLower
    }
}
