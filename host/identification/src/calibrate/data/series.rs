//! The samples of one or more recordings as one chain of stages, with breaks where ticks are missing.

use std::ops::Range;

use super::instants::GyroInstants;
use super::stamps;
use crate::model::law::Readings;
use crate::recording::Recording;
use crate::robot::{self, ChannelKind, Robot};

/// Shorter runs between two gaps are left out: a lone sample does not determine its own speeds, and a few say nothing of
/// the dynamics. With 1 % of the ticks missing they are half a percent of the samples.
pub(crate) const SHORTEST_RUN: usize = 10;

/// Stages of all recordings one after the other, in the layout that the solver's loop reads.
#[derive(Debug, Clone)]
pub struct Series {
    /// Measured columns, the same for all recordings.
    pub channels: Vec<robot::Channel>,
    /// `[k · channels + c]`; NaN where there is no valid reading.
    measured: Vec<f64>,
    /// `[k · joints + j]`, in the unit of the robot's input.
    input: Vec<f64>,
    /// How many times the usual error of a measured input is allowed, `[k · joints + j]`; empty where that is one everywhere.
    input_spread: Vec<f64>,
    /// Time to the next stage, s; NaN where the chain breaks.
    duration_s: Vec<f64>,
    /// Since the start of the whole recording, s.
    time_s: Vec<f64>,
    /// Time between samples, s: of recordings with different periods their median.
    pub period_s: f64,
    /// Which stages each recording has.
    pub recordings: Vec<Range<usize>>,
    /// Runs of stages without a gap.
    pub segments: Vec<Range<usize>>,
    /// The stages at rest at the start of each recording.
    pub rest: Vec<Range<usize>>,
    joints: usize,
    gyros: usize,
    /// `[k · gyros + g]`: instant of each gyro's reading after the stage, s; empty where all are read as the description says.
    instants_s: Vec<f64>,
}

/// Readings that go beyond what is taken for the end of a gyro's range: a few by noise that is added behind it or as spikes; and none.
const BEYOND_END: [usize; 2] = [20, 0];

/// The runs of a recording that are long enough.
fn runs(recording: &Recording) -> impl Iterator<Item = Range<usize>> {
    recording.segments().into_iter().filter(|run| run.len() >= SHORTEST_RUN)
}

/// Samples of a recording that a calibration can use.
pub(crate) fn usable_samples(recording: &Recording) -> usize {
    runs(recording).map(|run| run.len()).sum()
}

fn period_s(robot: &Robot, recordings: &[&Recording]) -> f64 {
    let mut periods: Vec<f64> = recordings.iter().map(|recording| recording.period_s).collect();
    periods.sort_by(f64::total_cmp);
    periods.get(periods.len() / 2).copied().unwrap_or(robot.sample_period_s)
}

impl Series {
    /// Joins recordings of `robot`, whose description says what their columns mean.
    pub fn of(robot: &Robot, recordings: &[&Recording]) -> Self {
        let (channels, joints) = (robot.channels(), robot.joints.len());
        let stages = recordings.iter().map(|r| r.len()).sum();
        let mut series = Series {
            measured: Vec::with_capacity(stages * channels.len()),
            input: Vec::with_capacity(stages * joints),
            input_spread: Vec::new(),
            duration_s: Vec::with_capacity(stages),
            time_s: Vec::with_capacity(stages),
            period_s: period_s(robot, recordings),
            recordings: Vec::new(),
            segments: Vec::new(),
            rest: Vec::new(),
            gyros: robot.gyros().count(),
            instants_s: Vec::new(),
            channels,
            joints,
        };
        let offsets_s: Vec<f64> = robot.gyros().map(|gyro| gyro.offset_s).collect();
        let instants: Vec<Vec<Option<GyroInstants>>> = recordings
            .iter()
            .map(|r| {
                offsets_s.iter().enumerate().map(|(gyro, offset_s)| GyroInstants::of(r, gyro, *offset_s)).collect()
            })
            .collect();
        let timed = instants.iter().flatten().any(Option::is_some);
        for (recording, instants) in recordings.iter().zip(&instants) {
            series.push(recording, timed.then_some((instants, &offsets_s)));
        }
        series
    }

