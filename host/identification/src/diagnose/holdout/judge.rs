//! What the other motion decides after the selection: the gain of all findings and of each, and what leaves because it harms.

use super::{Holdout, Predicted};
use crate::diagnose::axes::axes;
use crate::diagnose::interval::Gain;
use crate::diagnose::refit::{Fitted, Refit};
use crate::diagnose::result::{ChannelGain, HoldoutGain, Rejected};
use crate::diagnose::selection::{Accepted, Selection, losses};
use crate::effect::Effect;
use solve::threads::both;

/// A prediction whose error grows by more than that, as a share, has run away.
const TENFOLD: f64 = 10.0;

/// What the other motion says.
#[derive(Default)]
pub struct Judged {
    /// Of all findings together.
    pub all: Option<HoldoutGain>,
    /// Of each finding: blocks' loss without it, and the joint gain of the other motion.
    pub of_each: Vec<(Vec<f64>, Option<Gain>)>,
    /// Of each finding: whether the other motion can be predicted without it.
    pub predicted: Vec<bool>,
    /// By horizon and sensor, of all findings together.
    pub by_channel: Vec<ChannelGain>,
    /// Of the base model, half a second ahead, in standard deviations of the sensors.
    pub ahead_sigma: Vec<(String, f64)>,
    /// Of the model with all findings.
    pub extended_ahead_sigma: Vec<(String, f64)>,
}

/// Asks the other motion, after the selection: of all findings, and of each by leaving it out. What harms its prediction for sure is no cause and leaves the selection, the most harmful
/// one first, since beside it others may look harmful too; what the selection finds without it is judged in its turn. Nothing else is decided by it.
pub fn judge(
    refit: &Refit<'_>,
    holdout: &Holdout<'_>,
    selection: &mut Selection,
    grow: &dyn Fn(&mut Selection, &[Rejected]),
) -> (Judged, Vec<Rejected>) {
    let mut rejected: Vec<Rejected> = Vec::new();
    let base = match holdout.predict(&refit.bench, &refit.unweighted(&selection.base), &[], None) {
        Ok(base) => base,
        Err(error) => {
            tracing::debug!(%error, "the other motion cannot be predicted");
            let of_each = losses(refit, selection).into_iter().map(|(_, lost)| (lost, None)).collect();
            return (Judged { of_each, ..Judged::default() }, rejected);
        }
    };
    loop {
        let (judged, mut without) = evaluate(refit, (holdout, &base), selection);
        let gain = |place: &usize| judged.of_each[*place].1.as_ref().map_or(0.0, |gain| gain.share);
        let is_harmful = |place: &usize| judged.of_each[*place].1.as_ref().is_some_and(Gain::is_harmful);
        let worst = (0..judged.of_each.len()).filter(is_harmful).min_by(|a, b| gain(a).total_cmp(&gain(b)));
        // With which the other motion cannot be predicted at all, and without which it can.
        let unfit = || (0..judged.of_each.len()).rev().find(|place| judged.all.is_none() && judged.predicted[*place]);
        // All together harm, and none is to blame for sure: the one that came in last, since the model before it is known to be sound on its own motion.
        let is_harmful = judged.all.as_ref().is_some_and(|all| all.ci95.is_some_and(|[_, high]| high < 0.0));
        let last = || judged.of_each.len().checked_sub(1).filter(|_| is_harmful);
        let Some(worst) = worst.or_else(unfit).or_else(last) else {
            let is_rejected = |effect: &Effect| rejected.iter().any(|rejected| rejected.effect == effect.id);
            selection.accepted.iter_mut().for_each(|accepted| accepted.leave_out_rivals(is_rejected));
            return (in_order(selection, judged), rejected);
        };
        let axes = axes(selection.accepted[worst].named.effect, &selection.current.trial);
        let others = if selection.accepted.len() > 1 { without.swap_remove(worst) } else { selection.base.clone() };
        let accepted = selection.remove(worst, others);
        rejected.push(reject(&accepted, &axes, judged.of_each[worst].1.as_ref()));
        grow(selection, &rejected);
    }
}

