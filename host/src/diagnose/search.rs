//! The search for causes: scan, refit, hold against curves without a shape, accept, drop, and again.
//!
//! ```text
//!   current model ─▶ scan (every law, one score) ─▶ refit the best and what looks like it ─▶ best law ┐
//!         ▲          scan of curves on every place ─▶ refit the best ─────────────────────▶ best curve ─┤
//!         │                 no law holds: those that led nowhere are refitted from its end ─────────────┤
//!         │                                                                                               ▼
//!         └── drop or swap what it makes superfluous ◀── accepted where the law, or it with another one, explains ≥ 80 % of the curve's part
//!                                                        else: a cause without a name
//! ```

use std::sync::Arc;

use super::axes::axes_of_score;
use super::candidate::Candidate;
use super::curves::{REFITTED, best_curves};
use super::found::{Accepted, CurveFit, FINAL_ITERATIONS, LEVEL, Named, Scanned, Search, laws};
use super::refit::{Events, Refit, from_a_curve, refit, straighten};
use super::scan::Scan;
use super::settle::accept;
use super::worth::{Scale, is_rest, keeps};
use crate::calibrate::{Bench, CalibrateError, Trial};
use crate::effect::{Effect, Row};
use crate::model::law::Law;

/// Alternatives of a law that are scanned on the samples that decide, where few samples show nothing and no curve points to it: a scan costs in
/// proportion to both.
pub const USUAL_ALTERNATIVES: usize = 2;
/// A score of few samples that hardly tells one law from another.
const WEAK: f64 = 100.0;
/// Most causes.
const MOST_FINDINGS: usize = 4;
/// A named law explains this share of what the best curve does, or of what causes did one of which cannot be.
pub const NAMED_SHARE: f64 = 0.8;
/// What a law explains is hardly ever more than so many times the score of a scan, which is a tangent.
const TANGENT: f64 = 10.0;
/// Of two laws together.
const PAIR_ITERATIONS: usize = 8;

/// Why a cause may have to go again.
#[derive(Debug, Clone, Copy)]
enum Doubt {
    /// No robot can have its parameters.
    Impossible,
    /// It explains too little of what a curve does, if not together with another cause on this equation.
    Leans(Row),
}