    /// With the instants of gyros and the offsets of those that have none, where any recording has some.
    fn push(&mut self, recording: &Recording, instants: Option<(&Vec<Option<GyroInstants>>, &Vec<f64>)>) {
        let first = self.stages();
        let rest = recording.rest_window();
        let mut at_rest = 0;
        let segments: Vec<Range<usize>> = runs(recording).collect();
        let times_us = stamps::times_us(recording, &segments);
        for segment in segments {
            let start = self.stages();
            for k in segment.clone() {
                self.measured.extend(recording.channels.iter().map(|c| c.values[k]));
                if let Some((instants, offsets_s)) = instants {
                    self.place_gyros(recording, (instants, offsets_s), (k, &segment), &times_us);
                }
                self.input.extend(recording.duty.iter().map(|duty| duty[k]));
                let last = k + 1 == segment.end;
                let step_us = if last { f64::NAN } else { times_us[k + 1] - times_us[k] };
                self.duration_s.push(step_us * 1e-6);
                self.time_s.push(recording.motion_time_s(k));
                at_rest += usize::from(rest.contains(&k));
            }
            self.segments.push(start..self.stages());
        }
        self.recordings.push(first..self.stages());
        self.rest.push(first..first + at_rest);
    }

    /// Puts the readings of gyros that belong to sample k into the last stage.
    fn place_gyros(
        &mut self,
        recording: &Recording,
        (instants, offsets_s): (&[Option<GyroInstants>], &[f64]),
        (k, run): (usize, &Range<usize>),
        times_us: &[f64],
    ) {
        let stage = self.measured.len() - self.channels.len();
        let first = self.instants_s.len();
        self.instants_s.extend_from_slice(offsets_s);
        for (channel, spec) in self.channels.iter().enumerate() {
            let ChannelKind::GyroAxis { gyro, .. } = spec.kind else { continue };
            let Some(instants) = &instants[gyro] else { continue };
            let reading = instants.reading(k, run, times_us);
            self.measured[stage + channel] =
                reading.map_or(f64::NAN, |(from, _)| recording.channels[channel].values[from]);
            self.instants_s[first + gyro] = reading.map_or(0.0, |(_, after_s)| after_s);
        }
    }

    /// About so many stages in so many windows spread over all recordings, with the start of their rest, as a series of their own; none
    /// where that would be more than a third of them.
    pub fn excerpt(&self, samples: usize, windows: usize) -> Option<Series> {
        Some(self.excerpt_of(&self.spread(samples, windows)?, samples / windows))
    }

    /// The windows of [`Self::excerpt`], of `samples / windows` stages each.
    pub fn spread(&self, samples: usize, windows: usize) -> Option<Vec<Range<usize>>> {
        let (whole, length) = (self.stages(), samples / windows);
        if whole < 3 * samples {
            return None;
        }
        let mut spread = Vec::with_capacity(windows + self.recordings.len());
        for (recording, moving) in self.recordings.iter().zip(self.moving(length)) {
            let count = (windows * recording.len()).div_ceil(whole);
            let last = recording.end.saturating_sub(length);
            let mut from = moving;
            for window in 0..count {
                let start = from.max(moving + last.saturating_sub(moving) * (window + 1) / count);
                from = (start + length).min(recording.end);
                spread.push(start..from);
            }
        }
        Some(spread)
    }

    /// Where each recording goes on behind so many stages of its rest.
    pub fn moving(&self, rest: usize) -> impl Iterator<Item = usize> {
        self.rest.iter().map(move |at_rest| at_rest.start + at_rest.len().min(rest))
    }

