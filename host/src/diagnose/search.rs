//! The search for causes: scan, refit, hold against curves without a shape, accept, drop, and again.
//!
//! ```text
//!   current model ─▶ scan (every law, one score) ─▶ refit the best and what looks like it ─▶ best law ┐
//!         ▲          scan of curves on every place ─▶ refit the best ─────────────────────▶ best curve ─┤
//!         │                                                                                               ▼
//!         └── drop or swap what it makes superfluous ◀── accepted where the law explains ≥ 80 % of the curve's part
//!                                                        else: a cause without a name
//! ```

use std::sync::Arc;

use super::candidate::{Candidate, Curves, PLACES, Place};
use super::scan::{Scan, Score};
use super::significance::p_of_score;
use crate::calibrate::{Bench, CalibrateError, Trial};
use crate::effect::{CATALOGUE, Effect};
use crate::model::law::{Law, Of};

/// Share of noise in which anything is found at all.
pub const LEVEL: f64 = 0.01;
/// Most causes.
const MOST_FINDINGS: usize = 4;
/// Laws that are refitted, besides what looks like the best.
const REFITS: usize = 4;
const REFIT_ITERATIONS: usize = 8;
/// Curves are linear in their coefficients.
const CURVE_ITERATIONS: usize = 3;
const CURVES_REFITTED: usize = 2;
/// Iterations of a model that stays.
const FINAL_ITERATIONS: usize = 25;
/// A named law explains this share of what the best curve does.
const NAMED_SHARE: f64 = 0.8;
/// Laws whose scores differ by less cannot be told apart.
const ALIAS: f64 = 12.0;

/// An effect with one of its laws.
#[derive(Debug, Clone)]
pub struct Named {
    /// Which.
    pub effect: &'static Effect,
    /// Its law.
    pub law: Arc<dyn Law>,
}

/// One law of the catalogue on top of the current model.
#[derive(Debug, Clone)]
pub struct Scanned {
    /// Which.
    pub named: Named,
    /// Its fit, if it has one.
    pub trial: Option<Trial>,
    /// Twice the log-likelihood gained.
    pub score: f64,
    /// Parameters that the motion shows.
    pub freedom: usize,
    /// Share of noise that would bring any candidate this far.
    pub p_family: f64,
    /// See [`axes`].
    pub axes: Vec<usize>,
    /// Of its parameters, the largest.
    pub vif: Option<f64>,
}

/// Curves on top of the current model.
#[derive(Debug, Clone)]
pub struct CurveFit {
    /// Which.
    pub curves: Curves,
    /// Their fit.
    pub trial: Trial,
    /// Twice the log-likelihood gained, less two for every coefficient.
    pub score: f64,
    /// Share of noise that would bring any of the curves this far.
    pub p_family: f64,
}

/// An accepted cause.
#[derive(Debug, Clone)]
pub struct Accepted {
    /// Which.
    pub named: Named,
    /// Twice the log-likelihood gained when it came in.
    pub score: f64,
    /// See [`Scanned::p_family`].
    pub p_family: f64,
    /// What was refitted in its place.
    pub rivals: Vec<Rival>,
}

/// A law that was tried in the place of an accepted one.
#[derive(Debug, Clone)]
pub struct Rival {
    /// Which.
    pub effect: &'static Effect,
    /// Twice the log-likelihood gained.
    pub score: f64,
    /// See [`axes`].
    pub axes: Vec<usize>,
    /// Whether this motion cannot tell it from the accepted one.
    pub is_alias: bool,
}

/// What a search found.
#[derive(Debug)]
pub struct Search {
    /// In the order in which they were accepted.
    pub accepted: Vec<Accepted>,
    /// The model with all of them.
    pub trial: Trial,
    /// The scan of the base model.
    pub first_scan: Vec<Scanned>,
    /// The best curves on top of the base model.
    pub first_curves: Vec<CurveFit>,
    /// What curves still find on top of the final model, best first.
    pub left: Vec<CurveFit>,
    /// The best law that did not hold its own against a curve, where the search ended for that.
    pub refused: Option<Scanned>,
}

