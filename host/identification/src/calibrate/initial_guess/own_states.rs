//! Own states of laws, such as the current of a winding or the bending of bristles, where nothing but the motion is known: the model's own steps along the
//! motion lead to them.
//!
//! ```text
//!   own[k+1] = φ(x[k])        from what they come to where the first sample of a run goes on
//! ```
//! A search that starts with all of them at zero has steps that are wrong by thousands of sigmas, and gets lost.

use crate::calibrate::residuals::point::Point;
use crate::calibrate::residuals::problem::Problem;
use solve::LeastSquares;
use solve::levenberg::total_cost;

/// Steps at the first sample of a run. A lag of five samples forgets where it began.
const OPENING_STEPS: usize = 25;

/// Gives these components of all states the values to which the model's steps lead, if that is a better start than none; all others stay.
pub(crate) fn follow(problem: &Problem<'_>, point: &mut Point<'_>, components: &[usize], threads: usize) {
    if components.is_empty() {
        return;
    }
    let (before, states) = (total_cost(problem, point, threads), point.states.clone());
    lead(problem, point, components);
    let after = total_cost(problem, point, threads);
    // Steps that a law is too stiff for lead far away, or to no number.
    if after.is_nan() || after > before {
        point.states = states;
    }
}

fn lead(problem: &Problem<'_>, point: &mut Point<'_>, components: &[usize]) {
    let size = problem.model.layout().size();
    let mut scratch = problem.scratch();
    let mut set = |point: &mut Point<'_>, from: usize, to: usize| {
        // A step that ends in no number leaves what was there.
        let next = problem.next(point, from, &mut scratch);
        for component in components {
            if next[*component].is_finite() {
                point.states[to * size + component] = next[*component];
            }
        }
    };
    for run in problem.series.segments.clone() {
        for _ in 0..OPENING_STEPS {
            if problem.linked(run.start) {
                set(point, run.start, run.start);
            }
        }
        for k in run.start..run.end.saturating_sub(1) {
            if problem.linked(k) {
                set(point, k, k + 1);
            }
        }
    }
}
