//! The diagnosis: what a calibrated model gets wrong, by which law, and what knowing it brings.
//!
//! ```text
//!   recordings ─▶ calibration of the base model ─▶ bench: blocks of time, fixed noise ─▶ selection ─▶ extended calibration
//!                                                        │ does it fit at all?              │
//!   another motion ────────────────────────── asked once: joint gain of all, of each ◀──────┘──▶ result
//! ```
//!
//! The method is that of stochastic grey-box models (Kristensen, Madsen, Jørgensen 2004): fix the noise first, look for what explains the
//! residuals under it. One currency decides: the prediction of blocks of time that a fit has not seen. One error model goes with it: the scatter between blocks.
//! Every objection is a number or a flag on a finding; none deletes another finding.

mod axes;
mod blocks;
mod catalogue;
pub mod criteria;
mod curves;
mod holdout;
mod interval;
mod margin;
mod plausibility;
mod refit;
mod report;
mod result;
mod rivals;
mod scores;
mod selection;
mod stretch;
mod yardstick;

pub use criteria::LEVEL;
pub use interval::Gain;
pub use margin::margin;
pub use report::base_fit::AT_NOISE;
pub use result::{
    BaseFit, Candidate, ChannelFit, ChannelGain, Defect, Diagnosis, Finding, Flag, HoldoutGain, HorizonGain,
    NotTestable, OverTime, Picture, Rejected, Rival, Unexplained, Verdict,
};
pub use scores::block_scores::{LawScore, block_scores, score_laws};
pub use scores::significance::p_of_family;
pub use scores::stability::Stability;
pub use stretch::Stretch;
pub use yardstick::yardstick;

use criteria::{BLOCKS, LEAST_BLOCK, SAMPLES, WORST_BLOCKS};
use holdout::{Holdout, judge};
use plausibility::Plausibility;
use refit::{Fitted, Refit, samples_for};
use report::Evidence;
use scores::events;
use selection::{Search, Selection};

use crate::calibrate::{Bench, CalibrateError, Fit, Method, Preset, Trial, extend_as, fit};
use crate::effect::{Effect, EffectError};
use crate::model::Model;
use crate::recording::Recording;
use crate::robot::Robot;
use solve::levenberg::Settings;

/// Trials end at this relative change of the cost: half a unit of the likelihood where the model fits. Wrong models crawl on for long.
const ENOUGH: f64 = 1e-4;
/// And after so many iterations.
const MOST_ITERATIONS: usize = 25;
/// Iterations of each search of the calibration with the findings, which starts where the bench has ended.
const EXTENDED_ITERATIONS: usize = 25;

