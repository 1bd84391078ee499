//! What a new cause does to those found before it: some stood for it and are dropped, some stood for something simpler and are swapped.
//!
//! ```text
//! found ─▶ with the new cause ─▶ drop: what the others explain as well ─▶ swap: for a rival that is worth more beside the others
//! ```

use super::found::{Accepted, DROP_ITERATIONS, FINAL_ITERATIONS, LEVEL, Named, Rival, Scanned, Search, laws};
use super::refit::are_alike;
use super::significance::p_of_score;
use super::worth::Scale;
use crate::calibrate::{Bench, CalibrateError, Trial};

/// Laws whose worths differ by less cannot be told apart.
const ALIAS: f64 = 12.0;
/// Rivals that are tried in the place of a cause.
const MOST_SWAPS: usize = 2;

/// Takes the best of the refitted laws in, and settles all causes among each other.
///
/// # Errors
/// As a calibration's, of the model with all of them.
pub fn accept(
    bench: &Bench<'_>,
    found: &mut Search,
    best: Scanned,
    refitted: &[Scanned],
) -> Result<(), CalibrateError> {
    let scale = Scale::of(refitted, &found.trial, bench.series().stages());
    let worth = |s: &Scanned| scale.worth(s.score, s.freedom);
    let rivals = refitted
        .iter()
        .filter(|other| other.named.effect.id != best.named.effect.id)
        .map(|other| Rival {
            named: other.named.clone(),
            freedom: other.freedom,
            score: other.score,
            axes: other.axes.clone(),
            is_alias: worth(&best) - worth(other) < ALIAS,
        })
        .collect();
    let Scanned { named, score, p_family, freedom, .. } = best;
    found.accepted.push(Accepted { named, score, p_family, freedom, rivals });
    let from = best.trial.unwrap_or_else(|| found.trial.clone());
    let trial = bench.fit(&found.laws(), &from, FINAL_ITERATIONS)?;
    // A search that starts among large residuals leaves its start first, and may end short of it.
    found.trial = if from.has_laws(&trial.laws) && from.cost < trial.cost { from } else { trial };
    drop_superfluous(bench, found)?;
    swap(bench, found);
    Ok(())
}

/// What came in first may have stood for what came in last.
fn drop_superfluous(bench: &Bench<'_>, found: &mut Search) -> Result<(), CalibrateError> {
    let mut place = 0;
    while found.accepted.len() > 1 && place + 1 < found.accepted.len() {
        let (trial, lost) = found.without(bench, place)?;
        let dropped = &found.accepted[place].named;
        let p = p_of_score(lost / found.trial.inflation, dropped.law.parameters().coordinates.len());
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

/// Beside another cause, what looked best alone may be worth less than what it was taken for.
fn swap(bench: &Bench<'_>, found: &mut Search) {
    if found.accepted.len() < 2 {
        return;
    }
    for place in 0..found.accepted.len() {
        let Some((rival, trial, gained)) = better(bench, found, place) else { continue };
        let accepted = &mut found.accepted[place];
        tracing::debug!(effect = accepted.named.effect.id, by = rival.named.effect.id, "swapped");
        let loser = Rival {
            named: accepted.named.clone(),
            freedom: accepted.freedom,
            score: accepted.score,
            axes: Vec::new(),
            is_alias: gained < ALIAS,
        };
        accepted.rivals.retain(|other| other.named.effect.id != rival.named.effect.id);
        accepted.rivals.insert(0, loser);
        (accepted.named, accepted.freedom) = (rival.named, rival.freedom);
        found.trial = trial;
    }
}

/// A rival of the cause at `place` that is worth more there beside the others, with its fit and by how much.
fn better(bench: &Bench<'_>, found: &Search, place: usize) -> Option<(Rival, Trial, f64)> {
    let accepted = &found.accepted[place];
    let is_in = |named: &Named| found.accepted.iter().any(|other| other.named.effect.id == named.effect.id);
    let mut alike: Vec<&Rival> = accepted
        .rivals
        .iter()
        .filter(|rival| rival.is_alias || are_alike(accepted.named.effect, rival.named.effect))
        .filter(|rival| !is_in(&rival.named))
        .collect();
    alike.sort_by(|a, b| b.score.total_cmp(&a.score));
    let others = || found.accepted.iter().enumerate().filter(|(other, _)| *other != place);
    alike.into_iter().take(MOST_SWAPS).find_map(|rival| {
        let named = others().map(|(_, accepted)| &accepted.named).chain([&rival.named]);
        let trial = bench.fit(&laws(named), &found.trial, DROP_ITERATIONS).ok()?;
        let best = if trial.cost < found.trial.cost { &trial } else { &found.trial };
        let scale = Scale::after(best, bench.series().stages());
        let gained =
            scale.worth(2.0 * (found.trial.cost - trial.cost), rival.freedom) - scale.worth(0.0, accepted.freedom);
        tracing::debug!(effect = accepted.named.effect.id, by = rival.named.effect.id, gained, "swap?");
        (gained > 0.0 && trial.is_possible()).then(|| (rival.clone(), trial, gained))
    })
}
