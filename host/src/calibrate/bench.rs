//! A bench for models: one recording, one frozen noise, and any laws tried on it from the end of another trial.
//!
//! A diagnosis tries hundreds of models. What they have in common is made once: the samples, cut down to windows where the recording is
//! long, the noise, and what the motion does not determine. A trial is a search from where another one ended; it keeps what the next one
//! needs, and no result for users.

use std::sync::Arc;

use nalgebra::{DMatrix, Matrix3, Vector3};

use super::extension::{self, Known};
use super::inflation::inflation;
use super::noise::Noise;
use super::point::Point;
use super::possible::{self, Beyond};
use super::preset::Preset;
use super::problem::Problem;
use super::result::Calibration;
use super::series::Series;
use super::trimmed::Trimmed;
use super::{CalibrateError, Fit, equilibrium, identify, observability};
use crate::model::law::Law;
use crate::model::{Layout, Model};
use crate::robot::{InputUnit, Robot, Symbol};
use solve::border::Border;
use solve::levenberg::{self, Settings};

/// A value with its standard error under the frozen noise.
#[derive(Debug, Clone, PartialEq)]
pub struct TrialValue {
    /// As in results.
    pub name: String,
    /// Unit.
    pub unit: &'static str,
    /// Estimate.
    pub estimate: f64,
    /// `None` where the search holds it or nothing shows it.
    pub std_error: Option<f64>,
    /// How much what else is unknown takes of its information: 1 is nothing.
    pub vif: f64,
}

/// The end of a search on a [`Bench`].
#[derive(Debug, Clone)]
pub struct Trial {
    /// What extends the base model.
    pub laws: Vec<Arc<dyn Law>>,
    /// ½ Σ r².
    pub cost: f64,
    /// How many times as large as their noise residuals make scores, where that is coloured or more than it was taken to be; at least 1.
    pub inflation: f64,
    /// Every parameter of the dynamics, the laws' behind the base model's.
    pub values: Vec<TrialValue>,
    rotations: Vec<Matrix3<f64>>,
    biases: Vec<Vec<Vector3<f64>>>,
    states: Vec<f64>,
    layout: Layout,
}

impl Trial {
    /// The value of this name.
    pub fn value(&self, name: &str) -> Option<&TrialValue> {
        self.values.iter().find(|value| value.name == name)
    }

    /// Whether every law's parameters are such as a robot can have: within their ranges, but for three standard errors and a twentieth of the
    /// largest of their kind, which what the law leaves of a joint may make.
    pub fn is_possible(&self) -> bool {
        self.beyond().is_empty()
    }

    fn beyond(&self) -> Vec<Beyond> {
        let values = self.values.iter().map(|value| (value.name.as_str(), value.estimate, value.std_error));
        possible::beyond(&self.laws, values)
    }

    /// The first of this trial's laws that a calibration leads where no robot can be.
    pub fn impossible_in(&self, calibration: &Calibration) -> Option<usize> {
        let results = calibration.parameters.iter();
        let results = results.map(|result| (result.name.as_str(), result.estimate, result.std_error));
        possible::beyond(&self.laws, results).first().map(|beyond| beyond.law)
    }

    /// Position and speed of link and motor of a joint at stage k.
    pub fn joint(&self, k: usize, joint: usize) -> JointState {
        let (x, layout) = (&self.states[k * self.layout.size()..][..self.layout.size()], &self.layout);
        let (q, qd) = (x[layout.q(joint)], x[layout.qd(joint)]);
        let elastic = layout.is_elastic(joint);
        let (theta, thetad) = if elastic { (x[layout.theta(joint)], x[layout.thetad(joint)]) } else { (q, qd) };
        JointState { q, qd, theta, thetad }
    }

    pub(super) fn known(&self) -> Known<'_> {
        Known {
            value: Box::new(|name| self.value(name).map(|value| value.estimate)),
            rotations: self.rotations.clone(),
            biases: self.biases.clone(),
            states: &self.states,
            layout: &self.layout,
        }
    }
}

/// A joint at one instant, rad or m and per second.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct JointState {
    /// Link position.
    pub q: f64,
    /// Link speed.
    pub qd: f64,
    /// Motor position.
    pub theta: f64,
    /// Motor speed.
    pub thetad: f64,
}

/// A start whose squares are this many times as many as rows is far off.
const FAR: f64 = 2.0;
/// Iterations under the base model's own noise, from a start that is far off, and the relative change of the cost that ends them.
const EASY_ITERATIONS: usize = 8;
const EASY: f64 = 1e-4;
/// A search that still falls when its iterations are used up goes on, so many times as far.
const WHILE_FALLING: usize = 4;
/// Searches in which what leaves its range is held at its end.
const ROUNDS_WITHIN: usize = 3;

