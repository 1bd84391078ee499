//! Refits: the best laws of a scan, and what they may be taken for, fitted in full on top of the current model.
//!
//! ```text
//! scan ─▶ the best four and their alias class ─▶ on few samples, to the end ─▶ those near the best ─▶ on the samples that decide
//! ```
//!
//! Laws of events start from what the recording shows of them ([`Events`]) and come first: few samples may not hold the event. One that is so
//! small that only the scan shows it is timed by scores (`event_time`).
//!
//! A scan is a tangent; where an effect is large the fit ends far from it, and in another order. Most laws are beaten clearly on few samples
//! already, at a third of the cost.

use std::sync::Arc;

use super::LEVEL;
use super::axes::{axes, is_of};
use super::candidate::Candidate;
use super::event_time::{beside, timed};
use super::found::{CurveFit, Named, Scanned, Search, laws};
use super::scan::Scan;
use super::significance::{p_of_family, p_of_score};
use super::worth::Scale;
use crate::calibrate::{Bench, Trial, Trimmed};
use crate::effect::Effect;
use crate::model::law::Law;

/// Laws that are refitted, besides what looks like the best.
const BEST: usize = 4;
/// Iterations of a law.
const ITERATIONS: usize = 20;
/// Of a law of events, which starts anew.
const EVENT_ITERATIONS: usize = 40;
/// A law whose score on few samples is less than this share of the best one's, and less by so much, is beaten.
pub const NEAR: (f64, f64) = (0.5, 24.0);

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
    /// Whether few samples show what there is: then they tell which laws are beaten. Else all that is refitted goes to the samples that decide.
    pub few_tell: bool,
    /// Laws started from what the recording shows of events and contacts.
    pub events: &'a Events,
}

/// What a recording shows of events and contacts, and the laws that say so.
#[derive(Debug, Default)]
pub struct Events {
    /// The base model beside them.
    pub trimmed: Option<Trimmed>,
    /// Laws, best first.
    pub named: Vec<Named>,
}

impl Events {
    /// Those of the laws of `candidates` that `trimmed` shows.
    pub fn of(trimmed: Option<Trimmed>, candidates: &[Candidate]) -> Self {
        let starts = |candidate: &Candidate| {
            let effect = candidate.effect;
            let laws = trimmed.as_ref().map_or_else(Vec::new, |trimmed| candidate.starts(&trimmed.clues));
            laws.into_iter().map(move |law| Named { effect, law })
        };
        let named = candidates.iter().flat_map(starts).collect();
        Events { trimmed, named }
    }
}

/// Refits the best of a scan and what the best may be taken for, and the laws of events, which the samples of the scan may not hold.
pub fn refit(on: &Refit<'_>, scanned: Vec<Scanned>) -> Vec<Scanned> {
    let is_in = |named: &&Named| on.found.accepted.iter().any(|accepted| accepted.named.effect.id == named.effect.id);
    let mut refitted: Vec<Scanned> =
        on.events.named.iter().filter(|named| !is_in(named)).map(|named| on.event(named.clone())).collect();
    // One that led nowhere from there may still be found as any other law is.
    refitted.retain(|event| event.score > 0.0);
    let others =
        scanned.into_iter().filter(|s| refitted.iter().all(|event| event.named.effect.id != s.named.effect.id));
    refitted.extend(best_of_scan(on, others.collect()));
    refitted
}

/// Refits what was bent out of its range with that held at the range's end: beside other effects that nobody has found yet a law may be bent on one
/// joint, and still be the truth on the others.
pub fn straighten(on: &Refit<'_>, refitted: &mut [Scanned]) {
    for s in refitted.iter_mut() {
        let Some(bent) = s.bent.take() else { continue };
        if !on.few_tell {
            on.within(s, &bent);
            continue;
        }
        let trial = on.few.fit_within(&bent, ITERATIONS).ok();
        on.judge(s, trial.as_ref(), on.on_few);
        s.on_few = trial.filter(|_| s.score > 0.0);
        if s.on_few.is_some() {
            on.in_full(s);
            if let Some(bent) = s.bent.take() {
                on.within(s, &bent);
            }
        }
        tracing::debug!(effect = s.named.effect.id, score = s.score, "straightened");
    }
}

