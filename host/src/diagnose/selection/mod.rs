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
            let dropped = drop_superfluous(self.refit, selection)?;
            let exchanged = exchange(self.refit, selection, self.plausibility);
            if !(dropped || exchanged) {
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
            let mut covered: Option<Covered<'_>> = None;
            let (chosen, fitted) = loop {
                let Some((chosen, place)) = choose(&selection.current, &scan, &left, self.plausibility) else {
                    return Ok(());
                };
                if matters(selection, &chosen) {
                    let covered = covered.get_or_insert_with(|| Covered::of(self.refit, selection, &scan, &left));
                    if covered.is_enough(&chosen) {
                        break (chosen, left.swap_remove(place).fitted);
                    }
                }
                left.retain(|tried| tried.named.effect.id != chosen.named.effect.id);
            };
            tracing::debug!(effect = chosen.named.effect.id, weight = chosen.weight, "accepted");
            selection.push(chosen, self.refit.reweighted(fitted));
        }
        Ok(())
    }
}
