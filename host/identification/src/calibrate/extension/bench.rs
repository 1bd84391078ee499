//! A bench for models: one recording, one frozen noise, and any laws tried on it from the end of another trial.
//!
//! A diagnosis tries hundreds of models. What they have in common is made once: the samples, cut down to windows where the recording is
//! long, the noise, and what the motion does not determine. A trial is a search from where another one ended; it keeps what the next one
//! needs, and no result for users.

use std::sync::Arc;

use super::laws;
use super::trial::{self, Trial};
use super::trimmed::Trimmed;
use super::warm_start;
use super::warm_start::Known;
use crate::calibrate::data::series::Series;
use crate::calibrate::error::CalibrateError;
use crate::calibrate::identifiability::identify;
use crate::calibrate::identifiability::observability;
use crate::calibrate::initial_guess::equilibrium;
use crate::calibrate::residuals::noise::Noise;
use crate::calibrate::residuals::point::Point;
use crate::calibrate::residuals::preset::Preset;
use crate::calibrate::residuals::problem::Problem;
use crate::calibrate::result::fitted::Fit;
use crate::model::law::Law;
use crate::model::{Layout, Model};
use crate::robot::Robot;
use solve::border::Border;
use solve::levenberg::{self, Enough, Hopeless, Settings};

/// A point whose squares are this many times as many as rows is far off.
const FAR: f64 = 2.0;
/// Iterations under the base model's own noise, from a start that is far off, and the relative change of the cost that ends them.
const EASY_ITERATIONS: usize = 8;
const EASY: f64 = 1e-4;
/// Iterations after which more laws explain more, or are about to, or never do.
const HOPELESS: usize = 8;

/// Stages that a search may factorise in steps of the states alone, after steps that lead to more than they started from: short recordings can afford more of such steps.
const INNER_STAGES: usize = 120_000;

/// How long a search goes on.
#[derive(Debug, Clone, Copy)]
struct Effort {
    /// Most iterations.
    iterations: usize,
    hopeless: Option<Hopeless>,
    enough: Option<Enough>,
}

impl Effort {
    fn of(iterations: usize) -> Self {
        Effort { iterations, hopeless: None, enough: None }
    }
}

/// How long a search goes on of which it is asked what more laws save.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SavingEffort {
    /// Most iterations.
    pub iterations: usize,
    /// ½ Σ r² above which it is given up, unless it falls fast.
    pub above: f64,
    /// A step that saves less than this share of all that is saved is the last one.
    pub enough: f64,
}

impl SavingEffort {
    /// Where savings count from `below` on.
    fn from(self, below: f64) -> Effort {
        let SavingEffort { iterations, above, enough } = self;
        let hopeless = Some(Hopeless { after: HOPELESS, above });
        Effort { iterations, hopeless, enough: Some(Enough { below, share: enough }) }
    }
}

/// The samples, the noise and what the motion does not determine: all that trials of models have in common.
#[derive(Clone)]
pub struct Bench<'a> {
    pub(crate) robot: &'a Robot,
    pub(crate) series: Series,
    /// The first stage of every block of time.
    pub(crate) block_starts: Vec<usize>,
    pub(crate) noise: Noise,
    /// The noise that the base model takes its errors for.
    pub(crate) easy: Noise,
    pub(crate) layout: Layout,
    pub(crate) preset: Preset,
    /// What the motion does not determine of the base model, in the unknowns of its border.
    pub(crate) weak: Vec<Vec<f64>>,
    pub(crate) base_unknowns: usize,
    pub(crate) settings: Settings,
}

impl<'a> Bench<'a> {
    /// A bench for models of `robot` on `series`, whose blocks start with these stages, under `noise` (of the base model), and the base model on it,
    /// searched from `fit`.
    ///
    /// # Errors
    /// As a calibration's.
    pub fn new(
        robot: &'a Robot,
        (series, block_starts): (Series, Vec<usize>),
        fit: &Fit,
        noise: Noise,
        settings: Settings,
    ) -> Result<(Self, Trial), CalibrateError> {
        let model = Model::new(robot);
        let base_unknowns = model.coordinates().len();
        let mut bench = Bench {
            robot,
            series,
            block_starts,
            noise,
            easy: fit.noise.clone(),
            layout: model.layout().clone(),
            preset: fit.calibration.preset,
            weak: Vec::new(),
            base_unknowns,
            settings,
        };
        let mut known = warm_start::known(fit);
        // Its states belong to other samples.
        known.states = &[];
        let iterations = bench.settings.max_iterations;
        let mut base = bench.search(&[], &known, Effort::of(iterations))?;
        bench.weak = bench.weak_directions(&base)?;
        if !bench.weak.is_empty() {
            base = bench.search(&[], &known, Effort::of(iterations))?;
        }
        Ok((bench, base))
    }

