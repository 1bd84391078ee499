//! Forward selection by what a law gains out of sample.
//!
//! ```text
//!   current model ─▶ scan by blocks ─▶ refit the best, and what is collinear with them ─▶ gain of other blocks, with its interval
//!        ▲                                                                                   │ supported, enough, and half of what a curve gains
//!        └── drop what no longer gains, exchange what a rival explains better ◀── add ◀──────┘            else: the next best, or end
//! ```
//! Nothing is rolled back and nothing is struck out for another one's sake.

use std::sync::Arc;

use super::axes::axes_of_step;
use super::block_scores::{LawScore, collinearity, score_laws};
use super::catalogue::{Candidate, Named};
use super::criteria::{
    BLOCKS, COLLINEAR, COVERED, IMPLAUSIBLE, LEAST_OF_BEST, LEAST_SHARE, LEVEL, MOST_FINDINGS, PROMISING, REFITTED,
    RIVALS_REFITTED, SCAN_SAMPLES, SIEVE,
};
use super::curves::curves;
use super::events::{at_worst_times, p_of_event, timed};
use super::interval::{Gain, bca, standard_error};
use super::plausibility::Plausibility;
use super::refit::{Fitted, Refit};
use super::rivals::{Contender, best, weights};
use super::significance::{p_of_both, p_of_family, p_of_gains, p_of_score};
use crate::calibrate::{BlockScores, CalibrateError};
use crate::effect::Effect;
use crate::model::law::Law;

/// What the scan says of an effect: of its best start.
#[derive(Debug, Clone)]
pub struct Scanned {
    /// Which.
    pub named: Named,
    /// What the blocks say.
    pub score: LawScore,
    /// Share of worlds without any effect in which any law comes this far.
    pub p_family: f64,
    /// Joints (1-based) in whose coordinates it shows.
    pub axes: Vec<usize>,
}

/// A law that was refitted in the place of an accepted one.
#[derive(Debug, Clone)]
pub struct Rival {
    /// Which.
    pub named: Named,
    /// What it gains out of sample.
    pub gain: f64,
    /// Its weight beside the accepted one and the other rivals.
    pub weight: f64,
    /// Joints (1-based).
    pub axes: Vec<usize>,
}

/// An accepted cause.
#[derive(Debug, Clone)]
pub struct Accepted {
    /// Which.
    pub named: Named,
    /// What it gained in each block out of sample when it came in.
    pub gains: Vec<f64>,
    /// See [`Scanned::p_family`]; of what blocks lose without it beside the others, and when it came in.
    pub p_family: f64,
    /// When it came in.
    p_when_added: f64,
    /// Its weight among its rivals.
    pub weight: f64,
    /// What is collinear with it.
    pub rivals: Vec<Rival>,
    /// Whether it happened once: no other block can know of it.
    pub is_event: bool,
}

impl Accepted {
    fn add_rival(&mut self, other: &Accepted) {
        if self.rivals.iter().all(|rival| rival.named.effect.id != other.named.effect.id) {
            let axes = axes_of_step_free(&*other.named.law);
            let gain = other.gains.iter().sum();
            self.rivals.push(Rival { named: other.named.clone(), gain, weight: 0.0, axes });
        }
    }
}

/// What a selection came to.
#[derive(Debug, Clone)]
pub struct Selection {
    /// In the order in which they were accepted.
    pub accepted: Vec<Accepted>,
    /// The model with all of them.
    pub current: Fitted,
    /// The base model.
    pub base: Fitted,
    /// The scan of the base model, best first.
    pub scan: Vec<Scanned>,
    /// Effects whose columns are not numbers.
    pub not_finite: Vec<(&'static str, usize)>,
    /// Laws that a scan looks at.
    tests: usize,
    /// The models before each cause came in, as long as none has left.
    path: Vec<Fitted>,
    /// The model without each cause, and what each block loses, where that is known of what is accepted now.
    losses: Option<Vec<Loss>>,
}

/// The model without a cause, and what each block loses without it.
pub type Loss = (Fitted, Vec<f64>);

impl Selection {
    /// Nothing is accepted yet.
    fn of(base: Fitted) -> Self {
        Selection {
            accepted: Vec::new(),
            current: base.clone(),
            base,
            scan: Vec::new(),
            not_finite: Vec::new(),
            tests: 1,
            path: Vec::new(),
            losses: None,
        }
    }

    /// Another model takes the place of the current one.
    fn replace(&mut self, current: Fitted) -> Fitted {
        self.losses = None;
        self.path.clear();
        std::mem::replace(&mut self.current, current)
    }

