//! Levenberg–Marquardt on a chain: the states are eliminated, the damping acts on the shared unknowns.
//!
//! Of a rejected step a part is tried first, which costs no more than residuals; then more damping, a solve of the small border and a
//! back-substitution, no new factorisation. Only where the states themselves lead astray (several rejections, near the end one of
//! a step whose promise they make; or a stage that its residuals do not determine) are their diagonals damped too, near the end as much as
//! it takes for steps to keep their promise.

use std::time::Instant;

use super::border::Border;
use super::error::SolveError;
use super::factor::Factor;
use super::threads::both;
use super::{LeastSquares, Step};

mod inner;
mod terms;

use inner::{Inner, Relaxed};
pub use terms::{Enough, Hopeless, Iteration, Seconds, Settings, Solution, Status};

/// Damping from which on a small change of the cost is no sign of a minimum.
const HEAVY_DAMPING: f64 = 1e-2;

/// What a whole step gains of what it promised, where the parabola along it is lowest near its end. Where residuals are large or bend, the
/// matrix of Gauss and Newton is not the cost's curvature and whole steps go too far, or not far enough, again and again (twenty of them,
/// each leaving 73 % of the error, were seen under the rows of the paper). A step to the lowest point of the parabola, 1 / (2 − gain) of the
/// way, leaves none of what went too far, and the whole step after it little of the rest; one shortened step after the other would leave
/// some of both.
const WHOLE_STEP_GAIN: std::ops::RangeInclusive<f64> = 0.6..=1.4;

/// Share of a step's promise from which on it is the states' alone.
const STATES_OWN: f64 = 0.9;

/// Where states stand at a bend of the model, steps have to be damped or shortened, and creep. So many of them in a row that change less
/// than [`CREEPING`] times what is asked are enough; where they promise less than ten times that, it is almost the minimum.
const MOST_CREEPING_STEPS: usize = 4;
/// See there.
const CREEPING: f64 = 10.0;

/// What a step may promise for its factor to serve the next one too, for residuals in units of their noise: less than that, and all unknowns
/// together move by less than one standard deviation. By how much the matrix changes over so little no estimate and no interval shows.
const NEAR_PROMISE: f64 = 0.5;
/// So much less than the one before it has a step by an old factor to promise, for the next one to go by that factor as well: all of them
/// together move by some two standard deviations at most.
const SHRINKS: f64 = 0.3;

/// A change of the cost with which it still falls.
const FALLING: f64 = 0.02;

/// A step that was taken.
struct Accepted {
    /// After it.
    cost: f64,
    /// Of the border.
    damping: f64,
    /// Whether nothing but the whole of it was tried.
    whole: bool,
    /// What it gained of what it promised.
    ratio: f64,
}

impl Accepted {
    /// Whether it was whole, and gained about what it promised.
    fn kept_its_promise(&self) -> bool {
        self.whole && WHOLE_STEP_GAIN.contains(&self.ratio)
    }

    /// By what the damping of the states changes near the end: it is needed as long as steps under it do not keep their promise.
    fn less_state_damping(&self) -> f64 {
        match (self.whole, self.ratio) {
            (false, _) => 10.0,
            (true, 0.5..) => 0.1,
            (true, _) => 1.0,
        }
    }
}

/// Sum of ½ Σ r² over all stages; partial sums over fixed runs of stages make it independent of the number of threads.
pub fn total_cost<P: LeastSquares>(problem: &P, point: &P::Point, threads: usize) -> f64 {
    const RUN: usize = 2048;
    let stages = problem.shape().stages;
    let runs = stages.div_ceil(RUN);
    let sum_runs = |runs: std::ops::Range<usize>| -> Vec<f64> {
        let mut scratch = problem.scratch();
        runs.map(|run| problem.cost(point, run * RUN..((run + 1) * RUN).min(stages), &mut scratch)).collect()
    };
    let half = runs / 2;
    let (mut sums, rest) = both(threads, || sum_runs(0..half), || sum_runs(half..runs));
    sums.extend(rest);
    sums.iter().sum::<f64>() + problem.border_cost(point)
}

