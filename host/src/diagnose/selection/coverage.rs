//! What a law has to gain beside the curves that stand for it.

use std::sync::Arc;

use super::super::catalogue::laws;
use super::super::criteria::COVERED;
use super::super::curves::{Ceiling, Curves};
use super::super::refit::Refit;
use super::scan::Scan;
use super::state::{Accepted, Selection};
use super::tried::Tried;
use crate::model::law::Law;

/// The curves of a round, with the laws that were tried in it: what the best of those that stand for a law gains.
pub(super) struct Covered<'a> {
    refit: &'a Refit<'a>,
    selection: &'a Selection,
    ceiling: Option<Ceiling>,
    ids: Vec<&'static str>,
    /// Samples of the bench for one that curves have seen.
    more: f64,
    /// Curves that were refitted, and what they gain.
    refitted: Vec<(Arc<dyn Law>, f64)>,
}

impl<'a> Covered<'a> {
    pub(super) fn of(refit: &'a Refit<'a>, selection: &'a Selection, scan: &Scan, tried: &[Tried]) -> Self {
        let (bench, trial, more) = refit.thinned(&selection.current.trial);
        let scanned = scan.scanned.iter().filter(|s| tried.iter().any(|t| t.named.effect.id == s.named.effect.id));
        let (ids, tried): (Vec<&'static str>, Vec<Arc<dyn Law>>) =
            scanned.map(|s| (s.named.effect.id, s.named.law.clone())).unzip();
        let ceiling = Ceiling::of(&bench, &trial, &bench.is_contiguous(), &tried);
        let ceiling = ceiling.inspect_err(|error| tracing::debug!(%error, "no curve can be fitted")).ok();
        Covered { refit, selection, ceiling, ids, more, refitted: Vec::new() }
    }

    /// Whether a law gains enough of that: what predicts better than nothing, and far worse than a curve that does the same, is the shadow of something else.
    /// The curve is refitted, as the law is: a tangent promises less than a refit keeps where the step is large.
    pub(super) fn is_enough(&mut self, chosen: &Accepted) -> bool {
        let effect = chosen.named.effect;
        let law = self.ids.iter().position(|id| *id == effect.id).unwrap_or(self.ids.len());
        let own: f64 = chosen.gains.iter().sum();
        let best = self.ceiling.as_ref().and_then(|ceiling| ceiling.over(law, effect.row)).cloned();
        let tangent = best.as_ref().map_or(0.0, |curves| self.more * curves.gain());
        let refitted = best.filter(|_| own >= COVERED * tangent).map_or(0.0, |curves| self.refitted(&curves));
        tracing::debug!(effect = effect.id, own, tangent, refitted, "covered?");
        own >= COVERED * tangent.max(refitted)
    }

    /// What curves gain by their refit.
    fn refitted(&mut self, curves: &Curves) -> f64 {
        if let Some((_, gain)) = self.refitted.iter().find(|(law, _)| Arc::ptr_eq(law, &curves.law)) {
            return *gain;
        }
        let current = &self.selection.current;
        let mut with = laws(self.selection.accepted.iter().map(|accepted| &accepted.named));
        with.push(curves.law.clone());
        let fitted = self.refit.with_laws(&with, current);
        let gain = fitted.map_or(0.0, |fitted| fitted.gains_over(current).iter().sum::<f64>());
        self.refitted.push((curves.law.clone(), gain));
        gain
    }
}