/// Laws in the catalogue's order: a plant's line asks them so.
fn laws<'a>(named: impl Iterator<Item = &'a Named>) -> Vec<Arc<dyn Law>> {
    let place = |effect: &Effect| CATALOGUE.iter().position(|other| other.id == effect.id);
    let mut sorted: Vec<&Named> = named.collect();
    sorted.sort_by_key(|named| place(named.effect));
    sorted.into_iter().map(|named| named.law.clone()).collect()
}

/// Searches from the base model, a trial on each bench: `few` samples for the scan of everything, `bench` for what decides. `step` is told
/// what begins.
///
/// # Errors
/// As a calibration's, of a model that was accepted; a candidate that cannot be fitted is passed over.
pub fn search(
    (few, few_base): (&Bench<'_>, &Trial),
    (bench, base): (&Bench<'_>, &Trial),
    candidates: &[Candidate],
    step: &dyn Fn(&str),
) -> Result<Search, CalibrateError> {
    let mut found = Search {
        accepted: Vec::new(),
        trial: base.clone(),
        first_scan: Vec::new(),
        first_curves: Vec::new(),
        left: Vec::new(),
        refused: None,
    };
    let mut on_few = few_base.clone();
    loop {
        step("scanning the catalogue");
        let (mut scanned, family) = scan(few, &found.accepted, &on_few, candidates)?;
        scanned.sort_by(|a, b| b.score.total_cmp(&a.score));
        if found.accepted.is_empty() {
            found.first_scan = scanned.clone();
        }
        note("scan", scanned.iter().take(12));
        step("refitting the best");
        let mut refitted = refit(bench, &found, scanned, &family);
        let samples = bench.series().stages();
        refitted.sort_by(|a, b| worth(b, samples).total_cmp(&worth(a, samples)));
        note("refit", refitted.iter());
        step("holding them against curves");
        let mut curves = curves(few, &on_few, (bench, &found.trial))?;
        curves.sort_by(|a, b| b.score.total_cmp(&a.score));
        if found.accepted.is_empty() {
            found.first_curves = curves.clone();
        }
        for c in &curves {
            tracing::debug!(place = ?c.curves.place, score = c.score, p = c.p_family, "curve");
        }
        // A law has to earn its parameters besides: what the null of the draws does not hold, a clock that jitters, gains a little too.
        let best = refitted.first().filter(|best| best.p_family < LEVEL && worth(best, samples) > 0.0).cloned();
        let rival = curves.first().filter(|curve| curve.p_family < LEVEL);
        let holds = |best: &Scanned| rival.is_none_or(|curve| best.score >= NAMED_SHARE * curve.score);
        match best {
            Some(best) if holds(&best) && found.accepted.len() < MOST_FINDINGS => {
                accept(bench, &mut found, best, &refitted)?;
                on_few = few.fit(&all_laws(&found), &found.trial, FINAL_ITERATIONS)?;
            }
            best => {
                found.refused = best;
                found.left = curves;
                return Ok(found);
            }
        }
    }
}

/// For the log.
fn note<'a>(what: &str, scanned: impl Iterator<Item = &'a Scanned>) {
    for s in scanned {
        tracing::debug!(effect = s.named.effect.id, score = s.score, freedom = s.freedom, p = s.p_family, "{what}");
    }
}

/// What a law is worth on so many samples: its score less Schwarz's price of its parameters. A law that contains another one as a special
/// case gains as much; the simpler one is meant.
fn worth(scanned: &Scanned, samples: usize) -> f64 {
    scanned.score - scanned.freedom as f64 * (samples.max(2) as f64).ln()
}

/// The best alternative of every candidate that is not in yet, and the scan that they come from.
fn scan(
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
    let scan = Scan::of(&bench.scores(current, &laws)?);
    let mut best: Vec<Scanned> = Vec::new();
    for (named, score) in named.into_iter().zip(&scan.scores) {
        let scanned = Scanned {
            score: score.as_ref().map_or(0.0, |score| score.score),
            freedom: score.as_ref().map_or(0, |score| score.freedom),
            p_family: score.as_ref().map_or(1.0, |score| scan.p_of_family(score.p)),
            axes: score.as_ref().map_or_else(Vec::new, |score| axes_of_score(&named, score)),
            vif: score.as_ref().map(|score| score.vif),
            trial: None,
            named,
        };
        match best.last_mut().filter(|last| last.named.effect.id == scanned.named.effect.id) {
            Some(last) if last.score >= scanned.score => {}
            Some(last) => *last = scanned,
            None => best.push(scanned),
        }
    }
    Ok((best, scan))
}

/// The joints (1-based) in whose coordinates a score shows.
fn axes_of_score(named: &Named, score: &Score) -> Vec<usize> {
    let coordinates = &named.law.parameters().coordinates;
    let first = score.z.len() - coordinates.len();
    let mut axes: Vec<usize> = coordinates
        .iter()
        .zip(&score.z[first..])
        .filter(|(_, z)| z.abs() > 3.0)
        .filter_map(|(coordinate, _)| if let Of::Joint(joint) = coordinate.of { Some(joint + 1) } else { None })
        .collect();
    axes.sort_unstable();
    axes.dedup();
    axes
}

/// Fits a law together with what has been accepted.
fn try_on_top(bench: &Bench<'_>, found: &Search, named: Named, family: &Scan) -> Scanned {
    let (accepted, current) = (&found.accepted, &found.trial);
    let all = accepted.iter().map(|accepted| &accepted.named).chain([&named]);
    let trial = bench.fit(&laws(all), current, REFIT_ITERATIONS).ok().filter(|trial| trial.cost.is_finite());
    let score = trial.as_ref().map_or(0.0, |trial| 2.0 * (current.cost - trial.cost)).max(0.0);
    let freedom = named.law.parameters().coordinates.len().max(1);
    let (mut joints, mut vif) = (Vec::new(), None);
    if let Some(trial) = &trial {
        joints = axes(named.effect, trial);
        let own = trial.values.iter().filter(|value| is_of(named.effect, &value.name));
        vif = own.map(|value| value.vif).filter(|vif| vif.is_finite()).reduce(f64::max);
    }
    let p_family = family.p_of_family(p_of_score(score, freedom));
    Scanned { p_family, named, trial, score, freedom, axes: joints, vif }
}

/// Refits the best of a scan and what the best may be taken for.
fn refit(bench: &Bench<'_>, found: &Search, scanned: Vec<Scanned>, family: &Scan) -> Vec<Scanned> {
    let Some(best) = scanned.first().filter(|best| best.p_family < LEVEL).map(|best| best.named.effect) else {
        return Vec::new();
    };
    let alike =
        |effect: &Effect| best.confounded_with.contains(&effect.id) || effect.confounded_with.contains(&best.id);
    let wanted = |place: usize, s: &Scanned| place < REFITS || alike(s.named.effect);
    scanned
        .into_iter()
        .enumerate()
        .filter(|(place, s)| s.p_family < LEVEL && wanted(*place, s))
        .map(|(_, s)| try_on_top(bench, found, s.named, family))
        .collect()
}

/// The best curves: places by a scan of few samples, refitted on the samples that decide.
fn curves(
    few: &Bench<'_>,
    on_few: &Trial,
    (bench, current): (&Bench<'_>, &Trial),
) -> Result<Vec<CurveFit>, CalibrateError> {
    let laws: Vec<Arc<dyn Law>> = PLACES.iter().map(|place| place.curves(few, on_few).law).collect();
    let scan = Scan::of(&few.scores(on_few, &laws)?);
    let worth = |score: &Score| score.score - 2.0 * score.freedom as f64;
    let mut places: Vec<(Place, f64)> = PLACES
        .into_iter()
        .zip(&scan.scores)
        .filter_map(|(place, score)| Some((place, worth(score.as_ref()?))))
        .collect();
    places.sort_by(|a, b| b.1.total_cmp(&a.1));
    let fit = |place: &Place| {
        let curves = place.curves(bench, current);
        let freedom = curves.law.parameters().coordinates.len();
        let mut laws = current.laws.clone();
        laws.push(curves.law.clone());
        let trial = bench.fit(&laws, current, CURVE_ITERATIONS).ok().filter(|trial| trial.cost.is_finite())?;
        let gained = 2.0 * (current.cost - trial.cost);
        let p_family = scan.p_of_family(p_of_score(gained, freedom));
        Some(CurveFit { curves, trial, score: gained - 2.0 * freedom as f64, p_family })
    };
    Ok(places.iter().take(CURVES_REFITTED).filter_map(|(place, _)| fit(place)).collect())
}

fn accept(bench: &Bench<'_>, found: &mut Search, best: Scanned, refitted: &[Scanned]) -> Result<(), CalibrateError> {
    let samples = bench.series().stages();
    let rivals = refitted
        .iter()
        .filter(|other| other.named.effect.id != best.named.effect.id)
        .map(|other| Rival {
            effect: other.named.effect,
            score: other.score,
            axes: other.axes.clone(),
            is_alias: worth(&best, samples) - worth(other, samples) < ALIAS,
        })
        .collect();
    found.accepted.push(Accepted { named: best.named, score: best.score, p_family: best.p_family, rivals });
    let from = best.trial.unwrap_or_else(|| found.trial.clone());
    found.trial = bench.fit(&all_laws(found), &from, FINAL_ITERATIONS)?;
    // What came in first may have stood for what came in last.
    let mut place = 0;
    while found.accepted.len() > 1 && place + 1 < found.accepted.len() {
        let (trial, lost) = found.without(bench, place)?;
        let dropped = &found.accepted[place].named;
        let p = p_of_score(lost, dropped.law.parameters().coordinates.len());
        tracing::debug!(effect = dropped.effect.id, lost, p, "drop?");
        if p > LEVEL {
            found.accepted.remove(place);
            found.trial = trial;
        } else {
            place += 1;
        }
    }
    Ok(())
}

fn all_laws(found: &Search) -> Vec<Arc<dyn Law>> {
    laws(found.accepted.iter().map(|accepted| &accepted.named))
}

impl Search {
    /// The model without one of the accepted, and what is lost: twice the log-likelihood.
    ///
    /// # Errors
    /// As a calibration's.
    pub fn without(&self, bench: &Bench<'_>, place: usize) -> Result<(Trial, f64), CalibrateError> {
        let others = self.accepted.iter().enumerate().filter(|(other, _)| *other != place);
        let trial = bench.fit(&laws(others.map(|(_, accepted)| &accepted.named)), &self.trial, REFIT_ITERATIONS)?;
        let lost = 2.0 * (trial.cost - self.trial.cost);
        Ok((trial, lost))
    }
}

/// Whether a result is a parameter of this effect.
pub fn is_of(effect: &Effect, name: &str) -> bool {
    name.strip_prefix(effect.id).is_some_and(|rest| rest.starts_with('.'))
}

/// The joints (1-based) in whose parameters an effect shows: more than three standard errors from nothing, and no less than a twentieth of
/// the largest. Empty for effects that are no joint's.
pub fn axes(effect: &Effect, trial: &Trial) -> Vec<usize> {
    let prefix = format!("{}.", effect.id);
    let joint = |name: &str| -> Option<usize> {
        let index = name.strip_prefix(&prefix)?.split_once('[')?.1.strip_suffix(']')?;
        index.parse().ok()
    };
    let of_joints: Vec<_> = trial
        .values
        .iter()
        .filter(|value| !value.name.contains(".phi") && !value.name.contains(".q0") && !value.name.contains(".tau"))
        .filter_map(|value| Some((joint(&value.name)?, value)))
        .collect();
    let significance =
        |value: &crate::calibrate::TrialValue| value.std_error.map_or(0.0, |error| value.estimate.abs() / error);
    let unit_largest = |unit: &str| {
        of_joints.iter().filter(|(_, v)| v.unit == unit).map(|(_, v)| v.estimate.abs()).fold(0.0, f64::max)
    };
    let mut axes: Vec<usize> = of_joints
        .iter()
        .filter(|(_, value)| significance(value) > 3.0 && value.estimate.abs() > 0.05 * unit_largest(value.unit))
        .map(|(joint, _)| *joint)
        .collect();
    axes.sort_unstable();
    axes.dedup();
    axes
}
