//! The state at each sample from the readings up to it: an extended Kalman filter running forward.
//!
//! ```text
//!   sample k:   z_k ─▶ update ─▶ x_k|k  (kept: what a prediction may start from)
//!               u_k ─▶ predict ─▶ x_k+1|k            never a smoothed state, nothing from after t_k
//! ```
//!
//! **Process noise.** A filter with the paper's (36) trusts its model so little that velocities follow the gyros' noise,
//! and predictions over 100 ms start wrong. The model's own error in a step is far smaller: the difference between one
//! step of Δt and two of Δt/2 (the integrator's error), and a random push on the velocities of standard deviation
//! [`velocity_sigma`](ProcessNoise::velocity_sigma) a period. How large the latter is depends on how well the model fits
//! the robot, so it is the one of [`CANDIDATES`] under which the readings are most likely. That one number is chosen
//! from the whole recording; the states are not. Four filters run side by side, a candidate each.
//!
//! **Gaps.** Over a gap up to [`BRIDGED_S`] the filter predicts with the last known input and as much uncertainty as an
//! unknown input brings; after a longer one it starts anew. States count as settled [`SETTLING_S`] after a start and
//! [`SETTLING_AFTER_BRIDGE_S`] after a bridge.

mod covariance;
mod four;

use solve::simd::LANES;

use super::system::{Columns, System, lane_of};
use four::Filters;

/// Gaps up to this long are bridged, s.
pub const BRIDGED_S: f64 = 0.05;

/// Time after a start or a gap before predictions start from the filter's states, s.
pub const SETTLING_S: f64 = 0.1;

/// The same after a gap that was bridged, s: the state is known but for what an unknown input did meanwhile.
pub const SETTLING_AFTER_BRIDGE_S: f64 = 0.02;

/// Standard deviations tried for the random push on each velocity in one period, rad/s (m/s).
pub const CANDIDATES: [f64; 6] = [1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 1e-1];

/// What the filter allows the model to be wrong by in one step, beside the integrator's own error.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ProcessNoise {
    /// Standard deviation of the random change of each velocity in one nominal period, rad/s (m/s).
    pub velocity_sigma: f64,
}

/// What the filter made of a recording.
#[derive(Debug, Clone)]
pub struct Track {
    states: usize,
    values: Vec<f64>,
    settled: Vec<bool>,
    started: Vec<bool>,
    /// Σ over all readings of −½ (ν²/S + ln S + ln 2π), ν the difference to the prediction, S its variance.
    pub log_likelihood: f64,
    /// Mean of ν²/S: 1 if the filter's uncertainty is the true one.
    pub mean_nis: f64,
    /// Times that the filter had to start anew.
    pub restarts: usize,
    /// The noise it ran with.
    pub noise: ProcessNoise,
}

impl Track {
    /// The state at sample k from the readings up to and including k.
    pub fn state(&self, k: usize) -> &[f64] {
        &self.values[k * self.states..(k + 1) * self.states]
    }

    /// Whether enough readings came before sample k since the last start and the last gap.
    pub fn is_settled(&self, k: usize) -> bool {
        self.settled[k]
    }

    /// Whether enough readings came before sample k since the last start, gaps that were bridged or not.
    pub fn has_started(&self, k: usize) -> bool {
        self.started[k]
    }
}

/// Runs the filter with the process noise of [`CANDIDATES`] that makes the readings most likely, of those that are no less than `least`.
///
/// Candidates are tried from the least on, four at a time, until they get less likely.
pub fn run<S: System>(system: &S, columns: &Columns<'_>, least: Option<ProcessNoise>) -> Track {
    let mut best: Option<Track> = None;
    // A filter that ran away (NaN) is the least likely of all.
    let rank = |track: &Track| if track.log_likelihood.is_nan() { f64::NEG_INFINITY } else { track.log_likelihood };
    let too_small = |sigma: &&f64| least.is_some_and(|least| **sigma < least.velocity_sigma);
    let first = CANDIDATES.iter().take_while(too_small).count().min(CANDIDATES.len() - 1);
    for candidates in CANDIDATES[first..].chunks(LANES) {
        let last = candidates[candidates.len() - 1];
        best = best
            .into_iter()
            .chain(run_side_by_side(system, columns, candidates))
            .max_by(|a, b| rank(a).total_cmp(&rank(b)));
        if best.as_ref().is_some_and(|best| best.noise.velocity_sigma != last && rank(best).is_finite()) {
            break;
        }
    }
    best.expect("there is at least one candidate")
}

/// Runs the filter with the process noise given.
pub fn run_with<S: System>(system: &S, columns: &Columns<'_>, noise: ProcessNoise) -> Track {
    let track = run_side_by_side(system, columns, &[noise.velocity_sigma]);
    track.expect("one noise was given")
}

/// Runs up to four filters, one for each of `velocity_sigma`, and gives the likeliest.
fn run_side_by_side<S: System>(system: &S, columns: &Columns<'_>, velocity_sigma: &[f64]) -> Option<Track> {
    let mut filters = Filters::new(system, columns, velocity_sigma);
    let n = columns.len();
    let mut values = Vec::with_capacity(n * system.states());
    let mut settled = Vec::with_capacity(n);
    let mut restarts = 0usize;
    let mut started = Vec::with_capacity(n);
    let (mut started_at, mut settled_at) = (0.0_f64, 0.0_f64);
    for (number, segment) in columns.segments.iter().enumerate() {
        for k in segment.clone() {
            let t = columns.t_s[k];
            filters.read(k);
            if k == segment.start {
                let bridged = number > 0 && filters.bridge(t - columns.t_s[k - 1], k - 1);
                if bridged {
                    settled_at = settled_at.max(t + SETTLING_AFTER_BRIDGE_S);
                } else {
                    restarts += 1;
                    started_at = t + SETTLING_S;
                    settled_at = started_at;
                    filters.start();
                }
            }
            filters.update(k);
            values.extend_from_slice(filters.states());
            // Half a period of tolerance, so that rounding of time stamps does not decide.
            settled.push(t > settled_at - 0.5 * columns.period_s);
            started.push(t > started_at - 0.5 * columns.period_s);
            if k + 1 < segment.end {
                filters.predict(k, columns.t_s[k + 1] - t);
            }
        }
    }
    let likely = |lane: &usize| filters.log_likelihood.0[*lane];
    let rank = |lane: &usize| if likely(lane).is_nan() { f64::NEG_INFINITY } else { likely(lane) };
    let lane = (0..velocity_sigma.len().min(LANES)).max_by(|a, b| rank(a).total_cmp(&rank(b)))?;
    Some(Track {
        states: system.states(),
        values: lane_of(&values, lane),
        settled,
        started,
        log_likelihood: likely(&lane),
        mean_nis: filters.squares.0[lane] / filters.readings.max(1) as f64,
        restarts: restarts.saturating_sub(1),
        noise: ProcessNoise { velocity_sigma: velocity_sigma[lane] },
    })
}
