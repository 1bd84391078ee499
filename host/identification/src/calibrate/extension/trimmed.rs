//! The base model fitted to those pieces of a recording that it explains, and what it then misses in the others.
//!
//! ```text
//! |····|····|··!·|····|!!··|····|····|     pieces without a link between them: states start anew in each
//!   fit what is kept ─▶ states of all pieces ─▶ keep what costs little ─▶ again until nothing changes
//!   whole recording, shared unknowns held, speeds free to jump ─▶ torques that the links get and no equation has
//! ```
//!
//! A belt that jumps once and a stop that is hit now and then bend a fit of the whole recording out of all proportion; least trimmed squares
//! (Rousseeuw 1984) do not see them.

use std::ops::Range;

use nalgebra::{Matrix3, Vector3};

use super::warm_start::Known;
use crate::calibrate::data::series::{SHORTEST_RUN, Series};
use crate::calibrate::error::CalibrateError;
use crate::calibrate::identifiability::observability;
use crate::calibrate::initial_guess::start::{self, Shared};
use crate::calibrate::residuals::point::Point;
use crate::calibrate::residuals::preset::Preset;
use crate::calibrate::residuals::problem::Problem;
use crate::model::law::{Clues, JointClues};
use crate::model::{Layout, Model};
use crate::robot::{Robot, Symbol};
use solve::LeastSquares;
use solve::levenberg::{self, Settings};

/// Length of a piece, s.
const PIECE_S: f64 = 0.2;
/// Squares a row below which a piece is explained.
const EXPLAINED: f64 = 1.5;
/// Rounds of trimming at most, iterations of each, and of states alone.
const ROUNDS: usize = 8;
const ITERATIONS: usize = 6;
const STATE_ITERATIONS: usize = 6;
/// They end at this relative change of the cost.
const ENOUGH: f64 = 1e-4;
/// Of the pieces that move, the share that is always kept, and that the model has to explain in the end.
const LEAST: f64 = 0.35;
/// What a round leaves at most of what the one before it left, as long as it explains nothing.
const HOPELESS: f64 = 0.5;
/// How far speeds may jump within 1 ms where torques are left open, rad/s or m/s.
const OPEN_SPEED: f64 = 0.05;

/// The base model as the greater part of a recording shows it, where it does not explain the rest.
#[derive(Debug, Clone)]
pub struct Trimmed {
    /// What it misses.
    pub clues: Clues,
    values: Vec<(String, f64)>,
    rotations: Vec<Matrix3<f64>>,
    biases: Vec<Vec<Vector3<f64>>>,
    states: Vec<f64>,
    layout: Layout,
}

impl Trimmed {
    /// Of `series`; none where the base model explains all of it, or too little of the motion.
    ///
    /// # Errors
    /// As a solve's own.
    pub(crate) fn of(robot: &Robot, series: &Series, settings: &Settings) -> Result<Option<Self>, CalibrateError> {
        let model = Model::new(robot);
        let length = ((PIECE_S / series.median_period_s()) as usize).max(SHORTEST_RUN);
        let pieces = series.in_pieces(length);
        let moves =
            |place: usize| pieces.segments[place].clone().any(|k| pieces.input(k).iter().any(|input| *input != 0.0));
        let moving: Vec<bool> = (0..pieces.segments.len()).map(moves).collect();
        let trim = Trim { robot, model: &model, settings, pieces: &pieces, moving: &moving };
        let count = moving.iter().filter(|moves| **moves).count();
        let first = moving.iter().position(|moves| *moves).unwrap_or(0);
        let half = first + (moving.len() - first) / 2;
        // What lasts from an event on may bend the whole, but not both sides of it.
        let parts: [&dyn Fn(usize) -> bool; 3] =
            [&|_| true, &|place| place < half, &|place| place < first || place >= half];
        let mut best: Option<(usize, Shared)> = None;
        for part in parts {
            // One that cannot be solved is not the best.
            let Ok((explained, shared)) = trim.from(part) else { continue };
            if explained == count {
                return Ok(None);
            }
            if best.as_ref().is_none_or(|(most, _)| explained > *most) {
                best = Some((explained, shared));
            }
            if 2 * explained >= count {
                break;
            }
        }
        let Some((_, shared)) = best.filter(|(explained, _)| *explained as f64 >= LEAST * count as f64) else {
            return Ok(None);
        };
        let (clues, states) = match trim.clues(series, &shared) {
            Ok(found) => found,
            Err(error) => {
                tracing::debug!(%error, "no clues");
                return Ok(None);
            }
        };
        let names = model.coordinates().names().map(|(name, _)| name.to_string());
        let values = names.zip(model.coordinates().to_physical(&shared.z)).collect();
        let layout = model.layout().clone();
        Ok(Some(Trimmed { clues, values, rotations: shared.rotations, biases: shared.biases, states, layout }))
    }

    /// What a search may start from.
    pub(crate) fn known(&self) -> Known<'_> {
        let value = |name: &str| self.values.iter().find(|(own, _)| own == name).map(|(_, value)| *value);
        Known {
            value: Box::new(value),
            rotations: self.rotations.clone(),
            biases: self.biases.clone(),
            states: &self.states,
            layout: &self.layout,
            laws: &[],
            block_weights: &[],
        }
    }
}

struct Trim<'a> {
    robot: &'a Robot,
    model: &'a Model,
    settings: &'a Settings,
    pieces: &'a Series,
    /// Which of them move.
    moving: &'a [bool],
}

