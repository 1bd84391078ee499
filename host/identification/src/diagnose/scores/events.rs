//! Laws of single events: a belt that jumps. No other block knows of one, so that cross-validation cannot speak; it is told from what the same law finds at
//! other times.
//!
//! ```text
//!   worst times of the current model ─▶ the law at each of them, scored ─▶ the best, timed ever finer ─▶ refit
//!   chance: its gain against the scores of the same law at the other times, F(d, times), and the number of samples it was looked for at
//! ```

use std::sync::Arc;

use super::block_scores::{block_scores, score_laws};
use super::significance::{p_of_family, p_of_ratio};
use crate::calibrate::{Bench, CalibrateError, Trial, Trimmed};
use crate::diagnose::catalogue::{Candidate, Named};
use crate::model::law::Law;

/// Worst times at which a law of an event is scored.
const WORST_TIMES: usize = 12;
/// Steps of the grids around the best time, in sample periods: each reaches over the step of the one before.
const FINER: [f64; 3] = [20.0, 4.0, 1.0];
/// Times on each side of the best one.
const ON_EACH_SIDE: i32 = 5;

/// The same law at the times around which `current` fits worst: one for each joint's and each time.
pub fn at_worst_times(
    bench: &Bench<'_>,
    current: &Trial,
    candidate: &Candidate,
) -> Result<Vec<Arc<dyn Law>>, CalibrateError> {
    let mut firsts: Vec<&Arc<dyn Law>> = Vec::new();
    for law in &candidate.alternatives {
        let is_of_same = |other: &&Arc<dyn Law>| other.parameters().results[0].name == law.parameters().results[0].name;
        if !firsts.iter().any(is_of_same) {
            firsts.push(law);
        }
    }
    let times_s = bench.worst_times(current, WORST_TIMES)?;
    let at = |law: &Arc<dyn Law>, time_s: f64| law.later(time_s - law.event_s()?);
    Ok(firsts.into_iter().flat_map(|law| times_s.iter().filter_map(move |time_s| at(law, *time_s))).collect())
}

/// The law of an event at the time near its own that scores best.
///
/// # Errors
/// A trial that cannot be factorised.
pub fn timed((bench, current): (&Bench<'_>, &Trial), mut named: Named) -> Result<Named, CalibrateError> {
    let period_s = bench.series().median_period_s();
    let contiguous = bench.is_contiguous();
    for step in FINER {
        let shifts = (-ON_EACH_SIDE..=ON_EACH_SIDE).map(|i| f64::from(i) * step * period_s);
        let laws: Vec<Arc<dyn Law>> = shifts.filter_map(|by_s| named.law.later(by_s)).collect();
        let scores = score_laws(&block_scores(bench, current, (&laws, 0))?, &contiguous, false);
        let score = |score: &Result<Option<super::block_scores::LawScore>, _>| {
            score.as_ref().ok().and_then(|score| score.as_ref()).map_or(0.0, |score| score.score)
        };
        let best = scores.iter().enumerate().max_by(|(_, a), (_, b)| score(a).total_cmp(&score(b)));
        let Some((best, _)) = best else { break };
        named.law = laws[best].clone();
    }
    Ok(named)
}

/// Share of worlds without the event in which the law would save `gained` of Σ r² with so many parameters at the best of `times`, where it saves `elsewhere` at others.
pub fn p_of_event(gained: f64, freedom: usize, elsewhere: &[f64], times: usize) -> f64 {
    if elsewhere.is_empty() {
        return 1.0;
    }
    let usual = elsewhere.iter().sum::<f64>() / elsewhere.len() as f64;
    let p = p_of_ratio(gained / freedom.max(1) as f64 / usual, freedom as f64, elsewhere.len() as f64);
    p_of_family(p, times)
}

/// Laws of contacts started from what the greater part of the recording shows of them, best first.
pub fn from_clues(trimmed: Option<&Trimmed>, candidates: &[Candidate]) -> Vec<Named> {
    let starts = |candidate: &Candidate| {
        let effect = candidate.effect;
        let first = candidate.alternatives.first().filter(|law| law.is_event() && law.event_s().is_none());
        let laws = trimmed.zip(first).map_or_else(Vec::new, |(trimmed, law)| law.starts(&trimmed.clues));
        laws.into_iter().map(move |law| Named { effect, law })
    };
    candidates.iter().flat_map(starts).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_event_stands_out_of_what_its_law_finds_elsewhere() {
        let elsewhere = [900.0, 1100.0, 1000.0, 950.0, 1050.0, 1000.0, 1000.0, 1000.0, 1000.0, 1000.0, 1000.0];
        // Twice as much as at other times is chance, three hundred times as much is not.
        assert!(p_of_event(2.0 * 2_000.0, 2, &elsewhere, 10_000) > 0.9);
        assert!(p_of_event(2.0 * 300_000.0, 2, &elsewhere, 10_000) < 1e-3);
        assert_eq!(p_of_event(1e9, 2, &[], 1), 1.0);
    }
}
