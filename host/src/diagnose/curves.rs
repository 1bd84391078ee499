//! Where curves without a shape are tried, and which of them explain most: the rivals of every name.
//!
//! ```text
//! places ─▶ scan of few samples, smooth curves and single waves ─▶ the best waves become one ripple ─▶ refit of the best on few ─▶ and on all
//! ```

use std::f64::consts::TAU;
use std::sync::Arc;

use super::found::CurveFit;
use super::refit::NEAR;
use super::scan::{Scan, Score};
use super::shapeless::{self, Argument, Curve, Shape, Shapeless};
use super::significance::p_of_score;
use super::spline::Knots;
use super::waves::Waves;
use crate::calibrate::{Bench, CalibrateError, JointState, Trial};
use crate::effect::Row;
use crate::model::law::{Hook, Law};

/// Curves are linear in their coefficients.
const ITERATIONS: usize = 3;
/// Curves that are refitted.
pub const REFITTED: usize = 2;
/// Most waves a turn that are looked for, and how many of them make a ripple.
const MOST_WAVES: u8 = 16;
const RIPPLE: usize = 4;
/// Less than this of a turn shows no ripple.
const LEAST_TURN: f64 = 0.5;

/// A place for a curve: which quantity it is added to, and what it is a function of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Place {
    /// Quantity.
    pub hook: Hook,
    /// Argument.
    pub argument: Argument,
}