    /// A cause comes in, with the model that has it.
    fn push(&mut self, accepted: Accepted, with: Fitted) {
        let mut path = std::mem::take(&mut self.path);
        let follows = path.len() == self.accepted.len();
        let before = self.replace(with);
        path.push(before);
        if follows {
            self.path = path;
        }
        self.accepted.push(accepted);
    }

    /// The model before the last cause came in, if that is known.
    fn before_last(&self) -> Option<&Fitted> {
        self.path.last().filter(|_| self.path.len() == self.accepted.len())
    }

    /// Takes a cause out, whose model without it is known.
    pub fn remove(&mut self, place: usize, without: Fitted) -> Accepted {
        let mut path = std::mem::take(&mut self.path);
        let is_last = place + 1 == self.accepted.len() && path.len() == self.accepted.len();
        self.replace(without);
        if is_last {
            path.pop();
            self.path = path;
        }
        self.accepted.remove(place)
    }
}

/// The sum of what blocks gain, as a share.
pub fn share(gains: &[f64], of: f64) -> Gain {
    let sum = |blocks: &mut dyn Iterator<Item = usize>| {
        let (mut sum, mut count) = (0.0, 0);
        for block in blocks {
            sum += gains[block];
            count += 1;
        }
        sum * gains.len() as f64 / f64::from(count.max(1))
    };
    let scale = of.max(f64::MIN_POSITIVE);
    let ci95 = bca(gains.len(), sum).map(|[low, high]| [low / scale, high / scale]);
    Gain { share: gains.iter().sum::<f64>() / scale, ci95, blocks: gains.len() }
}

/// The scan of all candidates that are not in yet.
struct Scan {
    scores: BlockScores,
    /// Laws with a score.
    count: usize,
    /// Best first.
    scanned: Vec<Scanned>,
    not_finite: Vec<(&'static str, usize)>,
}

/// A refit on top of the current model.
#[derive(Clone)]
struct Tried {
    named: Named,
    fitted: Fitted,
    gains: Vec<f64>,
    p_family: f64,
    freedom: usize,
    is_event: bool,
    score: Option<LawScore>,
    axes: Vec<usize>,
}

/// Passes of additions and of what they make superfluous.
const PASSES: usize = 2;

/// Searches from the base model. `clues` are laws started from what the recording shows of events and contacts; `step` is told what begins.
///
/// # Errors
/// As a calibration's, of a model that was accepted; a law that cannot be fitted is passed over.
pub fn select(
    refit: &Refit<'_>,
    base: Fitted,
    (candidates, clues): (&[Candidate], &[Named]),
    plausibility: &Plausibility,
    step: &dyn Fn(&str),
) -> Result<Selection, CalibrateError> {
    let mut selection = Selection::of(base);
    grow(refit, &mut selection, (candidates, clues), plausibility, step)?;
    Ok(selection)
}

/// Adds what is supported and drops what that makes superfluous.
///
/// # Errors
/// As a calibration's, of a model that was accepted.
pub fn grow(
    refit: &Refit<'_>,
    selection: &mut Selection,
    (candidates, clues): (&[Candidate], &[Named]),
    plausibility: &Plausibility,
    step: &dyn Fn(&str),
) -> Result<(), CalibrateError> {
    for _ in 0..PASSES {
        add(refit, selection, (candidates, clues), plausibility, step)?;
        step("looking at what stands for something else");
        let dropped = drop_superfluous(refit, selection)?;
        let exchanged = exchange(refit, selection, plausibility);
        if !(dropped || exchanged) {
            break;
        }
    }
    Ok(())
}

/// Adds laws until none is supported.
fn add(
    refit: &Refit<'_>,
    selection: &mut Selection,
    (candidates, clues): (&[Candidate], &[Named]),
    plausibility: &Plausibility,
    step: &dyn Fn(&str),
) -> Result<(), CalibrateError> {
    while selection.accepted.len() < MOST_FINDINGS {
        step("scanning the catalogue");
        let scan = scan(refit, selection, candidates)?;
        step("refitting the best");
        let tried = refitted(refit, selection, &scan, clues);
        if selection.accepted.is_empty() {
            selection.scan.clone_from(&scan.scanned);
        }
        selection.not_finite.clone_from(&scan.not_finite);
        selection.tests = selection.tests.max(scan.count);
        let mut left = tried;
        let (chosen, fitted) = loop {
            let Some((chosen, fitted)) = choose(&selection.current, &scan, left.clone(), plausibility) else {
                return Ok(());
            };
            if matters(selection, &chosen) && covers(refit, selection, &chosen) {
                break (chosen, fitted);
            }
            left.retain(|tried| tried.named.effect.id != chosen.named.effect.id);
        };
        tracing::debug!(effect = chosen.named.effect.id, weight = chosen.weight, "accepted");
        selection.push(chosen, refit.reweighted(fitted));
    }
    Ok(())
}

/// What a law has to gain beside what is explained already.
fn least_gain(selection: &Selection) -> f64 {
    let explained: f64 = selection.current.gains_over(&selection.base).iter().sum();
    LEAST_SHARE / (1.0 - LEAST_SHARE) * explained.max(0.0)
}

/// Whether a law gains enough.
fn matters(selection: &Selection, chosen: &Accepted) -> bool {
    chosen.gains.iter().sum::<f64>() >= least_gain(selection)
}

/// The cost that a law has to come to for that: a gain is n ln of what the cost falls by.
fn cost_that_matters(selection: &Selection) -> f64 {
    let freedom: f64 = selection.current.freedom.iter().sum();
    selection.current.trial.cost * (-least_gain(selection) / freedom.max(1.0)).exp()
}

/// Whether a law gains enough of what the best curve on its row does: what predicts better than nothing, and far worse than a curve, is the shadow of something else.
fn covers(refit: &Refit<'_>, selection: &Selection, chosen: &Accepted) -> bool {
    let (bench, trial) = refit.bench.thinned(&selection.current.trial, refit.samples(SCAN_SAMPLES) / BLOCKS);
    let Ok(curves) = curves(&bench, &trial, &bench.is_contiguous()) else { return true };
    let more = refit.bench.series().stages() as f64 / bench.series().stages().max(1) as f64;
    let on_row = curves.iter().filter(|curve| curve.place.row() == chosen.named.effect.row && curve.p_family < LEVEL);
    let best = on_row.map(|curve| more * curve.gain()).fold(0.0, f64::max);
    let own: f64 = chosen.gains.iter().sum();
    tracing::debug!(effect = chosen.named.effect.id, own, best_curve = best, "covered?");
    own >= COVERED * best
}

fn scan(refit: &Refit<'_>, selection: &Selection, candidates: &[Candidate]) -> Result<Scan, CalibrateError> {
    let current = &selection.current.trial;
    let (bench, trial) = refit.bench.thinned(current, refit.samples(SCAN_SAMPLES) / BLOCKS);
    let is_in = |effect: &Effect| selection.accepted.iter().any(|accepted| accepted.named.effect.id == effect.id);
    let mut named: Vec<Named> = Vec::new();
    for candidate in candidates.iter().filter(|candidate| !is_in(candidate.effect)) {
        let is_timed = candidate.alternatives.iter().any(|law| law.event_s().is_some());
        let laws =
            if is_timed { at_worst_times(&refit.bench, current, candidate)? } else { candidate.alternatives.clone() };
        named.extend(laws.into_iter().map(|law| Named { effect: candidate.effect, law }));
    }
    let laws: Vec<Arc<dyn Law>> = named.iter().map(|named| named.law.clone()).collect();
    let scores = bench.block_scores(&trial, &laws)?;
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
    Ok(Scan { scores, count, scanned, not_finite })
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

/// Refits of what the scan shows best, of what is collinear with the best, and of events.
fn refitted(refit: &Refit<'_>, selection: &Selection, scan: &Scan, clues: &[Named]) -> Vec<Tried> {
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
            axes: axes_of_step_free(&*named.law),
            named,
            fitted,
        }));
    }
    let is_event = |s: &&Scanned| s.named.law.event_s().is_some();
    let (mut events, others): (Vec<&Scanned>, Vec<&Scanned>) = scan.scanned.iter().partition(is_event);
    events.retain(|event| event.p_family < LEVEL);
    let most = others.iter().map(|s| s.score.score).fold(0.0, f64::max);
    // What no more than white noise would show is not refitted. A first sieve: coloured noise passes it.
    let shows = |s: &&Scanned| p_of_family(p_of_score(s.score.score, s.score.freedom), scan.count) < SIEVE;
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