/// Searches from the base model, a trial on each bench: `few` samples for the scan of everything, `bench` for what decides. `unseen` is ½ Σ r²,
/// a sample, of samples that are on neither bench, with the parameters of a trial. `step` is told what begins.
///
/// # Errors
/// As a calibration's, of a model that was accepted; a candidate that cannot be fitted is passed over.
pub fn search(
    (few, few_base): (&Bench<'_>, &Trial),
    (bench, base): (&Bench<'_>, &Trial),
    unseen: &dyn Fn(&Trial) -> Option<f64>,
    (candidates, events): (&[Candidate], &Events),
    step: &dyn Fn(&str),
) -> Result<Search, CalibrateError> {
    let mut found = Search::at(base);
    let mut on_few = few_base.clone();
    // Where the search stood when it accepted a cause that no robot can have, or that does not hold its own against a curve, unless another
    // one is found beside it.
    let mut before_doubt: Option<(Search, Doubt)> = None;
    // And before it accepted any.
    let mut before_all: Option<Search> = None;
    loop {
        step("scanning the catalogue");
        let (mut scanned, of_few) = scan(few, &found.accepted, &on_few, candidates)?;
        let (of_enough, mut family);
        family = &of_few;
        step("refitting the best");
        let on = |family, few_tell| Refit { few, on_few: &on_few, bench, found: &found, family, events, few_tell };
        let mut few_tell = true;
        let samples = bench.series().stages();
        let best_first = |refitted: &mut Vec<Scanned>| {
            let scale = Scale::of(refitted, &found.trial, samples);
            refitted.sort_by(|a, b| scale.worth(b.score, b.freedom).total_cmp(&scale.worth(a.score, a.freedom)));
            note("refit", refitted.iter());
        };
        let explained = 2.0 * (base.cost - found.trial.cost);
        tracing::debug!(explained, left = 2.0 * found.trial.cost, inflation = found.trial.inflation, samples, "model");
        let more = samples as f64 / few.series().stages().max(1) as f64;
        let may_earn = |s: &Scanned| !is_rest(&found.accepted, explained, s, TANGENT * more * s.score);
        let mut refitted = refit(&on(family, few_tell), scanned.iter().filter(|s| may_earn(s)).cloned().collect());
        best_first(&mut refitted);
        step("holding them against curves");
        // Beside a law that explains nearly all that is left there is no rival: one curve shows its shape.
        let left = 2.0 * found.trial.cost;
        let is_contested = refitted.first().is_none_or(|best| best.score < NAMED_SHARE * left);
        let most = if is_contested { REFITTED } else { 1 };
        let curves = best_curves(few, &on_few, (bench, &found.trial), most)?;
        // A law has to earn its parameters besides: what the null of the draws does not hold, a clock that jitters, gains a little too.
        let earns = |s: &&Scanned| {
            let scale = Scale::after(s.trial.as_ref().unwrap_or(&found.trial), samples);
            let earned = scale.worth(s.score, s.freedom) > 0.0;
            s.p_family < LEVEL && earned && !is_rest(&found.accepted, explained, s, s.score)
        };
        // A model that runs away where the one before did not is no robot's, however well its steps fit one after the other.
        let is_sound = |s: &&Scanned| {
            let bad = |trial: &Trial| bench.runs_away(trial) && !bench.runs_away(&found.trial);
            let is_kept = |s: &Scanned| found.accepted.is_empty() || keeps(s, &found.trial, samples, unseen);
            earns(s) && !s.trial.as_ref().is_some_and(bad) && is_kept(s)
        };
        let rival = curves.first().filter(|curve| curve.p_family < LEVEL);
        let enough = |score: f64| rival.is_none_or(|curve| score >= NAMED_SHARE * curve.score);
        let may_go_on = found.accepted.len() < MOST_FINDINGS;
        let may_lean = found.accepted.len() + 1 < MOST_FINDINGS;
        let is_held = |best: &Scanned, refitted: &[Scanned]| {
            enough(best.score) || may_lean && enough(with_another(bench, &found, best, refitted, enough))
        };
        let mut best = refitted.iter().find(is_sound).cloned();
        // What few samples show well and nothing may be made of, more samples show too. What they hardly show may be anything; beside a cause that
        // has been found, most likely what its law leaves.
        if best.is_none() && found.accepted.is_empty() && scanned.iter().all(|s| s.p_family >= LEVEL || s.score < WEAK)
        {
            step("scanning more samples");
            let points_to = |candidate: &Candidate| {
                let acts_on = |hook| candidate.alternatives.first().is_some_and(|law| law.hooks().contains(&hook));
                rival.is_some_and(|curve| acts_on(curve.curves.place.hook))
            };
            let some_of = |candidate: &Candidate| {
                if points_to(candidate) { candidate.clone() } else { candidate.first(USUAL_ALTERNATIVES) }
            };
            let usual: Vec<Candidate> = candidates.iter().map(some_of).collect();
            (scanned, of_enough) = scan(bench, &found.accepted, &found.trial, &usual)?;
            (family, few_tell) = (&of_enough, false);
            refitted = refit(&on(family, few_tell), scanned.clone());
            best_first(&mut refitted);
            best = refitted.iter().find(is_sound).cloned();
        }
        let mut holds = may_go_on && best.as_ref().is_some_and(|best| is_held(best, &refitted));
        let judged = |refitted: &mut Vec<Scanned>| {
            best_first(refitted);
            let best = refitted.iter().find(is_sound).cloned();
            let holds = best.as_ref().is_some_and(|best| is_held(best, refitted));
            (best, holds)
        };
        // A first cause may be bent by a second one; after a sound one it is what that leaves.
        let may_be_bent = found.accepted.is_empty() || before_doubt.is_some();
        if may_go_on && may_be_bent && !holds && rival.is_some() && refitted.iter().any(|s| s.bent.is_some()) {
            straighten(&on(family, few_tell), &mut refitted);
            (best, holds) = judged(&mut refitted);
        }
        if let Some(curve) = rival.filter(|_| may_go_on && !holds)
            && from_a_curve(&on(family, few_tell), curve, &mut refitted)
        {
            (best, holds) = judged(&mut refitted);
        }
        if found.accepted.is_empty() {
            found.first_scan = scanned;
            found.first_curves = curves.clone();
        }
        match best {
            Some(best) if holds => {
                let from = best.on_few.clone();
                let (before, refused) = (found.clone(), best.clone());
                let (leans, row) = (!enough(best.score), best.named.effect.row);
                if before.accepted.is_empty() {
                    before_all =
                        Some(Search { refused: Some(refused.clone()), left: curves.clone(), ..before.clone() });
                }
                accept(bench, &mut found, best, &refitted)?;
                let is_possible = found.trial.is_possible();
                if !is_possible {
                    found.trial = bench.fit_within(&found.trial, FINAL_ITERATIONS)?;
                }
                let doubt = match (is_possible, leans) {
                    (false, _) => Some(Doubt::Impossible),
                    (true, true) => Some(Doubt::Leans(row)),
                    (true, false) => None,
                };
                before_doubt = match (before_doubt, doubt) {
                    // What leans waits for a cause on its own equation.
                    (Some((before, Doubt::Leans(on))), None) if on != row => Some((before, Doubt::Leans(on))),
                    (_, None) => None,
                    (Some((first, _)), Some(doubt)) => Some((first, doubt)),
                    (None, Some(doubt)) => Some((Search { refused: Some(refused), left: curves, ..before }, doubt)),
                };
                on_few = match from {
                    Some(fitted) if fitted.has_laws(&found.laws()) => fitted,
                    from => few.fit(&found.laws(), from.as_ref().unwrap_or(&found.trial), FINAL_ITERATIONS)?,
                };
                if !is_possible && !on_few.is_possible() {
                    on_few = few.fit_within(&on_few, FINAL_ITERATIONS)?;
                }
            }
            best => {
                let is_disputed = rival.is_some();
                found.refused = best;
                found.left = curves;
                let found = match before_doubt {
                    // Nothing is left that would speak against it.
                    Some((_, Doubt::Leans(_))) if !is_disputed => found,
                    Some((before, _)) => before,
                    None => found,
                };
                return Ok(before_all.filter(|_| imitates_a_curve(&found, base)).unwrap_or(found));
            }
        }
    }
}

/// Whether what was found are pieces of one cause that has no name. Spring, constant and an encoder's error together are nearly gravity: then one curve
/// explains more on the base model than all of them, and a curve on the same place is still missing beside them. True causes leave it nothing.
fn imitates_a_curve(found: &Search, base: &Trial) -> bool {
    let explained = 2.0 * (base.cost - found.trial.cost);
    let Some(first) = found.first_curves.first().filter(|first| first.score >= explained) else { return false };
    let is_missing = |left: &CurveFit| left.curves.place == first.curves.place && left.p_family < LEVEL;
    let imitates = found.accepted.len() > 1 && found.left.iter().any(is_missing);
    tracing::debug!(explained, by_one_curve = first.score, imitates, "pieces of one curve?");
    imitates
}

/// What the best law gains together with another of the refitted ones on the same equation, as soon as that is `enough`: where two causes follow
/// the same argument, one curve takes both, and neither alone holds its own against it.
fn with_another(
    bench: &Bench<'_>,
    found: &Search,
    best: &Scanned,
    refitted: &[Scanned],
    enough: impl Fn(f64) -> bool,
) -> f64 {
    let Some(trial) = &best.trial else { return best.score };
    let samples = bench.series().stages();
    let mut most = best.score;
    let others = refitted.iter().filter(|other| other.named.effect.id != best.named.effect.id);
    for other in others.filter(|other| other.named.effect.row == best.named.effect.row && other.score > 0.0) {
        let named = found.accepted.iter().map(|accepted| &accepted.named).chain([&best.named, &other.named]);
        let Ok(both) = bench.fit(&laws(named), trial, PAIR_ITERATIONS) else { continue };
        let gained = 2.0 * (trial.cost - both.cost);
        if Scale::after(&both, samples).worth(gained, other.freedom) > 0.0 {
            most = most.max(best.score + gained);
        }
        if enough(most) {
            break;
        }
    }
    most
}

/// For the log.
fn note<'a>(what: &str, scanned: impl Iterator<Item = &'a Scanned>) {
    for s in scanned {
        let inflation = s.trial.as_ref().map(|trial| trial.inflation);
        tracing::debug!(
            effect = s.named.effect.id,
            score = s.score,
            freedom = s.freedom,
            p = s.p_family,
            inflation,
            "{what}"
        );
    }
}

/// The best alternative of every candidate that is not in yet, and the scan that they come from; best first.
///
/// # Errors
/// As a calibration's.
pub fn scan(
    bench: &Bench<'_>,
    accepted: &[Accepted],
    current: &Trial,
    candidates: &[Candidate],
) -> Result<(Vec<Scanned>, Scan), CalibrateError> {
    let is_in = |effect: &Effect| accepted.iter().any(|accepted| accepted.named.effect.id == effect.id);
    let others = candidates.iter().filter(|candidate| !is_in(candidate.effect));
    let named: Vec<Named> = others
        .flat_map(|candidate| candidate.alternatives.iter().map(|law| (candidate.effect, law)))
        .map(|(effect, law)| Named { effect, law: law.clone() })
        .collect();
    let laws: Vec<Arc<dyn Law>> = named.iter().map(|named| named.law.clone()).collect();
    let scan = Scan::of(&bench.scores(current, &laws)?, current.inflation);
    let mut best: Vec<Scanned> = Vec::new();
    for (named, score) in named.into_iter().zip(&scan.scores) {
        let scanned = Scanned {
            score: score.as_ref().map_or(0.0, |score| score.score),
            freedom: score.as_ref().map_or(0, |score| score.freedom),
            p_family: score.as_ref().map_or(1.0, |score| scan.p_of_family(score.p)),
            axes: score.as_ref().map_or_else(Vec::new, |score| axes_of_score(&*named.law, score)),
            vif: score.as_ref().map(|score| score.vif),
            trial: None,
            on_few: None,
            bent: None,
            named,
        };
        match best.last_mut().filter(|last| last.named.effect.id == scanned.named.effect.id) {
            Some(last) if last.score >= scanned.score => {}
            Some(last) => *last = scanned,
            None => best.push(scanned),
        }
    }
    best.sort_by(|a, b| b.score.total_cmp(&a.score));
    note("scan", best.iter().take(12));
    Ok((best, scan))
}
