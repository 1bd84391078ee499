//! The corner of the positions' low-pass, from the data.
//!
//! A corner that is too high leaves noise in the accelerations, which draws inertias and weights towards nothing (attenuation of errors in variables); one that is
//! too low takes motion away. Both explain the torques worse, and what all corners have to explain is the same: the torques as they were read. So each corner of
//! a ladder gets its own robust least squares, and the one that leaves least is taken, among those that show a robot which can be.
//!
//! ```text
//!   corner ─▶ positions filtered ─▶ parameters by torques in its band ─▶ what they leave of the torques as they were read: median size
//! ```

use super::{Identified, Loss, Motion, Readings};
use crate::model::Model;

/// The highest corner that is tried, as a share of the sampling frequency.
pub const HIGHEST_CORNER: f64 = 0.2;
const LOWEST_CORNER: f64 = 0.001;
/// From one corner of the first look to the next, and of the second look beside the best of the first.
const NEXT_CORNER: f64 = 0.5;
const BESIDE: f64 = std::f64::consts::FRAC_1_SQRT_2;

/// A corner, over the sampling frequency, with the motion that it leaves and what that shows.
#[derive(Debug)]
pub struct Cornered {
    /// The motion by differences of what the corner leaves of positions.
    pub motion: Motion,
    /// Parameters by robust least squares.
    pub identified: Identified,
    /// How many parameters are impossible, then ln of what is left, the sum over joints.
    left: (usize, f64),
}

/// The corner whose motion explains the torques best, by parameters of `model` found from `z` on, of which `impossible` counts those that no robot has. None
/// where no run is long enough.
pub fn corner(
    readings: &[Readings],
    model: &Model,
    (z, held): (&[f64], &[usize]),
    impossible: impl Fn(&[f64]) -> usize,
) -> Option<Cornered> {
    let at = |corner: f64| {
        let motion = Motion::of(readings, corner)?;
        let identified = motion.identify(model, z, held, Loss::Bisquare);
        let left: f64 = motion.missing_scale(model, &identified.z).iter().map(|left| left.ln()).sum();
        tracing::debug!(corner, left, z = ?identified.z, "corner");
        let left = (impossible(&identified.z), if left.is_nan() { f64::INFINITY } else { left });
        Some(Cornered { motion, identified, left })
    };
    let mut best = at(HIGHEST_CORNER)?;
    let mut next = HIGHEST_CORNER * NEXT_CORNER;
    while next >= LOWEST_CORNER {
        best = better(best, at(next));
        next *= NEXT_CORNER;
    }
    let first = best.motion.corner();
    for beside in [BESIDE, 1.0 / BESIDE] {
        best = better(best, at((first * beside).min(HIGHEST_CORNER)));
    }
    Some(best)
}

/// That which leaves less; of two that leave the same the one with the higher corner, which comes first.
fn better(best: Cornered, other: Option<Cornered>) -> Cornered {
    match other {
        Some(other) if other.left < best.left => other,
        _ => best,
    }
}
