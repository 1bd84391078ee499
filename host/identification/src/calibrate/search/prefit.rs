//! Start values of the shared unknowns from a part of the recording, so that the search over all of it begins near its end.
//!
//! ```text
//! whole series ─▶ excerpt: a sixth, in windows ─▶ search, roughly ─▶ z, rotations, biases ─▶ first guess of all states with them
//! ```
//! An iteration on the excerpt costs a sixth of one. Where the excerpt leaves a direction open that the whole tells, nothing is taken
//! from it.

use crate::calibrate::data::series::Series;
use crate::calibrate::identifiability::identify::{self, Judgement};
use crate::calibrate::identifiability::observability::Held;
use crate::calibrate::initial_guess::equilibrium;
use crate::calibrate::initial_guess::start::{self, Shared};
use crate::calibrate::residuals::point::Point;
use crate::calibrate::residuals::preset::GyroRows;
use crate::calibrate::residuals::problem::Problem;
use crate::robot::Robot;
use solve::levenberg::{self, Settings, Status};

/// Samples of the excerpt, in so many windows.
const SAMPLES: usize = 12_000;
const WINDOWS: usize = 16;
/// Relative change of the cost at which the excerpt has told what it can.
const ROUGH: f64 = 1e-5;

/// A series long enough to have one: its excerpt.
pub(crate) fn excerpt(series: &Series) -> Option<Series> {
    series.excerpt(SAMPLES, WINDOWS)
}

/// The problem of an excerpt.
pub(crate) struct Part<'a, 'm> {
    whole: &'a Problem<'m>,
    problem: Problem<'a>,
    robot: &'a Robot,
}

impl<'a, 'm: 'a> Part<'a, 'm> {
    pub(crate) fn new(whole: &'a Problem<'m>, robot: &'a Robot, excerpt: &'a Series) -> Self {
        let mut problem = Problem::new(whole.model, robot, excerpt, whole.assumptions.clone());
        problem.set_noise(whole.noise().clone());
        Part { whole, problem, robot }
    }

    /// Whether the excerpt leaves nothing open but what is held by the robot's build: then the whole does not either, at a twentieth of the price.
    pub(crate) fn tells_all(&self, start: &Point<'_>, structural: &[Held], threads: usize) -> bool {
        self.judge(start, structural, threads).is_some_and(|found| found.weak.is_empty())
    }

    /// What the excerpt says of the motion at the end of a search, if it leaves nothing open and every joint slides in it: then the whole says the
    /// same, at six times the price. Not under the rows of `default`, where how much the whole says is used later.
    pub(crate) fn judged(&self, end: &Point<'_>, structural: &[Held], threads: usize) -> Option<Judgement> {
        let enough = self.whole.assumptions.gyro_rows == GyroRows::Chained;
        let found = enough.then(|| self.judge(end, structural, threads))??;
        (found.weak.is_empty() && found.silent.is_empty()).then_some(found)
    }

    fn judge(&self, at: &Point<'_>, structural: &[Held], threads: usize) -> Option<Judgement> {
        identify::judge(&self.problem, self.robot, &self.with_states(at), structural, threads).ok()
    }

    fn with_states(&self, start: &Point<'_>) -> Point<'a> {
        start::with_states(self.whole.model, self.problem.series, shared(start))
    }

    /// The point that a search from `start` with `held` directions better begins at; none where the excerpt says too little. What is held is
    /// where it was.
    pub(crate) fn point(
        &self,
        start: &Point<'m>,
        structural: &[Held],
        weak: &[Held],
        settings: &Settings,
    ) -> Option<Point<'m>> {
        let (part, whole) = (&self.problem, self.whole);
        let held: Vec<_> = structural.iter().chain(weak).map(|held| held.direction.clone()).collect();
        let settings = Settings { relative_cost_change: settings.relative_cost_change.max(ROUGH), ..settings.clone() };
        let from = equilibrium::settled(part, self.with_states(start), &settings);
        let found = levenberg::minimise(part, from, &held, &settings, |_, _| {}).ok()?;
        let samples = part.series.stages();
        tracing::debug!(samples, iterations = found.iterations.len(), status = ?found.status, "excerpt");
        let ended = !matches!(found.status, Status::NoProgress);
        if !ended || identify::open(part, &found.point, &found.information, structural) > weak.len() {
            return None;
        }
        let point = start::with_states(whole.model, whole.series, shared(&found.point));
        Some(identify::at_start(whole, point, start, weak, &found.information))
    }
}

fn shared(point: &Point<'_>) -> Shared {
    Shared { z: point.z.clone(), rotations: point.rotations.clone(), biases: point.biases.clone() }
}
