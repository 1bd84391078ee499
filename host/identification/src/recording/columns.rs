//! The recording itself: columns, and the questions that every user of one asks.

use std::ops::Range;

use super::mcap::Damage;
use super::{Event, LogLine, LossBalance, Session, Source};
use crate::robot::{self, Robot};

/// [`Recording::phase`] outside of a motion, and of every row of an imported table.
pub const NO_PHASE: u8 = u8::MAX;

/// A time step longer than this many periods is a gap.
const LONGEST_STEP_PERIODS: f64 = 1.5;

/// A recording: one entry a tick in every column.
#[derive(Debug, Clone)]
pub struct Recording {
    /// The robot that moved.
    pub robot: Robot,
    /// The file that it was read from.
    pub source: Source,
    /// The table that it was imported from.
    pub imported_from: Option<Source>,
    /// Nominal period of the tick, of an imported table the mean step between its rows, s.
    pub period_s: f64,
    /// Device time, unwrapped, strictly rising, µs.
    pub t_us: Vec<u64>,
    /// Device time of the first sample of the recording that this is a part of; `None` of a whole one.
    pub part_of_us: Option<u64>,
    /// Number of the tick, unwrapped, strictly rising.
    pub seq: Vec<u64>,
    /// `[joint][k]`: input in force from t_k to t_{k+1}, in the unit of the robot's input (duty −1 … 1, say).
    pub duty: Vec<Vec<f64>>,
    /// Measured columns in the order of [`Robot::channels`].
    pub channels: Vec<Channel>,
    /// Segment of the motion that was being played, or [`NO_PHASE`].
    pub phase: Vec<u8>,
    /// What the device said of each tick; defaults for imported tables.
    pub ticks: Vec<Tick>,
    /// See [`Session::zero_rad`].
    pub zero_rad: Vec<f64>,
    /// See [`Session::gyro_times`].
    pub gyro_times: Vec<super::GyroTime>,
    /// The motion that was played.
    pub motion: Option<super::MotionFile>,
    /// Where missing samples went; `None` for tables, and for a recording that was cut off before the first balance.
    pub balance: Option<LossBalance>,
    /// What happened meanwhile.
    pub events: Vec<Event>,
    /// What the firmware logged.
    pub log: Vec<LogLine>,
    /// The device's handshake.
    pub firmware: Option<super::Firmware>,
    /// What is wrong with the file that it was read from; empty for a whole one.
    pub damage: Vec<Damage>,
}

/// One measured column.
#[derive(Debug, Clone, PartialEq)]
pub struct Channel {
    /// What it measures, its names, unit and sigma.
    pub spec: robot::Channel,
    /// One value a tick; NaN where the sensor had no valid reading (stale, saturated).
    pub values: Vec<f64>,
}

/// What the device says of a tick beside its measurements.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tick {
    /// The protocol's flags, as bits.
    pub flags: u16,
    /// Time that the tick before this one took, µs; NaN if unknown.
    pub execution_us: f64,
    /// How much later than one period after the tick before this one began, µs; NaN if unknown.
    pub jitter_us: f64,
    /// How long before the tick's time each gyro ended the conversion of its words, µs; NaN if unknown.
    pub gyro_ages_us: [f64; protocol::MAX_GYROS],
}

impl Default for Tick {
    fn default() -> Self {
        Self { flags: 0, execution_us: f64::NAN, jitter_us: f64::NAN, gyro_ages_us: [f64::NAN; protocol::MAX_GYROS] }
    }
}

impl Recording {
    /// Another description of the robot as it suits this recording: with the lags of gyros estimated whose clocks the device tells of.
    pub fn suited(&self, robot: Robot) -> Robot {
        super::session::suited(robot, &self.gyro_times)
    }

    /// Number of samples.
    pub fn len(&self) -> usize {
        self.t_us.len()
    }

    /// Whether there is no sample. A recording that was read has at least one.
    pub fn is_empty(&self) -> bool {
        self.t_us.is_empty()
    }

    /// Time of sample k after the first one, s.
    pub fn time_s(&self, k: usize) -> f64 {
        (self.t_us[k] - self.t_us[0]) as f64 * 1e-6
    }

    /// Time of sample k after the first one of the whole recording, s: what changes as a motion goes on, as warm-up does, counts from there.
    pub fn motion_time_s(&self, k: usize) -> f64 {
        (self.t_us[k] - self.part_of_us.unwrap_or(self.t_us[0])) as f64 * 1e-6
    }

