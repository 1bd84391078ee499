//! What the robot may be: parameters drawn from what is known of it.
//!
//! Before a calibration that is the description: the start value of a parameter of the dynamics may be off by a factor of two either
//! way. After one it is the estimates and their covariance; what the calibration gave no number is drawn within ± 30 %. The noise of the
//! model's steps, which decides what errors a motion leaves, is that of the calibration; before one it is open as well.

use nalgebra::{DMatrix, DVector};
use rand::{Rng, RngExt};
use rand_distr::{Distribution, StandardNormal};

use super::PlanError;
use crate::calibrate::information::Weights;
use crate::calibrate::{CalibrateError, Calibration};
use crate::recording::Recording;
use crate::robot::{ParameterSpec, Robot, Symbol};
use crate::simulate::Truth;

/// A start value is off by so much at most: on Doggy, the motor's back-EMF constant is.
const START_OFF: f64 = 2.0;
/// What a calibration could not tell is off by this part of its value at most.
const UNTOLD_OFF: f64 = 0.3;
/// A drawn value keeps at least this part of the likeliest one, where physics leaves no other sign.
const LEAST_PART: f64 = 0.2;
/// Standard deviation of a gyro's misalignment about each axis before a calibration, rad: 2°.
const MOUNTING_RAD: f64 = 0.035;

/// What is known of a robot.
#[derive(Debug, Clone)]
pub struct Belief {
    /// The description.
    pub robot: Robot,
    /// Recordings of it, to which the motion is to add.
    pub(super) known: Vec<Recording>,
    /// The likeliest values, in the order of [`Robot::parameters`].
    likely: Vec<f64>,
    spread: Spread,
}

#[derive(Debug, Clone)]
enum Spread {
    Description,
    /// Places of the parameters among the robot's, and a root of their covariance.
    Calibrated {
        places: Vec<usize>,
        root: DMatrix<f64>,
        weights: Weights,
    },
}

impl Belief {
    /// What a description says.
    pub fn of_description(robot: Robot) -> Self {
        let likely = robot.parameters().iter().map(|spec| spec.value.start).collect();
        Self { robot, known: Vec::new(), likely, spread: Spread::Description }
    }

    /// What a calibration of this robot says.
    pub fn of_calibration(robot: Robot, calibration: &Calibration) -> Self {
        let specs = robot.parameters();
        let place = |name: &str| specs.iter().position(|spec| spec.name == name);
        let mut likely: Vec<f64> = specs.iter().map(|spec| spec.value.start).collect();
        for told in &calibration.parameters {
            if let Some(place) = place(&told.name) {
                likely[place] = told.estimate;
            }
        }
        let told = &calibration.covariance;
        let rows: Vec<(usize, usize)> =
            told.parameters.iter().enumerate().filter_map(|(i, name)| Some((i, place(name)?))).collect();
        let covariance = DMatrix::from_fn(rows.len(), rows.len(), |i, j| told.matrix[rows[i].0][rows[j].0]);
        let eigen = (0.5 * (&covariance + covariance.transpose())).symmetric_eigen();
        let sizes = eigen.eigenvalues.map(|value| value.max(0.0).sqrt());
        let root = eigen.eigenvectors * DMatrix::from_diagonal(&sizes);
        let places = rows.into_iter().map(|(_, place)| place).collect();
        let weights = Weights::of(&robot, calibration);
        Self { robot, known: Vec::new(), likely, spread: Spread::Calibrated { places, root, weights } }
    }

    /// The same, with a recording of the robot, to which a motion is to add.
    ///
    /// # Errors
    /// [`PlanError::Calibrate`] of a recording of another robot.
    pub fn after(mut self, recording: Recording) -> Result<Self, PlanError> {
        if recording.robot.name != self.robot.name {
            let (path, robot) = (recording.source.path.display().to_string(), recording.robot.name);
            let expected = self.robot.name;
            return Err(CalibrateError::DifferentRobot { path, robot, expected }.into());
        }
        self.known.push(recording);
        Ok(self)
    }

    /// Whether a calibration stands behind it.
    pub fn is_calibrated(&self) -> bool {
        matches!(self.spread, Spread::Calibrated { .. })
    }

    /// The noise of the n-th robot, counted from 0: as the calibration found it. Before one it is the preset's on every other robot, and on the
    /// others none but the sensors' and the integrator's.
    pub fn weights(&self, nth: usize) -> Weights {
        match &self.spread {
            Spread::Calibrated { weights, .. } => weights.clone(),
            Spread::Description if nth.is_multiple_of(2) => Weights::Assumed,
            Spread::Description => Weights::EXACT,
        }
    }

    /// The likeliest robot.
    pub fn likely(&self) -> Truth {
        Truth::of(self.likely.clone())
    }

    /// A robot that it may be.
    pub fn draw(&self, rng: &mut impl Rng) -> Truth {
        let mut values = self.likely.clone();
        let specs = self.robot.parameters();
        match &self.spread {
            Spread::Description => {
                for (spec, value) in specs.iter().zip(&mut values) {
                    let factor = START_OFF.powf(rng.random_range(-1.0..1.0));
                    let turn: f64 = StandardNormal.sample(rng);
                    match spec.symbol {
                        _ if !is_open(&self.robot, spec) => {}
                        Symbol::Misalignment { .. } => *value += MOUNTING_RAD * turn,
                        _ => *value *= factor,
                    }
                }
            }
            Spread::Calibrated { places, root, .. } => {
                for (place, (spec, value)) in specs.iter().zip(&mut values).enumerate() {
                    let factor = 1.0 + rng.random_range(-UNTOLD_OFF..UNTOLD_OFF);
                    if is_open(&self.robot, spec) && !places.contains(&place) {
                        *value *= factor;
                    }
                }
                let unit: DVector<f64> = DVector::from_fn(places.len(), |_, _| StandardNormal.sample(rng));
                for (place, shift) in places.iter().zip((root * unit).iter()) {
                    let least = LEAST_PART * values[*place];
                    values[*place] += shift;
                    if !has_either_sign(specs[*place].symbol) {
                        values[*place] = values[*place].max(least);
                    }
                }
            }
        }
        Truth::of(values)
    }
}

/// Whether its value is open: a free parameter of the dynamics, or a free mounting of a gyro.
fn is_open(robot: &Robot, spec: &ParameterSpec) -> bool {
    match spec.symbol {
        Symbol::Misalignment { gyro, .. } => robot.gyros().nth(gyro).is_some_and(|gyro| gyro.rotation_free),
        Symbol::Bias { .. } | Symbol::Lag { .. } => false,
        _ => spec.value.free,
    }
}

fn has_either_sign(symbol: Symbol) -> bool {
    symbol.has_either_sign() || matches!(symbol, Symbol::Bias { .. } | Symbol::Misalignment { .. })
}
