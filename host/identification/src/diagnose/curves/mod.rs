//! Curves without a shape: what a motion shows of a cause, whatever its name. They are the ceiling of what a law can explain, and the picture of the defect.
//!
//! ```text
//! places: torque rows × arguments, ripples of a turn, sensor rows × arguments ─▶ columns beside the current model ─▶ block scores, shrunk
//! ```
//! Curves are linear in their coefficients, so that the scan's tangent is their fit.

mod sensor;
mod shapeless;
mod spline;
mod waves;

pub use shapeless::{Argument, Curve, Shape};

use std::f64::consts::TAU;
use std::sync::Arc;

use sensor::SensorCurve;
use shapeless::Shapeless;
use spline::Knots;
use waves::Waves;

use super::criteria::{COVERED, LEVEL};
use super::scores::block_scores::{LawScore, block_scores, score_laws, score_left_beside};
use super::scores::significance::p_of_family;
use crate::calibrate::{Bench, BlockScores, CalibrateError, JointState, Trial};
use crate::effect::Row;
use crate::model::law::{Hook, Law, Of};
use crate::robot::{ChannelKind, Side};

/// Waves a turn that are looked for.
const WAVES: u8 = 16;
/// Less than this of a turn shows no ripple.
const LEAST_TURN: f64 = 0.5;

/// What a curve is added to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Target {
    /// A torque.
    Torque(Hook),
    /// What a position sensor on this side reads.
    Position(Side),
    /// What gyros read, axis by axis.
    Gyro,
}

/// A place for a curve: what it is added to, and what it is a function of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Place {
    /// Quantity.
    pub target: Target,
    /// Argument.
    pub argument: Argument,
}

const fn torque(hook: Hook, argument: Argument) -> Place {
    Place { target: Target::Torque(hook), argument }
}

const fn position(side: Side, argument: Argument) -> Place {
    Place { target: Target::Position(side), argument }
}

/// Where smooth curves are tried.
const PLACES: [Place; 15] = [
    torque(Hook::Friction, Argument::MotorSpeed),
    torque(Hook::Friction, Argument::MotorAngle),
    torque(Hook::Friction, Argument::Time),
    torque(Hook::Friction, Argument::Windup),
    torque(Hook::MotorTorque, Argument::DrivingTorque),
    torque(Hook::Transmission, Argument::Windup),
    torque(Hook::Transmission, Argument::WindupRate),
    torque(Hook::LinkLoad, Argument::LinkAngle),
    torque(Hook::LinkLoad, Argument::LinkSpeed),
    position(Side::Motor, Argument::MotorAngle),
    position(Side::Motor, Argument::MotorSpeed),
    position(Side::Link, Argument::LinkAngle),
    position(Side::Link, Argument::LinkSpeed),
    Place { target: Target::Gyro, argument: Argument::Rate },
    Place { target: Target::Gyro, argument: Argument::Time },
];

/// Where ripples are.
const TURN: Place = torque(Hook::MotorTorque, Argument::MotorPhase);

impl Place {
    /// Which equation.
    pub fn row(self) -> Row {
        match (self.target, self.argument) {
            (Target::Torque(Hook::Transmission | Hook::LinkLoad), _) => Row::Link,
            (Target::Torque(_), _) => Row::Motor,
            // A reading that follows the speed is one of another time.
            (Target::Position(_), Argument::MotorSpeed | Argument::LinkSpeed) => Row::Timing,
            _ => Row::Sensor,
        }
    }
}

/// Curves of one kind at all joints (or gyros), as the motion shows them on top of a model.
#[derive(Debug, Clone)]
pub struct Curves {
    /// Where.
    pub place: Place,
    /// What they do, by their coefficients.
    pub law: Arc<dyn Law>,
    /// What the blocks say of them.
    pub score: LawScore,
    /// p of the best of all places.
    pub p_family: f64,
    /// Of every joint that has one: joint, curve and coefficients.
    pub of_joints: Vec<(usize, Curve, Vec<f64>)>,
    /// Σ r² that each joint's curve alone would save out of sample, by the size of what it adds.
    pub size_of: Vec<(Option<usize>, f64)>,
}

impl Curves {
    /// Σ r² saved out of sample.
    pub fn gain(&self) -> f64 {
        self.score.gain()
    }
}

/// The curves of one place at all joints that have one, as a law.
struct Tried {
    place: Place,
    law: Arc<dyn Law>,
    curves: Vec<Option<Curve>>,
}

/// What curves show on top of a model, and which of them do what a law does.
pub struct Ceiling {
    /// Best first.
    pub curves: Vec<Curves>,
    /// Of so many.
    pub places: usize,
    scores: BlockScores,
    laws: Vec<Option<LawScore>>,
}

