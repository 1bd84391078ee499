//! The pipeline from recordings to a result, for the base model and for models extended by effects.
//!
//! ```text
//! base       start from the description ─▶ search ─▶ noise? ─▶ search ─▶ result, states, noise
//! extended   start from a fit ───────────▶ choose among a law's alternatives ─▶ the same
//! ```

use std::time::{Duration, Instant};

use super::data::series::Series;
use super::error::CalibrateError;
use super::extension::bench::Bench;
use super::extension::laws;
use super::extension::trial::Trial;
use super::extension::trimmed::Trimmed;
use super::extension::warm_start;
use super::extension::warm_start::Known;
use super::identifiability::observability;
use super::initial_guess::equilibrium;
use super::initial_guess::start;
use super::initial_guess::torque_start::TorqueStart;
use super::noise_estimate::outliers::Screened;
use super::noise_estimate::reml::{self, Residue};
use super::requirements::accept;
use super::residuals::noise::Noise;
use super::residuals::point::Point;
use super::residuals::preset::{Method, NoiseSource, Preset};
use super::residuals::problem::Problem;
use super::result::calibration::{BlockScatter, Calibration, Seconds, Status};
use super::result::fitted::Fit;
use super::result::misfit;
use super::result::summary;
use super::result::{pushes_told, untold_ages};
use super::scatter;
use super::search::{self, Found};
use super::search::{marginal, specification};
use crate::effect::Effect;
use crate::model::Model;
use crate::recording::Recording;
use crate::robot::Robot;
use solve::border::Border;
use solve::levenberg::{Iteration, Settings};

/// Relative change of the cost from which on a search ends whose weights will change anyway.
const ROUGH: f64 = 1e-5;

/// The same where a trial has found the shared unknowns: the estimate of the noise that follows takes the states' step that is left.
const TRIED: f64 = 1e-2;

/// Iterations of a first search from what torques have shown, after which both are compared. Half and double have not been tried.
const NEAR: usize = 10;

/// Inner iterations of a search: where friction is steep states stand at bends of the model, and a step of all unknowns is rejected for a few of them.
/// Kernels that make four stages at once have robots whose friction is not.
const INNER_ITERATIONS: usize = 100;

/// Searches at most that leave out what the one before found to be outliers.
const MOST_SIFTINGS: usize = 3;

/// Readings are moved by whole samples at most so often.
const MOST_SHIFTS: usize = 4;

/// Calibrates `robot` on recordings of it, by a [`Preset`] or a [`Method`]. `progress` is called once an iteration.
///
/// Where the noise is estimated, the problem is solved under the preset's noise, roughly, and again under the noise that was found. Lone
/// readings far from what the model and their neighbours say are left out, unless the preset keeps all.
///
/// # Errors
/// [`CalibrateError`].
pub fn calibrate(
    robot: &Robot,
    recordings: &[&Recording],
    method: impl Into<Method>,
    settings: &Settings,
    progress: impl FnMut(usize, &Iteration),
) -> Result<Calibration, CalibrateError> {
    Ok(fit(robot, recordings, method, settings, progress)?.calibration)
}

/// [`calibrate`] by the base model, and from there by the model extended by the effects of these ids.
///
/// # Errors
/// [`CalibrateError`]; an unknown id before any work.
pub fn calibrate_extended<S: AsRef<str>>(
    robot: &Robot,
    recordings: &[&Recording],
    method: impl Into<Method>,
    ids: &[S],
    settings: &Settings,
    mut progress: impl FnMut(usize, &Iteration),
) -> Result<Calibration, CalibrateError> {
    laws::effects(ids)?;
    let base = fit(robot, recordings, method, settings, &mut progress)?;
    match ids {
        [] => Ok(base.calibration),
        ids => Ok(extend(robot, recordings, &base, ids, settings, progress)?.calibration),
    }
}