    /// Time from the first to the last sample, s.
    pub fn duration_s(&self) -> f64 {
        self.len().checked_sub(1).map_or(0.0, |last| self.time_s(last))
    }

    /// Ticks for which there is no sample, between the first and the last one.
    pub fn missing_ticks(&self) -> u64 {
        match (self.seq.first(), self.seq.last()) {
            (Some(first), Some(last)) => (last - first).saturating_add(1).saturating_sub(self.len() as u64),
            _ => 0,
        }
    }

    /// Whether something is missing between sample k − 1 and sample k: a number was skipped, or a device's time step is
    /// longer than 1.5 periods. Numbers of a table's rows come from their steps.
    pub fn gap_before(&self, k: usize) -> bool {
        let step_us = (self.t_us[k] - self.t_us[k - 1]) as f64;
        let is_long = self.imported_from.is_none() && step_us > LONGEST_STEP_PERIODS * self.period_s * 1e6;
        self.seq[k] != self.seq[k - 1] + 1 || is_long
    }

    /// Runs of samples without a gap, in order; together they are all samples.
    pub fn segments(&self) -> Vec<Range<usize>> {
        let mut segments = Vec::new();
        let mut start = 0;
        for k in 1..self.len() {
            if self.gap_before(k) {
                segments.push(start..k);
                start = k;
            }
        }
        if start < self.len() {
            segments.push(start..self.len());
        }
        segments
    }

    /// Gaps between the samples.
    pub fn gaps(&self) -> usize {
        self.segments().len().saturating_sub(1)
    }

    /// The samples before the first input that is not zero: the robot rests, and gyros show their bias.
    ///
    /// It says nothing about whether the robot really rested; `check` does.
    pub fn rest_window(&self) -> Range<usize> {
        let end = (0..self.len()).find(|&k| self.duty.iter().any(|duty| duty[k] != 0.0));
        0..end.unwrap_or(self.len())
    }

    /// The column of that name, as in tables (`theta1`) or results (`encoder1`).
    pub fn channel(&self, name: &str) -> Option<&Channel> {
        self.channels.iter().find(|channel| channel.spec.column == name || channel.spec.name == name)
    }

    /// The samples of `range` as a recording of their own.
    pub fn part(&self, range: Range<usize>) -> Self {
        let cut = |column: &Vec<f64>| column[range.clone()].to_vec();
        Self {
            t_us: self.t_us[range.clone()].to_vec(),
            part_of_us: self.part_of_us.or(self.t_us.first().copied()),
            seq: self.seq[range.clone()].to_vec(),
            duty: self.duty.iter().map(cut).collect(),
            channels: self
                .channels
                .iter()
                .map(|channel| Channel { spec: channel.spec.clone(), values: cut(&channel.values) })
                .collect(),
            phase: self.phase[range.clone()].to_vec(),
            ticks: self.ticks[range.clone()].to_vec(),
            ..self.clone()
        }
    }

    /// One line for people: samples, length, rate and what is missing.
    pub fn summary(&self) -> String {
        let gaps = match (self.gaps(), self.missing_ticks()) {
            (0, _) => "no gap".to_owned(),
            (gaps, missing) => format!("{gaps} gaps, {missing} ticks missing"),
        };
        let (samples, robot, duration_s) = (self.len(), &self.robot.name, self.duration_s());
        format!("{samples} samples of {robot}, {duration_s:.3} s, {gaps}")
    }

    /// What surrounds the samples, to write them again.
    pub fn session(&self) -> Session {
        Session {
            robot: self.robot.clone(),
            motion: self.motion.clone(),
            zero_rad: self.zero_rad.clone(),
            firmware: self.firmware.clone(),
            gyro_times: self.gyro_times.clone(),
            period_s: (self.period_s != self.robot.sample_period_s).then_some(self.period_s),
            imported_from: self.imported_from.clone(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::fixture::plain;

    #[test]
    fn a_part_of_a_part_keeps_the_time_of_the_whole() {
        let part = plain(50).part(10..40).part(5..20);
        assert_eq!(part.len(), 15);
        assert_eq!(part.time_s(0), 0.0);
        // Samples are 1 ms apart; atol 1 ns, what a product with 1e-6 rounds.
        assert!((part.motion_time_s(0) - 0.015).abs() < 1e-9 && (part.motion_time_s(14) - 0.029).abs() < 1e-9);
    }
}