impl Ceiling {
    /// Of one rule for all: a curve that loses out of sample is not in the list. `laws` are what curves are compared with.
    ///
    /// # Errors
    /// A trial that cannot be factorised.
    pub fn of(
        bench: &Bench<'_>,
        current: &Trial,
        contiguous: &[bool],
        laws: &[Arc<dyn Law>],
    ) -> Result<Self, CalibrateError> {
        let tried = tried(bench, current);
        let count = tried.len();
        let all: Vec<Arc<dyn Law>> = laws.iter().chain(tried.iter().map(|tried| &tried.law)).cloned().collect();
        let scores = block_scores(bench, current, (&all, laws.len()))?;
        let mut of_all = score_laws(&scores, contiguous, true).into_iter().map(|score| score.ok().flatten());
        let laws = of_all.by_ref().take(laws.len()).collect();
        let mut curves: Vec<Curves> = tried
            .into_iter()
            .zip(of_all)
            .filter_map(|(tried, score)| Some(tried.shown(score?, count)))
            .filter(|curves| curves.gain() > 0.0)
            .collect();
        curves.sort_by(|a, b| b.gain().total_cmp(&a.gain()));
        for curve in curves.iter().take(6) {
            tracing::debug!(place = ?curve.place, gain = curve.gain(), p = curve.p_family, "curve");
        }
        Ok(Ceiling { curves, places: count, scores, laws })
    }

    /// The best of the curves that do what the law does: beside them less than half of its score is left.
    pub fn like(&self, law: usize) -> Option<&Curves> {
        let own = self.laws.get(law).and_then(Option::as_ref)?;
        self.curves.iter().find(|curves| score_left_beside(&self.scores, own, &curves.score) < COVERED)
    }

    /// What the tangent of the best curve gains that is there for sure, and on the law's row or like the law.
    pub fn over(&self, law: usize, row: Row) -> f64 {
        let own = self.laws.get(law).and_then(Option::as_ref);
        let stands = |curves: &&Curves| {
            let left = |own: &LawScore| score_left_beside(&self.scores, own, &curves.score);
            curves.place.row() == row || own.is_some_and(|own| left(own) < COVERED)
        };
        self.curves.iter().filter(|curves| curves.p_family < LEVEL).find(stands).map_or(0.0, Curves::gain)
    }
}

/// The curves of all places.
fn tried(bench: &Bench<'_>, current: &Trial) -> Vec<Tried> {
    let joints = bench.series().joints();
    let mut tried: Vec<Tried> = PLACES.into_iter().filter_map(|place| smooth(place, bench, current)).collect();
    let turns: Vec<[f64; 2]> = (0..joints).map(|joint| range(bench, current, joint, TURN.argument)).collect();
    for wave in 1..=WAVES {
        let curve = |joint: usize| {
            let gear = bench.robot().joints[joint].gear;
            let shows = turns[joint][1] - turns[joint][0] > LEAST_TURN * TAU;
            shows.then(|| Curve { argument: TURN.argument, gear, shape: Shape::Ripple(Waves(vec![wave])) })
        };
        let curves: Vec<Option<Curve>> = (0..joints).map(curve).collect();
        if curves.iter().any(Option::is_some) {
            let law = Arc::new(Shapeless::new(Hook::MotorTorque, curves.clone()));
            tried.push(Tried { place: TURN, law, curves });
        }
    }
    tried
}

impl Tried {
    /// With what the blocks say, of so many places.
    fn shown(self, score: LawScore, count: usize) -> Curves {
        let Tried { place, law, curves } = self;
        let coefficients = |joint: usize| -> Vec<f64> {
            law.parameters().of(|of| of == Of::Joint(joint)).into_iter().map(|i| score.step[i]).collect()
        };
        let of_joints: Vec<(usize, Curve, Vec<f64>)> = curves
            .into_iter()
            .enumerate()
            .filter_map(|(joint, curve)| Some((joint, curve?, coefficients(joint))))
            .collect();
        let p_family = p_of_family(score.p, count);
        let size_of = sizes(&*law, &score);
        Curves { place, law, score, p_family, of_joints, size_of }
    }
}

/// How much each joint has of a law's score: by the share of its coordinates in the step, in units of their own errors.
fn sizes(law: &dyn Law, score: &LawScore) -> Vec<(Option<usize>, f64)> {
    let coordinates = &law.parameters().coordinates;
    let mut sizes: Vec<(Option<usize>, f64)> = Vec::new();
    for (coordinate, z) in coordinates.iter().zip(&score.z) {
        let joint = if let Of::Joint(joint) = coordinate.of { Some(joint) } else { None };
        match sizes.iter_mut().find(|(of, _)| *of == joint) {
            Some((_, size)) => *size += z * z,
            None => sizes.push((joint, z * z)),
        }
    }
    let all: f64 = sizes.iter().map(|(_, size)| size).sum();
    sizes.iter_mut().for_each(|(_, size)| *size /= all.max(f64::MIN_POSITIVE));
    sizes
}

