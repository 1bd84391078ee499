//! What laws would add to the residuals of a trial, all from one factorisation: the columns of a score test (Rao 1948).
//!
//! ```text
//!   column of coordinate c   C_c = [r(law at its start, c moved by δ) − r(law at its start)] / δ     along the states of the trial
//!   a law that is not nothing at its start has one more                r(law at its start) − r(trial)
//! ```
//! Differences of residuals need nothing of a law but that it can be asked, so that every kind of law has columns by the same few lines. States
//! that a law brings (a Maxwell branch, a flexible base) are carried along with those of the trial: they answer to what the robot is known to
//! have done. `solve::columns` then eliminates all states and shared unknowns from all columns at once.

use std::ops::Range;
use std::sync::Arc;

use nalgebra::{DMatrix, DVector};

use super::bench::{Bench, Trial};
use super::point::Point;
use super::problem::{Problem, Scratch};
use super::{CalibrateError, extension, start};
use crate::model::law::Law;
use crate::model::{Layout, Model};
use solve::border::Border;
use solve::columns::{Entries, ExtraColumns, eliminate};
use solve::factor::Factor;
use solve::{LeastSquares, RowAt, Stage};

/// By how much a coordinate is moved: torques and angles differ by far more than their rounding, and no law bends within it.
const MOVED_BY: f64 = 1e-5;

/// Information and gradient of all columns, with all states and shared unknowns eliminated.
#[derive(Debug, Clone)]
pub struct Scores {
    /// q × q.
    pub information: DMatrix<f64>,
    /// q: half the slope of Σ r² along the columns.
    pub gradient: DVector<f64>,
    /// q: the information of each column if the shared unknowns were known.
    pub alone: DVector<f64>,
    /// The columns of each law; none of one that cannot be asked on top of the trial.
    pub columns: Vec<Option<Range<usize>>>,
}

impl Bench<'_> {
    /// The scores of `laws`, each on its own on top of `trial`.
    ///
    /// # Errors
    /// A trial that cannot be factorised.
    pub fn scores(&self, trial: &Trial, laws: &[Arc<dyn Law>]) -> Result<Scores, CalibrateError> {
        let model = Model::extended(self.robot, trial.laws.clone())?;
        let (problem, point, held) = self.at(&model, trial);
        let mut factor = Factor::new(&problem)?;
        factor.factorise(&problem, &point, 0.0, self.settings.threads).map_err(solve::factor::SolveError::from)?;
        let (information, gradient) = factor.schur();
        let border = Border::new(&information, &gradient, &held);

        let models: Vec<Option<Model>> = laws
            .iter()
            .map(|law| {
                let together = trial.laws.iter().chain([law]).cloned().collect();
                let extended = Model::extended(self.robot, together).ok()?;
                let passive = |model: &Model| model.layout().passive().count();
                // Which of the passive joints are whose would have to be told.
                (passive(&model) == 0 || passive(&extended) == passive(&model)).then_some(extended)
            })
            .collect();
        let mut asked = Vec::new();
        let mut columns = Vec::new();
        let mut count = 0;
        for extended in &models {
            let one = extended.as_ref().map(|extended| Asked::of(self, &model, &point, extended, trial));
            let first = count;
            count += one.as_ref().map_or(0, Asked::count);
            columns.push(one.as_ref().map(|_| first..count));
            asked.extend(one.map(|one| (first, one)));
        }
        let all = AllColumns { base: &problem, asked, count };
        let reduced = eliminate(&problem, &point, &factor, &all, self.settings.threads);
        let Some(score) = reduced.score(&border, &gradient) else {
            let none = vec![None; laws.len()];
            return Ok(Scores {
                information: DMatrix::zeros(0, 0),
                gradient: DVector::zeros(0),
                alone: DVector::zeros(0),
                columns: none,
            });
        };
        let alone = reduced.information.diagonal();
        Ok(Scores { information: score.information, gradient: score.gradient, alone, columns })
    }
}

/// One law on top of the trial, at its start and with each of its coordinates moved.
struct Asked<'m> {
    problem: Problem<'m>,
    at_start: Point<'m>,
    moved: Vec<Point<'m>>,
    /// Whether the law changes anything where it starts.
    is_something: bool,
    /// Of each component of the trial's state, where it stands in that of this model.
    places: Vec<usize>,
}

impl<'m> Asked<'m> {
    fn of(bench: &'m Bench<'_>, base: &Model, trial_point: &Point<'_>, extended: &'m Model, trial: &Trial) -> Self {
        let mut problem = bench.problem(extended);
        let series = bench.series();
        let shared = extension::shared(extended, bench.robot(), series, &trial.known());
        problem.shift_readings(&shared.z);
        let places = places(base.layout(), extended.layout());
        let fresh = start::with_states(extended, series, shared);
        let added: Vec<usize> = (0..extended.layout().size()).filter(|i| !places.contains(i)).collect();
        let along = |z: &[f64]| {
            let mut point = Point { z: z.to_vec(), dynamics: extended.at(z), ..fresh.clone() };
            carry(&problem, (trial_point, &places, &added), &mut point);
            point
        };
        let first = base.coordinates().len();
        let at_start = along(&fresh.z);
        let moved = (first..extended.coordinates().len()).map(|c| {
            let mut z = fresh.z.clone();
            z[c] += MOVED_BY;
            along(&z)
        });
        let moved = moved.collect();
        // A law whose coordinates all start at nothing is nothing there; others may be.
        let own = extended.laws().last().map(|law| law.parameters().coordinates.iter().any(|c| c.start != 0.0));
        let has_none = extended.coordinates().len() == first;
        let is_something = has_none || own.unwrap_or(false);
        Asked { problem, at_start, moved, is_something, places }
    }

