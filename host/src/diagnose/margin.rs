//! How much a recording tells of a cause: by how much its law fits better than the nearest rival.
//!
//! What a diagnosis can be asked for depends on nothing else. Studies set the sizes of what they hide by it.

use super::found::{Scanned, Search};
use super::refit::{Events, Refit, refit};
use super::scan::Scan;
use super::search::{USUAL_ALTERNATIVES, scan};
use super::{DiagnoseError, benches, candidate, fitted_and_unseen};
use crate::calibrate::{Method, Preset, fit};
use crate::effect::Effect;
use crate::recording::Recording;
use crate::robot::Robot;
use solve::levenberg::Settings;

/// Twice the difference of the log-likelihoods of two refits on the samples that decide: of the law of `effect`, and of the best of its rivals
/// (those that the first round of [`diagnose`](super::diagnose) would try, without those that only a curve leads to). Zero where a rival fits better. A rival with more parameters that fits as well holds the
/// law as a special case, and is none. The last third of the recording is left out, as by a diagnosis without another recording.
///
/// # Errors
/// As a diagnosis.
pub fn margin(
    robot: &Robot,
    recording: &Recording,
    effect: &'static Effect,
    settings: &Settings,
) -> Result<f64, DiagnoseError> {
    let [fitted, _] = fitted_and_unseen(recording);
    let base = fit(robot, &[&fitted], Method::suited(Preset::Default, robot), settings, |_, _| {})?;
    let [(few, on_few), (bench, trial)] = benches(robot, &base, settings)?;
    let (candidates, _) = candidate::catalogue(robot, &[]);
    let events = Events::of(bench.trimmed(&trial)?, &candidates);
    let found = Search::at(&trial);
    let is_own = |scanned: &Scanned| scanned.named.effect.id == effect.id;
    let refitted = |(mut scanned, family): (Vec<Scanned>, Scan)| {
        // Its own class is that of the best.
        scanned.sort_by_key(|scanned| !is_own(scanned));
        let on = Refit {
            few: &few,
            on_few: &on_few,
            bench: &bench,
            found: &found,
            family: &family,
            events: &events,
            few_tell: true,
        };
        refit(&on, scanned)
    };
    let mut tried = refitted(scan(&few, &found.accepted, &on_few, &candidates)?);
    if !tried.iter().any(|scanned| is_own(scanned) && scanned.score > 0.0) {
        let usual: Vec<_> = candidates.iter().map(|candidate| candidate.first(USUAL_ALTERNATIVES)).collect();
        tried = refitted(scan(&bench, &found.accepted, &trial, &usual)?);
    }
    for s in &tried {
        tracing::debug!(effect = s.named.effect.id, score = s.score, freedom = s.freedom, "margin");
    }
    Ok(over_the_nearest(&tried, is_own))
}

fn over_the_nearest(refitted: &[Scanned], is_own: impl Fn(&Scanned) -> bool) -> f64 {
    let own = refitted.iter().filter(|scanned| is_own(scanned)).max_by(|a, b| a.score.total_cmp(&b.score));
    let Some(own) = own else { return 0.0 };
    let holds_it = |rival: &Scanned| rival.freedom > own.freedom && rival.score >= own.score;
    let rivals = refitted.iter().filter(|rival| !is_own(rival) && !holds_it(rival));
    let nearest = rivals.map(|rival| rival.score).fold(0.0, f64::max);
    (own.score - nearest).max(0.0)
}
