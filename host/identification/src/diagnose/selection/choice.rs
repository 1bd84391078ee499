//! The choice among refits: what is supported, and which of those that explain the same.

use super::super::criteria::{COLLINEAR, IMPLAUSIBLE, LEVEL};
use super::super::plausibility::Plausibility;
use super::super::refit::Fitted;
use super::super::rivals::{Contender, best, weights};
use super::super::scores::block_scores::collinearity;
use super::scan::Scan;
use super::state::{Accepted, Rival, share};
use super::tried::Tried;

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

/// The law that is added, if any is supported, and its place among those that were tried.
pub(super) fn choose(
    current: &Fitted,
    scan: &Scan,
    tried: &[Tried],
    plausibility: &Plausibility,
) -> Option<(Accepted, usize)> {
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
    let tried = &tried[chosen];
    let accepted = Accepted {
        named: tried.named.clone(),
        gains: tried.gains.clone(),
        p_family: tried.p_family,
        p_when_added: tried.p_family,
        weight,
        rivals,
        is_event: tried.is_event,
    };
    Some((accepted, chosen))
}
