//! Refits: the best laws of a scan, and what they may be taken for, fitted in full on top of the current model.
//!
//! ```text
//! scan ─▶ the best four and their alias class ─▶ on few samples, to the end ─▶ those near the best ─▶ on the samples that decide
//! ```
//!
//! A scan is a tangent; where an effect is large the fit ends far from it, and in another order. Most laws are beaten clearly on few samples
//! already, at a third of the cost.

use std::sync::Arc;

use super::LEVEL;
use super::axes::{axes, is_of};
use super::scan::Scan;
use super::search::{Named, Scanned, Search, laws};
use super::significance::p_of_score;
use crate::calibrate::{Bench, Trial};
use crate::effect::Effect;
use crate::model::law::Law;

/// Laws that are refitted, besides what looks like the best.
const BEST: usize = 4;
/// Iterations of a law.
const ITERATIONS: usize = 20;
/// A law whose score on few samples is less than this share of the best one's, and less by so much, is beaten.
const NEAR: (f64, f64) = (0.5, 24.0);

/// On top of what laws are refitted, and where.
pub struct Refit<'a> {
    /// Few samples.
    pub few: &'a Bench<'a>,
    /// The current model there.
    pub on_few: &'a Trial,
    /// The samples that decide.
    pub bench: &'a Bench<'a>,
    /// The current model.
    pub found: &'a Search,
    /// The null of the scan.
    pub family: &'a Scan,
}

/// Refits the best of a scan and what the best may be taken for. What is beaten on few samples keeps its score there, as many times as there are
/// more samples.
pub fn refit(on: &Refit<'_>, scanned: Vec<Scanned>) -> Vec<Scanned> {
    let Some(best) = scanned.first().filter(|best| best.p_family < LEVEL).map(|best| best.named.effect) else {
        return Vec::new();
    };
    let alike =
        |effect: &Effect| best.confounded_with.contains(&effect.id) || effect.confounded_with.contains(&best.id);
    let wanted = |place: usize, s: &Scanned| place < BEST || alike(s.named.effect);
    let mut refitted: Vec<Scanned> = scanned
        .into_iter()
        .enumerate()
        .filter(|(place, s)| s.p_family < LEVEL && wanted(*place, s))
        .map(|(_, s)| on.on_few_samples(s.named))
        .collect();
    let most = refitted.iter().map(|s| s.score).fold(0.0, f64::max);
    let more = on.bench.series().stages() as f64 / on.few.series().stages().max(1) as f64;
    for s in &mut refitted {
        tracing::debug!(effect = s.named.effect.id, score = s.score, "refit on few samples");
        if s.on_few.is_none() {
            continue;
        }
        if s.score < NEAR.0 * most && s.score < most - NEAR.1 {
            s.score *= more;
            s.p_family = on.family.p_of_family(p_of_score(s.score / on.on_few.inflation, s.freedom));
        } else {
            on.in_full(s);
        }
    }
    refitted
}

impl Refit<'_> {
    fn on_few_samples(&self, named: Named) -> Scanned {
        let trial = self.few.fit(&self.with(&named), self.on_few, ITERATIONS).ok();
        let mut scanned = Scanned {
            trial: None,
            on_few: None,
            score: 0.0,
            freedom: named.law.parameters().coordinates.len().max(1),
            p_family: 1.0,
            axes: Vec::new(),
            vif: None,
            named,
        };
        self.judge(&mut scanned, trial.as_ref(), self.on_few);
        scanned.on_few = trial.filter(|_| scanned.score > 0.0);
        scanned
    }

    fn in_full(&self, scanned: &mut Scanned) {
        let current = &self.found.trial;
        let from = scanned.on_few.as_ref().unwrap_or(current);
        let trial = self.bench.fit_from(&self.with(&scanned.named), (from, current), ITERATIONS).ok();
        self.judge(scanned, trial.as_ref(), current);
        scanned.trial = trial.filter(|_| scanned.score > 0.0);
    }

    /// The model with one more law.
    fn with(&self, named: &Named) -> Vec<Arc<dyn Law>> {
        laws(self.found.accepted.iter().map(|accepted| &accepted.named).chain([named]))
    }

    /// What a trial says of the law. Nothing, where it ended at what no robot can have.
    fn judge(&self, scanned: &mut Scanned, trial: Option<&Trial>, current: &Trial) {
        scanned.score = 0.0;
        if let Some(trial) = trial.filter(|trial| trial.cost.is_finite() && trial.is_possible()) {
            scanned.score = (2.0 * (current.cost - trial.cost)).max(0.0);
            scanned.axes = axes(scanned.named.effect, trial);
            let own = trial.values.iter().filter(|value| is_of(scanned.named.effect, &value.name));
            scanned.vif = own.map(|value| value.vif).filter(|vif| vif.is_finite()).reduce(f64::max);
        }
        scanned.p_family = self.family.p_of_family(p_of_score(scanned.score / current.inflation, scanned.freedom));
    }
}
