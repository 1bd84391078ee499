//! Which windows of a long recording decide: spread evenly, but those in which something happens that they do not see.
//!
//! ```text
//! even     ─ ▒▒▒▒ ─ ─ ▒▒▒▒ ─ ─ ▒▒▒▒ ─ ─ ▒▒▒▒ ─ ─ ▒▒▒▒ ─
//! costs    ▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁█▁▁▁▁▁▁▁▁▁▁▁▂▂▂▁▁▁▁   of the model that the even ones show, on the whole recording
//! taken    ─ ▒▒▒▒ ─ ─ ▒▒▒▒ ─ ▓▓▓▓▓ ─ ─ ─ ─ ─ ─ ─ ─ ▒▒▒▒ ─   the calmest goes
//! ```
//!
//! A gyro may leave its range in a few turns of seventy seconds, a belt jumps once, a stop is met now and then.

use std::ops::Range;

/// Something happens where samples cost so many times what they do anywhere in the even windows …
const WORSE: f64 = 1.5;
/// … or in a blow so many times, where these show that the model is wrong: those of free play differ by 14 times, a belt that jumps costs 31 times what its windows do.
const FAR_WORSE: f64 = 20.0;
/// They do where samples cost so many times what noise does.
const WRONG: f64 = 2.0;
/// Samples that a blow costs.
const BLOW: usize = 11;
/// Of the windows, those that may be taken elsewhere.
const MOST_ELSEWHERE: usize = 3;

/// The windows to look at in the place of these, which are in order and of about `length` samples; none where nothing speaks against them.
/// `costs` is what every sample costs the model that they show, and what noise does, `moving` the samples of every recording behind its rest.
pub fn elsewhere(
    even: &[Range<usize>],
    length: usize,
    moving: &[Range<usize>],
    (costs, noise): (&[f64], f64),
) -> Option<Vec<Range<usize>>> {
    let sums = Sums::of(costs);
    let blow_in = |of: &Range<usize>, k: usize| {
        sums.of_range(k.saturating_sub(BLOW / 2).max(of.start)..(k + BLOW / 2 + 1).min(of.end))
    };
    let blow = |k: usize| blow_in(&(0..costs.len()), k);
    let mean = |range: &Range<usize>| sums.of_range(range.clone()) / range.len().max(1) as f64;
    let hardest = |range: Range<usize>| range.max_by(|a, b| blow(*a).total_cmp(&blow(*b)));
    let most = |values: &mut dyn Iterator<Item = f64>| values.fold(f64::MIN_POSITIVE, f64::max);
    let [usual_blow, usual_mean] = [
        most(&mut even.iter().flat_map(|window| window.clone().map(|k| blow_in(window, k)))),
        most(&mut even.iter().filter(|window| 2 * window.len() > length).map(mean)),
    ];
    let is_wrong = usual_mean > WRONG * noise;
    let mut new: Vec<Range<usize>> = Vec::new();
    while new.len() < MOST_ELSEWHERE {
        let free = free(moving, even, &new);
        let hit = free.iter().cloned().filter_map(hardest).max_by(|a, b| blow(*a).total_cmp(&blow(*b)));
        let long = free
            .iter()
            .flat_map(|gap| windows_in(gap, length))
            .max_by(|a, b| mean(a).total_cmp(&mean(b)))
            .filter(|window| !is_wrong && mean(window) > WORSE * usual_mean);
        let worse = if is_wrong { FAR_WORSE } else { WORSE };
        let of_hit = hit
            .filter(|k| blow(*k) > worse * usual_blow)
            .and_then(|k| Some(around(k, free.iter().find(|gap| gap.contains(&k))?, length)));
        let by_mean = long.as_ref().map_or(0.0, |window| mean(window) / usual_mean);
        let by_blow = hit.map_or(0.0, |k| blow(k) / usual_blow);
        tracing::debug!(by_mean, by_blow, usual = usual_mean / noise, "elsewhere");
        let Some(window) = (if by_mean > by_blow { long.or(of_hit) } else { of_hit.or(long) }) else { break };
        new.push(window);
    }
    if new.is_empty() {
        return None;
    }
    let mut kept = even.to_vec();
    kept.sort_by(|a, b| mean(b).total_cmp(&mean(a)));
    kept.truncate(even.len().saturating_sub(new.len()).max(1));
    kept.append(&mut new);
    kept.sort_by_key(|window| window.start);
    Some(kept)
}

/// Sums over any range.
struct Sums {
    before: Vec<f64>,
}

impl Sums {
    fn of(values: &[f64]) -> Self {
        let mut sum = 0.0;
        let up_to = |value: &f64| {
            sum += value;
            sum
        };
        Sums { before: std::iter::once(0.0).chain(values.iter().map(up_to)).collect() }
    }

    fn of_range(&self, range: Range<usize>) -> f64 {
        self.before[range.end] - self.before[range.start]
    }
}

