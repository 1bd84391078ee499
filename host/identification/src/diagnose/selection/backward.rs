//! After an addition: what no longer gains is dropped, and what a rival explains better is exchanged.

use super::super::catalogue::Named;
use super::super::criteria::LEVEL;
use super::super::interval::standard_error;
use super::super::plausibility::Plausibility;
use super::super::refit::Refit;
use super::super::scores::significance::{p_of_both, p_of_family, p_of_gains};
use super::state::{Loss, Selection, share};
use crate::calibrate::CalibrateError;

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
pub(super) fn drop_superfluous(refit: &Refit<'_>, selection: &mut Selection) -> Result<(), CalibrateError> {
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
    Ok(())
}

/// Beside another cause, what predicted best alone may be predicted better by a rival.
pub(super) fn exchange(refit: &Refit<'_>, selection: &mut Selection, plausibility: &Plausibility) -> bool {
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
