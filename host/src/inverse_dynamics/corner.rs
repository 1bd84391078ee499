//! The corner of the positions' low-pass, from the data.
//!
//! A corner that is too high leaves noise in the accelerations, which draws inertias and weights towards nothing (attenuation of errors in variables); one that is
//! too low takes motion away. So each corner of a ladder gets its own robust least squares, and the highest is taken whose parameters no lower one refutes:
//!
//! ```text
//!   in the band of the lower corner:   F = (Σ r²(high) − Σ r²(low)) / Σ r²(low) · (rows − unknowns) / unknowns   > 4 ─▶ the higher one is refuted
//! ```
//! Each motion is filtered by its own corner and has its own parameters. Where the lower one has lost motion it leaves more, and refutes nothing.

use super::robust;
use super::{Identified, Loss, Motion, Readings};
use crate::model::Model;

/// The highest corner that is tried, as a share of the sampling frequency.
pub const HIGHEST_CORNER: f64 = 0.2;
const LOWEST_CORNER: f64 = 0.001;
/// From one corner to the next.
const NEXT_CORNER: f64 = 0.5;
/// F from which on a corner is refuted: of normal residuals and five unknowns one in five hundred. On the pendulums of DFKI attenuated corners have tens to
/// hundreds; half and double have not been tried.
const REFUTED: f64 = 4.0;
/// Rows for an unknown below which a corner refutes none: a robust scale of fewer is that of chance.
const FEWEST_ROWS: f64 = 4.0;
/// Scales at which residuals are clipped before they are squared.
const CLIPPED: f64 = 3.0;

/// A corner, over the sampling frequency, with the motion that it leaves and what that shows.
#[derive(Debug)]
pub struct Cornered {
    /// The motion by differences of what the corner leaves of positions.
    pub motion: Motion,
    /// Parameters by robust least squares.
    pub identified: Identified,
}

/// The highest corner that no lower one refutes, by parameters of `model` found from `z` on, of which some are `held`. None where no run is long enough.
pub fn corner(readings: &[Readings], model: &Model, z: &[f64], held: &[usize]) -> Option<Cornered> {
    let mut ladder = Vec::new();
    let mut next = HIGHEST_CORNER;
    while next >= LOWEST_CORNER {
        let motion = Motion::of(readings, next)?;
        let identified = motion.identify(model, z, held, Loss::Bisquare);
        ladder.push(Cornered { motion, identified });
        next *= NEXT_CORNER;
    }
    let unknowns = z.len().saturating_sub(held.len()).max(1) as f64;
    let stands = |place: usize| ladder[place + 1..].iter().all(|low| ladder[place].stands(low, model, unknowns));
    let place = (0..ladder.len()).find(|place| stands(*place))?;
    Some(ladder.swap_remove(place))
}

impl Cornered {
    /// Whether a lower corner does not refute this one.
    fn stands(&self, low: &Cornered, model: &Model, unknowns: f64) -> bool {
        // What a corner leaves is told by one sample of so many, however many the least squares keep.
        let decimation = (1.0 / low.motion.corner()).round() as usize;
        let of = |cornered: &Cornered| cornered.motion.every(decimation, model, &cornered.identified.z, true);
        let (mut own, mut lows, mut rows) = (0.0, 0.0, 0usize);
        for (high, low) in of(self).iter().zip(&of(low)) {
            let scale = robust::scale(low).max(f64::MIN_POSITIVE);
            let squares = |left: &[f64]| left.iter().map(|r| (r / scale).abs().min(CLIPPED).powi(2)).sum::<f64>();
            own += squares(high);
            lows += squares(low);
            rows += low.len();
        }
        let rows = rows as f64;
        // What is no number is no better than anything, and few rows follow any parameters.
        rows < FEWEST_ROWS * unknowns || lows.is_nan() || (own - lows) / lows * (rows - unknowns) / unknowns <= REFUTED
    }
}
