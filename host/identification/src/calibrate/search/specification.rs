//! Whether two estimators that agree where the model holds do agree: Hausman's test of specification (1978).
//!
//! Torques along filtered positions, in a band that explains them best, show the parameters of a rigid robot to the slow motion alone. The joint fit sees every
//! reading; where the model holds it sees them better, and both agree. A gear that gives, a belt, a rod that bends, time stamps that wander: then fast motion is
//! not that of a rigid joint, the noise of the input that the fit estimates is large at all frequencies, and what moves fast by no torque gets no inertia.
//!
//! ```text
//!   |p_fit − p_torque| > 3 √(σ_fit² + σ_torque²)   and   > a tenth of what would make all of the torque    ─▶ does not fit
//! ```
//! The numbers are then those of the torques: they are wrong at no frequency that control uses, and a diagnosis starts from them.

use nalgebra::DMatrix;

use crate::calibrate::identifiability::observability::Held;
use crate::calibrate::initial_guess::torque_start::TorqueStart;
use crate::calibrate::residuals::point::Point;
use crate::calibrate::residuals::problem::Problem;
use crate::calibrate::search::Found;
use solve::border::Border;
use solve::error::SolveError;
use solve::levenberg::{self, Settings, Solution};

/// Standard errors of the difference that two estimators may differ by. No population was counted, and half and double have
/// not been tried.
const ERRORS: f64 = 3.0;
/// And the share of what would make all of the torque of the motion, since filters distort a little what they leave. Half and double have not been tried.
const SHARE: f64 = 0.1;

/// A parameter of which two estimators say different things.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Disagreement {
    /// Of the base model's coordinates.
    pub coordinate: usize,
    pub by_fit: f64,
    pub by_torques: f64,
    /// Corner of the torques' filter, Hz.
    pub corner_hz: f64,
}

/// The parameters at which the fit and the torques disagree. Unknowns in `wider` have so many times the standard error of the fit.
pub(crate) fn disagreements(
    problem: &Problem<'_>,
    torques: &TorqueStart,
    found: &Found<'_>,
    wider: &[(usize, f64)],
) -> Vec<Disagreement> {
    let directions: Vec<_> = found.held.iter().map(|held| held.direction.clone()).collect();
    let Solution { point, information, gradient, .. } = &found.solution;
    let Some(covariance) = Border::new(information, gradient, &directions).covariance() else { return Vec::new() };
    let coordinates = problem.model.coordinates();
    let (fit, by_torques) = (coordinates.to_physical(&point.z), coordinates.to_physical(&torques.z));
    let sizes = problem.scale.sizes(problem.model, problem.series, point);
    let disagrees = |i: &usize| {
        let Some(error) = torques.std_error(*i) else { return false };
        let factor = wider.iter().find(|(unknown, _)| unknown == i).map_or(1.0, |(_, factor)| *factor);
        let apart = (fit[*i] - by_torques[*i]).abs();
        apart > ERRORS * error.hypot(factor * covariance[(*i, *i)].max(0.0).sqrt()) && apart > SHARE * sizes[*i]
    };
    let told = |i: usize| Disagreement {
        coordinate: i,
        by_fit: fit[i],
        by_torques: by_torques[i],
        corner_hz: torques.corner_hz,
    };
    (0..torques.z.len()).filter(disagrees).map(told).collect()
}

/// States and what else is free around the parameters of the torques, in place of those of a fit; the errors of the parameters are those of the torques. What
/// these do not show is held.
///
/// # Errors
/// As a solve's own.
pub(crate) fn at_torques<'m>(
    problem: &Problem<'m>,
    torques: &TorqueStart,
    found: &mut Found<'m>,
    structural: &[Held],
    settings: &Settings,
) -> Result<(), SolveError> {
    let unknowns = problem.border().size();
    let unit = |i: usize| (0..unknowns).map(|j| f64::from(u8::from(i == j))).collect::<Vec<f64>>();
    let held = structural.iter().map(|held| held.direction.clone());
    let directions: Vec<_> = (0..torques.z.len()).map(unit).chain(held).collect();
    let dynamics = problem.model.at(&torques.z);
    let from = Point { z: torques.z.clone(), dynamics, ..found.solution.point.clone() };
    let mut solution = levenberg::minimise(problem, from, &directions, settings, |_, _| {})?;
    let before = &mut found.solution;
    solution.add_before(std::mem::take(&mut before.iterations), before.seconds);
    found.solution = solution;
    let not_shown = (0..torques.z.len()).filter(|i| torques.std_error(*i).is_none());
    let not_shown = not_shown.filter(|i| structural.iter().all(|held| held.shares[*i] != 1.0)).map(|i| Held {
        direction: unit(i),
        shares: unit(i),
        reason: "the torques of slow motion do not show it, and the faster motion is not that of this model"
            .to_string(),
        convention: false,
    });
    found.held = structural.iter().cloned().chain(not_shown).collect();
    found.silent.clear();
    set_information(&mut found.solution.information, unknowns, torques);
    Ok(())
}

/// Gives the dynamics' block of an information matrix of so many unknowns that of the torques.
fn set_information(information: &mut [f64], unknowns: usize, torques: &TorqueStart) {
    let dynamics = torques.z.len();
    let shown: Vec<usize> = (0..dynamics).filter(|i| torques.std_error(*i).is_some()).collect();
    let of_shown = DMatrix::from_fn(shown.len(), shown.len(), |i, j| torques.covariance[(shown[i], shown[j])]);
    let Some(inverse) = of_shown.cholesky().map(|factor| factor.inverse()) else { return };
    for i in 0..dynamics {
        for j in 0..unknowns {
            information[i * unknowns + j] = 0.0;
            information[j * unknowns + i] = 0.0;
        }
        information[i * unknowns + i] = 1.0;
    }
    for (a, i) in shown.iter().enumerate() {
        for (b, j) in shown.iter().enumerate() {
            information[i * unknowns + j] = inverse[(a, b)];
        }
    }
}