/// Minimises ½ Σ r² from `start`. `held` are directions of the shared unknowns that no step takes; `progress` is called once an iteration.
///
/// # Errors
/// A stage too large for the solver, or one that stays undetermined however strongly its states are damped; a search that was stopped.
pub fn minimise<P: LeastSquares>(
    problem: &P,
    start: P::Point,
    held: &[Vec<f64>],
    settings: &Settings,
    mut progress: impl FnMut(usize, &Iteration),
) -> Result<Solution<P::Point>, SolveError> {
    let begin = Instant::now();
    let mut seconds = Seconds::default();
    let mut factor = Factor::with_precision(problem, settings.precision)?;
    let mut point = start;
    // Reused from step to step: fresh memory costs more than the arithmetic on it.
    let mut trial = point.clone();
    let mut spare = (settings.inner_iterations > 0).then(|| point.clone());
    let mut inner = Inner::default();
    let mut step = Step::default();
    let mut cost = total_cost(problem, &point, settings.threads);
    let mut damping = settings.initial_damping;
    let mut state_damping = 0.0;
    let mut iterations: Vec<Iteration> = Vec::new();
    // Whether the last step was moved to the lowest point along its way.
    let mut mended = false;
    let mut status = Status::IterationLimit;
    // Whether the factor is undamped and belongs to the final point, or to one that the tolerance does not tell from it.
    let mut factor_is_final = false;

    let mut still_falls = false;
    let mut creeping_steps = 0;
    // What the last step promised, if its factor serves the next one too.
    let mut near: Option<f64> = None;

    while iterations.len() < settings.max_iterations || (still_falls && iterations.len() < settings.most_while_falling)
    {
        if settings.is_stopped() {
            return Err(SolveError::Stopped);
        }
        let clock = Instant::now();
        let promised_before = near.take();
        let is_old = promised_before.is_some();
        let factored = if is_old {
            factor.renew(problem, &point, settings.threads);
            Ok(())
        } else {
            factor.factorise(problem, &point, state_damping, settings.threads)
        };
        seconds.add(&clock, &factor);
        if let Err(singular) = factored {
            state_damping = if state_damping == 0.0 { 1e-12 } else { state_damping * 100.0 };
            if state_damping > 1e3 {
                return Err(singular.into());
            }
            continue;
        }
        let (information, gradient) = factor.schur();
        let border = Border::new(&information, &gradient, held);
        // What the states alone promise: half the squares that their elimination removed.
        let states_promise = cost - 0.5 * factor.eliminated_square_sum();

        let clock = Instant::now();
        let mut accepted = None;
        let mut trials = 0;
        inner.begin();
        // What an undamped step promises: half the Newton decrement, whatever the damping of the trials.
        let undamped_promise = states_promise + border.step(0.0).map_or(f64::INFINITY, |(_, promise)| promise);
        // Then this step is the last one, whether rounding lets it reduce the cost or not.
        let mut nothing_left = undamped_promise <= settings.relative_cost_change * cost;
        while trials < 12 {
            trials += 1;
            let Some((shared, border_promise)) = border.step(damping) else {
                damping = (damping * 10.0).max(1e-12);
                continue;
            };
            let promised = states_promise + border_promise;
            factor.back_substitute(&shared, settings.threads, &mut step);
            problem.retract(&point, &step, &mut trial);
            let mut trial_cost = total_cost(problem, &trial, settings.threads);
            // The promise is a small difference of large sums: where rounding hides it, a whole step that changes next to nothing tells.
            // NaN counts as a rejection.
            let rejected = trial_cost.is_nan() || trial_cost >= cost;
            let little = (trial_cost - cost).abs() <= settings.relative_cost_change * cost;
            if rejected && is_old && !nothing_left {
                // The old factor leads nowhere, which says nothing of the minimum.
                break;
            }
            nothing_left |= rejected && little && damping <= HEAVY_DAMPING && state_damping <= 1e-9;
            let mut fraction = 1.0;
            let mut is_relaxed = false;
            if let Some(spare) = spare.as_mut().filter(|_| rejected && !nothing_left) {
                match inner.relax(problem, (&mut trial, spare), (trial_cost, cost), settings) {
                    Relaxed::Lower(relaxed) => (trial_cost, is_relaxed) = (relaxed, true),
                    // No damping of the border shortens a step that is the states' own.
                    Relaxed::NoLower if states_promise < STATES_OWN * promised => {
                        damping = (damping * 10.0).max(1e-9);
                        continue;
                    }
                    Relaxed::NoLower | Relaxed::NotTried => {}
                }
            }
            if rejected && !is_relaxed && !nothing_left && trial_cost.is_finite() {
                // Mostly states went too far, past a reversal of friction, which no damping of the border holds back: a part of the same
                // step, to where the parabola through both costs and the slope at the start, −2 · promised, is lowest.
                trials += 1;
                fraction = (promised / (trial_cost - cost + 2.0 * promised)).clamp(0.1, 0.5);
                step.scale(fraction);
                problem.retract(&point, &step, &mut trial);
                trial_cost = total_cost(problem, &trial, settings.threads);
            }
            if trial_cost < cost {
                let ratio = (cost - trial_cost) / (promised * fraction * (2.0 - fraction));
                let (whole, used) = (fraction == 1.0, damping);
                damping *= if ratio < 0.1 {
                    10.0
                } else if ratio > 0.5 && whole {
                    0.1
                } else {
                    1.0
                };
                mended =
                    whole && !is_relaxed && !mended && !nothing_left && !little && !WHOLE_STEP_GAIN.contains(&ratio);
                if mended {
                    trials += 1;
                    let lowest = (2.0 - ratio).max(0.5).recip();
                    step.scale(lowest);
                    problem.retract(&point, &step, &mut trial);
                    let cost_there = total_cost(problem, &trial, settings.threads);
                    if cost_there < trial_cost {
                        trial_cost = cost_there;
                    } else {
                        step.scale(1.0 / lowest);
                        problem.retract(&point, &step, &mut trial);
                    }
                }
                accepted = Some(Accepted { cost: trial_cost, damping: used, whole, ratio });
                break;
            }
            // No damping of the border shortens a step that is the states' own.
            let is_near = promised < FALLING * cost;
            if nothing_left || (is_near && states_promise > STATES_OWN * promised) {
                break;
            }
            damping = (damping * 10.0).max(1e-9);
        }
        seconds.solve += clock.elapsed().as_secs_f64();
        factor_is_final = state_damping == 0.0;
        let Some(accepted) = accepted else {
            if nothing_left {
                status = Status::Converged;
                break;
            }
            if is_old {
                continue;
            }
            if state_damping < 1.0 {
                // The states are the ones that lead astray.
                state_damping = if state_damping == 0.0 { 1e-6 } else { state_damping * 100.0 };
                damping = settings.initial_damping;
                continue;
            }
            status = if undamped_promise <= 1e3 * settings.relative_cost_change * cost {
                Status::Almost
            } else {
                Status::NoProgress
            };
            break;
        };
        let change = (cost - accepted.cost) / accepted.cost.max(f64::MIN_POSITIVE);
        still_falls = change > FALLING;
        std::mem::swap(&mut point, &mut trial);
        let before = std::mem::replace(&mut cost, accepted.cost);
        let iteration = Iteration { cost, damping: accepted.damping, trials, by_old_factor: is_old };
        progress(iterations.len() + 1, &iteration);
        iterations.push(iteration);
        // A heavily damped step and a part of one change little anywhere: they say nothing of the minimum. Nor does a step by an old factor,
        // unless it gains what it promises.
        let is_enough = settings.enough.is_some_and(|enough| enough.is_reached(before, cost));
        let little_changed = (change < settings.relative_cost_change || is_enough)
            && accepted.whole
            && accepted.damping <= HEAVY_DAMPING
            && (!is_old || accepted.kept_its_promise());
        if (nothing_left || little_changed) && state_damping <= 1e-9 {
            status = Status::Converged;
            break;
        }
        factor_is_final = false;
        if settings.hopeless.is_some_and(|hopeless| hopeless.gives_up(iterations.len(), before, cost)) {
            break;
        }
        let shrinks = promised_before.is_none_or(|before| undamped_promise < SHRINKS * before);
        if state_damping == 0.0 && accepted.kept_its_promise() && undamped_promise < NEAR_PROMISE && shrinks {
            near = Some(undamped_promise);
        }
        let creeping = CREEPING * settings.relative_cost_change;
        let is_held_back = !accepted.whole || state_damping > 0.0 || accepted.damping > HEAVY_DAMPING;
        creeping_steps = if is_held_back && change < creeping { creeping_steps + 1 } else { 0 };
        if creeping_steps == MOST_CREEPING_STEPS {
            let is_near = undamped_promise < 10.0 * creeping * cost;
            status = if is_near { Status::Almost } else { Status::NoProgress };
            break;
        }
        state_damping *= if still_falls { 0.01 } else { accepted.less_state_damping() };
        if state_damping <= 1e-9 {
            state_damping = 0.0;
        }
    }

    if !factor_is_final {
        let clock = Instant::now();
        factor.factorise_somehow(problem, &point, settings.threads)?;
        seconds.add(&clock, &factor);
    }
    seconds.total = begin.elapsed().as_secs_f64();
    let (information, gradient) = factor.schur();
    Ok(Solution { point, cost, status, iterations, seconds, information, gradient })
}
