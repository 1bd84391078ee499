//! What a law has to gain beside the curves that stand for it.

use std::sync::Arc;

use super::super::criteria::COVERED;
use super::super::curves::Ceiling;
use super::super::refit::Refit;
use super::scan::Scan;
use super::state::{Accepted, Selection};
use super::tried::Tried;
use crate::model::law::Law;

/// The curves of a round, with the laws that were tried in it: what the best of those that stand for a law gains.
pub(super) struct Covered {
    ceiling: Option<Ceiling>,
    ids: Vec<&'static str>,
    /// Samples of the bench for one that curves have seen.
    more: f64,
}

impl Covered {
    pub(super) fn of(refit: &Refit<'_>, selection: &Selection, scan: &Scan, tried: &[Tried]) -> Self {
        let (bench, trial, more) = refit.thinned(&selection.current.trial);
        let scanned = scan.scanned.iter().filter(|s| tried.iter().any(|t| t.named.effect.id == s.named.effect.id));
        let (ids, laws): (Vec<&'static str>, Vec<Arc<dyn Law>>) =
            scanned.map(|s| (s.named.effect.id, s.named.law.clone())).unzip();
        let ceiling = Ceiling::of(&bench, &trial, &bench.is_contiguous(), &laws);
        let ceiling = ceiling.inspect_err(|error| tracing::debug!(%error, "no curve can be fitted")).ok();
        Covered { ceiling, ids, more }
    }

    /// Whether a law gains enough of that: what predicts better than nothing, and far worse than a curve that does the same, is the shadow of something else.
    pub(super) fn is_enough(&self, chosen: &Accepted) -> bool {
        let effect = chosen.named.effect;
        let law = self.ids.iter().position(|id| *id == effect.id).unwrap_or(self.ids.len());
        let best = self.ceiling.as_ref().map_or(0.0, |ceiling| self.more * ceiling.over(law, effect.row));
        let own: f64 = chosen.gains.iter().sum();
        tracing::debug!(effect = effect.id, own, best_curve = best, "covered?");
        own >= COVERED * best
    }
}
