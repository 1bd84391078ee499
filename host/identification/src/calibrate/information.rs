//! The information that a motion holds of the parameters, as a matrix that adds up: motions that are played one after the other tell together what each
//! of them tells.
//!
//! It is that of noise-free predictions, all states eliminated, as a calibration judges its motion, in units of the values:
//!
//! ```text
//! J = D (∂z/∂p)ᵀ S (∂z/∂p) D        S: information of the solver's unknowns z,  p: parameters,  D: their values
//! ```
//!
//! so the inverse holds squares of relative errors. Laws that the robot may have beside the base model add their coordinates to p, at their starts, where most of them are
//! nothing; their D is a typical size. A joint that sticks shows its Coulomb friction by the smoothing of the sign function only,
//! which is no friction: it is eliminated as if it were another one in each such motion. What the robot's build hides is taken as known.

use std::sync::Arc;

use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

use super::data::series::Series;
use super::error::CalibrateError;
use super::extension::laws;
use super::identifiability::noise_free::NoiseFree;
use super::identifiability::{identify, observability};
use super::initial_guess::start;
use super::noise_estimate::floor;
use super::requirements::accept;
use super::residuals::noise::{Noise, process_names};
use super::residuals::point::Point;
use super::residuals::preset::{NoiseSource, Preset};
use super::residuals::problem::Problem;
use super::result::calibration::Calibration;
use super::result::summary;
use crate::model::law::Law;
use crate::model::{Model, rotation};
use crate::recording::Recording;
use crate::robot::{Robot, Symbol};
use solve::factor;

/// A direction that the build of the robot hides is known this much better than to its size.
const KNOWN: f64 = 1e12;

/// Where the noise comes from that weights the rows.
#[derive(Debug, Clone, PartialEq)]
pub enum Weights {
    /// The robot file's for the sensors, the preset's for the steps of the model.
    Assumed,
    /// As a calibration would estimate it: sensors as they are here, by channel; of a step the integrator's own error in this motion, and beside it what the model
    /// misses, by state component. Empty: the robot file's, and nothing.
    Estimated {
        /// Standard deviations by channel, in the channel's unit.
        channels: Vec<f64>,
        /// Standard deviations by state component over a sample period, each in its own unit.
        missed: Vec<f64>,
    },
    /// That of another motion.
    Given(Noise),
    /// For a part of a motion of which this is the noise: of steps, the root mean square of it and of the integrator's own error in the part.
    Part(Noise),
}

impl Weights {
    /// Of a robot of which the model misses nothing.
    pub const EXACT: Self = Self::Estimated { channels: Vec::new(), missed: Vec::new() };

    /// As this calibration of the robot found them.
    pub fn of(robot: &Robot, calibration: &Calibration) -> Self {
        if calibration.noise_source == NoiseSource::Fixed {
            return Self::Assumed;
        }
        let told = |name: &str| calibration.noise.iter().find(|noise| noise.channel == name);
        let sigma = |channel: crate::robot::Channel| told(&channel.name).map_or(channel.sigma, |noise| noise.sigma);
        let missed = |(name, _): (String, &str)| {
            let noise = told(&name);
            noise.map_or(0.0, |noise| (noise.sigma.powi(2) - noise.floor.unwrap_or(0.0).powi(2)).max(0.0).sqrt())
        };
        Self::Estimated {
            channels: robot.channels().into_iter().map(sigma).collect(),
            missed: process_names(robot, Model::new(robot).layout()).into_iter().map(missed).collect(),
        }
    }

