//! Pushes: times at which a measured input misses far more than it does otherwise, as where somebody pushes the robot, or it hits something.
//!
//! The error of the input is a state. Squares of a push of ten seconds' usual error would make that noise large everywhere, and the parameters small: what moves
//! by no torque has no inertia. So the error is allowed more there, by a power of two, as in the scale mixture that Student's distribution is:
//!
//! ```text
//!   scale   the upper quartile of |e| over that of the normal distribution; up to half of a recording may be at rest
//!   times   2^⌈log₂(|e| / 5 scale)⌉ where that is more than one
//! ```

use crate::calibrate::residuals::point::Point;
use crate::calibrate::residuals::problem::Problem;

/// Scales beyond which an error is a push: of normal errors one in two million. No population was counted, and half and double have not been tried.
const FAR: f64 = 5.0;
/// Upper quartile of |x| under the normal distribution to the standard deviation.
const QUARTILE: f64 = 1.1503;
/// A joint with a larger share of pushes than this has an input that is no measurement of its torque: nothing is allowed.
const MOST_SHARE: f64 = 0.1;

/// Stages at which inputs err by far, `(stage, joint, times)`.
pub(super) fn pushes(problem: &Problem<'_>, point: &Point<'_>) -> Vec<(usize, usize, f64)> {
    let stages = problem.series.stages();
    let mut found = Vec::new();
    for (joint, component) in problem.model.layout().inputs().enumerate() {
        let errors: Vec<f64> = (0..stages).map(|k| point.state(k)[component]).collect();
        let far = FAR * scale(&errors);
        let before = found.len();
        let pushed = errors.iter().enumerate().filter(|(_, e)| far > 0.0 && e.abs() > far);
        found.extend(pushed.map(|(k, e)| (k, joint, (e.abs() / far).log2().ceil().exp2().max(2.0))));
        if (found.len() - before) as f64 > MOST_SHARE * stages as f64 {
            found.truncate(before);
        }
    }
    found
}

/// The standard deviation of normal values of which up to half may be nothing.
fn scale(values: &[f64]) -> f64 {
    let mut sizes: Vec<f64> = values.iter().map(|value| value.abs()).collect();
    if sizes.is_empty() {
        return 0.0;
    }
    let quartile = 3 * sizes.len() / 4;
    *sizes.select_nth_unstable_by(quartile, f64::total_cmp).1 / QUARTILE
}
