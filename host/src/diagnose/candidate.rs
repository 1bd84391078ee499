//! What is tried in the place of what is missing: laws of the catalogue, and curves without a shape.

use std::sync::Arc;

use super::shapeless::{self, Argument, Knots, Shapeless};
use crate::calibrate::{Bench, JointState, Trial};
use crate::effect::{CATALOGUE, Effect, Row};
use crate::model::law::{Clues, Hook, Law};
use crate::robot::Robot;

/// An effect of the catalogue that this robot could have.
#[derive(Debug, Clone)]
pub struct Candidate {
    /// Which.
    pub effect: &'static Effect,
    /// Its law from several starts or in several shapes.
    pub alternatives: Vec<Arc<dyn Law>>,
}

impl Candidate {
    /// With the first of its alternatives only.
    pub fn first(&self, alternatives: usize) -> Self {
        let alternatives = self.alternatives.iter().take(alternatives).cloned().collect();
        Candidate { effect: self.effect, alternatives }
    }

    /// Its law from what the recording shows of events and contacts.
    pub fn starts(&self, clues: &Clues) -> Vec<Arc<dyn Law>> {
        self.alternatives.first().filter(|law| law.is_event()).map_or_else(Vec::new, |law| law.starts(clues))
    }
}

/// The catalogue for `robot` but for the ids in `without`; and what cannot be tested, with the reason.
pub fn catalogue(robot: &Robot, without: &[String]) -> (Vec<Candidate>, Vec<(&'static str, String)>) {
    let (mut candidates, mut others) = (Vec::new(), Vec::new());
    for effect in CATALOGUE.into_iter().filter(|effect| !without.iter().any(|id| id == effect.id)) {
        match effect.laws(robot) {
            Ok(alternatives) => candidates.push(Candidate { effect, alternatives }),
            Err(error) => others.push((effect.id, error.to_string())),
        }
    }
    (candidates, others)
}

/// A place for a curve: which quantity it is added to, and what it is a function of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Place {
    /// Quantity.
    pub hook: Hook,
    /// Argument.
    pub argument: Argument,
}

/// Where curves are tried.
pub const PLACES: [Place; 9] = [
    Place { hook: Hook::Friction, argument: Argument::MotorSpeed },
    Place { hook: Hook::Friction, argument: Argument::MotorAngle },
    Place { hook: Hook::Friction, argument: Argument::Time },
    Place { hook: Hook::Friction, argument: Argument::Windup },
    Place { hook: Hook::MotorTorque, argument: Argument::DrivingTorque },
    Place { hook: Hook::Transmission, argument: Argument::Windup },
    Place { hook: Hook::Transmission, argument: Argument::WindupRate },
    Place { hook: Hook::LinkLoad, argument: Argument::LinkAngle },
    Place { hook: Hook::LinkLoad, argument: Argument::LinkSpeed },
];

impl Place {
    /// Which equation.
    pub fn row(self) -> Row {
        match self.hook {
            Hook::Transmission | Hook::LinkLoad => Row::Link,
            _ => Row::Motor,
        }
    }

    /// Curves of all joints over what the states of `trial` cover.
    pub fn curves(self, bench: &Bench<'_>, trial: &Trial) -> Curves {
        let joints = bench.series().joints();
        let knots: Vec<Option<Knots>> = (0..joints)
            .map(|joint| {
                let range = range(bench, trial, joint, self.argument);
                (range[1] - range[0] > 1e-9).then(|| Knots::over(self.argument, range))
            })
            .collect();
        let law = Arc::new(Shapeless::new(self.hook, knots.clone()));
        Curves { place: self, knots, law }
    }
}

/// One curve a joint, of the same kind.
#[derive(Debug, Clone)]
pub struct Curves {
    /// Where.
    pub place: Place,
    /// Of every joint; none where its argument never changes.
    pub knots: Vec<Option<Knots>>,
    /// The law.
    pub law: Arc<dyn Law>,
}

impl Curves {
    /// The coefficients of a joint in a trial that has these curves.
    pub fn coefficients(&self, trial: &Trial, joint: usize) -> Option<Vec<f64>> {
        let name = |i: usize| format!("{}.c{i}[{}]", shapeless::ID, joint + 1);
        (0..shapeless::COEFFICIENTS).map(|i| trial.value(&name(i)).map(|value| value.estimate)).collect()
    }
}

/// The least and the largest value of an argument, but for a thousandth at either end.
fn range(bench: &Bench<'_>, trial: &Trial, joint: usize, argument: Argument) -> [f64; 2] {
    let series = bench.series();
    let mut values: Vec<f64> = (0..series.stages()).map(|k| argument_of(bench, trial, k, joint, argument)).collect();
    values.sort_by(f64::total_cmp);
    let at = |share: f64| values.get(((values.len().max(1) - 1) as f64 * share) as usize).copied().unwrap_or(0.0);
    [at(0.001), at(0.999)]
}

/// The argument at stage k along the states of a trial.
fn argument_of(bench: &Bench<'_>, trial: &Trial, k: usize, joint: usize, argument: Argument) -> f64 {
    let JointState { q, qd, theta, thetad } = trial.joint(k, joint);
    match argument {
        Argument::MotorSpeed => thetad,
        Argument::MotorAngle => theta,
        Argument::LinkSpeed => qd,
        Argument::LinkAngle => q,
        Argument::Windup => q - theta,
        Argument::WindupRate => qd - thetad,
        Argument::DrivingTorque => bench.driving_torque(trial, k, joint),
        Argument::Time => bench.series().time_s(k),
    }
}
