//! When gyros read what stands in a recording: they convert by clocks of their own, behind filters.
//!
//! ```text
//!            conversion's end      t_k     t_{k+1}                      t_{k+2}
//!    ──────────────┴────────────────┴────────┴──┬─────────────────────────┴──
//!   ◀ filter delay ▶◀────── age ────▶
//!   instant = t_k − age − filter delay (the middle of what the filter weighs)
//! ```
//!
//! An instant may lie some ticks before the tick that read the words. The reading then belongs to the stage before it, so that the
//! state is carried on over a part of a step only: the readings of a gyro are moved by whole ticks, by the same number in all of
//! a recording. What is left is at most a period or so; by how much a gyro is later than anybody told is a parameter.

use std::borrow::Cow;
use std::ops::Range;

use crate::recording::Recording;
use crate::robot::ChannelKind;

/// The recording without the readings of gyros whose age is not known, though that of others is.
pub(crate) fn of_known_age(recording: &Recording) -> Cow<'_, Recording> {
    let age_us = |gyro: usize, k: usize| recording.ticks[k].gyro_ages_us.get(gyro).copied().unwrap_or(f64::NAN);
    let is_mixed = |gyro: usize| {
        let known = (0..recording.len()).filter(|k| age_us(gyro, *k).is_finite()).count();
        known > 0 && known < recording.len()
    };
    let mixed: Vec<usize> = (0..recording.robot.gyros().count()).filter(|gyro| is_mixed(*gyro)).collect();
    if mixed.is_empty() {
        return Cow::Borrowed(recording);
    }
    let mut known = recording.clone();
    for channel in &mut known.channels {
        let ChannelKind::GyroAxis { gyro, .. } = channel.spec.kind else { continue };
        if mixed.contains(&gyro) {
            let values = channel.values.iter_mut().enumerate();
            values.filter(|(k, _)| age_us(gyro, *k).is_nan()).for_each(|(_, value)| *value = f64::NAN);
        }
    }
    Cow::Owned(known)
}

/// The readings of one gyro of a recording.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct GyroInstants {
    /// The reading that belongs to a sample is that of so many samples later.
    shift: usize,
    /// By sample: its own reading's instant after its time, s; NaN where that is not known, though it is of others.
    after_s: Vec<f64>,
}

impl GyroInstants {
    /// Of gyro `gyro`, which the description has read `offset_s` after the tick; none where a recording tells nothing.
    pub fn of(recording: &Recording, gyro: usize, offset_s: f64) -> Option<Self> {
        let ages_us = || recording.ticks.iter().map(|tick| tick.gyro_ages_us.get(gyro).copied().unwrap_or(f64::NAN));
        let has_ages = ages_us().any(f64::is_finite);
        let told = recording.gyro_times.get(gyro);
        if told.is_none() && !has_ages {
            return None;
        }
        let delay_s = 1e-6 * told.and_then(|told| told.filter_delay_us).unwrap_or(0.0);
        // Where no age is known at all, words are those of the moment at which they are read; the mean age is part of the lag.
        let after = |age_us: f64| if has_ages { -1e-6 * age_us - delay_s } else { offset_s - delay_s };
        let after_s: Vec<f64> = ages_us().map(after).collect();
        let (mut sum_s, mut count) = (0.0, 0.0_f64);
        for after_s in after_s.iter().filter(|after_s| after_s.is_finite()) {
            (sum_s, count) = (sum_s - after_s, count + 1.0);
        }
        let shift = (sum_s / count.max(1.0) / recording.period_s).ceil().max(0.0) as usize;
        Some(GyroInstants { shift, after_s })
    }

    /// By sample: its own reading's instant after its time, s; where that is not known, the mean.
    pub fn own_s(&self) -> Vec<f64> {
        let known = || self.after_s.iter().copied().filter(|after_s| after_s.is_finite());
        let mean = known().sum::<f64>() / (known().count() as f64).max(1.0);
        self.after_s.iter().map(|after_s| if after_s.is_finite() { *after_s } else { mean }).collect()
    }

