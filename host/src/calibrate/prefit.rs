//! Start values of the shared unknowns from a part of the recording, so that the search over all of it begins near its end.
//!
//! ```text
//! whole series ─▶ excerpt: a sixth, in windows ─▶ search, roughly ─▶ z, rotations, biases ─▶ first guess of all states with them
//! ```
//! An iteration on the excerpt costs a sixth of one. Where the excerpt leaves a direction open that the whole tells, nothing is taken
//! from it.

use super::identify;
use super::observability::Held;
use super::point::Point;
use super::problem::Problem;
use super::start::{self, Shared};
use crate::robot::Robot;
use solve::levenberg::{self, Settings, Status};

/// Samples of the excerpt, in so many windows.
const SAMPLES: usize = 12_000;
const WINDOWS: usize = 16;
/// Relative change of the cost at which the excerpt has told what it can.
const ROUGH: f64 = 1e-5;

/// The point that a search from `start` with `held` directions better begins at; none where the series is short or the excerpt says
/// too little. What is held is where it was.
pub(super) fn of<'m>(
    problem: &Problem<'m>,
    robot: &Robot,
    start: &Point<'m>,
    structural: &[Held],
    weak: &[Held],
    settings: &Settings,
) -> Option<Point<'m>> {
    let series = problem.series.excerpt(SAMPLES, WINDOWS)?;
    let mut part = Problem::new(problem.model, robot, &series, problem.assumptions.clone());
    part.set_noise(problem.noise().clone());
    let held: Vec<_> = structural.iter().chain(weak).map(|held| held.direction.clone()).collect();
    let settings = Settings { relative_cost_change: settings.relative_cost_change.max(ROUGH), ..settings.clone() };
    let from = start::with_states(problem.model, &series, shared(start));
    let found = levenberg::minimise(&part, from, &held, &settings, |_, _| {}).ok()?;
    tracing::debug!(samples = series.stages(), iterations = found.iterations.len(), status = ?found.status, "excerpt");
    let ended = !matches!(found.status, Status::NoProgress);
    if !ended || identify::open(&part, &found.point, &found.information, structural) > weak.len() {
        return None;
    }
    let point = start::with_states(problem.model, problem.series, shared(&found.point));
    Some(identify::at_start(problem, point, start, weak))
}

fn shared(point: &Point<'_>) -> Shared {
    Shared { z: point.z.clone(), rotations: point.rotations.clone(), biases: point.biases.clone() }
}