/// A smooth curve for each joint whose argument changes, as a law.
fn smooth(place: Place, bench: &Bench<'_>, trial: &Trial) -> Option<Tried> {
    let robot = bench.robot();
    let over = |[low, high]: [f64; 2]| (high - low > 1e-9).then(|| Knots::over([low, high], place.argument.bends()));
    let curve = |joint: usize| {
        let knots = over(range(bench, trial, joint, place.argument))?;
        Some(Curve { argument: place.argument, gear: robot.joints[joint].gear, shape: Shape::Spline(knots) })
    };
    let joints = bench.series().joints();
    match place.target {
        Target::Torque(hook) => {
            // Of a rigid joint the link is the motor, and nothing winds.
            let is_another = |joint: usize| {
                let on_motor = matches!(hook, Hook::Friction | Hook::MotorTorque);
                let winds = matches!(place.argument, Argument::Windup | Argument::WindupRate);
                trial.is_elastic(joint) || on_motor && !winds
            };
            let curves: Vec<Option<Curve>> =
                (0..joints).map(|joint| curve(joint).filter(|_| is_another(joint))).collect();
            curves.iter().any(Option::is_some).then(|| {
                let law = Arc::new(Shapeless::new(hook, curves.clone()));
                Tried { place, law, curves }
            })
        }
        Target::Position(side) => {
            let has = |joint: usize| {
                robot.channels().iter().any(|channel| match channel.kind {
                    ChannelKind::MotorPosition { joint: j } => side == Side::Motor && j == joint,
                    ChannelKind::LinkPosition { joint: j } => side == Side::Link && j == joint,
                    _ => false,
                })
            };
            let curves: Vec<Option<Curve>> = (0..joints).map(|joint| curve(joint).filter(|_| has(joint))).collect();
            curves.iter().any(Option::is_some).then(|| {
                let law = Arc::new(SensorCurve::of_positions(side, place.argument, curves.clone()));
                Tried { place, law, curves }
            })
        }
        Target::Gyro => {
            let mut axes: Vec<((usize, usize), Knots)> = Vec::new();
            for (channel, spec) in bench.series().channels.iter().enumerate() {
                let ChannelKind::GyroAxis { gyro, axis, .. } = spec.kind else { continue };
                let values = match place.argument {
                    Argument::Time => (0..bench.series().stages()).map(|k| bench.series().time_s(k)).collect(),
                    _ => (0..bench.series().stages()).map(|k| bench.series().measured(k)[channel]).collect(),
                };
                axes.extend(over(within(values)).map(|knots| ((gyro, axis), knots)));
            }
            let law = (!axes.is_empty()).then(|| SensorCurve::of_gyros(place.argument, axes))?;
            Some(Tried { place, law: Arc::new(law), curves: vec![None; joints] })
        }
    }
}

/// The least and the largest value, but for a thousandth at either end.
fn within(mut values: Vec<f64>) -> [f64; 2] {
    values.retain(|value| value.is_finite());
    values.sort_by(f64::total_cmp);
    let at = |share: f64| values.get(((values.len().max(1) - 1) as f64 * share) as usize).copied().unwrap_or(0.0);
    [at(0.001), at(0.999)]
}

/// What an argument covers at a joint along the states of a trial.
fn range(bench: &Bench<'_>, trial: &Trial, joint: usize, argument: Argument) -> [f64; 2] {
    within((0..bench.series().stages()).map(|k| argument_of(bench, trial, k, joint, argument)).collect())
}

/// The argument at stage k along the states of a trial.
fn argument_of(bench: &Bench<'_>, trial: &Trial, k: usize, joint: usize, argument: Argument) -> f64 {
    let JointState { q, qd, theta, thetad } = trial.joint(k, joint);
    match argument {
        Argument::MotorSpeed => thetad,
        Argument::MotorAngle => theta,
        Argument::MotorPhase => theta * bench.robot().joints[joint].gear,
        Argument::LinkSpeed => qd,
        Argument::LinkAngle => q,
        Argument::Windup => q - theta,
        Argument::WindupRate => qd - thetad,
        Argument::DrivingTorque => bench.driving_torque(trial, k, joint),
        Argument::Time => bench.series().time_s(k),
        Argument::Rate => f64::NAN,
    }
}