    /// The samples.
    pub fn series(&self) -> &Series {
        &self.series
    }

    /// What the base calibration assumed.
    pub fn preset(&self) -> Preset {
        self.preset
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
        self.search(laws, &from.known(), Effort::of(iterations))
    }

    /// Fits the model of `from` again with all rows of each block multiplied by such a weight, in at most so many iterations.
    ///
    /// # Errors
    /// A model that cannot be solved.
    pub fn fit_weighted(
        &self,
        from: &Trial,
        block_weights: &[f64],
        iterations: usize,
    ) -> Result<Trial, CalibrateError> {
        self.search(&from.laws, &Known { block_weights, ..from.known() }, Effort::of(iterations))
    }

    /// [`Self::fit`] of laws on top of those of `from`, a trial on this bench, until it is known what they save.
    ///
    /// # Errors
    /// A model that cannot be built or solved.
    pub fn fit_on_top(
        &self,
        laws: &[Arc<dyn Law>],
        from: &Trial,
        effort: SavingEffort,
    ) -> Result<Trial, CalibrateError> {
        self.search(laws, &from.known(), effort.from(from.cost))
    }

    /// The same from the values of one trial, and the states of another, both on this bench.
    ///
    /// # Errors
    /// A model that cannot be built or solved.
    pub fn fit_from(
        &self,
        laws: &[Arc<dyn Law>],
        (values, states): (&Trial, &Trial),
        effort: SavingEffort,
    ) -> Result<Trial, CalibrateError> {
        self.search(
            laws,
            &Known { states: &states.states, layout: &states.layout, laws: &states.laws, ..values.known() },
            effort.from(values.cost),
        )
    }

    /// The base model as the greater part of the samples shows it; none where it explains all of them, or it is no better.
    ///
    /// # Errors
    /// As a solve's own.
    pub fn trimmed(&self) -> Result<Option<Trimmed>, CalibrateError> {
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
        let known = Known { value: Box::new(value), block_weights: &other.block_weights, ..from.known() };
        self.search(laws, &known, Effort::of(iterations))
    }

    /// k_pwm U u (or k_t i, or the torque itself) at stage k by the values of a trial, N m or N.
    pub fn driving_torque(&self, trial: &Trial, k: usize, joint: usize) -> f64 {
        let spec = self.robot.input.unit.torque_constant().and_then(|symbol| self.robot.joint_parameter(symbol, joint));
        let constant = spec.map_or(1.0, |spec| trial.value(&spec.name).map_or(spec.value.start, |v| v.estimate));
        constant * self.robot.input.scale * self.series.input(k)[joint]
    }

    pub(crate) fn problem<'m>(&'m self, model: &'m Model) -> Problem<'m> {
        let assumptions = laws::assumptions(model.laws(), self.preset);
        let mut problem = Problem::new(model, self.robot, &self.series, assumptions);
        self.weigh(&mut problem, &self.noise);
        problem
    }

    /// Weights the rows by `noise` of the base model.
    fn weigh(&self, problem: &mut Problem<'_>, noise: &Noise) {
        problem.set_noise(self.carried(problem, noise));
    }

    /// The noise of this bench for a problem, which may be of other samples.
    pub(crate) fn noise_of(&self, problem: &Problem<'_>) -> Noise {
        self.carried(problem, &self.noise)
    }

    fn carried(&self, problem: &Problem<'_>, noise: &Noise) -> Noise {
        let assumed = Noise::assumed(self.robot, problem.model, problem.series, &problem.assumptions);
        noise.carried(&self.layout, problem.model.layout(), assumed)
    }

