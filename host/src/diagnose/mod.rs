//! The diagnosis: what a calibrated model gets wrong, by which law, and what knowing it brings.
//!
//! ```text
//!   recording ─▶ calibration of the base model ─▶ bench (frozen yardstick) ─▶ search ─▶ verdict
//!                                                                               │
//!   second recording ────────────────────────────── gain of the extended calibration ◀──┘
//! ```
//!
//! The method is that of stochastic grey-box models (Kristensen, Madsen, Jørgensen 2004): fix the noise first, look for what explains the
//! residuals under it. New is that the cause is named: every law of the catalogue is tried, and a name has to hold its own against any smooth
//! curve on the same equation.

mod axes;
mod bootstrap;
mod candidate;
mod curves;
mod event_time;
mod found;
mod gain;
mod margin;
mod refit;
mod result;
pub mod scan;
mod search;
mod settle;
mod shapeless;
mod significance;
mod spline;
mod tell;
mod waves;
mod windows;
mod worth;
mod yardstick;

pub use bootstrap::Gain;
pub use found::LEVEL;
pub use margin::margin;
pub use result::{
    Candidate, ChannelGain, Defect, Diagnosis, Finding, NotTestable, Picture, Rival, Unexplained, Verdict,
};
pub use yardstick::yardstick;

use std::cell::OnceCell;
use std::ops::Range;

use found::Search;
use refit::Events;

use crate::calibrate::{Bench, CalibrateError, Fit, Method, Preset, Series, Trial, extend_as, fit};
use crate::effect::{Effect, EffectError};
use crate::model::Model;
use crate::recording::Recording;
use crate::robot::Robot;
use crate::verify::VerifyError;
use solve::levenberg::Settings;

/// Samples that everything is tried on, of a robot with [`STATES`] states. Fewer states cost less, and a short motion in a few windows may
/// always be caught in the same phase.
const FEW_SAMPLES: usize = 4_000;
/// States of Doggy.
const STATES: usize = 12;
/// Samples that decide; of a recording three times as long windows are taken.
const ENOUGH_SAMPLES: usize = 12_000;
/// Trials end at this relative change of the cost: a thousandth of what tells two laws apart. Wrong models crawl on for long.
const ENOUGH: f64 = 1e-6;
/// And after so many iterations.
const MOST_ITERATIONS: usize = 25;
/// Windows of a bench.
const WINDOWS: usize = 8;

