//! The search for the estimate, with what the motion cannot tell held.

use super::identify;
use super::observability::Held;
use super::point::Point;
use super::problem::Problem;
use crate::robot::Robot;
use crate::solve::factor::SolveError;
use crate::solve::levenberg::{self, Iteration, Settings, Solution};

/// Most searches until what is held agrees with what the estimate says is not determined. One is enough where the start tells it already.
const MOST_ROUNDS: usize = 3;

/// An estimate.
pub(super) struct Found<'m> {
    /// The end of the last search; what is held stands at its start value.
    pub solution: Solution<Point<'m>>,
    /// Everything that is held, by the robot's build, its file or for want of motion.
    pub held: Vec<Held>,
    /// Parameters that were free and that no number is given for.
    pub silent: Vec<Held>,
}

/// Searches from `start` with `structural` held.
///
/// What the motion does not determine is held from the outset, so that the search does not run away along it; whether it is so is judged
/// again at the estimate.
///
/// # Errors
/// As a solve's own.
pub(super) fn search<'m>(
    problem: &Problem<'m>,
    robot: &Robot,
    start: &Point<'m>,
    structural: &[Held],
    settings: &Settings,
    mut progress: impl FnMut(usize, &Iteration),
) -> Result<Found<'m>, SolveError> {
    let judge = |point: &Point<'_>| identify::judge(problem, robot, point, structural, settings.threads);
    let mut weak = judge(start)?.weak;
    let mut from = start.clone();
    let mut rounds = 0;
    loop {
        let directions: Vec<_> = structural.iter().chain(&weak).map(|held| held.direction.clone()).collect();
        let mut solution = levenberg::minimise(problem, from, &directions, settings, &mut progress)?;
        let found = judge(&solution.point)?;
        rounds += 1;
        let settled = rounds == MOST_ROUNDS || identify::same(problem, &solution.point, &found.weak, &weak);
        from = identify::at_start(problem, solution.point.clone(), start, &found.weak);
        weak = found.weak;
        if settled {
            solution.point = from;
            let held = structural.iter().chain(&weak).cloned().collect();
            return Ok(Found { solution, held, silent: found.silent });
        }
    }
}

/// Searches on from the end of another search, under other weights or with fewer readings.
///
/// # Errors
/// As a solve's own.
pub(super) fn again<'m>(
    problem: &Problem<'m>,
    robot: &Robot,
    from: Found<'m>,
    structural: &[Held],
    settings: &Settings,
    progress: impl FnMut(usize, &Iteration),
) -> Result<Found<'m>, SolveError> {
    let before = from.solution;
    let mut found = search(problem, robot, &before.point, structural, settings, progress)?;
    found.solution.add_before(before.iterations, before.seconds);
    Ok(found)
}
