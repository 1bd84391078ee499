//! What laws would add to the residuals of a trial, all from one factorisation: the columns of a score test (Rao 1948).
//!
//! ```text
//!   column of coordinate c   C_c = [r(law at its start, c moved by δ) − r(law at its start)] / δ     along the states of the trial
//!   a law that is not nothing at its start has one more                r(law at its start) − r(trial)
//! ```
//! Differences of residuals need nothing of a law but that it can be asked, so that every kind of law has columns by the same few lines. What a
//! law changes of a step is what it changes of the accelerations in the middle of it. States that a law brings (a Maxwell branch, a flexible base) are carried along with those of the trial: they answer to what the robot is known to
//! have done. `solve::columns` then eliminates all states and shared unknowns from all columns at once.

use std::ops::Range;
use std::sync::Arc;

use super::bench::Bench;
use super::trial::Trial;
use super::warm_start;
use crate::calibrate::initial_guess::start;
use crate::calibrate::initial_guess::start::Lagging;
use crate::calibrate::residuals::point::Point;
use crate::calibrate::residuals::problem::{Problem, Scratch};
use crate::model::law::Law;
use crate::model::{Layout, LinksAt, Model};
use crate::robot::Side;
use solve::columns::{Entries, ExtraColumns};
use solve::threads::both;
use solve::{LeastSquares, RowAt, Stage};

/// By how much a coordinate is moved: torques and angles differ by far more than their rounding, and no law bends within it.
const MOVED_BY: f64 = 1e-5;

impl Bench<'_> {
    /// The model with each of these laws on top; none where it cannot be asked.
    pub(crate) fn with_each(&self, model: &Model, trial: &Trial, laws: &[Arc<dyn Law>]) -> Vec<Option<Model>> {
        let extended = |law: &Arc<dyn Law>| {
            let together = trial.laws.iter().chain([law]).cloned().collect();
            let extended = Model::extended(self.robot, together).ok()?;
            let passive = |model: &Model| model.layout().passive().count();
            // Which of the passive joints are whose would have to be told.
            (passive(model) == 0 || passive(&extended) == passive(model)).then_some(extended)
        };
        laws.iter().map(extended).collect()
    }
}

/// One law on top of the trial, at its start and with each of its coordinates moved.
pub(crate) struct Asked<'m> {
    problem: Problem<'m>,
    at_start: Point<'m>,
    moved: Vec<Point<'m>>,
    /// Whether the law changes anything where it starts.
    is_something: bool,
    /// Whether what it changes of a step is seen by whole steps only.
    by_steps: bool,
    /// Whether it changes readings.
    sees: bool,
    /// Whether it changes steps.
    moves: bool,
    /// Whether the links are the trial's, wherever its coordinates are moved.
    keeps_links: bool,
    /// Of each component of the trial's state, where it stands in that of this model.
    places: Vec<usize>,
}