/// Why a recording cannot be diagnosed.
#[derive(Debug, thiserror::Error)]
pub enum DiagnoseError {
    /// No base model to begin with.
    #[error(transparent)]
    Calibrate(#[from] CalibrateError),
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

/// Diagnoses recordings of `robot` together. The gain is measured on `holdout`, or on the last third of each recording, which the fits then do not see.
/// `step` is told what begins.
///
/// # Errors
/// [`DiagnoseError`], where there is no base model. What fails later is told in the result.
pub fn diagnose(
    robot: &Robot,
    recordings: &[&Recording],
    holdout: Option<&Recording>,
    options: &Options,
    step: &dyn Fn(&str),
) -> Result<Diagnosis, DiagnoseError> {
    for id in &options.without {
        Effect::by_id(id)?;
    }
    let parts: Vec<[Recording; 2]> = recordings.iter().map(|recording| fitted_and_unseen(recording)).collect();
    let (fitted, unseen): (Vec<&Recording>, Vec<&Recording>) = match holdout {
        Some(holdout) => (recordings.to_vec(), vec![holdout]),
        None => (parts.iter().map(|part| &part[0]).collect(), parts.iter().map(|part| &part[1]).collect()),
    };
    let settings = &options.settings;
    step("calibrating the base model");
    let base = fit(robot, &fitted, Method::suited(Preset::Default, robot), settings, |_, _| {})?;
    let (bench, trial) = bench(robot, &base, settings)?;
    let contiguous = bench.is_contiguous();
    let (candidates, unsuited) = catalogue::catalogue(robot, &base.series.readings(), &options.without);
    let plausibility = Plausibility::of(&bench, &trial);
    let is_contact = |law: &std::sync::Arc<dyn crate::model::law::Law>| law.is_event() && law.event_s().is_none();
    let has_contacts = candidates.iter().any(|candidate| candidate.alternatives.iter().any(is_contact));
    let is_wrong = base.noise.steps_over(&yardstick(robot, &base.series)) > criteria::WRONG;
    let trimmed = if has_contacts && is_wrong { bench.trimmed().unwrap_or_default() } else { None };
    let clues = events::from_clues(trimmed.as_ref(), &candidates);
    let on_bench = Fitted::of(&bench, &contiguous, trial)?;
    let refit = Refit { bench, contiguous, trimmed };
    let on_bench = refit.reweighted(refit.reweighted(on_bench));
    let search = Search { refit: &refit, candidates: &candidates, clues: &clues, plausibility: &plausibility, step };
    let mut selection = search.select(on_bench)?;

    step("looking for curves");
    let thinned = |trial: &Trial| {
        let (bench, trial, more) = refit.thinned(trial);
        let contiguous = bench.is_contiguous();
        (curves::Ceiling::of(&bench, &trial, &contiguous, &[]).map(|c| c.curves).unwrap_or_default(), more)
    };
    let first_curves = selection.base_curves.clone().unwrap_or_else(|| thinned(&selection.base.trial).0);
    step("predicting the other motion");
    let unseen = Holdout::new(robot, &unseen);
    let grow = |selection: &mut Selection, rejected: &[Rejected]| {
        let is_left = |effect: &Effect| rejected.iter().all(|other| other.effect != effect.id);
        let candidates: Vec<_> = candidates.iter().filter(|c| is_left(c.effect)).cloned().collect();
        let clues: Vec<_> = clues.iter().filter(|clue| is_left(clue.effect)).cloned().collect();
        if let Err(error) = (Search { candidates: &candidates, clues: &clues, ..search }).grow(selection) {
            tracing::debug!(%error, "nothing takes the place of what was rejected");
        }
    };
    let (judged, rejected) = judge::judge(&refit, &unseen, &mut selection, &grow);
    let (left, scale) =
        if selection.accepted.is_empty() { (first_curves.clone(), 1.0) } else { thinned(&selection.current.trial) };

    step("calibrating the extended model");
    let extended = extended(robot, &fitted, &base, (&selection, &refit.bench), settings);
    let holdout = holdout.map(|recording| recording.source.path.display().to_string());
    let evidence =
        Evidence { refit: &refit, plausibility: &plausibility, selection: &selection, first_curves, left, scale };
    Ok(report::report(&evidence, (judged, rejected), (&base, extended), unsuited, holdout))
}

/// The calibration of all samples with the laws of a selection; none where there are none, or where it fails.
fn extended(
    robot: &Robot,
    recordings: &[&Recording],
    base: &Fit,
    (selection, bench): (&Selection, &Bench<'_>),
    settings: &Settings,
) -> Option<Fit> {
    let ids: Vec<&str> = selection.accepted.iter().map(|accepted| accepted.named.effect.id).collect();
    if ids.is_empty() {
        return None;
    }
    let known = (&ids[..], &selection.current.trial, bench);
    let most = |iterations: usize| iterations.min(EXTENDED_ITERATIONS);
    let settings = Settings {
        max_iterations: most(settings.max_iterations),
        most_while_falling: most(settings.most_while_falling),
        ..settings.clone()
    };
    let extended = extend_as(robot, recordings, base, known, &settings, |i, iteration| {
        tracing::trace!(i, cost = iteration.cost, damping = iteration.damping, trials = iteration.trials, "extended");
    });
    match extended {
        Ok(fit) => Some(fit),
        Err(error) => {
            tracing::debug!(%error, "the extended calibration of all samples failed");
            None
        }
    }
}

/// The two thirds of a recording that are fitted where there is no other, and the last one.
fn fitted_and_unseen(recording: &Recording) -> [Recording; 2] {
    let cut = recording.len() * 2 / 3;
    [recording.part(0..cut), recording.part(cut..recording.len())]
}

/// The blocks that a diagnosis looks at, and the base model on them under the noise that sensors and steps have by themselves: noise that is estimated takes model errors for its own.
///
/// # Errors
/// As a calibration's.
pub fn bench<'r>(robot: &'r Robot, base: &Fit, settings: &Settings) -> Result<(Bench<'r>, Trial), CalibrateError> {
    let noise = yardstick(robot, &base.series);
    let settings = Settings { relative_cost_change: ENOUGH, max_iterations: MOST_ITERATIONS, ..settings.clone() };
    let states = Model::new(robot).layout().size();
    let wanted = (samples_for(states, SAMPLES), BLOCKS, WORST_BLOCKS);
    let costs = || base.costs(robot, &settings).ok();
    let windows = blocks::blocks(&base.series, wanted, LEAST_BLOCK, costs);
    let (series, starts, _) = base.series.select(&windows);
    tracing::debug!(blocks = starts.len(), samples = series.stages(), "bench");
    Bench::new(robot, (series, starts), base, noise, settings)
}