/// The main cause first: by what other blocks lose without each.
fn in_order(selection: &mut Selection, mut judged: Judged) -> Judged {
    let lost = |place: usize| judged.of_each[place].0.iter().sum::<f64>();
    let mut order: Vec<usize> = (0..judged.of_each.len()).collect();
    order.sort_by(|a, b| lost(*b).total_cmp(&lost(*a)));
    selection.accepted = order.iter().map(|place| selection.accepted[*place].clone()).collect();
    judged.of_each = order.iter().map(|place| judged.of_each[*place].clone()).collect();
    judged
}

/// What the other motion says of a selection.
fn evaluate(
    refit: &Refit<'_>,
    (holdout, base): (&Holdout<'_>, &Predicted),
    selection: &mut Selection,
) -> (Judged, Vec<Fitted>) {
    let mut judged = Judged { ahead_sigma: holdout.ahead_sigma(base), ..Judged::default() };
    let effects: Vec<&'static Effect> = selection.accepted.iter().map(|accepted| accepted.named.effect).collect();
    if effects.is_empty() {
        return (judged, Vec::new());
    }
    let predict = |fitted: &Fitted, effects: &[&'static Effect], near: Option<&Predicted>| {
        holdout
            .predict(&refit.bench, &refit.unweighted(fitted), effects, near)
            .inspect_err(|error| tracing::debug!(%error, "an extended model cannot predict the other motion"))
            .ok()
    };
    // From states of its own: those of the base model may lie where a contact does not let go of them.
    let extended = predict(&selection.current, &effects, None);
    let can_predict =
        |fitted: &Fitted, effects: &[&'static Effect]| effects.is_empty() || predict(fitted, effects, None).is_some();
    let (models, lost): (Vec<Fitted>, Vec<Vec<f64>>) = losses(refit, selection).into_iter().unzip();
    let of_place = |place: usize| {
        let without = &models[place];
        let mut others = effects.clone();
        others.remove(place);
        let gain = extended.as_ref().and_then(|extended| {
            if others.is_empty() {
                return Some(holdout.gain(base, extended));
            }
            Some(holdout.gain(&predict(without, &others, Some(extended))?, extended))
        });
        (gain.is_some() || can_predict(without, &others), gain)
    };
    // Models do not know of each other, and a filter runs on one thread.
    let every_other =
        |first: usize| -> Vec<_> { (first..models.len()).step_by(2).map(|place| (place, of_place(place))).collect() };
    let (mut of_each, odd) = both(refit.bench.settings.threads, || every_other(0), || every_other(1));
    of_each.extend(odd);
    of_each.sort_by_key(|(place, _)| *place);
    for ((_, (predicted, gain)), lost) in of_each.into_iter().zip(lost) {
        judged.predicted.push(predicted);
        judged.of_each.push((lost, gain));
    }
    if let Some(extended) = extended {
        judged.by_channel = holdout.by_channel(base, &extended);
        judged.extended_ahead_sigma = holdout.ahead_sigma(&extended);
        let joint = holdout.gain(base, &extended);
        let ids: Vec<&str> = effects.iter().map(|effect| effect.id).collect();
        tracing::debug!(?ids, gain = joint.share, ci95 = ?joint.ci95, "the other motion");
        for channel in &judged.by_channel {
            tracing::trace!(channel.horizon_s, channel.channel, channel.gain, "the other motion");
        }
        judged.all = Some(HoldoutGain {
            share: joint.share,
            ci95: joint.ci95,
            blocks: joint.blocks,
            by_horizon: holdout.by_horizon(base, &extended),
            over_time: holdout.over_time(base, &extended),
        });
    }
    (judged, models)
}

fn reject(accepted: &Accepted, axes: &[usize], gain: Option<&Gain>) -> Rejected {
    let percent = |share: f64| format!("{:+.0} %", 100.0 * share);
    let why = match gain.and_then(|gain| gain.ci95.map(|ci95| (gain.share, ci95))) {
        Some((_, [_, high])) if high < -TENFOLD => "makes the prediction of the other motion run away".to_string(),
        Some((gain, [low, high])) => {
            format!("predicts the other motion worse: {} [{}, {}]", percent(gain), percent(low), percent(high))
        }
        None => "with it the other motion cannot be predicted".to_string(),
    };
    Rejected { effect: accepted.named.effect.id.to_string(), axes: axes.to_vec(), why }
}