/// The family's p of a law by its scan and by its refit: a tangent may show less than there is.
fn of_refit(scanned: &Scanned, gains: &[f64], tests: usize) -> f64 {
    p_of_both(scanned.p_family, p_of_family(p_of_gains(gains), tests))
}

fn axes_of_step_free(law: &dyn Law) -> Vec<usize> {
    let joints = law.parameters().coordinates.iter().filter_map(|coordinate| match coordinate.of {
        crate::model::law::Of::Joint(joint) => Some(joint + 1),
        _ => None,
    });
    let mut axes: Vec<usize> = joints.collect();
    axes.dedup();
    axes
}

/// Whether an addition is supported: out of sample, and against noise.
fn is_supported(tried: &Tried) -> bool {
    let gain = share(&tried.gains, 1.0);
    let supported = tried.is_event || gain.is_supported();
    tracing::debug!(
        effect = tried.named.effect.id,
        gain = gain.share,
        ci95 = ?gain.ci95,
        p = tried.p_family,
        gains = ?tried.gains.iter().map(|g| g.round() as i64).collect::<Vec<_>>(),
        "supported?"
    );
    supported && (!tried.is_event || tried.p_family < LEVEL) && gain.share > 0.0
}

/// The law that is added, if any is supported, and the model with it.
fn choose(current: &Fitted, scan: &Scan, tried: Vec<Tried>, plausibility: &Plausibility) -> Option<(Accepted, Fitted)> {
    let gain = |tried: &Tried| tried.gains.iter().sum::<f64>();
    let contender = |tried: &Tried| Contender {
        gains: tried.fitted.squares_saved_over(current),
        freedom: tried.freedom,
        implausibility: plausibility.of_law(tried.named.effect, &tried.fitted.trial),
    };
    let is_possible = |tried: &Tried| {
        let impossible = plausibility.impossible(tried.named.effect, &*tried.named.law, &tried.fitted.trial);
        if let Some(value) = impossible {
            tracing::debug!(
                effect = tried.named.effect.id,
                name = value.name,
                value = value.estimate,
                "no robot has this"
            );
        }
        impossible.is_none()
    };
    let mut supported: Vec<bool> = tried.iter().map(|tried| is_supported(tried) && is_possible(tried)).collect();
    // A size that no robot has is the last resort.
    let is_plausible = |i: usize| plausibility.of_law(tried[i].named.effect, &tried[i].fitted.trial) <= IMPLAUSIBLE;
    if (0..tried.len()).any(|i| supported[i] && is_plausible(i)) {
        (0..tried.len()).for_each(|i| supported[i] &= is_plausible(i));
    }
    let top =
        (0..tried.len()).filter(|i| supported[*i]).max_by(|a, b| gain(&tried[*a]).total_cmp(&gain(&tried[*b])))?;
    // Those that may stand for it: their columns do the same to the residuals.
    let alike = |i: usize| match (&tried[top].score, &tried[i].score) {
        (Some(of), Some(by)) => collinearity(&scan.scores, of, by).max(collinearity(&scan.scores, by, of)) > COLLINEAR,
        _ => tried[i].named.effect.id == tried[top].named.effect.id,
    };
    let class: Vec<usize> = (0..tried.len()).filter(|i| *i == top || alike(*i) && gain(&tried[*i]) > 0.0).collect();
    let contenders: Vec<Contender> = class.iter().map(|i| contender(&tried[*i])).collect();
    let weights = weights(&contenders);
    let of_supported: Vec<Contender> =
        class.iter().zip(&contenders).filter(|(i, _)| supported[**i]).map(|(_, c)| c.clone()).collect();
    let places: Vec<usize> = class.iter().copied().filter(|i| supported[*i]).collect();
    let chosen = places[best(&of_supported)?];
    let rivals = class.iter().zip(&weights).filter(|(i, _)| **i != chosen).map(|(i, weight)| Rival {
        named: tried[*i].named.clone(),
        gain: gain(&tried[*i]),
        weight: *weight,
        axes: tried[*i].axes.clone(),
    });
    let mut rivals: Vec<Rival> = rivals.collect();
    rivals.sort_by(|a, b| b.weight.total_cmp(&a.weight).then(b.gain.total_cmp(&a.gain)));
    let weight = class.iter().zip(&weights).find(|(i, _)| **i == chosen).map_or(1.0, |(_, weight)| *weight);
    let tried = tried.into_iter().nth(chosen)?;
    let accepted = Accepted {
        named: tried.named,
        gains: tried.gains,
        p_family: tried.p_family,
        p_when_added: tried.p_family,
        weight,
        rivals,
        is_event: tried.is_event,
    };
    Some((accepted, tried.fitted))
}