/// Why a recording cannot be diagnosed.
#[derive(Debug, thiserror::Error)]
pub enum DiagnoseError {
    /// No base model to begin with.
    #[error(transparent)]
    Calibrate(#[from] CalibrateError),
    /// The second recording cannot be predicted.
    #[error(transparent)]
    Verify(#[from] VerifyError),
    /// An id that `--without` names.
    #[error(transparent)]
    Effect(#[from] EffectError),
}

/// How to diagnose.
#[derive(Debug, Clone, Default)]
pub struct Options {
    /// Ids of the catalogue that are left out.
    pub without: Vec<String>,
    /// Of all searches.
    pub settings: Settings,
}

/// Diagnoses `recording` of `robot`. The gain is measured on `holdout`, or on the last third of the recording, which the fits then do not see.
/// `step` is told what begins.
///
/// # Errors
/// [`DiagnoseError`].
pub fn diagnose(
    robot: &Robot,
    recording: &Recording,
    holdout: Option<&Recording>,
    options: &Options,
    step: &dyn Fn(&str),
) -> Result<Diagnosis, DiagnoseError> {
    for id in &options.without {
        Effect::by_id(id)?;
    }
    let parts = fitted_and_unseen(recording);
    let (fitted, unseen) = holdout.map_or((&parts[0], &parts[1]), |holdout| (recording, holdout));
    step("calibrating the base model");
    let base = fit(robot, &[fitted], Method::suited(Preset::Default, robot), &options.settings, |_, _| {})?;
    let [(few, few_base), (bench, trial)] = benches(robot, &base, &options.settings)?;
    let (mut candidates, unsuited) = candidate::catalogue(robot, &options.without);
    let mut events = Events::of(bench.trimmed(&trial)?, &candidates);
    let others = OnceCell::new();
    let cost_of_others = |trial: &Trial| {
        let others = others.get_or_init(|| {
            let series = Series::of(robot, &[unseen]);
            bench.of_others(series.excerpt(FEW_SAMPLES, WINDOWS).unwrap_or(series))
        });
        let samples = others.series().stages();
        (samples > 0).then(|| others.cost_as(trial).ok().map(|cost| cost / samples as f64)).flatten()
    };
    let mut found = search::search((&few, &few_base), (&bench, &trial), &cost_of_others, (&candidates, &events), step)?;

    let extended = loop {
        step("calibrating the extended model");
        let ids: Vec<&str> = found.accepted.iter().map(|accepted| accepted.named.effect.id).collect();
        if ids.is_empty() {
            break base.clone();
        }
        let known = (&ids[..], &found.trial, &bench);
        let extended = extend_as(robot, &[fitted], &base, known, &options.settings, |i, iteration| {
            tracing::trace!(
                i,
                cost = iteration.cost,
                damping = iteration.damping,
                trials = iteration.trials,
                "extended"
            );
        })?;
        let Some(law) = found.trial.impossible_in(&extended.calibration) else { break extended };
        // What the whole recording leads where no robot can be stood for something else, and what came in after it was found beside it.
        let impossible = found.cause_of(law);
        tracing::debug!(effect = impossible.id, "no robot can have it: searched again without");
        candidates.retain(|candidate| candidate.effect.id != impossible.id);
        events.named.retain(|named| named.effect.id != impossible.id);
        let first = std::mem::take(&mut found.first_scan);
        let explained = |found: &Search| trial.cost - found.trial.cost;
        let with_impossible = explained(&found);
        found = search::search((&few, &few_base), (&bench, &trial), &cost_of_others, (&candidates, &events), step)?;
        let named: Vec<&str> = found.accepted.iter().map(|accepted| accepted.named.effect.id).collect();
        if stands_in((&named, explained(&found)), (&ids, with_impossible)) {
            let curves = found.first_curves;
            found = Search { left: curves.clone(), first_curves: curves, ..Search::at(&trial) };
        }
        // What it stood for is there, though nothing may be left to name it.
        found.refused = found.refused.or_else(|| first.iter().find(|s| s.named.effect.id == impossible.id).cloned());
        found.first_scan = first;
    };
    step("measuring the gain");
    let gain = if found.accepted.is_empty() {
        Vec::new()
    } else {
        gain::gain(&base.calibration, &extended.calibration, unseen, options.settings.threads)?
    };
    let holdout = holdout.map(|recording| recording.source.path.display().to_string());
    Ok(tell::tell(&bench, &trial, &found, (&base, extended), gain, unsuited, holdout)?)
}

/// Whether causes were named only because another one cannot be: none of them was found beside it, and they explain clearly less than was explained
/// with it. Then neither is what is there.
fn stands_in((named, explained): (&[&str], f64), (before, with_impossible): (&[&str], f64)) -> bool {
    let were_found = named.iter().any(|id| before.contains(id));
    !named.is_empty() && !were_found && explained < search::NAMED_SHARE * with_impossible
}

/// The two thirds of a recording that are fitted where there is no other, and the last one.
fn fitted_and_unseen(recording: &Recording) -> [Recording; 2] {
    let cut = recording.len() * 2 / 3;
    [recording.part(0..cut), recording.part(cut..recording.len())]
}

/// The base model on few samples, and on those that decide.
fn benches<'r>(robot: &'r Robot, base: &Fit, settings: &Settings) -> Result<[(Bench<'r>, Trial); 2], CalibrateError> {
    let noise = yardstick(robot, &base.series);
    let settings = Settings { relative_cost_change: ENOUGH, max_iterations: MOST_ITERATIONS, ..settings.clone() };
    let bench = |part: Series| Bench::new(robot, part, base, noise.clone(), settings.clone());
    let states = Model::new(robot).layout().size().min(STATES);
    let few = (FEW_SAMPLES * STATES * STATES / (states * states)).min(ENOUGH_SAMPLES);
    let even = |samples: usize| base.series.spread(samples, WINDOWS);
    let part = |samples: usize, windows: Option<Vec<Range<usize>>>| {
        windows.map_or_else(|| base.series.clone(), |windows| base.series.excerpt_of(&windows, samples / WINDOWS))
    };
    let enough = bench(part(ENOUGH_SAMPLES, even(ENOUGH_SAMPLES)))?;
    if even(ENOUGH_SAMPLES).is_none() {
        return Ok([bench(part(few, even(few)))?, enough]);
    }
    let costs = enough.0.of_others(base.series.clone()).costs_as(&enough.1)?;
    let elsewhere = |samples: usize| {
        let (even, length) = (even(samples)?, samples / WINDOWS);
        let ends = base.series.recordings.iter().map(|recording| recording.end);
        let moving: Vec<Range<usize>> = base.series.moving(length).zip(ends).map(|(start, end)| start..end).collect();
        let noise = 0.5 * base.series.channels.len() as f64;
        windows::elsewhere(&even, length, &moving, (&costs, noise))
    };
    let Some(windows) = elsewhere(ENOUGH_SAMPLES) else { return Ok([bench(part(few, even(few)))?, enough]) };
    tracing::debug!(?windows, "the samples that decide");
    let few = bench(part(few, elsewhere(few).or_else(|| even(few))))?;
    Ok([few, bench(part(ENOUGH_SAMPLES, Some(windows)))?])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::Size;
    use crate::link;
    use crate::simulate::{self, Direct, EffectChoice};

    /// A robot whose belt jumps where windows that are spread evenly over seventy seconds do not look.
    const JUMPS_BETWEEN: u64 = 1;

    #[test]
    fn what_explains_less_than_what_cannot_be_is_no_cause_either() {
        let hysteresis = (&["belt_hysteresis"][..], 162.0);
        assert!(stands_in((&["link_friction"], 60.0), hysteresis));
        // As good as it, found beside it, nothing at all.
        assert!(!stands_in((&["link_friction"], 150.0), hysteresis));
        assert!(!stands_in((&["link_friction"], 60.0), (&["link_friction", "belt_hysteresis"], 162.0)));
        assert!(!stands_in((&[], 0.0), hysteresis));
    }

    #[test]
    fn the_samples_that_decide_hold_what_happens_once() {
        let robot = Robot::builtin("doggy").unwrap();
        let motion = firmware::motion::preset::calibration(&link::joint_limits(&robot));
        let effects = vec![EffectChoice { effect: Effect::by_id("belt_tooth_skip").unwrap(), size: Size::Level(-1.0) }];
        let options = simulate::Options { seed: JUMPS_BETWEEN, effects, ..simulate::Options::new(robot.clone()) };
        let Direct { recording, effects, .. } = Direct::record(&options, &toml::to_string(&motion).unwrap()).unwrap();
        let jump_s = effects[0].parameters.iter().find(|value| value.unit == "s").unwrap().value;
        let settings = Settings::default();
        let method = Method::suited(Preset::Default, &robot);
        let base = fit(&robot, &[&recording], method, &settings, |_, _| {}).unwrap();
        let holds = |series: &Series| {
            let near = (0..series.stages()).filter(|k| (series.time_s(*k) - jump_s).abs() < 0.02).count();
            near >= 20
        };
        let even = base.series.excerpt(ENOUGH_SAMPLES, WINDOWS).unwrap();
        assert!(!holds(&even), "the jump at {jump_s} s is in the even windows: another seed");
        let [(few, _), (bench, _)] = benches(&robot, &base, &settings).unwrap();
        assert!(holds(few.series()) && holds(bench.series()), "{jump_s} s");
        let ratio = bench.series().stages() as f64 / even.stages() as f64;
        assert!((0.9..=1.0).contains(&ratio), "{ratio} times as many samples");
    }
}