    fn count(&self) -> usize {
        self.moved.len() + usize::from(self.is_something)
    }
}

/// Where the components of a state stand in that of a model with one more law behind.
fn places(base: &Layout, extended: &Layout) -> Vec<usize> {
    let mut places = vec![0; base.size()];
    for i in 0..base.joints() {
        places[base.q(i)] = extended.q(i);
        places[base.qd(i)] = extended.qd(i);
        places[base.theta(i)] = extended.theta(i);
        places[base.thetad(i)] = extended.thetad(i);
    }
    for (from, to) in base.passive().zip(extended.passive()) {
        places[from] = to;
        places[base.chain() + from] = extended.chain() + to;
    }
    for (from, to) in base.own().zip(extended.own()) {
        places[from] = to;
    }
    places
}

/// Gives `point` the states of the trial, and those that the law adds as they answer to them; runs begin where `point` says.
fn carry(problem: &Problem<'_>, (trial, places, added): (&Point<'_>, &[usize], &[usize]), point: &mut Point<'_>) {
    let size = problem.model.layout().size();
    let mut scratch = problem.scratch();
    let stages = problem.series.stages();
    for k in 0..stages {
        for (value, place) in trial.state(k).iter().zip(places) {
            point.states[k * size + place] = *value;
        }
        if !added.is_empty() && k + 1 < stages && problem.linked(k) {
            let next = problem.next(point, k, &mut scratch);
            for place in added {
                point.states[(k + 1) * size + place] = next[*place];
            }
        }
    }
}

/// The columns of all laws.
struct AllColumns<'a, 'm> {
    base: &'a Problem<'m>,
    /// With the first column of each.
    asked: Vec<(usize, Asked<'a>)>,
    count: usize,
}

/// Room of one thread.
struct Room {
    base: Scratch,
    of_each: Vec<Scratch>,
    /// The trial's rows by channel, and its rows of the transition.
    rows: Vec<Option<RowAt>>,
    trial: Residuals,
    start: Residuals,
    moved: Residuals,
}

/// Whitened residuals of one stage: of channels (zero where there is no reading), and of the trial's components of the transition.
#[derive(Debug, Clone, Default)]
struct Residuals {
    channels: Vec<f64>,
    transition: Vec<f64>,
}

impl Residuals {
    fn fill(&mut self, problem: &Problem<'_>, point: &Point<'_>, k: usize, places: &[usize], scratch: &mut Scratch) {
        self.channels.clear();
        self.channels.resize(problem.series.channels.len(), 0.0);
        problem.sensor_rows(point, k, scratch, false, &mut |row| {
            if let Some(channel) = row.channel {
                self.channels[channel] = row.weight * row.residual;
            }
        });
        self.transition.clear();
        if problem.linked(k) {
            let after = point.state(k + 1);
            let next = problem.next(point, k, scratch);
            let residuals = places.iter().map(|&i| problem.process_weight[i] * (next[i] - after[i]));
            self.transition.extend(residuals);
        }
    }
}

impl ExtraColumns<Problem<'_>> for AllColumns<'_, '_> {
    type Scratch = Room;

    fn scratch(&self) -> Room {
        Room {
            base: self.base.scratch(),
            of_each: self.asked.iter().map(|(_, asked)| asked.problem.scratch()).collect(),
            rows: Vec::new(),
            trial: Residuals::default(),
            start: Residuals::default(),
            moved: Residuals::default(),
        }
    }

    fn count(&self) -> usize {
        self.count
    }

    fn fill(
        &self,
        point: &Point<'_>,
        first: usize,
        room: &mut Room,
        stages: &[Stage],
        entries: &mut [Entries],
    ) {
        let all: Vec<usize> = (0..self.base.model.layout().size()).collect();
        for (k, (_, entries)) in (first..).zip(stages.iter().zip(entries)) {
            let Room { base, of_each, rows, trial, start, moved } = &mut *room;
            rows.clear();
            rows.resize(self.base.series.channels.len(), None);
            let mut counts = [0usize; 3];
            self.base.row_channels(point, k, base, |kind, channel| {
                let at = counts[kind];
                counts[kind] += 1;
                if let Some(channel) = channel {
                    rows[channel] = Some(match kind {
                        0 => RowAt::Unit(at),
                        1 => RowAt::Sensor(at),
                        _ => RowAt::Other(at),
                    });
                }
            });
            trial.fill(self.base, point, k, &all, base);
            for ((column, asked), scratch) in self.asked.iter().zip(of_each) {
                let mut column = *column;
                start.fill(&asked.problem, &asked.at_start, k, &asked.places, scratch);
                let mut add = |from: &Residuals, to: &Residuals, by: f64| {
                    for (channel, row) in rows.iter().enumerate() {
                        let difference = to.channels[channel] - from.channels[channel];
                        if let (Some(row), true) = (row, difference != 0.0) {
                            entries.add(*row, column, difference / by);
                        }
                    }
                    for (i, (to, from)) in to.transition.iter().zip(&from.transition).enumerate() {
                        if to != from {
                            entries.add(RowAt::Transition(i), column, (to - from) / by);
                        }
                    }
                    column += 1;
                };
                if asked.is_something {
                    add(trial, start, 1.0);
                }
                for point in &asked.moved {
                    moved.fill(&asked.problem, point, k, &asked.places, scratch);
                    add(start, moved, MOVED_BY);
                }
            }
        }
    }
}
