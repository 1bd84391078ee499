//! Rows at another rate than the robot's tick would be read as gaps everywhere, or as no gap where there is one.

use super::TableError;
use crate::recording::Recording;
use crate::robot::TimeUnit;

/// The median step may differ from the robot's period by this factor (a clock that is off by 2 % is another rate).
const TOLERANCE: f64 = 0.02;
/// Steps that differ from the period by more than this are not jitter…
const ANOTHER: f64 = 0.2;
/// …if they agree with one another within this,
const ALIKE: f64 = 0.1;
/// and as many follow one another: losses of a link come by chance.
const LEAST_RUN: usize = 20;

/// `lines`: where each row stands, for the message.
pub(super) fn check(recording: &Recording, read_as: TimeUnit, lines: &[u64]) -> Result<(), TableError> {
    let steps: Vec<f64> = recording.t_us.windows(2).map(|pair| (pair[1] - pair[0]) as f64).collect();
    if steps.is_empty() {
        return Ok(());
    }
    let mut sorted = steps.clone();
    let middle = sorted.len() / 2;
    let found_us = *sorted.select_nth_unstable_by(middle, f64::total_cmp).1;
    let expected_us = recording.period_s * 1e6;
    let fits = |step_us: f64| (step_us / expected_us - 1.0).abs() <= TOLERANCE;
    if !fits(found_us) {
        let likely = TimeUnit::ALL.into_iter().find(|unit| fits(found_us / read_as.us() * unit.us()));
        return Err(TableError::Rate { found_us, expected_us, read_as, likely });
    }
    let mut run = 0..0;
    for (k, &step) in steps.iter().enumerate() {
        let other = (step / expected_us - 1.0).abs() > ANOTHER;
        let goes_on = other && !run.is_empty() && (step / steps[run.start] - 1.0).abs() <= ALIKE;
        run = match (goes_on, other) {
            (true, _) => run.start..k + 1,
            (false, true) => k..k + 1,
            (false, false) => k..k,
        };
        if run.len() >= LEAST_RUN && steps.get(k + 1).is_none_or(|next| (next / step - 1.0).abs() > ALIKE) {
            let (line, rows) = (lines.get(run.start + 1).copied().unwrap_or(0), run.len());
            return Err(TableError::MixedRates { line, rows, found_us: steps[run.start], expected_us });
        }
    }
    Ok(())
}
