//! What a law has to gain beside the curves that stand for it.

use std::sync::Arc;

use super::super::catalogue::laws;
use super::super::criteria::{COVERED, LEVEL};
use super::super::curves::{Ceiling, Curves};
use super::super::refit::Refit;
use super::super::scores::significance::{p_of_family, p_of_gains};
use super::scan::Scan;
use super::state::{Accepted, Selection, share};
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
    refitted: Vec<Refitted>,
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
    /// The curve is refitted, as the law is: where the step is large a tangent neither keeps what it promises nor promises what a refit finds.
    pub(super) fn is_enough(&mut self, chosen: &Accepted) -> bool {
        let effect = chosen.named.effect;
        let law = self.ids.iter().position(|id| *id == effect.id).unwrap_or(self.ids.len());
        let own: f64 = chosen.gains.iter().sum();
        let tangent = self.ceiling.as_ref().map_or(0.0, |ceiling| self.more * ceiling.over(law, effect.row));
        let like = self.ceiling.as_ref().and_then(|ceiling| ceiling.like(law)).cloned();
        let place = like.as_ref().map(|curves| curves.place);
        let refitted = like.filter(|_| own >= COVERED * tangent).map_or(0.0, |curves| self.refitted(&curves));
        tracing::debug!(effect = effect.id, own, tangent, refitted, ?place, "covered?");
        own >= COVERED * tangent.max(refitted)
    }

    /// What curves gain for sure by their refit.
    fn refitted(&mut self, curves: &Curves) -> f64 {
        if let Some(known) = self.refitted.iter().find(|refitted| Arc::ptr_eq(&refitted.law, &curves.law)) {
            return known.gain();
        }
        let places = self.ceiling.as_ref().map_or(1, |ceiling| ceiling.places);
        let current = &self.selection.current;
        let mut with = laws(self.selection.accepted.iter().map(|accepted| &accepted.named));
        with.push(curves.law.clone());
        let gains = self.refit.with_laws(&with, current).map_or_else(Vec::new, |fitted| fitted.gains_over(current));
        let p_family = p_of_family(p_of_gains(&gains), places);
        let is_sure = share(&gains, 1.0).is_supported() && p_family < LEVEL;
        let refitted = Refitted { law: curves.law.clone(), gains, p_family, is_sure };
        let gain = refitted.gain();
        self.refitted.push(refitted);
        gain
    }

    /// Of all places, best first, by what refits gain for sure where curves were refitted.
    pub(super) fn into_curves(self) -> Option<Vec<Curves>> {
        let Covered { ceiling, refitted, more, .. } = self;
        let mut curves = ceiling?.curves;
        for refitted in refitted.into_iter().filter(|refitted| refitted.is_sure) {
            let of_law = curves.iter_mut().find(|curves| Arc::ptr_eq(&curves.law, &refitted.law));
            if let Some(curves) = of_law.filter(|curves| refitted.gain() > more * curves.gain()) {
                curves.score.gains = refitted.gains.iter().map(|gain| gain / more).collect();
                curves.p_family = refitted.p_family.min(curves.p_family);
            }
        }
        curves.sort_by(|a, b| b.gain().total_cmp(&a.gain()));
        Some(curves)
    }
}

/// A curve that was refitted on the whole bench.
struct Refitted {
    law: Arc<dyn Law>,
    gains: Vec<f64>,
    p_family: f64,
    is_sure: bool,
}

impl Refitted {
    /// What is sure of it.
    fn gain(&self) -> f64 {
        if self.is_sure { self.gains.iter().sum() } else { 0.0 }
    }
}
