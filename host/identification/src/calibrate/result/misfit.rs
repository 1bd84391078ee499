//! Whether a calibrated model fits what it was calibrated on: what no robot has, and rows that are far from their noise.

use super::calibration::{Calibration, ParameterEstimate};
use crate::calibrate::residuals::preset::Preset;
use crate::calibrate::residuals::problem::Problem;
use crate::calibrate::search::Found;
use crate::calibrate::search::specification::Disagreement;
use crate::model::Model;

/// χ² per degree of freedom of a row beyond which its residuals are no noise of the size that is assumed: it is missed by twice its deviation. Where noise is
/// estimated it is 1; on KUKA KR300, whose file tells it, the worst row has 818 without the encoders' lag and 7 to 9 with it. Halved, a deviation told as 0.7 of
/// what it is does not fit; doubled, one told as 0.35 does. No study has counted either.
const MOST_CHI2: f64 = 4.0;
/// Rows that are told one by one, the worst first.
const ROWS_TOLD: usize = 3;
/// How many times all of the torque a parameter may make, to be one of that robot: for searches that ran away, which pass it by orders of magnitude. Neither half
/// nor double has been tried.
const MOST_TORQUE: f64 = 1000.0;
/// Standard errors below zero from which on a parameter is negative. At half of it a friction of nothing is called negative in one calibration of six, at
/// double of it in one of thirty thousand, and an inertia of −3 standard errors passes.
const NEGATIVE: f64 = 2.0;

/// Sentences on what does not fit; none where nothing is found.
pub(crate) fn sentences(
    problem: &Problem<'_>,
    (found, disagreements): (&Found<'_>, &[Disagreement]),
    calibration: &Calibration,
) -> Vec<String> {
    let model = problem.model;
    let mut sentences: Vec<String> = disagreement(model, disagreements).into_iter().collect();
    let sizes = problem.scale.sizes(model, problem.series, &found.solution.point);
    for (coordinate, size) in model.coordinates().iter().zip(sizes) {
        let Some(parameter) = calibration.parameter(&coordinate.spec.name) else { continue };
        let ParameterEstimate { name, estimate, unit, .. } = parameter;
        if !estimate.is_finite() {
            sentences.push(format!("{name} has come to no number"));
        } else if !coordinate.spec.symbol.has_either_sign() && is_negative(parameter) {
            sentences.push(format!("{name} is {estimate:.4} {unit}, and no robot has less than nothing of it"));
        } else if size.is_finite() && estimate.abs() > MOST_TORQUE * size {
            let times = estimate.abs() / size;
            sentences
                .push(format!("{name} is {estimate:.3e} {unit}, {times:.0e} times what would make all of the torque"));
        }
    }
    if calibration.preset == Preset::Paper {
        return sentences;
    }
    let rows = calibration.noise.iter().filter_map(|row| Some((row, row.chi2_per_dof.filter(|v| *v > MOST_CHI2)?)));
    let mut rows: Vec<_> = rows.collect();
    rows.sort_by(|(_, a), (_, b)| b.total_cmp(a));
    for (row, chi2) in rows.iter().take(ROWS_TOLD) {
        let (name, times) = (&row.channel, chi2.sqrt());
        sentences.push(format!("{name} is missed by {times:.1} times its noise of {:.2e} {}", row.sigma, row.unit));
    }
    if rows.len() > ROWS_TOLD {
        sentences.push(format!(
            "and {} more rows by more than {} times theirs",
            rows.len() - ROWS_TOLD,
            MOST_CHI2.sqrt()
        ));
    }
    sentences
}

/// That two estimators say different things of parameters; none where they do not.
fn disagreement(model: &Model, found: &[Disagreement]) -> Option<String> {
    let corner_hz = found.first()?.corner_hz;
    let of = |found: &Disagreement| {
        let spec = model.coordinates().iter().nth(found.coordinate).map(|c| &c.spec);
        let (name, unit) = spec.map_or(("a parameter", ""), |spec| (&spec.name, spec.unit));
        format!("{name} is {:.4} {unit} by these and {:.4} by all readings", found.by_torques, found.by_fit)
    };
    Some(format!(
        "the numbers are those of the torques of motion below {corner_hz:.1} Hz ({}): faster motion is not that of this model, as where a gear or a belt \
         gives, or time stamps wander",
        found.iter().map(of).collect::<Vec<_>>().join(", ")
    ))
}

fn is_negative(parameter: &ParameterEstimate) -> bool {
    parameter.estimate + NEGATIVE * parameter.std_error.unwrap_or(0.0) < 0.0
}