    /// The sample whose reading belongs to sample `k` of a run, and its instant after the time of `k`, s. Times are µs.
    pub fn reading(&self, k: usize, run: &Range<usize>, times_us: &[f64]) -> Option<(usize, f64)> {
        let from = k + self.shift;
        let after_s = *self.after_s.get(from).filter(|after_s| run.contains(&from) && after_s.is_finite())?;
        Some((from, after_s + 1e-6 * (times_us[from] - times_us[k])))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::recording::{GyroTime, Recorder, Row, Session, Source, Tick};
    use crate::robot::Robot;

    /// Doggy at rest for 40 ticks with these ages of its first gyro, µs, whose filter delays so much.
    fn aged(filter_delay_us: Option<f64>, age_us: impl Fn(usize) -> f64) -> Recording {
        let robot = Robot::builtin("doggy").unwrap();
        let channels = robot.channels().len();
        let time = GyroTime { filter_delay_us, output_rate_hz: Some(2000.0) };
        let mut recorder = Recorder::new(Session { gyro_times: vec![time; 2], ..Session::of(robot) });
        for k in 0..40 {
            let tick = Tick { gyro_ages_us: [age_us(k), f64::NAN], ..Tick::default() };
            let (duty, values) = ([0.0; 3], vec![0.0; channels]);
            let row = Row { t_us: 1000 * k as u64, seq: k as u64, phase: 0, tick, duty: &duty, values: &values };
            recorder.push(&row).unwrap();
        }
        recorder.finish(Source { path: "made up".into(), sha256: String::new() })
    }

    #[test]
    fn a_reading_belongs_to_the_stage_before_its_instant() {
        let recording = aged(Some(563.0), |k| 10.0 * k as f64);
        let times: Vec<f64> = (0..40).map(|k| 1000.0 * f64::from(k)).collect();
        let instants = GyroInstants::of(&recording, 0, 0.0).unwrap();
        // Mean lateness 563 + 195 µs: less than a tick, so that each reading is that of the tick after.
        let (from, after_s) = instants.reading(7, &(0..40), &times).unwrap();
        assert_eq!(from, 8);
        assert!((after_s - (1000.0 - 563.0 - 80.0) * 1e-6).abs() < 1e-12, "{after_s}");
        assert_eq!(instants.reading(39, &(0..40), &times), None, "the run is over");
    }

    #[test]
    fn without_ages_the_moment_of_the_read_counts() {
        let recording = aged(Some(200.0), |_| f64::NAN);
        let times: Vec<f64> = (0..40).map(|k| 1000.0 * f64::from(k)).collect();
        let instants = GyroInstants::of(&recording, 0, 300e-6).unwrap();
        let (from, after_s) = instants.reading(7, &(0..40), &times).unwrap();
        assert_eq!(from, 7);
        assert!((after_s - 100e-6).abs() < 1e-12, "{after_s}");
        assert_eq!(GyroInstants::of(&Recording { gyro_times: Vec::new(), ..recording }, 0, 0.0), None);
    }

    #[test]
    fn a_reading_without_an_age_among_others_with_one_is_left_out() {
        let recording = aged(Some(563.0), |k| if k == 9 { f64::NAN } else { 250.0 });
        let times: Vec<f64> = (0..40).map(|k| 1000.0 * f64::from(k)).collect();
        let instants = GyroInstants::of(&recording, 0, 0.0).unwrap();
        let known = of_known_age(&recording);
        assert!(known.channel("g1x").unwrap().values[9].is_nan() && known.channel("g2x").unwrap().values[9] == 0.0);
        assert_eq!(instants.reading(8, &(0..40), &times), None);
        assert!(instants.reading(9, &(0..40), &times).is_some());
    }
}
