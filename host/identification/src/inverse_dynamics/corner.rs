//! The corner of the positions' low-pass, from the data.
//!
//! A corner that is too high leaves noise in the accelerations, which draws inertias and weights towards nothing (attenuation of errors in variables); one that is
//! too low takes motion away. Both explain the torques worse, and what all corners have to explain is the same: the torques as they were read. So each corner of
//! a ladder gets its own robust least squares, and the highest is taken that leaves no more than the best but for what chance does to a median:
//!
//! ```text
//!   corner ─▶ positions filtered ─▶ parameters by torques in its band ─▶ what they leave of the torques as they were read: median size
//! ```

use super::{Identified, Loss, Motion, Readings};
use crate::model::Model;

/// The highest corner that is tried, as a share of the sampling frequency.
pub const HIGHEST_CORNER: f64 = 0.2;
const LOWEST_CORNER: f64 = 0.001;
/// From one corner to the next.
const NEXT_CORNER: f64 = 0.5;
/// What a corner may leave more than the best, in units of 1/√samples: ln of the median size of so many normal values has a standard error of 1.17 of them, and the
/// difference of two corners less. Half and double have not been tried.
const BY_CHANCE: f64 = 1.0;

/// A corner, over the sampling frequency, with the motion that it leaves and what that shows.
#[derive(Debug)]
pub struct Cornered {
    /// The motion by differences of what the corner leaves of positions.
    pub motion: Motion,
    /// Parameters by robust least squares.
    pub identified: Identified,
    /// ln of what is left, the mean over joints.
    left: f64,
}

/// The corner whose motion explains the torques best, by parameters of `model` found from `z` on, of which some are `held`. None where no run is long enough.
pub fn corner(readings: &[Readings], model: &Model, z: &[f64], held: &[usize]) -> Option<Cornered> {
    let mut ladder = Vec::new();
    let mut next = HIGHEST_CORNER;
    while next >= LOWEST_CORNER {
        let motion = Motion::of(readings, next)?;
        let identified = motion.identify(model, z, held, Loss::Bisquare);
        let scales = motion.missing_scale(model, &identified.z);
        let left = scales.iter().map(|scale| scale.ln()).sum::<f64>() / scales.len().max(1) as f64;
        ladder.push(Cornered { motion, identified, left: if left.is_nan() { f64::INFINITY } else { left } });
        next *= NEXT_CORNER;
    }
    let samples: usize = readings.iter().map(|run| run.time_s.len()).sum();
    let best = ladder.iter().map(|cornered| cornered.left).fold(f64::INFINITY, f64::min);
    let most = best + BY_CHANCE / (samples.max(1) as f64).sqrt();
    ladder.into_iter().find(|cornered| cornered.left <= most)
}
