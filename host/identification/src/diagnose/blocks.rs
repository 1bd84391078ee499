//! Which blocks of time a diagnosis looks at.
//!
//! ```text
//! short recordings   ▒▒▒▒│▒▒▒▒│▒▒▒▒│▒▒▒▒│▒▒▒▒        all of it, cut
//! long ones          ─ ▒▒ ─ ▒▒ ─ ▒▒ ▓▓ ─ ▒▒ ─        spread evenly ▒, and where the base model fits worst ▓
//! ```

use std::ops::Range;

use crate::calibrate::Series;

/// A recording of up to so many times the samples is looked at whole.
const WHOLE: usize = 2;

/// Blocks of about `samples` in all, in order and apart, each within one recording. `cost` gives what every sample of the series costs the base model; it is asked
/// only where the series is too long to be looked at whole.
pub fn blocks(
    series: &Series,
    (samples, count, worst): (usize, usize, usize),
    least: usize,
    cost: impl FnOnce() -> Option<Vec<f64>>,
) -> Vec<Range<usize>> {
    let whole = series.stages();
    if whole < WHOLE * samples {
        let length = (whole / count).max(least);
        return series.recordings.iter().flat_map(|recording| cut(recording, length)).collect();
    }
    let length = (samples / count).max(least);
    let Some(cost) = cost() else { return even(series, (count, length), &[]) };
    let worst = worst_windows(series, length, worst, &cost);
    let evenly = count - worst.len();
    even(series, (evenly, length), &worst)
}

/// All of a recording, cut into pieces of at least this length.
fn cut(recording: &Range<usize>, length: usize) -> Vec<Range<usize>> {
    let pieces = (recording.len() / length).max(1);
    let at = |piece: usize| recording.start + recording.len() * piece / pieces;
    (0..pieces).map(|piece| at(piece)..at(piece + 1)).collect()
}

/// Windows spread evenly over what these leave of each recording, the first one at its start, with them.
fn even(series: &Series, (count, length): (usize, usize), taken: &[Range<usize>]) -> Vec<Range<usize>> {
    let whole = series.stages() as f64;
    let mut windows = taken.to_vec();
    for (recording, rest) in series.recordings.iter().zip(&series.rest) {
        // The robot at rest shows biases: one window of it is enough.
        let moving = rest.end.saturating_sub(length / 2).max(recording.start);
        windows.push(recording.start..(recording.start + length).min(recording.end));
        let own = ((count as f64 * recording.len() as f64 / whole).round() as usize).max(2) - 1;
        let span = recording.end.saturating_sub(length).saturating_sub(moving);
        for place in 0..own {
            let start = moving + (span as f64 * (place as f64 + 0.5) / own as f64) as usize;
            windows.push(start..(start + length).min(recording.end));
        }
    }
    apart(windows, taken)
}

/// In order and without overlaps; what is `taken` stays as it is.
fn apart(mut windows: Vec<Range<usize>>, taken: &[Range<usize>]) -> Vec<Range<usize>> {
    windows.sort_by_key(|window| window.start);
    let mut kept: Vec<Range<usize>> = Vec::with_capacity(windows.len());
    for window in windows {
        let is_taken = taken.contains(&window);
        match kept.last_mut() {
            Some(last) if last.end > window.start && is_taken => {
                if taken.contains(last) {
                    continue;
                }
                last.end = window.start.max(last.start);
                kept.push(window);
            }
            Some(last) if last.end > window.start => {
                let start = last.end;
                if start < window.end {
                    kept.push(start..window.end);
                }
            }
            _ => kept.push(window),
        }
    }
    kept.retain(|window| !window.is_empty());
    kept
}

/// The windows of this length that cost most, apart from each other, around the worst moment of each.
fn worst_windows(series: &Series, length: usize, most: usize, cost: &[f64]) -> Vec<Range<usize>> {
    let mut before = vec![0.0];
    cost.iter().for_each(|cost| before.push(before[before.len() - 1] + cost));
    let mut candidates: Vec<Range<usize>> = series
        .recordings
        .iter()
        .flat_map(|recording| {
            let last = recording.end.saturating_sub(length);
            (recording.start..=last.max(recording.start)).step_by((length / 8).max(1))
        })
        .map(|start| start..(start + length).min(series.stages()))
        .collect();
    let sum = |window: &Range<usize>| before[window.end] - before[window.start];
    candidates.sort_by(|a, b| sum(b).total_cmp(&sum(a)));
    let mut worst: Vec<Range<usize>> = Vec::new();
    for window in candidates {
        if worst.len() == most {
            break;
        }
        if worst.iter().all(|other| other.end <= window.start || window.end <= other.start) {
            worst.push(window);
        }
    }
    worst
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::robot::Robot;

    fn series(stages: usize) -> Series {
        Series::made_up(&Robot::builtin("one_joint").unwrap(), stages, 100)
    }

    fn is_sound(windows: &[Range<usize>], stages: usize) -> bool {
        windows.windows(2).all(|pair| pair[0].end <= pair[1].start)
            && windows.iter().all(|window| window.start < window.end && window.end <= stages)
    }

    #[test]
    fn a_short_recording_is_looked_at_whole() {
        let series = series(2_501);
        let found = blocks(&series, (4_800, 24, 4), 40, || unreachable!("nothing has to be chosen"));
        assert!(is_sound(&found, 2_501) && found.len() == 24, "{found:?}");
        assert_eq!((found[0].start, found[23].end), (0, 2_501));
        // So short that blocks would be too short for anything: fewer of them.
        let few = blocks(&self::series(200), (4_800, 24, 4), 40, || None);
        assert_eq!(few.len(), 5);
    }

    #[test]
    fn of_a_long_one_blocks_are_spread_and_the_worst_moments_are_among_them() {
        let series = series(60_000);
        let cost: Vec<f64> = (0..60_000).map(|k| if (31_000..31_010).contains(&k) { 900.0 } else { 1.0 }).collect();
        let found = blocks(&series, (4_800, 24, 4), 40, || Some(cost));
        assert!(is_sound(&found, 60_000) && (22..=25).contains(&found.len()), "{found:?}");
        let samples: usize = found.iter().map(Range::len).sum();
        assert!((3_800..=5_000).contains(&samples), "{samples}");
        assert!(found.iter().any(|window| window.start < 31_000 && window.end > 31_010), "{found:?}");
        assert!(found[0].start == 0 && found.last().unwrap().start > 50_000);
    }
}