/// [`calibrate`] that keeps what [`extend`] starts from.
///
/// # Errors
/// [`CalibrateError`].
pub fn fit(
    robot: &Robot,
    recordings: &[&Recording],
    method: impl Into<Method>,
    settings: &Settings,
    progress: impl FnMut(usize, &Iteration),
) -> Result<Fit, CalibrateError> {
    let begin = Instant::now();
    let method = method.into();
    // The paper takes all readings at the tick.
    let known = (method.preset == Preset::Paper).then(|| robot.clone().with_known_lags());
    let robot = known.as_ref().unwrap_or(robot);
    accept(robot, recordings, method.preset)?;
    let model = Model::new(robot);
    let assumptions = method.preset.assumptions();
    let screened = Screened::new(Series::of(robot, recordings), assumptions.without_outliers);
    let clock = Instant::now();
    let start = start::start(&model, robot, screened.series());
    let by_torques = start.by_torques.as_ref();
    let task = Task { robot, recordings, method, begin, start: clock.elapsed(), settings, tight: None, by_torques };
    let mut problem = Problem::new(&model, robot, screened.series(), assumptions);
    if let Some(torques) = &start.by_torques {
        problem.set_noise(problem.noise().clone().with_inputs(robot, model.layout(), &torques.left));
    }
    task.solve(problem, &screened, start.point, progress)
}

/// Calibrates the model of `from` extended by the effects of these ids, instead of those that `from` has, by the method of `from` and from
/// its noise. The search starts at `from`, so that it takes a few iterations where the effects are small.
///
/// # Errors
/// [`CalibrateError`].
pub fn extend<S: AsRef<str>>(
    robot: &Robot,
    recordings: &[&Recording],
    from: &Fit,
    ids: &[S],
    settings: &Settings,
    progress: impl FnMut(usize, &Iteration),
) -> Result<Fit, CalibrateError> {
    let effects = laws::effects(ids)?;
    if effects.is_empty() {
        return Ok(from.clone());
    }
    let extended = Extended { robot, recordings, from, effects, tried: None };
    extended.fit(settings, progress)
}

/// [`extend`] by effects that a trial on a bench of `from` has fitted already: its laws, from its values, and under the bench's noise before
/// any noise is estimated. What the base model took its errors for is much more than the extended model has; a likelihood that starts there may
/// stay there.
///
/// # Errors
/// [`CalibrateError`].
pub fn extend_as<S: AsRef<str>>(
    robot: &Robot,
    recordings: &[&Recording],
    from: &Fit,
    (ids, trial, bench): (&[S], &Trial, &Bench<'_>),
    settings: &Settings,
    progress: impl FnMut(usize, &Iteration),
) -> Result<Fit, CalibrateError> {
    let tried = Some((trial, bench));
    let extended = Extended { robot, recordings, from, effects: laws::effects(ids)?, tried };
    extended.fit(settings, progress)
}

/// An extension of a fit.
struct Extended<'a> {
    robot: &'a Robot,
    recordings: &'a [&'a Recording],
    from: &'a Fit,
    effects: Vec<&'static Effect>,
    /// What is known of its laws.
    tried: Option<(&'a Trial, &'a Bench<'a>)>,
}

impl Extended<'_> {
    fn fit(&self, settings: &Settings, mut progress: impl FnMut(usize, &Iteration)) -> Result<Fit, CalibrateError> {
        let begin = Instant::now();
        let Extended { robot, recordings, from, .. } = *self;
        let preset = from.calibration.preset;
        if preset == Preset::Paper {
            return Err(CalibrateError::ExtendsThePaper);
        }
        accept(robot, recordings, preset)?;
        let screened = Screened::new(Series::of(robot, recordings), preset.assumptions().without_outliers);
        let series = screened.series();
        let clock = Instant::now();
        let trimmed;
        let (laws, known) = match self.tried {
            Some((trial, _)) => {
                (trial.laws.clone(), Known { states: &from.states, layout: &from.layout, laws: &[], ..trial.known() })
            }
            None => {
                let laws;
                (laws, trimmed) = laws::choose_laws(robot, series, &self.effects, from, settings)?;
                (laws, trimmed.as_ref().map_or_else(|| warm_start::known(from), Trimmed::known))
            }
        };
        let model = Model::extended(robot, laws)?;
        let method = Method { preset, noise: from.calibration.noise_source };
        let spent = clock.elapsed();
        let mut solve = |tight: bool| {
            let problem = laws::problem(&model, robot, series, from);
            let start = warm_start::warm_start(&problem, robot, series, &known, settings);
            let tight = self.tried.filter(|_| tight).map(|(_, bench)| bench.noise_of(&problem));
            let task = Task { robot, recordings, method, begin, start: spent, settings, tight, by_torques: None };
            task.solve(problem, &screened, start, &mut progress)
        };
        let mut fit = match solve(true) {
            // A law with sharp corners may be too stiff for so little noise.
            Err(CalibrateError::Solve(_)) if self.tried.is_some() => solve(false)?,
            fit => fit?,
        };
        fit.calibration.extensions = self.effects.iter().map(|effect| effect.id.to_string()).collect();
        Ok(fit)
    }
}