    fn weigh(&self, problem: &mut Problem<'_>, robot: &Robot, point: &Point<'_>) {
        match self {
            Self::Assumed => {}
            Self::Given(noise) => problem.set_noise(noise.clone()),
            Self::Part(whole) => {
                let mut noise = floor::floor(problem, robot, point);
                noise.channels.clone_from(&whole.channels);
                for (sigma, whole) in noise.process.iter_mut().zip(&whole.process) {
                    *sigma = (0.5 * (*sigma * *sigma + whole * whole)).sqrt();
                }
                problem.set_noise(noise);
            }
            Self::Estimated { channels, missed } => {
                let mut noise = floor::floor(problem, robot, point);
                noise.channels = problem.noise().channels.clone();
                noise.channels.iter_mut().zip(channels).for_each(|(sigma, known)| *sigma = *known);
                if !missed.is_empty() {
                    // Of the states that laws bring, nothing is known to be missed.
                    let (base, layout) = (Model::new(robot), problem.model.layout());
                    let none = Noise { channels: Vec::new(), process: vec![0.0; layout.size()] };
                    let missed = Noise { channels: Vec::new(), process: missed.clone() };
                    let missed = missed.carried(base.layout(), layout, none).process;
                    noise.process.iter_mut().zip(missed).for_each(|(sigma, missed)| *sigma = sigma.hypot(missed));
                }
                problem.set_noise(noise);
            }
        }
    }
}

/// A law that the robot may have beside the base model.
#[derive(Debug, Clone)]
pub struct SizedLaw {
    /// The law, at its start.
    pub law: Arc<dyn Law>,
    /// Of each of its coordinates.
    pub coordinates: Vec<SizedCoordinate>,
}

/// A coordinate of a law.
#[derive(Debug, Clone, PartialEq)]
pub struct SizedCoordinate {
    /// Name of the result that it stands in; of an amplitude, with ` cos` or ` sin`.
    pub name: String,
    /// Unit of that result.
    pub unit: &'static str,
    /// The typical value of that result; 1 where there is none.
    pub typical: f64,
    /// By how much the coordinate moves where the result does by its typical value.
    pub moves: f64,
    /// Whether it says how much of the law there is.
    pub is_size: bool,
}

/// What a parameter of an [`Information`] is one of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum About {
    /// The base model's dynamics.
    Dynamics,
    /// How much there is of a law.
    LawSize,
    /// How a law goes.
    LawShape,
    /// A gyro's mounting.
    Mounting,
    /// A gyro's bias, which every recording has its own of.
    Bias,
}

/// One parameter of an [`Information`].
#[derive(Debug, Clone, PartialEq)]
pub struct Informed {
    /// Name, as in results.
    pub name: String,
    /// Unit.
    pub unit: &'static str,
    /// The value for which the information holds; of a law, the typical one.
    pub value: f64,
    /// What an error of 1 is: the size of the value; of a gyro's bias and misalignment, what is known of it without a look.
    pub size: f64,
    /// What it is one of.
    pub about: About,
}

/// The parameters of the solver's unknowns in their order.
fn informed(problem: &Problem<'_>, robot: &Robot, point: &Point<'_>, laws: &[SizedLaw]) -> Vec<Informed> {
    let told = summary::values(problem, robot, point);
    let coordinates = problem.model.coordinates();
    let (base, gyros) = (coordinates.iter().count(), coordinates.results());
    let mountings = gyros + problem.border().bias(0, 0) - problem.border().dynamics;
    let of = |(name, unit, value): (String, &'static str, f64), size: f64, about: About| Informed {
        name,
        unit,
        value,
        size,
        about,
    };
    let mut parameters = Vec::new();
    for (i, result) in told.into_iter().enumerate() {
        if i == base {
            let sized = |c: &SizedCoordinate| Informed {
                name: c.name.clone(),
                unit: c.unit,
                value: c.typical,
                size: c.typical.abs(),
                about: if c.is_size { About::LawSize } else { About::LawShape },
            };
            parameters.extend(laws.iter().flat_map(|law| &law.coordinates).map(sized));
        }
        match i {
            i if i < base => {
                let size = if result.2 == 0.0 { 1.0 } else { result.2.abs() };
                parameters.push(of(result, size, About::Dynamics));
            }
            i if i < gyros => {}
            i if i < mountings => parameters.push(of(result, identify::MOUNTING_RAD, About::Mounting)),
            _ => parameters.push(of(result, identify::OFFSET_RAD_S, About::Bias)),
        }
    }
    parameters
}

