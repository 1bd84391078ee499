//! What a law has to gain to be a finding: a share of what is explained with it.

use super::super::criteria::LEAST_SHARE;
use super::state::{Accepted, Selection};

/// What a law has to gain beside what is explained already.
pub(super) fn least_gain(selection: &Selection) -> f64 {
    let explained: f64 = selection.current.gains_over(&selection.base).iter().sum();
    LEAST_SHARE / (1.0 - LEAST_SHARE) * explained.max(0.0)
}

/// Whether a law gains enough.
pub(super) fn matters(selection: &Selection, chosen: &Accepted) -> bool {
    chosen.gains.iter().sum::<f64>() >= least_gain(selection)
}

/// The cost that a law has to come to for that: a gain is n ln of what the cost falls by.
pub(super) fn cost_that_matters(selection: &Selection) -> f64 {
    let freedom: f64 = selection.current.freedom.iter().sum();
    selection.current.trial.cost * (-least_gain(selection) / freedom.max(1.0)).exp()
}
