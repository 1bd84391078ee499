//! What a calibration on this recording will be able to say, before it is made: the information of noise-free predictions at the start
//! values of the parameters, as the calibration itself judges it at its end.

use crate::model::Model;
use crate::recording::check::{About, Check, Finding};
use crate::recording::{Recording, Severity};
use crate::robot::{InputUnit, Robot, Transmission};
use solve::border::Border;
use solve::levenberg::Settings;

use super::data::series::Series;
use super::error::CalibrateError;
use super::identifiability::identify;
use super::identifiability::observability;
use super::identifiability::observability::Unobservable;
use super::initial_guess::start;
use super::requirements::accept;
use super::residuals::preset::Preset;
use super::residuals::problem::Problem;
use super::result::summary;

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
    accept(robot, &[recording], Preset::Default)?;
    let model = Model::new(robot);
    let series = Series::of(robot, &[recording]);
    let problem = Problem::new(&model, robot, &series, Preset::Default.assumptions());
    let mut held = observability::structural(&model, robot, problem.border());
    let start = start::start(&model, robot, &series).point;
    let threads = Settings::default().threads;
    let judgement = identify::judge(&problem, robot, &start, &held, threads).map_err(CalibrateError::Solve)?;
    held.extend(judgement.weak);
    let silent = judgement.silent;
    let directions: Vec<_> = held.iter().map(|held| held.direction.clone()).collect();
    let border = Border::new(&judgement.information, &vec![0.0; problem.border().size()], &directions);
    let estimates = summary::estimates(robot, &problem, &start, &start, &border, (&held, &silent, &[]));
    let parameters = estimates
        .into_iter()
        .map(|p| Expected { name: p.name, unit: p.unit, start: p.initial, std_error: p.std_error })
        .collect();
    Ok(Foresight {
        parameters,
        unobservable: summary::unobservable(robot, &problem, &start, held.iter().chain(&silent)),
    })
}

/// A parameter whose expected standard error is a larger share of its start value than this is hardly shown by the motion.
const WORST_SHARE: f64 = 0.05;
/// A gyro's bias has no size of its own: an error of a tenth of a degree per second is what a look at the rest window gives.
const WORST_BIAS_RAD_S: f64 = 1e-3;
/// Nor has a gyro's rotation: a mounting by eye is good to some degrees, a calibration should be ten times better.
const WORST_TURN_RAD: f64 = 5e-3;

/// What shows the parameters that this robot has.
fn advice(robot: &Robot) -> String {
    let mut advice = "move the joint more: slow moves with reversals for mu".to_owned();
    if robot.joints.iter().any(|joint| joint.transmission == Transmission::Elastic) {
        advice += ", fast ones and a chirp for k_s and d_s";
    } else {
        advice += ", fast ones for inertia and viscous friction";
    }
    if robot.gyros().next().is_some() {
        advice += ", large angles of all joints for a gyro's rotation, rest before the motion for its bias";
    }
    if robot.input.unit == InputUnit::Duty {
        let name = Robot::builtin_names().find(|name| *name == robot.name).unwrap_or("ROBOT.toml");
        advice += &format!("; or let the motion be planned: host plan {name} -o planned.toml");
    }
    advice
}

/// Adds to a check what a calibration will not be able to tell.
pub fn look(recording: &Recording, check: &mut Check) {
    let mut add = |severity, message, advice: &str| {
        let (about, advice) = (About::Identifiability, advice.to_string());
        check.add(Finding { severity, about, channel: None, message, advice });
    };
    let foresight = match foresee(&recording.robot, recording) {
        Ok(foresight) => foresight,
        Err(error) => return add(Severity::Error, error.to_string(), "see the other findings, and the robot file"),
    };
    for unobservable in foresight.unobservable {
        let names: Vec<_> = unobservable.direction.into_iter().map(|(name, _)| name).collect();
        let message = format!("{} will be given no number: {}", names.join(", "), unobservable.reason);
        add(Severity::Note, message, "nothing to do unless you need it; it is held at its nominal value");
    }
    for p in foresight.parameters {
        let Some(error) = p.std_error else { continue };
        let worst = match p.unit.as_str() {
            "rad" => WORST_TURN_RAD,
            "rad/s" => WORST_BIAS_RAD_S,
            _ => WORST_SHARE * p.start.abs(),
        };
        if error > worst {
            let message = format!("{} is hardly shown: expected ± {error:.2e} {} at {:.4}", p.name, p.unit, p.start);
            add(Severity::Warning, message, &advice(&recording.robot));
        }
    }
}