impl<'m> Asked<'m> {
    /// The columns of all of these models, and which are whose; none where there is no model. The products of columns of different models are those with the
    /// first `crossed` models.
    pub(crate) fn columns<'b>(
        bench: &'m Bench<'_>,
        (problem, model, point): (&'b Problem<'b>, &Model, &Point<'_>),
        (models, crossed): (&'m [Option<Model>], usize),
        trial: &Trial,
    ) -> (AllColumns<'m, 'b>, Vec<Option<Range<usize>>>) {
        let (left, right) = models.split_at(models.len() / 2);
        let ask = |models| Asked::of_all(bench, (model, point), models, trial);
        let (left, right) = both(bench.settings.threads, || ask(left), || ask(right));
        let mut asked = Vec::new();
        let mut columns = Vec::new();
        let mut count = 0;
        for one in left.into_iter().chain(right) {
            let first = count;
            count += one.as_ref().map_or(0, Asked::count);
            columns.push(one.as_ref().map(|_| first..count));
            asked.extend(one.map(|one| (first, one)));
        }
        let reaches = columns.iter().enumerate().flat_map(|(model, own)| {
            let own = own.clone().unwrap_or_default();
            let end = if model < crossed { count } else { own.end };
            own.map(move |_| end)
        });
        let reach = reaches.collect();
        let layout = model.layout();
        let (all, speed_of) = ((0..layout.size()).collect(), layout.speed_of());
        (AllColumns { base: problem, all, speed_of, asked, count, reach }, columns)
    }

    /// Of each of these models; none where there is none.
    fn of_all(
        bench: &'m Bench<'_>,
        (base, trial_point): (&Model, &Point<'_>),
        models: &'m [Option<Model>],
        trial: &Trial,
    ) -> Vec<Option<Self>> {
        let ask = |extended| Asked::of(bench, base, trial_point, extended, trial);
        models.iter().map(|extended| extended.as_ref().map(ask)).collect()
    }

    fn of(bench: &'m Bench<'_>, base: &Model, trial_point: &Point<'_>, extended: &'m Model, trial: &Trial) -> Self {
        let mut problem = bench.problem(extended);
        let series = bench.series();
        let shared = warm_start::shared(extended, bench.robot(), series, &trial.known());
        problem.shift_readings(&shared.z);
        let places = places(base.layout(), extended.layout());
        let added: Vec<usize> = (0..extended.layout().size()).filter(|i| !places.contains(i)).collect();
        // The trial has all states but those that the law adds.
        let begin = if added.is_empty() { start::without_states } else { start::with_states };
        let fresh = begin(extended, series, shared);
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
        let moved: Vec<Point<'_>> = moved.collect();
        let all = || moved.iter().chain([&at_start]);
        let keeps_links = all().all(|point| point.dynamics.has_links_of(&trial_point.dynamics));
        // A law whose coordinates all start at nothing is nothing there; others may be.
        let law = &extended.laws()[trial.laws.len()];
        let coordinates = &law.parameters().coordinates;
        let gyros = || bench.robot().gyros().enumerate().map(|(gyro, _)| gyro);
        let sees_gyro = gyros().any(|gyro| law.sees_gyro(gyro) || law.gyro_lag(gyro).is_some());
        let sees_position = (0..base.layout().joints())
            .any(|joint| [Side::Motor, Side::Link].into_iter().any(|side| law.sees_position(side, joint)));
        let moves_bodies = extended.layout().chain() != base.layout().chain();
        let sees = sees_gyro || sees_position || moves_bodies;
        // A law that changes readings, and has nothing by which it could change a step.
        let is_of_sensors = sees
            && !moves_bodies
            && added.is_empty()
            && keeps_links
            && law.hooks().is_empty()
            && !law.euler()
            && [law.input_delay(), law.coriolis()] == [None; 2]
            && law.payload().is_none();
        Asked {
            is_something: coordinates.is_empty() || coordinates.iter().any(|c| c.start != 0.0),
            by_steps: law.euler(),
            sees,
            moves: !is_of_sensors,
            keeps_links,
            problem,
            at_start,
            moved,
            places,
        }
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
    for (from, to) in base.inputs().zip(extended.inputs()).chain(base.own().zip(extended.own())) {
        places[from] = to;
    }
    places
}

/// Gives `point` the states of the trial, and those that the law adds as they answer to them; runs begin where `point` says. But gyros that lag begin
/// with the trial's rates: `point` has them from readings, whose noise would be in the column and in the residuals that it is held against.
fn carry(problem: &Problem<'_>, (trial, places, added): (&Point<'_>, &[usize], &[usize]), point: &mut Point<'_>) {
    let size = problem.model.layout().size();
    let mut scratch = problem.scratch();
    let lagging = Lagging::of(problem.model, problem.series).among(added);
    let stages = problem.series.stages();
    for k in 0..stages {
        for (value, place) in trial.state(k).iter().zip(places) {
            point.states[k * size + place] = *value;
        }
        if problem.series.starts_run(k) {
            lagging.begin(problem.model, &mut point.states[k * size..(k + 1) * size]);
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
pub(crate) struct AllColumns<'a, 'm> {
    base: &'m Problem<'m>,
    /// Every component of the trial's state, and that which is its derivative.
    all: Vec<usize>,
    speed_of: Vec<Option<usize>>,
    /// With the first column of each.
    asked: Vec<(usize, Asked<'a>)>,
    count: usize,
    /// Of each column, the end of those whose products with it are wanted.
    reach: Vec<usize>,
}

/// Room of one thread.
pub(crate) struct Room {
    base: Scratch,
    of_each: Vec<Scratch>,
    /// The trial's rows by channel.
    rows: Vec<Option<RowAt>>,
    trial: Prediction,
    /// Of the trial for laws that are seen by whole steps.
    whole_step: Prediction,
    start: Prediction,
    moved: Prediction,
}

/// What a model predicts of one stage.
#[derive(Debug, Clone, Default)]
struct Prediction {
    /// Whitened residuals of channels, zero where there is no reading.
    channels: Vec<f64>,
    /// How the trial's components of the state change over the step; empty where the chain breaks.
    change: Vec<f64>,
    middle: Vec<f64>,
    rates: Vec<f64>,
    /// The links in the middle of the step.
    links: LinksAt,
}

impl Prediction {
    fn fill(
        &mut self,
        (problem, point, places): (&Problem<'_>, &Point<'_>, &[usize]),
        k: usize,
        (by_steps, sees, moves): (bool, bool, bool),
        links: Option<&LinksAt>,
        scratch: &mut Scratch,
    ) {
        if sees {
            self.channels.clear();
            self.channels.resize(problem.series.channels.len(), 0.0);
            problem.sensor_rows(point, k, scratch, false, &mut |row| {
                if let Some(channel) = row.channel {
                    self.channels[channel] = row.weight * row.residual;
                }
            });
        }
        self.change.clear();
        if !moves || !problem.linked(k) {
            return;
        }
        let before = point.state(k);
        if by_steps {
            let next = problem.next(point, k, scratch);
            self.change.extend(places.iter().map(|&i| next[i] - before[i]));
            return;
        }
        self.middle.clear();
        self.middle.extend(before.iter().zip(point.state(k + 1)).map(|(a, b)| 0.5 * (a + b)));
        self.rates.resize(before.len(), 0.0);
        if links.is_none() {
            self.links = point.dynamics.links_at(&self.middle);
        }
        let links = links.unwrap_or(&self.links);
        problem.rates(point, k, (&self.middle, links), scratch, &mut self.rates);
        let duration_s = problem.series.duration_s(k);
        self.change.extend(places.iter().map(|&i| duration_s * self.rates[i]));
    }
}

impl ExtraColumns<Problem<'_>> for AllColumns<'_, '_> {
    type Scratch = Room;

    fn scratch(&self) -> Room {
        Room {
            base: self.base.scratch(),
            of_each: self.asked.iter().map(|(_, asked)| asked.problem.scratch()).collect(),
            rows: Vec::new(),
            trial: Prediction::default(),
            whole_step: Prediction::default(),
            start: Prediction::default(),
            moved: Prediction::default(),
        }
    }

    fn count(&self) -> usize {
        self.count
    }

    fn reach(&self, column: usize) -> usize {
        self.reach[column]
    }

    fn fill(&self, point: &Point<'_>, first: usize, room: &mut Room, stages: &[Stage], entries: &mut [Entries]) {
        for (k, (_, entries)) in (first..).zip(stages.iter().zip(entries)) {
            let Room { base, of_each, rows, trial, whole_step, start, moved } = &mut *room;
            self.rows_by_channel(point, k, base, rows);
            let half_s = 0.5 * self.base.series.duration_s(k);
            let stage_weight = self.base.stage_weight(k);
            let of_trial = (self.base, point, &self.all[..]);
            trial.fill(of_trial, k, (false, true, true), None, base);
            for ((column, asked), scratch) in self.asked.iter().zip(of_each) {
                let mut column = *column;
                let how = (asked.by_steps, asked.sees, asked.moves);
                let mut add = |from: &Prediction, to: &Prediction, by: f64| {
                    for (channel, row) in rows.iter().enumerate().filter(|_| asked.sees) {
                        let difference = to.channels[channel] - from.channels[channel];
                        if let (Some(row), true) = (row, difference != 0.0) {
                            entries.add(*row, column, stage_weight * difference / by);
                        }
                    }
                    let difference = |i: usize| to.change[i] - from.change[i];
                    for i in 0..to.change.len() {
                        // A push that lasts for the step moves the position too.
                        let pushed = self.speed_of[i]
                            .map_or(0.0, |speed| if asked.by_steps { 0.0 } else { half_s * difference(speed) });
                        let moved_by = difference(i) + pushed;
                        if moved_by != 0.0 {
                            let weight = stage_weight * self.base.process_weight[i];
                            entries.add(RowAt::Transition(i), column, weight * moved_by / by);
                        }
                    }
                    column += 1;
                };
                let is_trial = !asked.is_something && asked.places.len() == asked.at_start.dynamics.size();
                let links = asked.keeps_links.then_some(&trial.links);
                let trial = if asked.by_steps {
                    whole_step.fill(of_trial, k, (true, true, true), None, base);
                    &*whole_step
                } else {
                    &*trial
                };
                if !is_trial {
                    start.fill((&asked.problem, &asked.at_start, &asked.places), k, how, links, scratch);
                }
                if asked.is_something {
                    add(trial, start, 1.0);
                }
                let from = if is_trial { trial } else { &*start };
                for point in &asked.moved {
                    moved.fill((&asked.problem, point, &asked.places), k, how, links, scratch);
                    add(from, moved, MOVED_BY);
                }
            }
        }
    }
}

impl AllColumns<'_, '_> {
    /// The trial's row of every channel that has a reading at stage k.
    fn rows_by_channel(&self, point: &Point<'_>, k: usize, scratch: &mut Scratch, rows: &mut Vec<Option<RowAt>>) {
        rows.clear();
        rows.resize(self.base.series.channels.len(), None);
        let mut counts = [0usize; 3];
        self.base.row_channels(point, k, scratch, |kind, channel| {
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
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::calibrate::{Preset, fit};
    use crate::effect::Effect;
    use crate::robot::Robot;
    use crate::simulated::{Options, SHORT_MOTION, record};
    use solve::levenberg::Settings;

    #[test]
    fn a_lagging_gyro_begins_every_run_with_the_rate_of_the_trial_not_with_a_reading() {
        let robot = Robot::builtin("doggy").unwrap();
        let whole = record(&Options { seed: 3, ..Options::new(robot.clone()) }, SHORT_MOTION).recording;
        let recording = whole.part(0..8_000.min(whole.len()));
        let fitted = fit(&robot, &[&recording], Preset::Default, &Settings::default(), |_, _| {}).unwrap();
        let part = fitted.series.excerpt(2_000, 4).unwrap();
        let (bench, trial) =
            Bench::new(&robot, (part, vec![0]), &fitted, fitted.noise.clone(), Settings::default()).unwrap();
        let law = Effect::by_id("gyro_lag").unwrap().laws(&robot).unwrap().swap_remove(0);
        let (base, extended) = (Model::new(&robot), Model::extended(&robot, vec![law]).unwrap());
        let (_, point, _) = bench.at(&base, &trial.known());
        let asked = Asked::of(&bench, &base, &point, &extended, &trial);
        let first = extended.lagging(0).unwrap().state;
        let runs: Vec<usize> = (0..bench.series().stages()).filter(|k| bench.series().starts_run(*k)).collect();
        assert!(runs.len() > 2, "{runs:?}");
        for k in runs {
            // The first gyro sits on the body that turns about z with the first joint.
            let rate = point.state(k)[base.layout().qd(0)];
            let begins = &asked.at_start.state(k)[first..first + 3];
            assert_eq!(begins, [0.0, 0.0, rate], "run from {k}");
        }
    }
}