    /// These windows, in order and apart, and so many stages of every recording's rest, as a series of their own.
    pub fn excerpt_of(&self, windows: &[Range<usize>], rest: usize) -> Series {
        let samples = windows.iter().map(Range::len).sum::<usize>() + rest * self.recordings.len();
        let mut part = Series {
            measured: Vec::with_capacity(samples * self.channels.len()),
            input: Vec::with_capacity(samples * self.joints),
            input_spread: Vec::new(),
            duration_s: Vec::with_capacity(samples),
            time_s: Vec::with_capacity(samples),
            period_s: self.period_s,
            recordings: Vec::new(),
            segments: Vec::new(),
            rest: Vec::new(),
            channels: self.channels.clone(),
            joints: self.joints,
            gyros: self.gyros,
            instants_s: Vec::new(),
        };
        for ((recording, at_rest), moving) in self.recordings.iter().zip(&self.rest).zip(self.moving(rest)) {
            let first = part.stages();
            part.take(self, at_rest.start..moving);
            part.rest.push(first..part.stages());
            for window in windows.iter().filter(|window| recording.contains(&window.start)) {
                part.take(self, window.clone());
            }
            part.recordings.push(first..part.stages());
        }
        part
    }

    /// Appends stages of another series with the gaps that are among them.
    fn take(&mut self, from: &Series, stages: Range<usize>) {
        let mut start = stages.start;
        for k in stages.clone() {
            if k + 1 < stages.end && !from.duration_s[k].is_nan() {
                continue;
            }
            let run = start..k + 1;
            start = k + 1;
            if run.len() < SHORTEST_RUN {
                continue;
            }
            let first = self.stages();
            let channels = self.channels.len();
            self.measured.extend_from_slice(&from.measured[run.start * channels..run.end * channels]);
            self.input.extend_from_slice(&from.input[run.start * self.joints..run.end * self.joints]);
            if !from.input_spread.is_empty() {
                self.input_spread.extend_from_slice(&from.input_spread[run.start * self.joints..run.end * self.joints]);
            }
            self.duration_s.extend_from_slice(&from.duration_s[run.clone()]);
            self.time_s.extend_from_slice(&from.time_s[run.clone()]);
            if !from.instants_s.is_empty() {
                self.instants_s.extend_from_slice(&from.instants_s[run.start * from.gyros..run.end * from.gyros]);
            }
            if let Some(last) = self.duration_s.last_mut() {
                *last = f64::NAN;
            }
            self.segments.push(first..self.stages());
        }
    }

    /// These windows, in order and apart, as a series of their own, each a block: the series, the first stage of every block, and which stage of this
    /// series each of its stages is. The chain breaks before each block. Runs that are too short are left out.
    pub fn select(&self, windows: &[Range<usize>]) -> (Series, Vec<usize>, Vec<usize>) {
        let mut part = Series {
            measured: Vec::new(),
            input: Vec::new(),
            input_spread: Vec::new(),
            duration_s: Vec::new(),
            time_s: Vec::new(),
            recordings: Vec::new(),
            segments: Vec::new(),
            rest: Vec::new(),
            channels: self.channels.clone(),
            instants_s: Vec::new(),
            ..*self
        };
        let (mut starts, mut places) = (Vec::new(), Vec::new());
        for (recording, rest) in self.recordings.iter().zip(&self.rest) {
            let first = part.stages();
            for window in windows.iter().filter(|window| recording.contains(&window.start)) {
                let start = part.stages();
                let runs = self.segments.iter().map(|run| run.start.max(window.start)..run.end.min(window.end));
                for run in runs.filter(|run| run.len() >= SHORTEST_RUN) {
                    part.take(self, run.clone());
                    places.extend(run);
                }
                if part.stages() > start {
                    starts.push(start);
                }
            }
            let at_rest = places[first..].iter().filter(|k| rest.contains(k)).count();
            part.recordings.push(first..part.stages());
            part.rest.push(first..first + at_rest);
        }
        (part, starts, places)
    }