/// Where smooth curves are tried.
const PLACES: [Place; 9] = [
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

/// Where ripples are.
const TURN: Place = Place { hook: Hook::MotorTorque, argument: Argument::MotorPhase };

impl Place {
    /// Which equation.
    pub fn row(self) -> Row {
        match self.hook {
            Hook::Transmission | Hook::LinkLoad => Row::Link,
            _ => Row::Motor,
        }
    }

    /// Curves of all joints over `ranges` of the argument; of these waves, where the place is a turn.
    fn curves(self, waves: &[u8], ranges: &[[f64; 2]], bench: &Bench<'_>) -> Curves {
        let argument = self.argument;
        let curve = |(joint, range): (usize, &[f64; 2])| {
            let covered = range[1] - range[0];
            let shape = match argument {
                Argument::MotorPhase => (covered > LEAST_TURN * TAU).then(|| Shape::Ripple(Waves(waves.to_vec()))),
                _ => (covered > 1e-9).then(|| Shape::Spline(Knots::over(*range, argument.bends()))),
            };
            let gear = bench.robot().joints[joint].gear;
            shape.map(|shape| Curve { argument, gear, shape })
        };
        let of_joints: Vec<Option<Curve>> = ranges.iter().enumerate().map(curve).collect();
        let law = Arc::new(Shapeless::new(self.hook, of_joints.clone()));
        Curves { place: self, of_joints, law }
    }

    /// What the states of `trial` cover at every joint.
    fn ranges(self, bench: &Bench<'_>, trial: &Trial) -> Vec<[f64; 2]> {
        (0..bench.series().joints()).map(|joint| range(bench, trial, joint, self.argument)).collect()
    }
}

/// One curve a joint, of the same kind.
#[derive(Debug, Clone)]
pub struct Curves {
    /// Where.
    pub place: Place,
    /// Of every joint; none where its argument never changes.
    pub of_joints: Vec<Option<Curve>>,
    /// The law.
    pub law: Arc<dyn Law>,
}

impl Curves {
    fn freedom(&self) -> usize {
        self.law.parameters().coordinates.len()
    }

    /// A joint's curve with its coefficients in a trial that has these curves.
    pub fn fitted(&self, trial: &Trial, joint: usize) -> Option<(&Curve, Vec<f64>)> {
        let curve = self.of_joints[joint].as_ref()?;
        let name = |i: usize| format!("{}.c{i}[{}]", shapeless::ID, joint + 1);
        let values = (0..curve.coefficients()).map(|i| trial.value(&name(i)).map(|value| value.estimate));
        Some((curve, values.collect::<Option<_>>()?))
    }
}

/// What the scan says of curves somewhere.
struct Sought {
    place: Place,
    waves: Vec<u8>,
    /// Twice the log-likelihood that they would gain.
    score: f64,
    /// By how many coefficients.
    freedom: usize,
    /// And from how many these were chosen.
    chosen_from: usize,
}

impl Sought {
    fn worth(&self) -> f64 {
        self.score - 2.0 * self.freedom as f64
    }
}

/// The best curves on top of `current`, best first: places by a scan of few samples, refitted there, and what is not beaten clearly on the samples
/// that decide, `most` of them.
///
/// # Errors
/// As a calibration's, of the scan.
pub fn best_curves(
    few: &Bench<'_>,
    on_few: &Trial,
    (bench, current): (&Bench<'_>, &Trial),
    most: usize,
) -> Result<Vec<CurveFit>, CalibrateError> {
    let of_place = |place: Place| place.curves(&[], &place.ranges(few, on_few), few).law;
    let turns = TURN.ranges(few, on_few);
    let of_wave = |wave: u8| TURN.curves(&[wave], &turns, few).law;
    let laws: Vec<Arc<dyn Law>> = PLACES.into_iter().map(of_place).chain((1..=MOST_WAVES).map(of_wave)).collect();
    let scan = Scan::of(&few.scores(on_few, &laws)?, on_few.inflation);
    let (of_places, of_waves) = scan.scores.split_at(PLACES.len());
    let mut sought: Vec<Sought> =
        PLACES.into_iter().zip(of_places).filter_map(|(place, score)| Some(smooth(place, score.as_ref()?))).collect();
    sought.extend(ripple(of_waves));
    sought.sort_by(|a, b| b.worth().total_cmp(&a.worth()));
    let gained = |(trial, current): (&Trial, &Trial)| 2.0 * (current.cost - trial.cost);
    let of_few = |sought: Sought| {
        let curves = sought.place.curves(&sought.waves, &sought.place.ranges(few, on_few), few);
        let trial =
            few.fit(&on_top(on_few, &curves), on_few, ITERATIONS).ok().filter(|trial| trial.cost.is_finite())?;
        Some((sought, gained((&trial, on_few)) - 2.0 * curves.freedom() as f64))
    };
    let mut tried: Vec<_> = sought.into_iter().take(REFITTED).filter_map(of_few).collect();
    tried.sort_by(|(_, a), (_, b)| b.total_cmp(a));
    // The best is refitted whatever its score: few samples may not hold what it explains.
    let best = tried.first().map_or(f64::NEG_INFINITY, |(_, score)| *score);
    let is_near = |score: f64| score >= NEAR.0 * best || score >= best - NEAR.1;
    let fit = |(sought, _): (Sought, f64)| {
        let curves = sought.place.curves(&sought.waves, &sought.place.ranges(bench, current), bench);
        // From the current model, not from few samples: their values may be far from what the states of all of these suit.
        let laws = on_top(current, &curves);
        let trial = bench.fit(&laws, current, ITERATIONS).ok().filter(|trial| trial.cost.is_finite())?;
        let (gained, freedom) = (gained((&trial, current)), curves.freedom());
        let p = p_of_score(gained / current.inflation, freedom.max(sought.chosen_from));
        Some(CurveFit { curves, trial, score: gained - 2.0 * freedom as f64, p_family: scan.p_of_family(p) })
    };
    let near = tried.into_iter().filter(|(_, score)| is_near(*score));
    let mut fitted: Vec<CurveFit> = near.take(most).filter_map(fit).collect();
    fitted.sort_by(|a, b| b.score.total_cmp(&a.score));
    for curve in &fitted {
        tracing::debug!(place = ?curve.curves.place, score = curve.score, p = curve.p_family, "curve");
    }
    Ok(fitted)
}

/// The laws of a trial with these curves besides.
fn on_top(trial: &Trial, curves: &Curves) -> Vec<Arc<dyn Law>> {
    trial.laws.iter().chain([&curves.law]).cloned().collect()
}

/// A smooth curve, by what the scan says of it.
fn smooth(place: Place, score: &Score) -> Sought {
    let Score { score, freedom, .. } = *score;
    Sought { place, waves: Vec::new(), score, freedom, chosen_from: freedom }
}

/// The best waves together, by what the scan says of one, two, three … a turn. One hardly shows in the place of another, so that their
/// scores add up.
fn ripple(scores: &[Option<Score>]) -> Option<Sought> {
    let mut waves: Vec<(u8, &Score)> =
        (1..).zip(scores).filter_map(|(wave, score)| Some((wave, score.as_ref()?))).collect();
    let chosen_from = waves.iter().map(|(_, score)| score.freedom).sum();
    waves.sort_by(|(_, a), (_, b)| b.score.total_cmp(&a.score));
    waves.truncate(RIPPLE);
    (!waves.is_empty()).then(|| Sought {
        place: TURN,
        waves: waves.iter().map(|(wave, _)| *wave).collect(),
        score: waves.iter().map(|(_, score)| score.score).sum(),
        freedom: waves.iter().map(|(_, score)| score.freedom).sum(),
        chosen_from,
    })
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
        Argument::MotorPhase => theta * bench.robot().joints[joint].gear,
        Argument::LinkSpeed => qd,
        Argument::LinkAngle => q,
        Argument::Windup => q - theta,
        Argument::WindupRate => qd - thetad,
        Argument::DrivingTorque => bench.driving_torque(trial, k, joint),
        Argument::Time => bench.series().time_s(k),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ripple_is_of_the_best_waves_and_counts_all_that_it_was_chosen_from() {
        // Sixteen waves of sine and cosine at three joints, the fifth of which this motion does not show.
        let mut scores: Vec<Option<Score>> = (0..MOST_WAVES).map(|_| Some(Score::told(6.0, 6))).collect();
        scores[4] = None;
        for (wave, score) in [(3, 40.0), (7, 900.0), (12, 80.0), (14, 30.0), (16, 20.0)] {
            scores[wave - 1] = Some(Score::told(score, 6));
        }
        let sought = ripple(&scores).unwrap();
        assert_eq!(sought.waves, [7, 12, 3, 14]);
        assert_eq!((sought.place, sought.score, sought.freedom), (TURN, 1050.0, 24));
        assert_eq!(sought.chosen_from, 90);
        assert!(ripple(&vec![None; 16]).is_none());
    }
}
