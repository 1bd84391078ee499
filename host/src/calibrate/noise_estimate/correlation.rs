//! How long the error of a measured input lasts, by the restricted likelihood.
//!
//! What a torque from a motor's current misses is mostly slow: friction that no law has, a gear, a magnet that is warm. Taken for white noise it says that fast
//! torques err as much, and what fast motion shows of an inertia is given away to it. A process of first order has one time more. It is chosen among times that
//! double, since the likelihood is flat in it:
//!
//! ```text
//!   0 (white), T, 4 T, 16 T … a tenth of the longest run ─▶ the best of them, and beside it half and double
//! ```

use super::reml::Ascent;
use crate::calibrate::residuals::noise::Noise;
use crate::calibrate::residuals::problem::Problem;
use solve::error::SolveError;

/// Samples that are looked at, and steps of all standard deviations for each time.
const SAMPLES: usize = 8_000;
const ROUNDS: usize = 3;
/// Factor between times of the first look, in units of the sample period from one on.
const APART: f64 = 4.0;
/// Share of the longest run that an error may last.
const LONGEST: f64 = 0.1;
/// Gain in log-likelihood for which an error is not white.
const LEAST_GAIN: f64 = 10.0;

/// Chooses the correlation time of every input's error; whether any has changed.
pub(super) fn choose<'m>(problem: &mut Problem<'m>, ascent: &mut Ascent<'m>) -> Result<bool, SolveError> {
    let period_s = problem.series.median_period_s();
    let longest = problem.series.segments.iter().map(|run| run.len()).max().unwrap_or(0);
    let longest_s = LONGEST * longest as f64 * period_s;
    let mut changed = false;
    for input in 0..problem.model.layout().inputs().len() {
        let before = problem.noise().clone();
        let mut looked_at = |time_s: f64| -> Result<(f64, Noise), SolveError> {
            let mut noise = before.clone();
            noise.correlation_s[input] = time_s;
            problem.set_noise(noise);
            ascent.climb(problem, SAMPLES, ROUNDS)?;
            Ok((ascent.log_likelihood(problem, SAMPLES)?, problem.noise().clone()))
        };
        let white = looked_at(0.0)?;
        let mut best = white.clone();
        let mut time_s = period_s;
        while time_s <= longest_s {
            let found = looked_at(time_s)?;
            if found.0 > best.0 {
                best = found;
            }
            time_s *= APART;
        }
        let around = best.1.correlation_s[input];
        for time_s in [0.5 * around, 2.0 * around].into_iter().filter(|time_s| *time_s > 0.0) {
            let found = looked_at(time_s)?;
            if found.0 > best.0 {
                best = found;
            }
        }
        if best.0 < white.0 + LEAST_GAIN {
            best = white;
        }
        tracing::debug!(input, correlation_s = best.1.correlation_s[input], "error of an input");
        changed |= best.1.correlation_s[input] != before.correlation_s[input];
        problem.set_noise(best.1);
    }
    Ok(changed)
}