    /// The same stages with a break behind every so many.
    pub(crate) fn in_pieces(&self, stages: usize) -> Series {
        let mut pieces = self.clone();
        pieces.segments.clear();
        for run in &self.segments {
            let mut start = run.start;
            while start < run.end {
                // What would be left behind the last break is too short for a piece of its own.
                let end = if run.end - start < 2 * stages { run.end } else { start + stages };
                pieces.duration_s[end - 1] = f64::NAN;
                pieces.segments.push(start..end);
                start = end;
            }
        }
        pieces
    }

    /// The runs for which `keep` says so, by their place, as a series of their own.
    pub(crate) fn only(&self, keep: impl Fn(usize) -> bool) -> Series {
        let mut part = Series {
            measured: Vec::new(),
            input: Vec::new(),
            input_spread: Vec::new(),
            duration_s: Vec::new(),
            time_s: Vec::new(),
            recordings: Vec::new(),
            segments: Vec::new(),
            rest: Vec::new(),
            channels: self.channels.clone(),
            instants_s: Vec::new(),
            ..*self
        };
        for (recording, rest) in self.recordings.iter().zip(&self.rest) {
            let first = part.stages();
            let runs = self.segments.iter().enumerate().filter(|(_, run)| recording.contains(&run.start));
            let mut at_rest = 0;
            for (_, run) in runs.filter(|(place, _)| keep(*place)) {
                at_rest += run.clone().filter(|k| rest.contains(k)).count();
                part.take(self, run.clone());
            }
            part.recordings.push(first..part.stages());
            part.rest.push(first..first + at_rest);
        }
        part
    }

    /// Random readings around zero for tests: `rest` stages without input, then random input.
    #[cfg(test)]
    pub(crate) fn made_up(robot: &Robot, stages: usize, rest: usize) -> Self {
        use rand::{RngExt, SeedableRng};
        let mut rng = rand::rngs::StdRng::seed_from_u64(1);
        let (channels, joints) = (robot.channels(), robot.joints.len());
        Series {
            measured: (0..stages * channels.len()).map(|_| rng.random_range(-0.5..0.5)).collect(),
            input: (0..stages * joints)
                .map(|i| if i < rest * joints { 0.0 } else { rng.random_range(-0.9..0.9) })
                .collect(),
            input_spread: Vec::new(),
            time_s: (0..stages).map(|k| 1e-3 * k as f64).collect(),
            period_s: 1e-3,
            duration_s: (0..stages).map(|k| if k + 1 < stages { 1e-3 } else { f64::NAN }).collect(),
            recordings: std::iter::once(0..stages).collect(),
            segments: std::iter::once(0..stages).collect(),
            rest: std::iter::once(0..rest).collect(),
            gyros: robot.gyros().count(),
            instants_s: Vec::new(),
            channels,
            joints,
        }
    }

    /// Takes out readings `(stage, channel)` and breaks the chain behind stage `gap`.
    #[cfg(test)]
    pub(crate) fn spoil(&mut self, missing: &[(usize, usize)], gap: usize) {
        for (k, channel) in missing {
            self.measured[k * self.channels.len() + channel] = f64::NAN;
        }
        self.duration_s[gap] = f64::NAN;
        let stages = self.stages();
        self.segments = vec![0..gap + 1, gap + 1..stages];
    }

    /// Instants of gyros' readings as `of(stage, gyro)` says.
    #[cfg(test)]
    pub(crate) fn with_instants(mut self, of: impl Fn(usize, usize) -> f64) -> Self {
        let all = (0..self.stages()).flat_map(|k| (0..self.gyros).map(move |gyro| (k, gyro)));
        self.instants_s = all.map(|(k, gyro)| of(k, gyro)).collect();
        self
    }

    /// The instant of a gyro's reading after stage k, s, if it is not the description's.
    pub fn instant_s(&self, k: usize, gyro: usize) -> Option<f64> {
        self.instants_s.get(k * self.gyros + gyro).copied()
    }

    /// Whether gyros have instants of their own.
    pub fn has_instants(&self) -> bool {
        !self.instants_s.is_empty()
    }

    /// Number of stages.
    pub fn stages(&self) -> usize {
        self.duration_s.len()
    }

    /// Number of joints.
    pub fn joints(&self) -> usize {
        self.joints
    }

