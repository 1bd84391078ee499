//! Refits of what the scan shows best.

use super::super::axes::axes_of_joints;
use super::super::catalogue::{Candidate, Named};
use super::super::criteria::{COLLINEAR, LEAST_OF_BEST, LEVEL, PROMISING, REFITTED, RIVALS_REFITTED, SIEVE, TANGENT};
use super::super::refit::{Fitted, Refit};
use super::super::scores::block_scores::{LawScore, collinearity};
use super::super::scores::events::{p_of_event, timed};
use super::super::scores::significance::{p_of_both, p_of_family, p_of_gains, p_of_score};
use super::enough::{cost_that_matters, least_gain};
use super::scan::{Scan, scan};
use super::state::{Scanned, Selection};
use crate::calibrate::CalibrateError;
use crate::effect::Effect;

/// A refit on top of the current model.
pub(super) struct Tried {
    pub(super) named: Named,
    pub(super) fitted: Fitted,
    pub(super) gains: Vec<f64>,
    pub(super) p_family: f64,
    pub(super) freedom: usize,
    pub(super) is_event: bool,
    pub(super) score: Option<LawScore>,
    pub(super) axes: Vec<usize>,
}

/// Refits of what the scan shows best, of what is collinear with the best, and of events.
pub(super) fn refitted(refit: &Refit<'_>, selection: &Selection, scan: &Scan, clues: &[Named]) -> Vec<Tried> {
    let accepted: Vec<Named> = selection.accepted.iter().map(|accepted| accepted.named.clone()).collect();
    let current = &selection.current;
    let mut tried: Vec<Tried> = Vec::new();
    let is_in = |named: &Named| accepted.iter().any(|other| other.effect.id == named.effect.id);
    for named in clues.iter().filter(|named| !is_in(named)) {
        tried.extend(refit.with_event(&accepted, current, named).map(|(named, fitted)| Tried {
            gains: fitted.gains_over(current),
            freedom: named.law.parameters().coordinates.len(),
            p_family: 1.0,
            is_event: named.law.event_s().is_some(),
            score: None,
            axes: axes_of_joints(&*named.law),
            named,
            fitted,
        }));
    }
    let is_event = |s: &&Scanned| s.named.law.event_s().is_some();
    let (mut events, others): (Vec<&Scanned>, Vec<&Scanned>) = scan.scanned.iter().partition(is_event);
    events.retain(|event| event.p_family < LEVEL);
    let most = others.iter().map(|s| s.score.score).fold(0.0, f64::max);
    // What no more than white noise would show is not refitted, nor what is too little to matter. A first sieve: coloured noise passes it.
    let least = TANGENT * least_gain(selection) / scan.samples_each;
    let shows = |s: &&Scanned| is_promising((s.score.score, s.score.freedom), least, scan.count);
    let promising = |s: &&Scanned| s.score.score >= PROMISING * most && shows(s);
    let count = others.iter().copied().filter(promising).count().min(REFITTED);
    let (first, rest) = others.split_at(count);
    // What may stand for the best: what does the same to the residuals, or acts on the same quantity.
    let is_rival = |s: &&&Scanned| {
        first.first().is_some_and(|best| {
            let shares_a_hook = best.named.law.hooks().iter().any(|hook| s.named.law.hooks().contains(hook));
            shares_a_hook || collinearity(&scan.scores, &best.score, &s.score) > COLLINEAR
        })
    };
    let shows_too = |s: &&&Scanned| shows(s);
    let wanted = first.iter().chain(rest.iter().filter(shows_too).filter(is_rival).take(RIVALS_REFITTED));
    let enough = cost_that_matters(selection);
    for s in wanted.copied().chain(events) {
        let timed_law = if s.named.law.event_s().is_some() {
            timed((&refit.bench, &current.trial), s.named.clone())
        } else {
            Ok(s.named.clone())
        };
        let Ok(named) = timed_law else { continue };
        let least = tried.iter().map(|tried| tried.fitted.trial.cost).fold(current.trial.cost, f64::min);
        let above = (current.trial.cost - LEAST_OF_BEST * (current.trial.cost - least)).min(enough);
        tried.extend(refit.with(&accepted, current, &named, above).map(|(named, fitted)| Tried {
            p_family: of_refit(s, &fitted.gains_over(current), scan.count),
            gains: fitted.gains_over(current),
            freedom: s.score.freedom,
            is_event: named.law.event_s().is_some(),
            score: Some(s.score.clone()),
            axes: s.axes.clone(),
            named,
            fitted,
        }));
    }
    // What a single event gains, against what its law finds elsewhere.
    for event in tried.iter_mut().filter(|tried| tried.is_event) {
        event.gains = event.fitted.own_gains_over(current);
        let most = event.gains.iter().copied().fold(0.0, f64::max);
        let elsewhere: Vec<f64> = event.gains.iter().copied().filter(|gain| *gain < most).map(f64::abs).collect();
        let times = refit.bench.series().stages() * refit.bench.series().joints();
        event.p_family = p_of_event(most, event.freedom, &elsewhere, times);
    }
    tried
}

