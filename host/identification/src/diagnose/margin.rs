//! How much a recording tells of a cause: by how much its law fits better than the nearest rival.
//!
//! What a diagnosis can be asked for depends on nothing else. Studies set the sizes of what they hide by it.

use super::catalogue::catalogue;
use super::refit::{Fitted, Refit};
use super::selection::first_refits;
use super::{DiagnoseError, bench, fitted_and_unseen};
use crate::calibrate::{Method, Preset, fit};
use crate::effect::Effect;
use crate::recording::Recording;
use crate::robot::Robot;
use solve::levenberg::Settings;

/// Twice the difference of the log-likelihoods of two refits on the blocks of a diagnosis: of the law of `effect`, and of the best of its rivals (those that the first
/// round of [`diagnose`](super::diagnose) would refit). Zero where a rival fits better. A rival with more parameters that fits as well holds the law as a special case,
/// and is none. The last third of the recording is left out, as by a diagnosis without another recording.
///
/// # Errors
/// As a diagnosis.
pub fn margin(
    robot: &Robot,
    recording: &Recording,
    effect: &'static Effect,
    settings: &Settings,
) -> Result<f64, DiagnoseError> {
    let [fitted, _] = fitted_and_unseen(recording);
    let base = fit(robot, &[&fitted], Method::suited(Preset::Default, robot), settings, |_, _| {})?;
    let (bench, trial) = bench(robot, &base, settings)?;
    let contiguous = bench.is_contiguous();
    let (candidates, _) = catalogue(robot, &base.series.readings(), &[]);
    let on_bench = Fitted::of(&bench, &contiguous, trial)?;
    let refit = Refit { bench, contiguous, trimmed: None };
    let refits = first_refits(&refit, on_bench, &candidates, effect)?;
    Ok(over_the_nearest(&refits, effect.id))
}

/// Of refits (id, parameters, Σ r² saved) by how much that of `own` saves more than the nearest of the others.
fn over_the_nearest(refits: &[(&'static str, usize, f64)], own: &str) -> f64 {
    let saved = |(_, _, saved): &&(&str, usize, f64)| *saved;
    let own_fit = refits.iter().filter(|(id, ..)| *id == own).max_by(|a, b| saved(a).total_cmp(&saved(b)));
    let Some((_, freedom, gained)) = own_fit else { return 0.0 };
    let holds_it = |other: &(&str, usize, f64)| other.1 > *freedom && other.2 >= *gained;
    let rivals = refits.iter().filter(|other| other.0 != own && !holds_it(other));
    let nearest = rivals.map(|(.., saved)| *saved).fold(0.0, f64::max);
    (gained - nearest).max(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_rival_counts_but_for_one_that_holds_the_law_as_a_special_case() {
        let refits = [("viscous_friction", 2, 1000.0), ("stribeck", 3, 400.0), ("motor_mismatch", 6, 1010.0)];
        assert_eq!(over_the_nearest(&refits, "viscous_friction"), 600.0);
        assert_eq!(over_the_nearest(&refits, "stribeck"), 0.0);
        assert_eq!(over_the_nearest(&refits, "cogging"), 0.0);
    }
}