/// Information of all parameters.
#[derive(Debug, Clone, PartialEq)]
pub struct Information {
    /// The parameters, in the order of the rows.
    pub parameters: Vec<Informed>,
    /// In units of the sizes.
    matrix: DMatrix<f64>,
    /// Σ v vᵀ of the hidden directions.
    hidden: DMatrix<f64>,
    /// What the rows were weighted by.
    pub noise: Noise,
}

impl Information {
    /// What `recording` tells of a robot whose parameters are `values`, one for each of [`Robot::parameters`], and of laws that it may have as well.
    ///
    /// # Errors
    /// As a calibration's own.
    pub fn of(
        robot: &Robot,
        (values, laws): (&[f64], &[SizedLaw]),
        recording: &Recording,
        weights: &Weights,
    ) -> Result<Self, CalibrateError> {
        accept(robot, &[recording], Preset::Default)?;
        let model = Model::extended(robot, laws.iter().map(|sized| sized.law.clone()).collect())?;
        let series = Series::of(robot, &[recording]);
        let assumptions = laws::assumptions(model.laws(), Preset::Default);
        let mut problem = Problem::new(&model, robot, &series, assumptions);
        let point = point_of(&model, robot, &series, values);
        let free = NoiseFree::of(&problem, &point);
        weights.weigh(&mut problem, robot, &free.point);
        let unknowns = problem.border().size();
        let solver = factor::reduced(&problem, &free.point, 1).map_err(CalibrateError::Solve)?.0;
        let slopes = observability::physical_slopes(&model, &point.z, problem.border());
        let inverse = slopes.try_inverse().unwrap_or_else(|| DMatrix::identity(unknowns, unknowns));

        let parameters = informed(&problem, robot, &point, laws);
        // A law's coordinates are its own: they have no slopes here.
        let moves = laws.iter().flat_map(|law| &law.coordinates).map(|coordinate| coordinate.moves);
        let base = model.coordinates().iter().count();
        let mut steps: Vec<f64> = parameters.iter().map(|parameter| parameter.size).collect();
        steps[base..].iter_mut().zip(moves).for_each(|(step, moves)| *step = moves);
        let by_size = DMatrix::from_fn(unknowns, unknowns, |i, j| inverse[(i, j)] * steps[j]);
        let mut matrix = by_size.transpose() * DMatrix::from_row_slice(unknowns, unknowns, &solver) * by_size;
        for stuck in identify::sticking(&problem, robot, &free.joints) {
            if let Some(i) = stuck.shares.iter().position(|share| *share == 1.0) {
                eliminate(&mut matrix, i);
            }
        }
        let mut hidden = DMatrix::zeros(unknowns, unknowns);
        let mut axes: Vec<DVector<f64>> = Vec::new();
        for held in observability::structural(&model, robot, problem.border()) {
            let mut axis = DVector::from_fn(unknowns, |i, _| held.direction[i] / steps[i]);
            for before in &axes {
                axis -= before * before.dot(&axis);
            }
            if axis.norm() > 1e-9 {
                axis.normalize_mut();
                hidden += &axis * axis.transpose();
                axes.push(axis);
            }
        }
        let free = DMatrix::identity(unknowns, unknowns) - &hidden;
        let matrix = &free * matrix * &free;
        let noise = problem.noise().clone();
        Ok(Self { parameters, matrix: 0.5 * (&matrix + matrix.transpose()), hidden, noise })
    }

    /// Of no motion at all, for the same parameters.
    #[must_use]
    pub fn nothing(&self) -> Self {
        Self { matrix: DMatrix::zeros(self.matrix.nrows(), self.matrix.ncols()), ..self.clone() }
    }