/// Refits on the samples that decide what led nowhere, from the end of a curve where such a law acts: it has brought all the rest of the model to
/// where the law's own shape is the next step. Says whether that led anywhere.
pub fn from_a_curve(on: &Refit<'_>, curve: &CurveFit, refitted: &mut [Scanned]) -> bool {
    let hook = curve.curves.place.hook;
    let led_nowhere = |s: &&mut Scanned| s.score == 0.0 && s.bent.is_none() && s.named.law.hooks().contains(&hook);
    let mut leads = false;
    for s in refitted.iter_mut().filter(led_nowhere) {
        let ends = (&curve.trial, &curve.trial);
        let trial = on.bench.fit_from(&on.with(&s.named), ends, ITERATIONS).ok();
        on.judge(s, trial.as_ref(), &on.found.trial);
        s.trial = trial.filter(|_| s.score > 0.0);
        if let Some(bent) = s.bent.take() {
            on.within(s, &bent);
            s.bent = None;
        }
        on.sharpened(s);
        // What few samples made of it is not this.
        s.on_few = None;
        leads |= s.score > 0.0;
        tracing::debug!(effect = s.named.effect.id, score = s.score, by_curve = curve.score, "from a curve");
    }
    leads
}

/// What is beaten on few samples keeps its score there, as many times as there are more samples.
fn best_of_scan(on: &Refit<'_>, scanned: Vec<Scanned>) -> Vec<Scanned> {
    let Some(best) = scanned.first().filter(|best| best.p_family < LEVEL).map(|best| best.named.effect) else {
        return Vec::new();
    };
    let wanted = |place: usize, s: &Scanned| place < BEST || are_alike(best, s.named.effect);
    let found = scanned.into_iter().filter(|s| s.p_family < LEVEL).enumerate();
    let (first, others): (Vec<_>, Vec<_>) = found.partition(|(place, s)| wanted(*place, s));
    let try_it = |(_, s): (usize, Scanned)| {
        let scanned = if on.few_tell { on.few } else { on.bench };
        let named = timed(scanned.series(), (on.bench, &on.found.trial), s.named);
        if on.few_tell { on.on_few_samples(named) } else { on.at_once(named) }
    };
    let mut refitted: Vec<Scanned> = first.into_iter().map(try_it).collect();
    // A fit may end far from the tangent: what the best may be taken for then is tried too.
    if let Some(best) = refitted.iter().max_by(|a, b| a.score.total_cmp(&b.score)).map(|best| best.named.effect) {
        let alike = others.into_iter().filter(|(_, s)| are_alike(best, s.named.effect));
        refitted.extend(alike.map(try_it).collect::<Vec<_>>());
    }
    if !on.few_tell {
        return refitted;
    }
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

/// Whether one may be taken for the other.
pub fn are_alike(a: &Effect, b: &Effect) -> bool {
    a.confounded_with.contains(&b.id) || b.confounded_with.contains(&a.id)
}

impl Scanned {
    /// Nothing known yet of this law.
    fn untried(named: Named) -> Self {
        Scanned {
            trial: None,
            on_few: None,
            bent: None,
            score: 0.0,
            freedom: named.law.parameters().coordinates.len().max(1),
            p_family: 1.0,
            axes: Vec::new(),
            vif: None,
            named,
        }
    }
}

/// The same law with the corners that a search from afar would not get over. Events have them where they start.
fn sharp(named: &Named) -> Option<Named> {
    let law = named.law.sharp().filter(|_| !named.law.is_event())?;
    Some(Named { effect: named.effect, law })
}

impl Refit<'_> {
    fn on_few_samples(&self, named: Named) -> Scanned {
        let scanned = self.tried_on_few(named.clone());
        if scanned.score > 0.0 || scanned.bent.is_some() {
            return scanned;
        }
        // What led nowhere may be for want of its corners, or of a nearer start.
        if let Some(sharp) = sharp(&named) {
            return self.tried_on_few(sharp);
        }
        let tried = self.swinging_otherwise(&named).into_iter().map(|other| self.tried_on_few(other));
        let better =
            |a: &Scanned, b: &Scanned| a.score.total_cmp(&b.score).then(a.bent.is_some().cmp(&b.bent.is_some()));
        let best = tried.max_by(better);
        best.filter(|best| best.score > 0.0 || best.bent.is_some()).unwrap_or(scanned)
    }

    /// Of a law with joints of its own the other starts, as fast or as slow as a joint may swing: a tangent at one of them does not tell which is
    /// the nearest.
    fn swinging_otherwise(&self, named: &Named) -> Vec<Named> {
        let swings = !named.law.base_joints().is_empty() || named.law.structure().is_some();
        let starts = if swings { named.effect.laws(self.few.robot()).unwrap_or_default() } else { Vec::new() };
        let others = starts.into_iter().filter(|law| law.parameters() != named.law.parameters());
        others.map(|law| Named { law, ..named.clone() }).collect()
    }

    fn tried_on_few(&self, named: Named) -> Scanned {
        let trial = self.few.fit_on_top(&self.with(&named), self.on_few, ITERATIONS).ok();
        let mut scanned = Scanned::untried(named);
        self.judge(&mut scanned, trial.as_ref(), self.on_few);
        scanned.on_few = trial.filter(|_| scanned.score > 0.0);
        scanned
    }

    fn at_once(&self, named: Named) -> Scanned {
        let mut scanned = Scanned::untried(named);
        self.in_full(&mut scanned);
        scanned
    }

    /// The bent end of a fit on the samples that decide, fitted again within its ranges.
    fn within(&self, scanned: &mut Scanned, bent: &Trial) {
        if let Ok(trial) = self.bench.fit_within(bent, ITERATIONS) {
            self.judge(scanned, Some(&trial), &self.found.trial);
            scanned.trial = Some(trial).filter(|_| scanned.score > 0.0);
        }
    }

    fn in_full(&self, scanned: &mut Scanned) {
        let current = &self.found.trial;
        let from = scanned.on_few.as_ref().unwrap_or(current);
        let trial = self.bench.fit_from(&self.with(&scanned.named), (from, current), ITERATIONS).ok();
        self.judge(scanned, trial.as_ref(), current);
        scanned.trial = trial.filter(|_| scanned.score > 0.0);
        self.sharpened(scanned);
    }

    /// The same law with its corners, from where it ended without.
    fn sharpened(&self, scanned: &mut Scanned) {
        let Some((sharp, trial)) = sharp(&scanned.named).zip(scanned.trial.as_ref()) else { return };
        let mut other = Scanned::untried(sharp);
        let sharp = match self.bench.fit_from(&self.with(&other.named), (trial, trial), ITERATIONS) {
            Ok(sharp) => sharp,
            Err(error) => {
                tracing::debug!(effect = other.named.effect.id, %error, "sharp");
                return;
            }
        };
        self.judge(&mut other, Some(&sharp), &self.found.trial);
        tracing::debug!(effect = other.named.effect.id, score = other.score, before = scanned.score, "sharp");
        let scale = Scale::after(&sharp, self.bench.series().stages());
        if scale.worth(other.score, other.freedom) > scale.worth(scanned.score, scanned.freedom) {
            other.trial = Some(sharp);
            *scanned = other;
        }
    }

    /// An event that few samples may not hold, on all of them: not from the current model, which it has bent.
    fn event(&self, named: Named) -> Scanned {
        let current = &self.found.trial;
        let fit = |named: &Named| {
            let trimmed = self.events.trimmed.as_ref()?;
            self.bench.fit_trimmed(&self.with(named), (trimmed, current), EVENT_ITERATIONS).ok()
        };
        let moved = beside((self.bench, current), named.clone());
        let is_moved = moved.law.event_s() != named.law.event_s();
        let cost = |trial: &Option<Trial>| trial.as_ref().map_or(f64::INFINITY, |trial| trial.cost);
        let (as_told, beside) = (fit(&named), if is_moved { fit(&moved) } else { None });
        let is_better = cost(&beside) < cost(&as_told);
        let (named, trial) = if is_better { (moved, beside) } else { (named, as_told) };
        let mut scanned = Scanned::untried(named);
        self.judge(&mut scanned, trial.as_ref(), current);
        // The best of all samples and joints at which it was looked for.
        let looked_at = (self.bench.series().stages() * self.bench.series().joints()) as f64;
        let p = p_of_family(p_of_score(scanned.score / current.inflation, scanned.freedom), looked_at);
        scanned.p_family = self.family.p_of_family(p);
        let at_s = scanned.named.law.event_s();
        tracing::debug!(effect = scanned.named.effect.id, score = scanned.score, at_s, is_better, "event");
        scanned.trial = trial.filter(|_| scanned.score > 0.0);
        scanned
    }

    /// The model with one more law.
    fn with(&self, named: &Named) -> Vec<Arc<dyn Law>> {
        laws(self.found.accepted.iter().map(|accepted| &accepted.named).chain([named]))
    }

    /// What a trial says of the law. Nothing, where it ended at what no robot can have.
    fn judge(&self, scanned: &mut Scanned, trial: Option<&Trial>, current: &Trial) {
        scanned.score = 0.0;
        if let Some(trial) = trial.filter(|trial| trial.cost.is_finite()) {
            let own = trial.values.iter().filter(|value| is_of(scanned.named.effect, &value.name));
            if trial.is_possible() {
                scanned.score = (2.0 * (current.cost - trial.cost)).max(0.0);
                scanned.axes = axes(scanned.named.effect, trial);
                scanned.vif = own.map(|value| value.vif).filter(|vif| vif.is_finite()).reduce(f64::max);
            } else {
                let values: Vec<_> = own.map(|value| (&value.name, value.estimate, value.std_error)).collect();
                tracing::debug!(cost = trial.cost, ?values, "no robot can have this");
                scanned.bent = Some(trial.clone());
            }
        }
        scanned.p_family = self.family.p_of_family(p_of_score(scanned.score / current.inflation, scanned.freedom));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::calibrate::{Fit, Preset, fit};
    use crate::diagnose::{benches, candidate, curves, search};
    use crate::effect::Size;
    use crate::robot::Robot;
    use crate::simulate::{Direct, EffectChoice, Options, SHORT_MOTION};
    use solve::levenberg::Settings;

    /// A robot in which an effect of this level hides, with the base model fitted to its short motion.
    fn hidden(id: &str, level: f64, seed: u64) -> (Robot, Fit) {
        let robot = Robot::builtin("doggy").unwrap();
        let effects = vec![EffectChoice { effect: Effect::by_id(id).unwrap(), size: Size::Level(level) }];
        let options = Options { seed, effects, ..Options::new(robot.clone()) };
        let recording = Direct::record(&options, SHORT_MOTION).unwrap().recording;
        let fitted = fit(&robot, &[&recording], Preset::Default, &Settings::default(), |_, _| {}).unwrap();
        (robot, fitted)
    }

    #[test]
    fn a_rod_that_swings_fast_is_found_though_the_scan_starts_from_a_slow_one() {
        // 34 Hz and 11 Hz.
        let (robot, fitted) = hidden("structure_mode", -2.6, 1);
        let [(few, on_few), (bench, base)] = benches(&robot, &fitted, &Settings::default()).unwrap();
        let effect = Effect::by_id("structure_mode").unwrap();
        let slow = Named { effect, law: effect.laws(&robot).unwrap().swap_remove(0) };
        let family = Scan::of(&few.scores(&on_few, std::slice::from_ref(&slow.law)).unwrap(), on_few.inflation);

        let found = Search::at(&base);
        let (family, events) = (&family, &Events::default());
        let on = Refit { few: &few, on_few: &on_few, bench: &bench, found: &found, family, few_tell: true, events };
        let (from_slow, from_anywhere) = (on.tried_on_few(slow.clone()), on.on_few_samples(slow));
        assert_eq!(from_slow.score, 0.0);
        // 5,100 measured.
        assert!((4_900.0..5_300.0).contains(&from_anywhere.score), "{}", from_anywhere.score);
    }

    #[test]
    fn a_law_that_led_nowhere_is_found_from_a_curve_where_it_acts() {
        let (robot, fitted) = hidden("quadratic_drag", 0.0, 4);
        let bench = |part| Bench::new(&robot, part, &fitted, fitted.noise.clone(), Settings::default()).unwrap();
        let (few, on_few) = bench(fitted.series.excerpt(800, 4).unwrap());
        let (bench, base) = bench(fitted.series.clone());
        let (candidates, _) = candidate::catalogue(&robot, &[]);
        let (scanned, family) = search::scan(&few, &[], &on_few, &candidates).unwrap();
        let curve = curves::best_curves(&few, &on_few, (&bench, &base), 1).unwrap().swap_remove(0);
        let effect = Effect::by_id("quadratic_drag").unwrap();
        assert_eq!(curve.curves.place.row(), effect.row, "{:?}", curve.curves.place);

        let found = Search::at(&base);
        let (family, events) = (&family, &Events::default());
        let on = Refit { few: &few, on_few: &on_few, bench: &bench, found: &found, family, few_tell: true, events };
        let untried = |id: &str| {
            let of_effect = scanned.iter().find(|s| s.named.effect.id == id).unwrap();
            Scanned::untried(of_effect.named.clone())
        };
        // The second acts somewhere else; of the third something is known.
        let known = Scanned { score: 1.0, ..untried("quadratic_drag") };
        // Few samples led it somewhere, those that decide did not.
        let lost = Scanned { on_few: Some(on_few.clone()), ..untried("quadratic_drag") };
        let mut refitted = [lost, untried("cogging"), known];
        assert!(from_a_curve(&on, &curve, &mut refitted));
        let [drag, cogging, known] = &refitted;
        // 1.009 measured: the curve has paid for its many coefficients, and its bends are not quite the law.
        let share = drag.score / curve.score;
        assert!((1.0..1.02).contains(&share), "{share} of the curve's");
        assert!(drag.trial.is_some() && drag.on_few.is_none() && drag.p_family < LEVEL, "{}", drag.p_family);
        assert!(cogging.score == 0.0 && cogging.trial.is_none());
        assert!(known.score == 1.0 && known.trial.is_none());
    }
}
