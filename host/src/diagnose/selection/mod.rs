//! Forward selection by what a law gains out of sample.
//!
//! ```text
//!   current model ─▶ scan by blocks ─▶ refit the best, and what is collinear with them ─▶ gain of other blocks, with its interval
//!        ▲                                                                                   │ supported, enough, and half of what a curve gains
//!        └── drop what no longer gains, exchange what a rival explains better ◀── add ◀──────┘            else: the next best, or end
//! ```
//! Nothing is rolled back and nothing is struck out for another one's sake.

mod backward;
mod choice;
mod coverage;
mod enough;
mod scan;
mod state;
mod tried;

pub use backward::losses;
pub use state::{Accepted, Selection, share};
pub use tried::first_refits;

use backward::{drop_superfluous, exchange};
use choice::choose;
use coverage::Covered;
use enough::matters;
use scan::scan;
use tried::refitted;

use super::catalogue::{Candidate, Named};
use super::criteria::MOST_FINDINGS;
use super::plausibility::Plausibility;
use super::refit::{Fitted, Refit};
use crate::calibrate::CalibrateError;

/// Passes of additions and of what they make superfluous.
const PASSES: usize = 2;

/// Searches from the base model. `clues` are laws started from what the recording shows of events and contacts; `step` is told what begins.
///
/// # Errors
/// As a calibration's, of a model that was accepted; a law that cannot be fitted is passed over.
pub fn select(
    refit: &Refit<'_>,
    base: Fitted,
    (candidates, clues): (&[Candidate], &[Named]),
    plausibility: &Plausibility,
    step: &dyn Fn(&str),
) -> Result<Selection, CalibrateError> {
    let mut selection = Selection::of(base);
    grow(refit, &mut selection, (candidates, clues), plausibility, step)?;
    Ok(selection)
}

/// Adds what is supported and drops what that makes superfluous.
///
/// # Errors
/// As a calibration's, of a model that was accepted.
pub fn grow(
    refit: &Refit<'_>,
    selection: &mut Selection,
    (candidates, clues): (&[Candidate], &[Named]),
    plausibility: &Plausibility,
    step: &dyn Fn(&str),
) -> Result<(), CalibrateError> {
    for _ in 0..PASSES {
        add(refit, selection, (candidates, clues), plausibility, step)?;
        step("looking at what stands for something else");
        let dropped = drop_superfluous(refit, selection)?;
        let exchanged = exchange(refit, selection, plausibility);
        if !(dropped || exchanged) {
            break;
        }
    }
    Ok(())
}

/// Adds laws until none is supported.
fn add(
    refit: &Refit<'_>,
    selection: &mut Selection,
    (candidates, clues): (&[Candidate], &[Named]),
    plausibility: &Plausibility,
    step: &dyn Fn(&str),
) -> Result<(), CalibrateError> {
    while selection.accepted.len() < MOST_FINDINGS {
        step("scanning the catalogue");
        let scan = scan(refit, selection, candidates)?;
        step("refitting the best");
        let tried = refitted(refit, selection, &scan, clues);
        if selection.accepted.is_empty() {
            selection.scan.clone_from(&scan.scanned);
        }
        selection.not_finite.clone_from(&scan.not_finite);
        selection.tests = selection.tests.max(scan.count);
        let mut left = tried;
        let mut covered: Option<Covered> = None;
        let (chosen, fitted) = loop {
            let Some((chosen, place)) = choose(&selection.current, &scan, &left, plausibility) else {
                return Ok(());
            };
            if matters(selection, &chosen) {
                let covered = covered.get_or_insert_with(|| Covered::of(refit, selection, &scan, &left));
                if covered.is_enough(&chosen) {
                    break (chosen, left.swap_remove(place).fitted);
                }
            }
            left.retain(|tried| tried.named.effect.id != chosen.named.effect.id);
        };
        tracing::debug!(effect = chosen.named.effect.id, weight = chosen.weight, "accepted");
        selection.push(chosen, refit.reweighted(fitted));
    }
    Ok(())
}