    /// What is left of it for other motions of the robot: gyros' biases are another recording's own, and each is eliminated.
    #[must_use]
    pub fn without_biases(mut self) -> Self {
        for i in 0..self.parameters.len() {
            if self.parameters[i].about == About::Bias {
                eliminate(&mut self.matrix, i);
            }
        }
        self
    }

    /// Whether the robot's build hides this parameter.
    pub fn is_hidden(&self, parameter: usize) -> bool {
        self.hidden[(parameter, parameter)] > 0.5
    }

    /// Adds `times` what another motion tells of the same robot.
    pub fn add(&mut self, other: &Self, times: f64) {
        self.matrix.zip_apply(&other.matrix, |sum, more| *sum += times * more);
    }

    /// Expected standard errors in units of the sizes, in the order of the parameters, beside a guess that is as good as the sizes. None where rounding left
    /// no positive definite matrix.
    pub fn errors(&self) -> Option<Vec<f64>> {
        let n = self.matrix.nrows();
        let with_guess = &self.matrix + &self.hidden * KNOWN + DMatrix::identity(n, n);
        let covariance = with_guess.cholesky()?.inverse();
        Some(covariance.diagonal().iter().map(|variance| variance.max(0.0).sqrt()).collect())
    }

    /// ln det of the covariance of the parameters that `counts` says, in units of their sizes, beside the same guess.
    pub fn log_volume(&self, counts: impl Fn(About) -> bool) -> Option<f64> {
        let n = self.matrix.nrows();
        let with_guess = &self.matrix + &self.hidden * KNOWN + DMatrix::identity(n, n);
        let covariance = with_guess.cholesky()?.inverse();
        let counted: Vec<usize> = (0..n).filter(|&i| counts(self.parameters[i].about)).collect();
        let block = DMatrix::from_fn(counted.len(), counted.len(), |i, j| covariance[(counted[i], counted[j])]);
        Some(2.0 * block.cholesky()?.l_dirty().diagonal().iter().map(|v| v.ln()).sum::<f64>())
    }
}

/// Takes from `matrix` what it tells of unknown `i`, and what it tells of the others by it.
fn eliminate(matrix: &mut DMatrix<f64>, i: usize) {
    let own = matrix[(i, i)];
    if own > 0.0 {
        let column = matrix.column(i).clone_owned();
        *matrix -= &column * column.transpose() / own;
    }
    matrix.row_mut(i).fill(0.0);
    matrix.column_mut(i).fill(0.0);
}

/// A first guess of all states for these values of the parameters.
pub(super) fn point_of<'m>(model: &'m Model, robot: &Robot, series: &Series, values: &[f64]) -> Point<'m> {
    let value = |symbol: Symbol, name: &str| {
        let is = |spec: &crate::robot::ParameterSpec| spec.symbol == symbol && spec.name == name;
        robot.parameters().iter().position(is).and_then(|i| values.get(i).copied())
    };
    let physical: Vec<f64> =
        model.coordinates().iter().map(|c| value(c.spec.symbol, &c.spec.name).unwrap_or(c.spec.value.start)).collect();
    let mut shared = start::shared(model, robot, series);
    // Laws stay at their starts.
    let base = model.coordinates().base_from_physical(&physical);
    shared.z[..base.len()].copy_from_slice(&base);
    for (gyro, (matrix, spec)) in shared.rotations.iter_mut().zip(robot.gyros()).enumerate() {
        let nominal = Matrix3::from_fn(|i, j| spec.rotation[i][j]);
        let delta = Vector3::from_fn(|axis, _| {
            let symbol = Symbol::Misalignment { gyro, axis };
            let found = robot.parameters().iter().position(|spec| spec.symbol == symbol);
            found.and_then(|i| values.get(i).copied()).unwrap_or(0.0)
        });
        *matrix = rotation::boxplus(&nominal, &delta);
    }
    start::with_states(model, series, shared)
}