    /// A nearer start: where the rows are far from small, a search under the tight weights of the bench creeps along the narrow valley that the
    /// states leave it. Under the noise that the base model takes its errors for the valley is wide, and its floor is near. States that suit the tight weights follow.
    /// None where the start is near, or no search ends in numbers.
    pub(crate) fn eased<'m>(
        &self,
        problem: &mut Problem<'m>,
        start: &Point<'m>,
        held: &[Vec<f64>],
    ) -> Option<Point<'m>> {
        if !self.is_far(problem, start) {
            return None;
        }
        self.weigh(problem, &self.easy);
        let settings = Settings {
            max_iterations: EASY_ITERATIONS,
            most_while_falling: 3 * EASY_ITERATIONS,
            relative_cost_change: EASY,
            ..self.settings.clone()
        };
        let eased = levenberg::minimise(problem, start.clone(), held, &settings, |i, iteration| {
            tracing::trace!(i, cost = iteration.cost, trials = iteration.trials, "eased");
        });
        self.weigh(problem, &self.noise);
        match eased {
            Ok(eased) if eased.cost.is_finite() => {
                problem.shift_readings(&eased.point.z);
                Some(equilibrium::states_alone(problem, eased.point, &self.settings))
            }
            _ => None,
        }
    }

    /// Whether rows, as they are without the weights of blocks, are wrong by more than their noise.
    fn is_far<'m>(&self, problem: &mut Problem<'m>, point: &Point<'m>) -> bool {
        let weights = std::mem::take(&mut problem.stage_weights);
        let cost = levenberg::total_cost(problem, point, self.settings.threads);
        problem.stage_weights = weights;
        let rows = self.series.stages() * self.series.channels.len();
        cost >= 0.5 * FAR * rows as f64
    }

    /// A search from what is known.
    fn search(
        &self,
        laws: &[Arc<dyn Law>],
        from: &Known<'_>,
        Effort { iterations, hopeless, enough }: Effort,
    ) -> Result<Trial, CalibrateError> {
        let model = Model::extended(self.robot, laws.to_vec())?;
        let (mut problem, start, held) = self.at(&model, from);
        let mut start = equilibrium::settled(&problem, start, &self.settings);
        let is_fresh = from.states.is_empty();
        if is_fresh {
            start = self.eased(&mut problem, &start, &held).unwrap_or(start);
        }
        let settings = Settings {
            max_iterations: iterations,
            most_while_falling: iterations,
            hopeless,
            enough,
            inner_iterations: INNER_STAGES / self.series.stages().max(1),
            ..self.settings.clone()
        };
        let solution = levenberg::minimise(&problem, start, &held, &settings, Self::progress)?;
        let mut border = Border::new(&solution.information, &solution.gradient, &held);
        // A stop that is never met shows nothing of itself, and should not hide what the others show.
        border.hold_undetermined();
        let point = solution.point;
        let values = trial::values(&problem, &point, &border, &solution.information);
        Ok(Trial {
            laws: laws.to_vec(),
            cost: solution.cost,
            values,
            rotations: point.rotations,
            biases: point.biases,
            states: point.states,
            layout: model.layout().clone(),
            block_weights: from.block_weights.to_vec(),
        })
    }

    fn progress(i: usize, iteration: &levenberg::Iteration) {
        tracing::trace!(i, cost = iteration.cost, damping = iteration.damping, trials = iteration.trials, "bench");
    }

    /// The problem of `model`, where its search starts, and what is held.
    pub(crate) fn at<'m>(&'m self, model: &'m Model, from: &Known<'_>) -> (Problem<'m>, Point<'m>, Vec<Vec<f64>>) {
        let mut problem = self.problem(model);
        problem.stage_weights = self.stage_weights(from.block_weights);
        let point = warm_start::warm_start(&problem, self.robot, &self.series, from, &self.settings);
        problem.shift_readings(&point.z);
        let held = self.held(model, &problem);
        (problem, point, held)
    }

    /// Of every stage, that of its block; empty where blocks have none.
    fn stage_weights(&self, block_weights: &[f64]) -> Vec<f64> {
        let of_block = self.blocks().into_iter().zip(block_weights);
        of_block.flat_map(|(block, weight)| std::iter::repeat_n(*weight, block.len())).collect()
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
        let point = warm_start::warm_start(&problem, self.robot, &self.series, &base.known(), &self.settings);
        let judged = identify::judge(&problem, self.robot, &point, &structural, self.settings.threads)?;
        Ok(judged.weak.into_iter().map(|held| held.direction).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::calibrate::extension::fixture::doggy;
    use crate::effect::Effect;

    #[test]
    fn a_stop_that_is_never_met_leaves_the_others_their_errors() {
        let (robot, base) = doggy();
        let noise = base.noise.clone();
        let (bench, trial) =
            Bench::new(&robot, (base.series.clone(), vec![0]), &base, noise, Settings::default()).unwrap();
        let law = Effect::by_id("end_stop").unwrap().laws(&robot).unwrap().swap_remove(0).other_shape().unwrap();
        let with = bench.fit(&[law], &trial, 3).unwrap();
        let error = |trial: &Trial, name: &str| trial.value(name).unwrap().std_error;
        for name in ["k_s[2]", "b", "mu[3]"] {
            let (alone, beside) = (error(&trial, name).unwrap(), error(&with, name).unwrap());
            assert!((beside / alone - 1.0).abs() < 0.01, "{name}: {beside} beside a stop, {alone} without");
        }
        assert_eq!(error(&with, "end_stop.q_max[1]"), None);
    }
}
