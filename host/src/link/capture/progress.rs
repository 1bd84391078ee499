//! What the caller is told while a recording is made, and what was recorded.

use super::super::log::LogCounts;
use crate::recording::{LogLine, LossBalance};

/// What the caller is told while a recording is made.
#[derive(Debug, Clone, Copy)]
pub enum News<'a> {
    /// How far it is, a few times a second.
    Progress(Progress<'a>),
    /// The firmware logged a line, which is in the file as well.
    Log(&'a LogLine),
    /// The firmware logs and there is no [`Dictionary`](crate::link::Dictionary) to read it with. Told once.
    LogUnread,
    /// The file is closed, however the motion ended.
    Closed(&'a Captured),
}

/// How far a recording is.
#[derive(Debug, Clone, Copy)]
pub struct Progress<'a> {
    /// Name of the stage, once the motion runs.
    pub stage: Option<&'a str>,
    /// Time of the motion that is done if every move takes all of its time, s.
    pub done_s: f64,
    /// Time that the motion takes at most, s.
    pub total_s: f64,
    /// Ticks until the one in which the motion is to start; `None` once it runs, or without such a tick.
    pub starts_in_ticks: Option<u64>,
    /// Samples a second lately, as they arrive.
    pub rate_hz: f64,
    /// Where samples were lost so far.
    pub balance: LossBalance,
}

impl Progress<'_> {
    /// How much of the motion is done.
    pub fn per_mille(&self) -> u64 {
        (self.done_s / self.total_s * 1000.0) as u64
    }
}

/// What was recorded.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Captured {
    /// Samples in the file.
    pub samples: u64,
    /// Device time from the first to the last of them, s.
    pub duration_s: f64,
    /// Where the missing ones went.
    pub balance: LossBalance,
    /// Samples that arrived but could not follow the ones before them.
    pub refused: u64,
    /// What became of the firmware's log.
    pub log: LogCounts,
}