impl<'a> Trim<'a> {
    /// Trims from these pieces on: how many of those that move are explained, and by what.
    fn from(&self, first: &dyn Fn(usize) -> bool) -> Result<(usize, Shared), CalibrateError> {
        let mut shared = start::shared(self.model, self.robot, self.pieces);
        let mut keep: Vec<bool> = (0..self.moving.len()).map(first).collect();
        let (mut explained, mut least_before) = (0, f64::INFINITY);
        for round in 0..ROUNDS {
            shared = self.fit(&self.pieces.only(|place| keep[place]), shared)?;
            let costs = self.costs(&shared)?;
            let mut of_moving: Vec<f64> =
                costs.iter().zip(self.moving).filter(|(_, moves)| **moves).map(|(cost, _)| *cost).collect();
            of_moving.sort_by(f64::total_cmp);
            explained = of_moving.partition_point(|cost| *cost <= EXPLAINED);
            let least = of_moving.get((LEAST * of_moving.len() as f64) as usize).copied().unwrap_or(0.0);
            let before = std::mem::replace(&mut keep, costs.iter().map(|cost| *cost <= least.max(EXPLAINED)).collect());
            tracing::debug!(round, least, explained, of = of_moving.len(), "trimmed");
            // A fit of the better pieces that explains none of them and hardly gets better: what is missing is no event.
            let hopeless = explained == 0 && least > HOPELESS * least_before;
            if keep == before || hopeless {
                break;
            }
            least_before = least;
        }
        Ok((explained, shared))
    }

    fn problem<'s>(&'s self, series: &'s Series) -> Problem<'s> {
        Problem::new(self.model, self.robot, series, Preset::Default.assumptions())
    }

    fn settings(&self, iterations: usize) -> Settings {
        Settings { max_iterations: iterations, relative_cost_change: ENOUGH, ..self.settings.clone() }
    }

    /// The shared unknowns of a few steps further.
    fn fit(&self, series: &Series, from: Shared) -> Result<Shared, CalibrateError> {
        let problem = self.problem(series);
        let held = observability::structural(self.model, self.robot, problem.border());
        let held: Vec<_> = held.into_iter().map(|held| held.direction).collect();
        let start = start::with_states(self.model, series, from);
        let point = levenberg::minimise(&problem, start, &held, &self.settings(ITERATIONS), |_, _| {})?.point;
        Ok(Shared { z: point.z, rotations: point.rotations, biases: point.biases })
    }

    /// The states that suit these shared unknowns best.
    fn states<'s>(&'s self, problem: &Problem<'s>, shared: &Shared) -> Result<Point<'s>, CalibrateError> {
        let count = problem.border().size();
        let all: Vec<Vec<f64>> =
            (0..count).map(|i| (0..count).map(|j| if i == j { 1.0 } else { 0.0 }).collect()).collect();
        let start = start::with_states(self.model, problem.series, shared.clone());
        Ok(levenberg::minimise(problem, start, &all, &self.settings(STATE_ITERATIONS), |_, _| {})?.point)
    }

    /// Squares a row of every piece.
    fn costs(&self, shared: &Shared) -> Result<Vec<f64>, CalibrateError> {
        let pieces = self.pieces;
        let problem = self.problem(pieces);
        let point = self.states(&problem, shared)?;
        let mut scratch = problem.scratch();
        let of_piece = |run: &Range<usize>| {
            let rows = run.len() * pieces.channels.len();
            2.0 * problem.cost(&point, run.clone(), &mut scratch) / rows as f64
        };
        Ok(pieces.segments.iter().map(of_piece).collect())
    }

    /// The motion with the torques of the links left open.
    fn clues(&self, series: &Series, shared: &Shared) -> Result<(Clues, Vec<f64>), CalibrateError> {
        let layout = self.model.layout();
        let mut problem = self.problem(series);
        let mut noise = problem.noise().clone();
        let open = OPEN_SPEED * (series.median_period_s() / 1e-3).sqrt();
        (0..layout.joints()).for_each(|joint| {
            noise.process[layout.qd(joint)] = open;
            noise.process[layout.thetad(joint)] = open;
        });
        problem.set_noise(noise);
        let point = self.states(&problem, shared)?;
        let k_s = |joint| {
            let spec = self.robot.joint_parameter(Symbol::KS, joint)?;
            let names = self.model.coordinates().names().map(|(name, _)| name);
            let found = names.zip(self.model.coordinates().to_physical(&shared.z)).find(|(name, _)| *name == spec.name);
            Some(found.map_or(spec.value.start, |(_, value)| value))
        };
        let mut clues = Clues {
            time_s: Vec::new(),
            joints: (0..layout.joints()).map(|joint| JointClues { k_s: k_s(joint), ..JointClues::default() }).collect(),
        };
        let mut missing = vec![0.0; layout.chain()];
        for k in (0..series.stages()).filter(|&k| problem.linked(k)) {
            let (before, after, step_s) = (point.state(k), point.state(k + 1), series.duration_s(k));
            let middle: Vec<f64> = before.iter().zip(after).map(|(a, b)| 0.5 * (a + b)).collect();
            let speeds = layout.chain()..2 * layout.chain();
            let accelerations: Vec<f64> = speeds.map(|i| (after[i] - before[i]) / step_s).collect();
            point.dynamics.missing_torque(&middle, series.input(k), &accelerations, &mut missing);
            clues.time_s.push(series.time_s(k));
            for (joint, clues) in clues.joints.iter_mut().enumerate() {
                clues.q.push(middle[layout.q(joint)]);
                clues.qd.push(middle[layout.qd(joint)]);
                clues.missing.push(missing[layout.q(joint)]);
            }
        }
        Ok((clues, point.states))
    }
}