/// What neither the even nor the new windows cover.
fn free(moving: &[Range<usize>], even: &[Range<usize>], new: &[Range<usize>]) -> Vec<Range<usize>> {
    let mut taken: Vec<&Range<usize>> = even.iter().chain(new).collect();
    taken.sort_by_key(|window| window.start);
    let mut free = Vec::new();
    for recording in moving {
        let mut from = recording.start;
        for window in taken.iter().filter(|window| recording.contains(&window.start)) {
            free.push(from..window.start.max(from));
            from = from.max(window.end);
        }
        free.push(from..recording.end.max(from));
    }
    free.retain(|gap| !gap.is_empty());
    free
}

/// Windows of this length in a gap, each an eighth of it behind the one before; the whole gap where it is shorter, but for slivers.
fn windows_in(gap: &Range<usize>, length: usize) -> Vec<Range<usize>> {
    if gap.len() < length {
        return if 4 * gap.len() < length { Vec::new() } else { vec![gap.clone()] };
    }
    (gap.start..=gap.end - length).step_by((length / 8).max(1)).map(|start| start..start + length).collect()
}

/// A window of this length with `k` in its middle, moved into the gap that `k` is in, and cut to it.
fn around(k: usize, gap: &Range<usize>, length: usize) -> Range<usize> {
    let last = gap.end.saturating_sub(length).max(gap.start);
    let start = k.saturating_sub(length / 2).clamp(gap.start, last);
    start..(start + length).min(gap.end)
}

#[cfg(test)]
mod tests {
    use super::*;

    const LENGTH: usize = 100;

    fn even() -> Vec<Range<usize>> {
        (0..8).map(|i| 500 + 1000 * i..600 + 1000 * i).collect()
    }

    fn elsewhere_of(costs: &[f64]) -> Option<Vec<Range<usize>>> {
        let moving = 200..costs.len();
        elsewhere(&even(), LENGTH, std::slice::from_ref(&moving), (costs, 4.5))
    }

    #[test]
    fn where_all_is_alike_the_even_windows_stay() {
        let ripple: Vec<f64> = (0..8000).map(|k| 4.5 + (k as f64 * 0.37).sin()).collect();
        assert_eq!(elsewhere_of(&ripple), None);
        // However large what the even windows see themselves, and what happens before the motion.
        let seen: Vec<f64> = (0..8000).map(|k| if even().iter().any(|w| w.contains(&k)) { 1e6 } else { 1e5 }).collect();
        assert_eq!(elsewhere_of(&seen), None);
        let before: Vec<f64> = (0..8000).map(|k| if k < 150 { 1e3 } else { 1.0 }).collect();
        assert_eq!(elsewhere_of(&before), None);
    }

    #[test]
    fn a_blow_between_the_windows_is_looked_at_and_the_calmest_window_goes() {
        let mut costs = vec![5.0; 8000];
        costs[4510] = 4.0; // the fifth is the calmest
        costs[6789] = 200.0;
        let taken = elsewhere_of(&costs).unwrap();
        assert_eq!(taken.len(), 8);
        let there = taken.iter().find(|window| window.contains(&6789)).unwrap();
        assert!(there.len() == LENGTH && 6789 - there.start > 30 && there.end - 6789 > 30, "{taken:?}");
        assert!(!taken.contains(&(4500..4600)), "{taken:?}");
        // Just behind a window, and in the last samples.
        let of = |k: usize| {
            let mut costs = vec![5.0; 8000];
            costs[k] = 200.0;
            elsewhere_of(&costs).unwrap()
        };
        assert!(of(603).contains(&(600..700)), "{:?}", of(603));
        assert!(of(7998).contains(&(7900..8000)), "{:?}", of(7998));
    }

    #[test]
    fn where_the_even_windows_show_that_the_model_is_wrong_only_far_worse_ones_are_looked_at() {
        let stretch = |far: f64| -> Vec<f64> {
            (0..8000).map(|k| if (2000..2400).contains(&k) { far * 50.0 } else { 50.0 }).collect()
        };
        assert_eq!(elsewhere_of(&stretch(10.0)), None);
        assert!(elsewhere_of(&stretch(100.0)).is_some());
    }

    #[test]
    fn a_stretch_that_fits_worse_is_looked_at_and_most_windows_stay_where_they_are() {
        let costs: Vec<f64> = (0..8000).map(|k| if (2000..2400).contains(&k) { 9.0 } else { 5.0 }).collect();
        let taken = elsewhere_of(&costs).unwrap();
        let there = taken.iter().filter(|window| window.start >= 1950 && window.end <= 2450).count();
        assert_eq!((taken.len(), there), (8, 3), "{taken:?}");
        assert!(taken.windows(2).all(|pair| pair[0].end <= pair[1].start), "{taken:?}");
    }
}