/// The samples, the noise and what the motion does not determine: all that trials of models have in common.
pub struct Bench<'a> {
    pub(super) robot: &'a Robot,
    series: Series,
    noise: Noise,
    /// The noise that the base model takes its errors for.
    easy: Noise,
    layout: Layout,
    preset: Preset,
    /// What the motion does not determine of the base model, in the unknowns of its border.
    weak: Vec<Vec<f64>>,
    base_unknowns: usize,
    pub(super) settings: Settings,
}

impl<'a> Bench<'a> {
    /// A bench for models of `robot` on `series` under `noise` (of the base model), and the base model on it, searched from `fit`.
    ///
    /// # Errors
    /// As a calibration's.
    pub fn new(
        robot: &'a Robot,
        series: Series,
        fit: &Fit,
        noise: Noise,
        settings: Settings,
    ) -> Result<(Self, Trial), CalibrateError> {
        let model = Model::new(robot);
        let base_unknowns = model.coordinates().len();
        let mut bench = Bench {
            robot,
            series,
            noise,
            easy: fit.noise.clone(),
            layout: model.layout().clone(),
            preset: fit.calibration.preset,
            weak: Vec::new(),
            base_unknowns,
            settings,
        };
        let mut known = extension::known(fit);
        // Its states belong to other samples.
        known.states = &[];
        let iterations = bench.settings.max_iterations;
        let mut base = bench.search(&[], &known, &[], iterations)?;
        bench.weak = bench.weak_directions(&base)?;
        if !bench.weak.is_empty() {
            base = bench.search(&[], &known, &[], iterations)?;
        }
        Ok((bench, base))
    }

    /// The samples.
    pub fn series(&self) -> &Series {
        &self.series
    }