/// The model without the cause at `place`, and what each block loses.
///
/// # Errors
/// As a calibration's.
fn without(refit: &Refit<'_>, selection: &Selection, place: usize) -> Result<Loss, CalibrateError> {
    let is_last = place + 1 == selection.accepted.len();
    let fitted = match selection.before_last() {
        Some(before) if is_last => before.clone(),
        _ => {
            let others = selection.accepted.iter().enumerate().filter(|(other, _)| *other != place);
            let others: Vec<&Named> = others.map(|(_, accepted)| &accepted.named).collect();
            refit.of(&others, &selection.current)?
        }
    };
    let lost = if selection.accepted[place].is_event {
        selection.current.own_gains_over(&fitted)
    } else {
        selection.current.gains_over(&fitted)
    };
    Ok((fitted, lost))
}

/// The model without each cause, and what each block loses. Where a model cannot be fitted it is the base model, and the loss what the cause gained when it came in.
pub fn losses(refit: &Refit<'_>, selection: &mut Selection) -> Vec<Loss> {
    if let Some(losses) = selection.losses.take() {
        return losses;
    }
    let of = |place: usize| {
        without(refit, selection, place).unwrap_or_else(|error| {
            tracing::debug!(%error, "the model without a finding cannot be fitted");
            (selection.base.clone(), selection.accepted[place].gains.clone())
        })
    };
    (0..selection.accepted.len()).map(of).collect()
}

