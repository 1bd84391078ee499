//! Chooses which samples of a long recording a plot needs.
//!
//! A plot of a thousand pixels cannot show 100,000 samples, and leaving out every other one loses the spikes that one
//! looks for. So the samples are cut into buckets of equal count and of each bucket every series keeps its smallest and
//! its largest value. Overlaid series share their indices (the union), so that measured and simulated are compared at
//! the same instants:
//!
//! ```text
//!   bucket      |  0 1 2 3 4  |  5 6 7 8 9  |
//!   measured    |  ·   ▲   ▼  |  ▲     ▼    |      kept: 2 4 5 8
//!   simulated   |    ▲     ▼  |  ▲       ▼  |      kept: 1 4 5 9      union: 1 2 4 5 8 9
//! ```

use std::ops::Range;

/// Indices into the series, ascending, that keep the least and the greatest value of every bucket of every series.
///
/// At most about `budget` indices outside the `full` ranges, inside which every index is kept. The first and the last
/// sample are always kept, and so is one NaN of every bucket that has one (a gap stays a gap).
///
/// All series must have the same length.
pub fn decimate(series: &[&[f64]], budget: usize, full: &[Range<usize>]) -> Vec<usize> {
    let n = series.first().map_or(0, |s| s.len());
    assert!(series.iter().all(|s| s.len() == n), "overlaid series differ in length");
    let mut kept = if n <= budget { (0..n).collect() } else { within_budget(series, n, budget) };
    for range in full {
        kept.extend(range.start.min(n)..range.end.min(n));
    }
    kept.sort_unstable();
    kept.dedup();
    kept
}

/// Halves towards the number of buckets whose union fits the budget: how many extremes coincide depends on the signals.
fn within_budget(series: &[&[f64]], n: usize, budget: usize) -> Vec<usize> {
    let mut buckets = (budget / 2).max(1);
    loop {
        let kept = extremes(series, n, buckets);
        if kept.len() <= budget || buckets == 1 {
            return kept;
        }
        buckets = (buckets * budget / kept.len()).clamp(1, buckets - 1);
    }
}

fn extremes(series: &[&[f64]], n: usize, buckets: usize) -> Vec<usize> {
    let mut kept = vec![0, n - 1];
    for bucket in 0..buckets {
        let range = bucket * n / buckets..(bucket + 1) * n / buckets;
        for values in series {
            let mut low: Option<usize> = None;
            let mut high: Option<usize> = None;
            let mut missing = None;
            for k in range.clone() {
                if values[k].is_nan() {
                    missing = missing.or(Some(k));
                } else {
                    if low.is_none_or(|i| values[k] < values[i]) {
                        low = Some(k);
                    }
                    if high.is_none_or(|i| values[k] > values[i]) {
                        high = Some(k);
                    }
                }
            }
            kept.extend([low, high, missing].into_iter().flatten());
        }
    }
    kept.sort_unstable();
    kept.dedup();
    kept
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn least_and_greatest(values: impl Iterator<Item = f64>) -> (f64, f64) {
        values.fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), v| (lo.min(v), hi.max(v)))
    }

    proptest! {
        #[test]
        fn every_series_keeps_its_extremes_and_its_gaps(
            a in prop::collection::vec(prop_oneof![9 => -1e3..1e3_f64, 1 => Just(f64::NAN)], 1..2000),
            budget in 8_usize..200,
        ) {
            let b: Vec<f64> = a.iter().enumerate().map(|(k, v)| (k as f64 * 0.1).sin() - 0.5 * v).collect();
            let kept = decimate(&[&a, &b], budget, &[]);
            prop_assert!(kept.windows(2).all(|w| w[0] < w[1]));
            prop_assert!(kept.len() <= budget || kept.len() <= 8);
            prop_assert_eq!(kept[0], 0);
            prop_assert_eq!(*kept.last().unwrap(), a.len() - 1);
            for series in [&a, &b] {
                let all = least_and_greatest(series.iter().copied());
                let seen = least_and_greatest(kept.iter().map(|&k| series[k]));
                prop_assert_eq!(all, seen);
                let gap = series.iter().any(|v| v.is_nan());
                prop_assert_eq!(gap, kept.iter().any(|&k| series[k].is_nan()));
            }
        }
    }

    #[test]
    fn a_single_spike_in_one_of_six_long_series_survives() {
        let n = 100_000;
        let mut series: Vec<Vec<f64>> =
            (0..6).map(|s| (0..n).map(|k| (k as f64 * 1e-3 + s as f64).sin()).collect()).collect();
        series[4][71_234] = 9.0;
        series[2][3] = -7.0;
        let borrowed: Vec<&[f64]> = series.iter().map(Vec::as_slice).collect();
        let kept = decimate(&borrowed, 3000, &[]);
        assert!(kept.contains(&71_234) && kept.contains(&3));
        assert!((1500..=3000).contains(&kept.len()), "{} kept", kept.len());
    }

    #[test]
    fn the_zoom_window_keeps_every_sample() {
        let a: Vec<f64> = (0..10_000).map(|k| f64::from(k % 17)).collect();
        let kept = decimate(&[&a], 100, &[5000..5200, 9990..20_000]);
        for k in (5000..5200).chain(9990..10_000) {
            assert!(kept.binary_search(&k).is_ok());
        }
        assert!(kept.len() <= 310);
    }

    #[test]
    fn nothing_to_show_is_no_index() {
        assert!(decimate(&[], 100, &[]).is_empty());
        assert!(decimate(&[&[]], 100, &[0..5, 7..9]).is_empty());
    }
}
