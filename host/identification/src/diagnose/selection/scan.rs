//! The scan of the catalogue on top of the current model.

use std::sync::Arc;

use super::super::axes::axes_of_step;
use super::super::catalogue::{Candidate, Named};
use super::super::refit::Refit;
use super::super::scores::block_scores::{block_scores, score_laws};
use super::super::scores::events::{at_worst_times, p_of_event};
use super::super::scores::significance::p_of_family;
use super::state::{Scanned, Selection};
use crate::calibrate::{BlockScores, CalibrateError};
use crate::effect::Effect;
use crate::model::law::Law;

/// The scan of all candidates that are not in yet.
pub(super) struct Scan {
    pub(super) scores: BlockScores,
    /// How many samples of the bench each sample of the scan stands for.
    pub(super) samples_each: f64,
    /// Laws with a score.
    pub(super) count: usize,
    /// Best first.
    pub(super) scanned: Vec<Scanned>,
    pub(super) not_finite: Vec<(&'static str, usize)>,
}

pub(super) fn scan(refit: &Refit<'_>, selection: &Selection, candidates: &[Candidate]) -> Result<Scan, CalibrateError> {
    let current = &selection.current.trial;
    let (bench, trial, samples_each) = refit.thinned(current);
    let is_in = |effect: &Effect| selection.accepted.iter().any(|accepted| accepted.named.effect.id == effect.id);
    let mut named: Vec<Named> = Vec::new();
    for candidate in candidates.iter().filter(|candidate| !is_in(candidate.effect)) {
        let is_timed = candidate.alternatives.iter().any(|law| law.event_s().is_some());
        let laws =
            if is_timed { at_worst_times(&refit.bench, current, candidate)? } else { candidate.alternatives.clone() };
        named.extend(laws.into_iter().map(|law| Named { effect: candidate.effect, law }));
    }
    let laws: Vec<Arc<dyn Law>> = named.iter().map(|named| named.law.clone()).collect();
    let scores = block_scores(&bench, &trial, (&laws, laws.len()))?;
    let of_each = score_laws(&scores, &bench.is_contiguous(), false);
    let count = of_each.iter().filter(|score| matches!(score, Ok(Some(_)))).count();
    let (mut scanned, mut not_finite): (Vec<Scanned>, Vec<(&'static str, usize)>) = (Vec::new(), Vec::new());
    // Scores of each law of a single event at all times, the best of which is one.
    let mut at_times: Vec<(&'static str, f64)> = Vec::new();
    for (named, score) in named.into_iter().zip(of_each) {
        let score = match score {
            Ok(Some(score)) => score,
            Ok(None) => continue,
            Err(error) => {
                match not_finite.iter_mut().find(|(id, _)| *id == named.effect.id) {
                    Some((_, columns)) => *columns += error.columns,
                    None => not_finite.push((named.effect.id, error.columns)),
                }
                continue;
            }
        };
        if named.law.event_s().is_some() {
            at_times.push((named.effect.id, score.score));
        }
        let p_family = p_of_family(score.p, count);
        let axes = axes_of_step(&*named.law, &score);
        let new = Scanned { named, score, p_family, axes };
        // By their scores: of a law that starts far from where it ends, as a bearing does, the tangent shows that there is something, and leads astray in other blocks.
        let worth = |s: &Scanned| s.score.score;
        match scanned.iter_mut().find(|other| other.named.effect.id == new.named.effect.id) {
            Some(other) if worth(other) >= worth(&new) => {}
            Some(other) => *other = new,
            None => scanned.push(new),
        }
    }
    for event in scanned.iter_mut().filter(|s| s.named.law.event_s().is_some()) {
        let of_same = at_times.iter().filter(|(id, _)| *id == event.named.effect.id).map(|(_, score)| *score);
        let elsewhere: Vec<f64> = of_same.filter(|score| *score < event.score.score).collect();
        event.p_family = p_of_event(event.score.score, event.score.freedom, &elsewhere, bench.series().stages());
    }
    scanned.sort_by(|a, b| b.score.score.total_cmp(&a.score.score));
    for s in scanned.iter().take(10) {
        let (gain, score) = (s.score.gain(), s.score.score);
        tracing::debug!(effect = s.named.effect.id, gain, score, freedom = s.score.freedom, p = s.p_family, "scan");
    }
    Ok(Scan { scores, samples_each, count, scanned, not_finite })
}