    /// Measurements of stage k, one a channel.
    pub fn measured(&self, k: usize) -> &[f64] {
        &self.measured[k * self.channels.len()..(k + 1) * self.channels.len()]
    }

    /// What the readings alone show of where laws of sensors start.
    pub(crate) fn readings(&self) -> Readings {
        let largest = |gyro: usize| {
            let is_of = |kind| matches!(kind, ChannelKind::GyroAxis { gyro: of, .. } if of == gyro);
            let mut ends = [0.0_f64; BEYOND_END.len()];
            for axis in (0..self.channels.len()).filter(|&channel| is_of(self.channels[channel].kind)) {
                let mut sizes: Vec<f64> =
                    (0..self.stages()).map(|k| self.measured(k)[axis].abs()).filter(|size| size.is_finite()).collect();
                sizes.sort_unstable_by(|a, b| b.total_cmp(a));
                for (end, beyond) in ends.iter_mut().zip(BEYOND_END) {
                    *end = end.max(sizes.get(beyond).copied().unwrap_or(0.0));
                }
            }
            ends.to_vec()
        };
        Readings { gyro_ends_rad_s: (0..self.gyros).map(largest).collect() }
    }

    /// Replaces a reading, unless there is none.
    pub(crate) fn replace(&mut self, k: usize, channel: usize, reading: f64) {
        let measured = &mut self.measured[k * self.channels.len() + channel];
        if measured.is_finite() {
            *measured = reading;
        }
    }

    /// Input from stage k to the next, one a joint.
    pub fn input(&self, k: usize) -> &[f64] {
        &self.input[k * self.joints..(k + 1) * self.joints]
    }

    /// How many times the usual error is allowed of the measured input of a joint from stage k to the next.
    pub(crate) fn input_spread(&self, k: usize, joint: usize) -> f64 {
        self.input_spread.get(k * self.joints + joint).copied().unwrap_or(1.0)
    }

    /// Allows these measured inputs, (stage, joint), so many times the usual error, and all others one.
    pub(crate) fn spread_inputs(&mut self, spread: &[(usize, usize, f64)]) {
        self.input_spread.clear();
        if !spread.is_empty() {
            self.input_spread.resize(self.input.len(), 1.0);
        }
        for (k, joint, times) in spread {
            self.input_spread[k * self.joints + joint] = *times;
        }
    }

    /// Time from stage k to the next, s; NaN where the chain breaks.
    pub fn duration_s(&self, k: usize) -> f64 {
        self.duration_s[k]
    }

    /// The median time from a stage to the next, s.
    pub fn median_period_s(&self) -> f64 {
        let mut durations: Vec<f64> = self.duration_s.iter().copied().filter(|duration| !duration.is_nan()).collect();
        durations.sort_by(f64::total_cmp);
        durations.get(durations.len() / 2).copied().unwrap_or(f64::NAN)
    }

    /// Time of stage k since the start of its recording, s.
    pub fn time_s(&self, k: usize) -> f64 {
        self.time_s[k]
    }

    /// The stage `samples` after stage k, if it belongs to the same run.
    pub fn beside(&self, k: usize, samples: i32) -> Option<usize> {
        let run = &self.segments[self.segments.partition_point(|run| run.end <= k)];
        k.checked_add_signed(samples as isize).filter(|k| run.contains(k))
    }

    /// The stage `samples` after stage k, or the last of its run on the way there.
    pub fn nearest(&self, k: usize, samples: i32) -> usize {
        let run = &self.segments[self.segments.partition_point(|run| run.end <= k)];
        k.saturating_add_signed(samples as isize).clamp(run.start, run.end - 1)
    }

    /// Whether stage k is the first of a run.
    pub fn starts_run(&self, k: usize) -> bool {
        k == 0 || self.duration_s[k - 1].is_nan()
    }

    /// The recording that stage k belongs to.
    pub fn recording_of(&self, k: usize) -> usize {
        self.recordings.partition_point(|range| range.end <= k)
    }
}