/// Whether a score is one that a refit may make a finding of: no less than `least`, and more than white noise shows in the best of so many tests.
fn is_promising((score, freedom): (f64, usize), least: f64, tests: usize) -> bool {
    score >= least && p_of_family(p_of_score(score, freedom), tests) < SIEVE
}

/// The family's p of a law by its scan and by its refit: a tangent may show less than there is.
fn of_refit(scanned: &Scanned, gains: &[f64], tests: usize) -> f64 {
    p_of_both(scanned.p_family, p_of_family(p_of_gains(gains), tests))
}

/// Refits of the first round, with that of `effect` among them: id, parameters, and Σ r² saved with each model's own parameters.
///
/// # Errors
/// As a calibration's, of the scan.
pub fn first_refits(
    refit: &Refit<'_>,
    base: Fitted,
    candidates: &[Candidate],
    effect: &'static Effect,
) -> Result<Vec<(&'static str, usize, f64)>, CalibrateError> {
    let selection = Selection::of(base);
    let mut scan = scan(refit, &selection, candidates)?;
    // The law in question is refitted whatever the scan says of it.
    scan.scanned.sort_by_key(|s| s.named.effect.id != effect.id);
    let own = scan.scanned.first().filter(|s| s.named.effect.id == effect.id);
    let own = own.and_then(|s| {
        Some((s.score.freedom, refit.with(&[], &selection.current, &s.named, selection.current.trial.cost)?.1))
    });
    let saved = |fitted: &Fitted| -> f64 {
        selection.current.own.iter().zip(&fitted.own).map(|(before, after)| before - after).sum()
    };
    let mut refits: Vec<(&'static str, usize, f64)> = refitted(refit, &selection, &scan, &[])
        .into_iter()
        .filter(|tried| tried.named.effect.id != effect.id)
        .map(|tried| (tried.named.effect.id, tried.freedom, saved(&tried.fitted)))
        .collect();
    refits.extend(own.map(|(freedom, fitted)| (effect.id, freedom, saved(&fitted))));
    Ok(refits)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn neither_what_white_noise_shows_nor_what_is_too_little_to_matter_is_refitted() {
        // Of forty laws with three directions each white noise lets one reach 15.7 in SIEVE of all recordings.
        assert!(!is_promising((15.0, 3), 0.0, 40));
        assert!(is_promising((25.0, 3), 0.0, 40));
        assert!(!is_promising((25.0, 12), 0.0, 40), "more directions show more noise");
        // A misfit so large that only 400 matters.
        assert!(!is_promising((399.0, 3), 400.0, 40));
        assert!(is_promising((400.0, 3), 400.0, 40));
    }
}
