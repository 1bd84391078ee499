//! What a law has to explain, besides standing out of the noise, to be named.

use super::search::{Accepted, Scanned};

/// Of what accepted causes explain, the share that another law on the same equation, or in what stays structured, has to add to be one more cause.
const REST: f64 = 0.01;
/// Inflation of scores (see [`Trial::inflation`](crate::calibrate::Trial::inflation)) from which on residuals have a structure of their own: some 20 to 40 on a measured robot, next to 1 on
/// a simulated one whose causes are all found.
const STRUCTURED: f64 = 5.0;

/// Whether a law of this score explains too little beside accepted causes to be one more: no more than what the law of one of them, on the same
/// equation, may leave of it (laws are smooth, gaps and dead bands are not), or than may be found in residuals that keep their structure with it (no
/// measured robot is ever explained to the last digit).
pub fn is_rest(accepted: &[Accepted], explained: f64, scanned: &Scanned, score: f64) -> bool {
    let same_row = accepted.iter().any(|accepted| accepted.named.effect.row == scanned.named.effect.row);
    let structured = scanned.trial.as_ref().is_some_and(|trial| trial.inflation > STRUCTURED);
    (same_row || structured && !accepted.is_empty()) && score < REST * explained
}

/// What a law is worth on so many samples: its score less Schwarz's price of its parameters. A law that contains another one as a special
/// case gains as much; the simpler one is meant.
pub fn worth(scanned: &Scanned, samples: usize) -> f64 {
    scanned.score - price(scanned.freedom, samples)
}

/// Schwarz's price of so many parameters.
pub fn price(freedom: usize, samples: usize) -> f64 {
    freedom as f64 * (samples.max(2) as f64).ln()
}