/// What came in first may have stood for what came in last: dropped where the others predict as well without it.
fn drop_superfluous(refit: &Refit<'_>, selection: &mut Selection) -> Result<bool, CalibrateError> {
    let before = selection.accepted.len();
    let mut losses: Vec<Loss> = Vec::new();
    while losses.len() < selection.accepted.len() {
        let place = losses.len();
        let (fitted, lost) = without(refit, selection, place)?;
        let gain = share(&lost, 1.0);
        let tests = selection.tests;
        let accepted = &mut selection.accepted[place];
        let p = p_of_both(accepted.p_when_added, p_of_family(p_of_gains(&lost), tests));
        accepted.p_family = if accepted.is_event { accepted.p_when_added } else { p };
        let is_needed = gain.is_supported() && accepted.p_family < LEVEL || accepted.is_event && gain.share > 0.0;
        tracing::debug!(effect = selection.accepted[place].named.effect.id, lost = gain.share, ci95 = ?gain.ci95, p, "drop?");
        if is_needed {
            losses.push((fitted, lost));
        } else {
            let dropped = selection.remove(place, fitted);
            // What came in after it explains the same: should that not last, it has its turn again.
            for later in &mut selection.accepted[place..] {
                later.add_rival(&dropped);
            }
            losses.clear();
        }
    }
    selection.losses = Some(losses);
    Ok(selection.accepted.len() < before)
}

/// Beside another cause, what predicted best alone may be predicted better by a rival.
fn exchange(refit: &Refit<'_>, selection: &mut Selection, plausibility: &Plausibility) -> bool {
    let mut exchanged = false;
    if selection.accepted.len() < 2 {
        return exchanged;
    }
    for place in 0..selection.accepted.len() - 1 {
        let is_in = |named: &Named| selection.accepted.iter().any(|other| other.named.effect.id == named.effect.id);
        let rival = selection.accepted[place].rivals.iter().position(|rival| !is_in(&rival.named));
        let Some(rival) = rival else { continue };
        let other = selection.accepted[place].rivals[rival].named.clone();
        let others = selection.accepted.iter().enumerate().filter(|(i, _)| *i != place).map(|(_, a)| &a.named);
        let with: Vec<&Named> = others.chain([&other]).collect();
        let Ok(fitted) = refit.of(&with, &selection.current) else { continue };
        let gains = fitted.gains_over(&selection.current);
        let (gain, error) = (gains.iter().sum::<f64>(), standard_error(&gains));
        let is_plausible = plausibility.of_law(other.effect, &fitted.trial)
            <= plausibility.of_law(selection.accepted[place].named.effect, &selection.current.trial).max(3.0);
        tracing::debug!(
            effect = selection.accepted[place].named.effect.id,
            by = other.effect.id,
            gain,
            error,
            "exchange?"
        );
        if gain > error && is_plausible {
            let before = std::mem::replace(&mut selection.accepted[place].named, other);
            let old = &mut selection.accepted[place].rivals[rival];
            (old.named, old.gain) = (before, old.gain - gain);
            selection.replace(fitted);
            exchanged = true;
        }
    }
    exchanged
}
