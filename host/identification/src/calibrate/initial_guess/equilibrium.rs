//! States that suit the shared unknowns, before a search moves both.
//!
//! A first guess has passive joints at rest, or swinging as no spring would let them: their rows are wrong by millions of sigmas, their
//! springs, at zero deflection, have no slope, and a step that takes all unknowns along gets lost. With the shared unknowns held the states'
//! equations are all but linear, and a few steps answer them.

use crate::calibrate::residuals::point::Point;
use crate::calibrate::residuals::problem::Problem;
use solve::LeastSquares;
use solve::levenberg::{Settings, minimise, total_cost};

/// A mean square of the rows, in units of their noise, beyond which a start is far away.
const FAR: f64 = 100.0;

/// Most steps.
const ITERATIONS: usize = 6;
/// A step that changes the cost by less than this share is the last one.
const ENOUGH: f64 = 0.1;

/// `start` with states that suit its shared unknowns, if its model has passive joints and it is far away.
pub(crate) fn settled<'m>(problem: &Problem<'m>, start: Point<'m>, settings: &Settings) -> Point<'m> {
    let has_passive = problem.model.layout().passive().next().is_some();
    let rows = problem.series.stages() * problem.series.channels.len();
    if !has_passive || total_cost(problem, &start, settings.threads) < 0.5 * FAR * rows as f64 {
        return start;
    }
    states_alone(problem, start, settings)
}

/// `start` with the states that suit its shared unknowns, after a few steps.
pub(crate) fn states_alone<'m>(problem: &Problem<'m>, start: Point<'m>, settings: &Settings) -> Point<'m> {
    let shared = problem.shape().border;
    let unit = |held: usize| (0..shared).map(|i| f64::from(u8::from(i == held))).collect();
    let held: Vec<Vec<f64>> = (0..shared).map(unit).collect();
    let settings = Settings { max_iterations: ITERATIONS, relative_cost_change: ENOUGH, ..settings.clone() };
    match minimise(problem, start.clone(), &held, &settings, |i, iteration| {
        tracing::debug!(i, cost = iteration.cost, trials = iteration.trials, "states alone");
    }) {
        Ok(settled) if settled.cost.is_finite() => settled.point,
        _ => start,
    }
}