    /// The robot.
    pub fn robot(&self) -> &'a Robot {
        self.robot
    }

    /// Fits the base model with `laws`, in at most so many iterations from the end of `from`.
    ///
    /// # Errors
    /// A model that cannot be built or solved.
    pub fn fit(&self, laws: &[Arc<dyn Law>], from: &Trial, iterations: usize) -> Result<Trial, CalibrateError> {
        self.search(laws, &from.known(), &[], iterations)
    }

    /// Fits the laws of `trial` again from its end, with what no robot can have held at the end of its range. What follows from that may be
    /// beyond its own range, and is held too.
    ///
    /// # Errors
    /// A model that cannot be solved.
    pub fn fit_within(&self, trial: &Trial, iterations: usize) -> Result<Trial, CalibrateError> {
        let (mut trial, mut ends) = (trial.clone(), Vec::new());
        for _ in 0..ROUNDS_WITHIN {
            let beyond = trial.beyond();
            if beyond.is_empty() {
                break;
            }
            ends.extend(beyond);
            let next = self.search(&trial.laws, &trial.known(), &ends, iterations)?;
            trial = next;
        }
        Ok(trial)
    }

    /// Fits the base model with `laws` from the values of one trial, which may be another bench's, and the states of a trial on this one.
    ///
    /// # Errors
    /// A model that cannot be built or solved.
    pub fn fit_from(
        &self,
        laws: &[Arc<dyn Law>],
        (values, states): (&Trial, &Trial),
        iterations: usize,
    ) -> Result<Trial, CalibrateError> {
        self.search(laws, &Known { states: &states.states, layout: &states.layout, ..values.known() }, &[], iterations)
    }

    /// The base model as the greater part of the samples shows it; none where `base` explains all of them, or it is no better.
    ///
    /// # Errors
    /// As a solve's own.
    pub fn trimmed(&self, base: &Trial) -> Result<Option<Trimmed>, CalibrateError> {
        let rows = self.series.stages() * self.series.channels.len();
        if base.cost < 0.5 * FAR * rows as f64 {
            return Ok(None);
        }
        Trimmed::of(self.robot, &self.series, &self.settings)
    }

    /// Fits the base model with `laws` from what the greater part of the samples shows; what that does not know is as at the end of another trial.
    ///
    /// # Errors
    /// A model that cannot be built or solved.
    pub fn fit_trimmed(
        &self,
        laws: &[Arc<dyn Law>],
        (from, other): (&Trimmed, &Trial),
        iterations: usize,
    ) -> Result<Trial, CalibrateError> {
        let trimmed = from.known();
        let value = |name: &str| (trimmed.value)(name).or_else(|| other.value(name).map(|value| value.estimate));
        self.search(laws, &Known { value: Box::new(value), ..from.known() }, &[], iterations)
    }

    /// k_pwm U u (or k_t i, or the torque itself) at stage k by the values of a trial, N m or N.
    pub fn driving_torque(&self, trial: &Trial, k: usize, joint: usize) -> f64 {
        let symbol = match self.robot.input.unit {
            InputUnit::Duty | InputUnit::Volt => Some(Symbol::KPwm),
            InputUnit::Ampere => Some(Symbol::KT),
            InputUnit::NewtonMetre | InputUnit::Newton => None,
        };
        let spec = symbol.and_then(|symbol| self.robot.joint_parameter(symbol, joint));
        let constant = spec.map_or(1.0, |spec| trial.value(&spec.name).map_or(spec.value.start, |v| v.estimate));
        constant * self.robot.input.scale * self.series.input(k)[joint]
    }

    pub(super) fn problem<'m>(&'m self, model: &'m Model) -> Problem<'m> {
        let assumptions = extension::assumptions(model.laws(), self.preset);
        let mut problem = Problem::new(model, self.robot, &self.series, assumptions);
        self.weigh(&mut problem, &self.noise);
        problem
    }

    /// Weights the rows by `noise` of the base model.
    fn weigh(&self, problem: &mut Problem<'_>, noise: &Noise) {
        problem.set_noise(self.carried(problem, noise));
    }

    /// The noise of this bench for a problem, which may be of other samples.
    pub(super) fn noise_of(&self, problem: &Problem<'_>) -> Noise {
        self.carried(problem, &self.noise)
    }

    fn carried(&self, problem: &Problem<'_>, noise: &Noise) -> Noise {
        let assumed = Noise::assumed(self.robot, problem.model, problem.series, &problem.assumptions);
        noise.carried(&self.layout, problem.model.layout(), assumed)
    }

    /// A nearer start: where the rows are far from small, a search under the tight weights of the bench creeps along the narrow valley that the
    /// states leave it. Under the noise that the base model takes its errors for the valley is wide, and its floor is near.
    fn eased<'m>(&self, problem: &mut Problem<'m>, start: Point<'m>, held: &[Vec<f64>]) -> Point<'m> {
        let rows = self.series.stages() * self.series.channels.len();
        let cost = levenberg::total_cost(problem, &start, self.settings.threads);
        if cost < 0.5 * FAR * rows as f64 {
            return start;
        }
        self.weigh(problem, &self.easy);
        let settings =
            Settings { max_iterations: EASY_ITERATIONS, relative_cost_change: EASY, ..self.settings.clone() };
        let eased = levenberg::minimise(problem, start.clone(), held, &settings, |_, _| {});
        self.weigh(problem, &self.noise);
        match eased {
            Ok(eased) if eased.cost.is_finite() => {
                problem.shift_readings(&eased.point.z);
                eased.point
            }
            _ => start,
        }
    }

    /// A search from what is known, with coordinates of laws held at these ends.
    fn search(
        &self,
        laws: &[Arc<dyn Law>],
        from: &Known<'_>,
        ends: &[Beyond],
        iterations: usize,
    ) -> Result<Trial, CalibrateError> {
        let model = Model::extended(self.robot, laws.to_vec())?;
        let end = |name: &str| ends.iter().find(|end| end.name == name && end.coordinate.is_some());
        let value = |name: &str| end(name).map(|end| end.end).or_else(|| (from.value)(name));
        let at_ends = Known {
            value: Box::new(value),
            rotations: from.rotations.clone(),
            biases: from.biases.clone(),
            states: from.states,
            layout: from.layout,
        };
        let (mut problem, start, mut held) = self.at(&model, &at_ends);
        for (law, own) in ends.iter().filter_map(|end| Some((end.law, end.coordinate?))) {
            let mut direction = vec![0.0; problem.border().size()];
            direction[model.coordinates().first_of_law(law) + own] = 1.0;
            held.push(direction);
        }
        let start = equilibrium::settled(&problem, start, &self.settings);
        let start = self.eased(&mut problem, start, &held);
        let most_while_falling = WHILE_FALLING * iterations;
        let settings = Settings { max_iterations: iterations, most_while_falling, ..self.settings.clone() };
        let solution = levenberg::minimise(&problem, start, &held, &settings, |i, iteration| {
            tracing::trace!(i, cost = iteration.cost, damping = iteration.damping, trials = iteration.trials, "bench");
        })?;
        let mut border = Border::new(&solution.information, &solution.gradient, &held);
        // A stop that is never met shows nothing of itself, and should not hide what the others show.
        border.hold_undetermined();
        let point = solution.point;
        let values = values(&problem, &point, &border, &solution.information);
        let inflation = inflation(&problem, &point);
        Ok(Trial {
            laws: laws.to_vec(),
            cost: solution.cost,
            inflation,
            values,
            rotations: point.rotations,
            biases: point.biases,
            states: point.states,
            layout: model.layout().clone(),
        })
    }

    /// The problem of `model`, where its search starts, and what is held.
    pub(super) fn at<'m>(&'m self, model: &'m Model, from: &Known<'_>) -> (Problem<'m>, Point<'m>, Vec<Vec<f64>>) {
        let mut problem = self.problem(model);
        let point = extension::warm_start(&problem, self.robot, &self.series, from, &self.settings);
        problem.shift_readings(&point.z);
        let held = self.held(model, &problem);
        (problem, point, held)
    }

    /// Directions of the border that no search on this bench moves along.
    fn held(&self, model: &Model, problem: &Problem<'_>) -> Vec<Vec<f64>> {
        let structural = observability::structural(model, self.robot, problem.border());
        let added = model.coordinates().len() - self.base_unknowns;
        let weak = self.weak.iter().map(|direction| {
            let (base, rest) = direction.split_at(self.base_unknowns);
            base.iter().copied().chain(std::iter::repeat_n(0.0, added)).chain(rest.iter().copied()).collect()
        });
        structural.into_iter().map(|held| held.direction).chain(weak).collect()
    }

    fn weak_directions(&self, base: &Trial) -> Result<Vec<Vec<f64>>, CalibrateError> {
        let model = Model::new(self.robot);
        let problem = self.problem(&model);
        let structural = observability::structural(&model, self.robot, problem.border());
        let point = extension::warm_start(&problem, self.robot, &self.series, &base.known(), &self.settings);
        let judged = identify::judge(&problem, self.robot, &point, &structural, self.settings.threads)?;
        Ok(judged.weak.into_iter().map(|held| held.direction).collect())
    }
}

