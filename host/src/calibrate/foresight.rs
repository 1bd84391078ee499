//! What a calibration on this recording will be able to say, before it is made: the information of its rows at a first guess of
//! the states and at the start values of the parameters.
//!
//! One elimination of the states gives the information matrix of the shared unknowns there. The guess follows the sensors, so a little of their
//! noise is taken for motion; what a motion leaves unmoved still stands out by orders of magnitude.

use crate::calibrate::observability::{self, Held};
use crate::model::Model;
use crate::recording::Recording;
use crate::robot::Robot;
use crate::solve::border::Border;
use crate::solve::factor::{Factor, SolveError};

use super::{CalibrateError, Preset, Problem, Series, Unobservable, WEAK_INFORMATION, check, start, summary};

/// What a calibration can be expected to say.
#[derive(Debug, Clone, PartialEq)]
pub struct Foresight {
    /// Every free parameter that the robot's build lets the sensors see.
    pub parameters: Vec<Expected>,
    /// What neither this nor any motion can show, or what this motion leaves entirely open.
    pub unobservable: Vec<Unobservable>,
}

/// The expected precision of one parameter.
#[derive(Debug, Clone, PartialEq)]
pub struct Expected {
    /// Name, as in results.
    pub name: String,
    /// Unit.
    pub unit: String,
    /// Its start value.
    pub start: f64,
    /// Expected standard error, if the parameter is as its start value says; none where it is not determined.
    pub std_error: Option<f64>,
}

/// Foresees the calibration of `recording` with the preset `default`.
///
/// # Errors
/// As a calibration's own.
pub fn foresee(robot: &Robot, recording: &Recording) -> Result<Foresight, CalibrateError> {
    check(robot, &[recording], Preset::Default)?;
    let model = Model::new(robot);
    let series = Series::of(&[recording]);
    let problem = Problem::new(&model, robot, &series, Preset::Default.assumptions());
    let mut held = observability::structural(&model, robot, problem.border());
    let start = start::start(&model, robot, &series);
    let mut factor = Factor::new(&problem).map_err(CalibrateError::Solve)?;
    let threads = crate::solve::levenberg::Settings::default().threads;
    factor.factorise(&problem, &start, 0.0, threads).map_err(SolveError::from)?;
    let (information, gradient) = factor.schur();
    let directions: Vec<_> = held.iter().map(|held| held.direction.clone()).collect();
    let mut border = Border::new(&information, &gradient, &directions);
    for weak in border.weak_directions(WEAK_INFORMATION) {
        let direction = border.in_own_units(&weak);
        border.hold(&direction);
        held.push(Held { direction, reason: "this motion does not show it".to_string() });
    }
    let estimates = summary::estimates(robot, &problem, &start, &start, &border, &held);
    let parameters = estimates
        .into_iter()
        .map(|p| Expected { name: p.name, unit: p.unit, start: p.initial, std_error: p.std_error })
        .collect();
    Ok(Foresight { parameters, unobservable: summary::unobservable(robot, &problem, &start, &held) })
}