/// What a search is about, and when it began.
struct Task<'a> {
    robot: &'a Robot,
    recordings: &'a [&'a Recording],
    method: Method,
    begin: Instant,
    /// Time spent on the start values.
    start: Duration,
    settings: &'a Settings,
    /// Noise of the model without its errors, under which the search goes on before the noise is estimated.
    tight: Option<Noise>,
    /// What torques have shown, at which noise can be estimated before any search.
    by_torques: Option<&'a TorqueStart>,
}

impl Task<'_> {
    fn solve<'m>(
        &self,
        mut problem: Problem<'m>,
        screened: &'m Screened,
        start: Point<'m>,
        mut progress: impl FnMut(usize, &Iteration),
    ) -> Result<Fit, CalibrateError> {
        let Task { robot, .. } = *self;
        let inner_iterations = if problem.fast.is_some() && !problem.walks_sensors { 0 } else { INNER_ITERATIONS };
        let settings = &Settings { inner_iterations, ..self.settings.clone() };
        let model = problem.model;
        let structural = observability::structural(model, robot, problem.border());
        let estimated = self.method.noise == NoiseSource::Estimated;
        let rough = Settings { relative_cost_change: settings.relative_cost_change.max(ROUGH), ..settings.clone() };
        let first = if estimated { &rough } else { settings };
        // What torques have shown is near the end, or the model does not fit: then a search goes far, and slowly.
        let near = Settings { max_iterations: NEAR, ..rough.clone() };
        let opening = if self.by_torques.is_some() { &near } else { first };

        problem.shift_readings(&start.z);
        if estimated && self.by_torques.is_some() {
            let settled = reml::states(&problem, &start, settings.threads)?;
            screened.look(&mut problem, &settled, settings.threads);
        }
        let at_start = problem.noise().clone();
        let mut found = if let Some(noise) = &self.tight {
            // A trial has found the rest under this noise, which from states of another model leads astray: they get there under the base model's first.
            let eased = equilibrium::states_alone(&problem, start.clone(), settings);
            problem.set_noise(noise.clone());
            let near = Settings { relative_cost_change: TRIED, ..first.clone() };
            search::from_known(&problem, robot, (&start, eased), &structural, &near, &mut progress)?
        } else {
            search::search(&problem, robot, &start, &structural, opening, &mut progress)?
        };
        let scatter = |problem: &Problem<'m>, found: &Found<'m>| {
            let directions: Vec<_> = found.held.iter().map(|held| held.direction.clone()).collect();
            let is_asked = self.method.preset != Preset::Paper;
            is_asked.then(|| {
                scatter::between_blocks(problem, robot, &found.solution.point, &directions, settings.threads)
            })?
        };
        let disagreements = |problem: &Problem<'m>, found: &Found<'m>| match self.by_torques {
            Some(torques) if self.method.preset != Preset::Paper => {
                let wider = scatter(problem, found).map_or_else(Vec::new, |scatter| scatter.wider);
                specification::disagreements(problem, torques, found, &wider)
            }
            _ => Vec::new(),
        };
        let mut disagree = disagreements(&problem, &found);
        if self.by_torques.is_some() && disagree.is_empty() {
            found = search::again(&problem, robot, (&start, found), &structural, first, &mut progress)?;
            disagree = disagreements(&problem, &found);
        }
        for _ in 1..MOST_SHIFTS {
            if !problem.shift_readings(&found.solution.point.z) {
                break;
            }
            found = search::again(&problem, robot, (&start, found), &structural, first, &mut progress)?;
        }
        for _ in 0..MOST_SIFTINGS {
            if !disagree.is_empty() || !screened.look(&mut problem, &found.solution.point, settings.threads) {
                break;
            }
            found = search::again(&problem, robot, (&start, found), &structural, first, &mut progress)?;
        }
        let by_motion = found.noise_free.clone();
        let mut noise_clock = Duration::ZERO;
        let mut floor = None;
        if estimated && disagree.is_empty() {
            let clock = Instant::now();
            floor = Some(reml::estimate(&mut problem, robot, &found.solution.point, settings.threads)?.floor);
            noise_clock += clock.elapsed();
            found = search::again(&problem, robot, (&start, found), &structural, settings, &mut progress)?;
            if screened.look(&mut problem, &found.solution.point, settings.threads) {
                found = search::again(&problem, robot, (&start, found), &structural, settings, &mut progress)?;
            }
        }
        if disagree.is_empty() {
            disagree = disagreements(&problem, &found);
        }
        if let Some(torques) = self.by_torques.filter(|_| !disagree.is_empty()) {
            problem.set_noise(at_start);
            specification::at_torques(&problem, torques, &mut found, &structural, settings)?;
            if estimated {
                floor = Some(reml::estimate(&mut problem, robot, &found.solution.point, settings.threads)?.floor);
                specification::at_torques(&problem, torques, &mut found, &structural, settings)?;
            }
        }
        let clock = Instant::now();
        let residue = reml::residue(&problem, &found.solution.point, settings.threads)?;
        let residue = Residue { floor, ..residue };
        noise_clock += clock.elapsed();
        // The paper's preset shows what its noise does to the estimates.
        let mut wider = Vec::new();
        if self.method.preset != Preset::Paper {
            let by_noise = marginal::shown_by_noise(&problem, &found, &by_motion, settings.threads)?;
            found.silent.extend(by_noise.silent);
            wider = by_noise.wider;
        }
        // Torques have told the errors of what is theirs.
        let scatter = if disagree.is_empty() { scatter(&problem, &found) } else { None };
        for (unknown, factor) in scatter.iter().flat_map(|scatter| &scatter.wider) {
            match wider.iter_mut().find(|(known, _)| known == unknown) {
                Some((_, known)) => *known = f64::max(*known, *factor),
                None => wider.push((*unknown, *factor)),
            }
        }

        observability::without_held_turns(&mut found.solution.point.rotations, robot, problem.border(), &found.held);
        let Found { solution, held, silent, .. } = &found;
        let directions: Vec<_> = held.iter().map(|held| held.direction.clone()).collect();
        let border = Border::new(&solution.information, &solution.gradient, &directions);
        let mut calibration = summary::summarise(
            robot,
            &problem,
            (&start, solution),
            &border,
            (held, silent, &wider),
            &residue,
            settings.threads,
        );
        calibration.preset = self.method.preset;
        calibration.noise_source = self.method.noise;
        for (noise, left_out) in calibration.noise.iter_mut().zip(screened.left_out()) {
            noise.left_out = left_out;
        }
        calibration.recordings = self.recordings.iter().map(|recording| summary::used(recording)).collect();
        if held.len() + silent.len() > structural.len() && calibration.status == Status::Converged {
            calibration.status = Status::Unidentifiable;
        }
        calibration.scatter = scatter.map(|scatter| BlockScatter {
            blocks: scatter.blocks,
            ratio: scatter.ratio,
            coloured: !scatter.wider.is_empty(),
        });
        calibration.misfit = misfit::sentences(&problem, (&found, &disagree), &calibration);
        calibration.pushes = pushes_told::pushes(&problem, &found.solution.point);
        calibration.notes = untold_ages::sentences(robot, self.recordings, &calibration);
        calibration.notes.extend(pushes_told::sentences(robot, &calibration.pushes));
        if !calibration.misfit.is_empty() && calibration.status.is_usable() {
            calibration.status = Status::DoesNotFit;
        }
        calibration.seconds = Seconds {
            start: self.start.as_secs_f64(),
            noise: noise_clock.as_secs_f64(),
            linearise: solution.seconds.linearise,
            factor: solution.seconds.factor,
            solve: solution.seconds.solve,
            total: self.begin.elapsed().as_secs_f64(),
        };
        let (noise, layout) = (problem.noise().clone(), model.layout().clone());
        Ok(Fit { calibration, noise, series: problem.series.clone(), states: found.solution.point.states, layout })
    }
}