/// The results of the dynamics with their errors.
fn values(problem: &Problem<'_>, point: &Point<'_>, border: &Border, information: &[f64]) -> Vec<TrialValue> {
    let coordinates = problem.model.coordinates();
    let covariance = border.covariance();
    let size = problem.border().size();
    coordinates
        .names()
        .enumerate()
        .map(|(i, (name, unit))| {
            let (estimate, slopes) = coordinates.physical_and_slopes(&point.z, i);
            let variance = |covariance: &DMatrix<f64>| {
                let sum = slopes.iter().flat_map(|(a, by_a)| slopes.iter().map(move |(b, by_b)| (a, b, by_a * by_b)));
                sum.map(|(a, b, by)| by * covariance[(*a, *b)]).sum::<f64>()
            };
            let std_error = covariance.as_ref().map(|c| variance(c).sqrt()).filter(|e| e.is_finite() && *e > 0.0);
            let inflation = |(a, _): &(usize, f64)| {
                covariance.as_ref().map_or(f64::NAN, |c| c[(*a, *a)] * information[a * size + a])
            };
            let vif = slopes.iter().map(inflation).fold(f64::NAN, f64::max);
            TrialValue { name: name.to_string(), unit, estimate, std_error, vif }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::calibrate::fit;
    use crate::effect::Effect;
    use crate::simulate::{Direct, Options, SHORT_MOTION};

    #[test]
    fn a_stop_that_is_never_met_leaves_the_others_their_errors() {
        let robot = Robot::builtin("doggy").unwrap();
        let options = Options { seed: 3, ..Options::new(robot.clone()) };
        let whole = Direct::record(&options, SHORT_MOTION).unwrap().recording;
        let recording = whole.part(0..8_000.min(whole.len()));
        let base = fit(&robot, &[&recording], Preset::Default, &Settings::default(), |_, _| {}).unwrap();
        let noise = base.noise.clone();
        let (bench, trial) = Bench::new(&robot, base.series.clone(), &base, noise, Settings::default()).unwrap();
        let law = Effect::by_id("end_stop").unwrap().laws(&robot).unwrap().swap_remove(0).sharp().unwrap();
        let with = bench.fit(&[law], &trial, 3).unwrap();
        let error = |trial: &Trial, name: &str| trial.value(name).unwrap().std_error;
        for name in ["k_s[2]", "b", "mu[3]"] {
            let (alone, beside) = (error(&trial, name).unwrap(), error(&with, name).unwrap());
            assert!((beside / alone - 1.0).abs() < 0.01, "{name}: {beside} beside a stop, {alone} without");
        }
        assert_eq!(error(&with, "end_stop.q_max[1]"), None);
    }
}
