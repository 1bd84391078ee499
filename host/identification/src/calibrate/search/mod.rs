//! The search for the estimate, with what the motion cannot tell held.

pub(crate) mod marginal;
mod prefit;
pub(crate) mod specification;

use self::prefit::Part;
use crate::calibrate::identifiability::identify;
use crate::calibrate::identifiability::observability::Held;
use crate::calibrate::initial_guess::equilibrium;
use crate::calibrate::residuals::point::Point;
use crate::calibrate::residuals::problem::Problem;
use crate::robot::Robot;
use solve::error::SolveError;
use solve::levenberg::{self, Iteration, Settings, Solution, total_cost};

/// Most searches until what is held agrees with what the estimate says is not determined. One is enough where the start tells it already.
const MOST_ROUNDS: usize = 3;

/// An estimate.
pub(crate) struct Found<'m> {
    /// The end of the last search; what is held stands at its start value.
    pub solution: Solution<Point<'m>>,
    /// Everything that is held: by the robot's build and its file first, then for want of motion.
    pub held: Vec<Held>,
    /// Parameters that were free and that no number is given for.
    pub silent: Vec<Held>,
    /// Information of noise-free predictions, row-major, of the border's unknowns; of an excerpt's where
    /// [`Part::judged`] says so.
    pub noise_free: Vec<f64>,
}

/// Searches from `start` with `structural` held, of a long series a part first.
///
/// What the motion does not determine is held from the outset, so that the search does not run away along it; whether it is so is judged
/// again at the estimate.
///
/// # Errors
/// As a solve's own.
pub(crate) fn search<'m>(
    problem: &Problem<'m>,
    robot: &Robot,
    start: &Point<'m>,
    structural: &[Held],
    settings: &Settings,
    progress: impl FnMut(usize, &Iteration),
) -> Result<Found<'m>, SolveError> {
    let excerpt = prefit::excerpt(problem.series);
    let part = excerpt.as_ref().map(|excerpt| Part::new(problem, robot, excerpt));
    let weak = match &part {
        Some(part) if part.tells_all(start, structural, settings.threads) => Vec::new(),
        _ => identify::judge(problem, robot, start, structural, settings.threads)?.weak,
    };
    let from = part.as_ref().and_then(|part| part.point(start, structural, &weak, settings));
    let from = equilibrium::settled(problem, from.unwrap_or_else(|| start.clone()), settings);
    settle((problem, part.as_ref()), robot, (start, from), (structural, weak), settings, progress)
}

/// [`search`] from shared unknowns that another search has found under these weights, and `from`, whose states suit other weights: they are made to suit first.
///
/// # Errors
/// As a solve's own.
pub(crate) fn from_known<'m>(
    problem: &Problem<'m>,
    robot: &Robot,
    (start, from): (&Point<'m>, Point<'m>),
    structural: &[Held],
    settings: &Settings,
    progress: impl FnMut(usize, &Iteration),
) -> Result<Found<'m>, SolveError> {
    let from = equilibrium::states_alone(problem, from, settings);
    let weak = identify::judge(problem, robot, start, structural, settings.threads)?.weak;
    settle((problem, None), robot, (start, from), (structural, weak), settings, progress)
}

/// Searches on from the end of another search, under other weights or with fewer readings; what is held stands as it does at `start`.
///
/// # Errors
/// As a solve's own.
pub(crate) fn again<'m>(
    problem: &Problem<'m>,
    robot: &Robot,
    (start, from): (&Point<'m>, Found<'m>),
    structural: &[Held],
    settings: &Settings,
    progress: impl FnMut(usize, &Iteration),
) -> Result<Found<'m>, SolveError> {
    let before = from.solution;
    let weak = from.held.into_iter().skip(structural.len()).collect();
    let mut found = settle((problem, None), robot, (start, before.point), (structural, weak), settings, progress)?;
    found.solution.add_before(before.iterations, before.seconds);
    Ok(found)
}

/// Searches until what is held is what the estimate leaves open. `start` is where held directions stay.
fn settle<'m>(
    (problem, part): (&Problem<'m>, Option<&Part<'_, 'm>>),
    robot: &Robot,
    (start, mut from): (&Point<'m>, Point<'m>),
    (structural, mut weak): (&[Held], Vec<Held>),
    settings: &Settings,
    mut progress: impl FnMut(usize, &Iteration),
) -> Result<Found<'m>, SolveError> {
    let mut rounds = 0;
    loop {
        let directions: Vec<_> = structural.iter().chain(&weak).map(|held| held.direction.clone()).collect();
        let mut solution = levenberg::minimise(problem, from, &directions, settings, &mut progress)?;
        let told = part.and_then(|part| part.judged(&solution.point, structural, settings.threads));
        let found = match told {
            Some(found) => found,
            None => identify::judge(problem, robot, &solution.point, structural, settings.threads)?,
        };
        rounds += 1;
        let settled = rounds == MOST_ROUNDS || identify::same(problem, &solution.point, &found.weak, &weak);
        from = identify::at_start(problem, solution.point.clone(), start, &found.weak, &found.information);
        if !found.weak.is_empty() && !total_cost(problem, &from, settings.threads).is_finite() {
            // Where the start values lie along what is held, there is no such robot beside what was found: it stays where it was found.
            from = solution.point.clone();
        }
        weak = found.weak;
        if settled {
            solution.point = from;
            let held = structural.iter().chain(&weak).cloned().collect();
            return Ok(Found { solution, held, silent: found.silent, noise_free: found.information });
        }
    }
}
