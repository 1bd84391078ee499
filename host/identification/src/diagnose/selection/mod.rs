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

/// What a selection chooses from, and by what it judges.
pub struct Search<'a> {
    /// Where laws are refitted.
    pub refit: &'a Refit<'a>,
    /// The catalogue.
    pub candidates: &'a [Candidate],
    /// Laws started from what the recording shows of events and contacts.
    pub clues: &'a [Named],
    /// Sizes that robots have.
    pub plausibility: &'a Plausibility,
    /// Is told what begins.
    pub step: &'a dyn Fn(&str),
}

impl Search<'_> {
    /// What is selected on top of the base model.
    ///
    /// # Errors
    /// As a calibration's, of a model that was accepted; a law that cannot be fitted is passed over.
    pub fn select(&self, base: Fitted) -> Result<Selection, CalibrateError> {
        let mut selection = Selection::of(base);
        self.grow(&mut selection)?;
        Ok(selection)
    }

    /// Adds what is supported and drops what that makes superfluous.
    ///
    /// # Errors
    /// As a calibration's, of a model that was accepted.
    pub fn grow(&self, selection: &mut Selection) -> Result<(), CalibrateError> {
        for _ in 0..PASSES {
            self.add(selection)?;
            (self.step)("looking at what stands for something else");
            let added = selection.ids();
            drop_superfluous(self.refit, selection)?;
            let exchanged = exchange(self.refit, selection, self.plausibility);
            // Where only the last ones were dropped the model is one that was passed: the same would be added again.
            if !exchanged && added.starts_with(&selection.ids()) {
                break;
            }
        }
        Ok(())
    }

    /// Adds laws until none is supported.
    fn add(&self, selection: &mut Selection) -> Result<(), CalibrateError> {
        while selection.accepted.len() < MOST_FINDINGS {
            (self.step)("scanning the catalogue");
            let scan = scan(self.refit, selection, self.candidates)?;
            (self.step)("refitting the best");
            let mut left = refitted(self.refit, selection, &scan, self.clues);
            if selection.accepted.is_empty() {
                selection.scan.clone_from(&scan.scanned);
            }
            selection.not_finite.clone_from(&scan.not_finite);
            selection.tests = selection.tests.max(scan.count);
            let before: &Selection = selection;
            let mut covered: Option<Covered<'_>> = None;
            let found = loop {
                let Some((chosen, place)) = choose(&before.current, &scan, &left, self.plausibility) else {
                    break None;
                };
                if matters(before, &chosen) {
                    let covered = covered.get_or_insert_with(|| Covered::of(self.refit, before, &scan, &left));
                    if covered.is_enough(&chosen) {
                        break Some((chosen, left.swap_remove(place).fitted));
                    }
                }
                left.retain(|tried| tried.named.effect.id != chosen.named.effect.id);
            };
            let curves = covered.and_then(Covered::into_curves);
            if selection.accepted.is_empty() {
                selection.base_curves = curves;
            }
            let Some((chosen, fitted)) = found else { return Ok(()) };
            tracing::debug!(effect = chosen.named.effect.id, weight = chosen.weight, "accepted");
            selection.push(chosen, self.refit.reweighted(fitted));
        }
        Ok(())
    }
}
