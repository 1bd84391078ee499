//! Where on the other motion the base model is worst, and what the extended model predicts there.

use std::ops::Range;

use super::result::OverTime;

/// A stretch of a motion, with the errors of both models on it.
#[derive(Debug, Clone, PartialEq)]
pub struct Stretch {
    /// Its readings, as places in [`OverTime`].
    pub readings: Range<usize>,
    /// From its first reading on, s after the start.
    pub from_s: f64,
    /// Up to its last reading, s after the start.
    pub to_s: f64,
    /// Root mean square of the base model's errors, in the channel's unit.
    pub rmse_base: f64,
    /// Of the extended model's.
    pub rmse_extended: f64,
}

impl Stretch {
    /// 1 − extended / base.
    pub fn gain(&self) -> f64 {
        1.0 - self.rmse_extended / self.rmse_base
    }
}

impl OverTime {
    /// Whether there is one value of each kind a reading, and any at all.
    pub fn is_complete(&self) -> bool {
        let count = self.t_s.len();
        count > 0 && [&self.measured, &self.base, &self.extended].iter().all(|values| values.len() == count)
    }

    /// Errors of the base and of the extended model: predicted less measured.
    pub fn errors(&self) -> [Vec<f64>; 2] {
        [&self.base, &self.extended].map(|predicted| {
            predicted.iter().zip(&self.measured).map(|(predicted, measured)| predicted - measured).collect()
        })
    }

    /// The stretches of that length in which squares of the base model's errors sum up to most, worst first. They do not overlap.
    pub fn worst(&self, length_s: f64, most: usize) -> Vec<Stretch> {
        let [base, extended] = self.errors();
        let count = self.t_s.len().min(base.len()).min(extended.len());
        let squares = |errors: &[f64], readings: Range<usize>| -> (f64, usize) {
            let finite = errors[readings].iter().filter(|error| error.is_finite());
            finite.fold((0.0, 0), |(sum, count), error| (sum + error * error, count + 1))
        };
        let mut end = 0;
        let mut all: Vec<(f64, Range<usize>)> = Vec::new();
        for start in 0..count {
            end = end.max(start + 1);
            // Times are sums of periods: 0.1 s ten times may be a little less than 1 s.
            while end < count && self.t_s[end] - self.t_s[start] < length_s * (1.0 - 1e-9) {
                end += 1;
            }
            let sum = squares(&base, start..end).0;
            if sum > 0.0 {
                all.push((sum, start..end));
            }
        }
        all.sort_by(|(a, _), (b, _)| b.total_cmp(a));
        let mut worst: Vec<Stretch> = Vec::new();
        for (_, readings) in all {
            if worst.len() >= most {
                break;
            }
            if worst.iter().any(|other| readings.start < other.readings.end && other.readings.start < readings.end) {
                continue;
            }
            let rmse = |errors: &[f64]| {
                let (sum, count) = squares(errors, readings.clone());
                (sum / count as f64).sqrt()
            };
            worst.push(Stretch {
                from_s: self.t_s[readings.start],
                to_s: self.t_s[readings.end - 1],
                rmse_base: rmse(&base),
                rmse_extended: rmse(&extended),
                readings,
            });
        }
        worst
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn over_time(base: Vec<f64>) -> OverTime {
        let count = base.len();
        OverTime {
            channel: "encoder1".into(),
            unit: "rad".into(),
            t_s: (0..count).map(|k| 0.6 + 0.1 * k as f64).collect(),
            measured: vec![1.0; count],
            extended: vec![1.5; count],
            base,
        }
    }

    #[test]
    fn the_worst_second_comes_first_and_none_overlaps_another() {
        let mut base = vec![1.0; 60];
        base[33] = 5.0;
        base[7] = 3.0;
        base[8] = f64::NAN;
        let worst = over_time(base).worst(1.0, 3);
        assert_eq!(worst.len(), 2, "where the base model is right there is no worst moment: {worst:?}");
        assert!(worst[0].readings.contains(&33) && worst[1].readings.contains(&7), "{worst:?}");
        assert!(worst.iter().all(|stretch| stretch.to_s - stretch.from_s < 1.0 && stretch.readings.len() == 10));
        assert!((worst[0].rmse_base - 1.6f64.sqrt()).abs() < 1e-12);
        assert!((worst[0].rmse_extended - 0.5).abs() < 1e-12);
    }

    #[test]
    fn nothing_measured_is_no_moment() {
        assert!(over_time(Vec::new()).worst(1.0, 3).is_empty());
        assert!(over_time(vec![f64::NAN; 30]).worst(1.0, 3).is_empty());
        let mut torn = over_time(vec![2.0; 30]);
        torn.extended.truncate(12);
        assert!(!torn.is_complete());
        assert!(torn.worst(1.0, 3).iter().all(|stretch| stretch.readings.end <= 12));
    }
}
