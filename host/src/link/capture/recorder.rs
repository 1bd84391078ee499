//! A recording under way: what the device sends goes into the file, and the caller is told.

use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::time::{Duration, Instant};

use protocol::{EventKind, Flags, Motion, MotionId, Sample, Segment, Status};

use super::super::log::{Entry, LogCounts, LogReader};
use super::super::repeats::Repeats;
use super::super::{Arrival, Device, LinkError, Scales, words};
use super::error::CaptureError;
use super::progress::{Captured, News, Progress};
use crate::recording::mcap::{Disk, WriteError, Writer};
use crate::recording::{Event, LogLine, LossBalance, Severity};

/// The number under which motions are uploaded.
pub(super) const MOTION: MotionId = MotionId(1);
/// How long samples may stay away.
const SILENCE: Duration = Duration::from_secs(2);
/// How often the caller is told of progress, and looked at for a wish to stop.
const LOOK: Duration = Duration::from_millis(100);
/// Ticks that are recorded after the end of the motion.
const TAIL_TICKS: u64 = 250;
/// Device time between two balances in the file, for a reader of a recording that was cut off, µs.
const BALANCE_US: u64 = 1_000_000;
/// Ticks by which a motion may last longer than its segments can: it ends with them, so this is for a device that plays
/// something else or never says that it is over. With half of it nothing changes; twice records two seconds more.
const ENDLESS_TICKS: u64 = 2000;
/// Ticks within which an accepted start must be seen in the samples.
const START_TICKS: u64 = 2000;

/// A recording under way.
pub(super) struct Recorder<'a> {
    writer: Writer<Disk>,
    scales: Scales,
    /// The firmware's log, if it can be read.
    log: Option<LogReader>,
    log_unread: bool,
    tell: &'a mut dyn FnMut(News<'_>),
    warnings: Repeats,
    pub(super) counts: Counts,
}

/// Where it stands.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Counts {
    samples: u64,
    refused: u64,
    /// Where the motion is to start, as the device counts.
    start_tick: Option<u32>,
    first_us: Option<u64>,
    last_us: u64,
    first_seq: Option<u64>,
    last_seq: u64,
    /// Segment, and when it began.
    pub(super) phase: Option<usize>,
    phase_us: u64,
    /// First tick of the motion.
    begun_seq: Option<u64>,
    /// First tick after the motion.
    ended_seq: Option<u64>,
    balance_us: u64,
}

impl<'a> Recorder<'a> {
    pub(super) fn new(
        writer: Writer<Disk>,
        scales: Scales,
        log: Option<LogReader>,
        start_tick: Option<u32>,
        tell: &'a mut dyn FnMut(News<'_>),
    ) -> Self {
        let counts = Counts { start_tick, ..Counts::default() };
        Self { writer, scales, log, log_unread: false, tell, warnings: Repeats::default(), counts }
    }

    /// From the first sample to the last of the motion, and a little more.
    pub(super) fn play(&mut self, device: &mut Device, motion: &Motion, stop: &AtomicBool) -> Result<(), CaptureError> {
        device.stream()?;
        device.start(MOTION, self.counts.start_tick)?;
        let longest_ticks = u64::from(motion.longest_ms()) * 1000 / u64::from(device.hello().tick_us);
        let (mut looked, mut looked_samples, mut heard) = (Instant::now(), 0, Instant::now());
        loop {
            let arrival = device.next(LOOK)?;
            let now = Instant::now();
            match arrival {
                Some(arrival) => {
                    if matches!(arrival, Arrival::Sample { .. }) {
                        heard = now;
                    }
                    self.write(device, arrival)?;
                }
                None => self.writer.flush()?,
            }
            if stop.load(Relaxed) {
                return Err(CaptureError::Interrupted);
            }
            if now - heard > SILENCE {
                return Err(LinkError::Silent { waited: SILENCE }.into());
            }
            if self.counts.is_over() {
                return Ok(());
            }
            if self.counts.played_ticks() > longest_ticks + ENDLESS_TICKS {
                return Err(CaptureError::Endless { longest_s: f64::from(motion.longest_ms()) * 1e-3 });
            }
            if now - looked >= LOOK {
                let rate_hz = (self.counts.samples - looked_samples) as f64 / (now - looked).as_secs_f64();
                (looked, looked_samples) = (now, self.counts.samples);
                (self.tell)(News::Progress(self.counts.progress(motion, rate_hz, device.balance())));
            }
        }
    }

    /// Ends the stream and takes what is still under way.
    pub(super) fn end_stream(&mut self, device: &mut Device) -> Result<Status, LinkError> {
        let status = device.end_stream();
        while let Ok(Some(arrival)) = device.next(Duration::ZERO) {
            if let Err(error) = self.write(device, arrival) {
                // The file fails; closing it will say so again.
                tracing::warn!("{error}");
                break;
            }
        }
        status
    }

    /// Writes the balance and closes the file.
    pub(super) fn close(mut self, balance: &LossBalance) -> Result<(), WriteError> {
        self.writer.balance(balance)?;
        self.writer.finish()?.sync().map_err(|error| WriteError::File(error.into()))
    }

    fn write(&mut self, device: &Device, arrival: Arrival) -> Result<(), WriteError> {
        let (seq, t_us, (severity, text)) = match arrival {
            Arrival::Sample { seq, t_us, sample } => return self.sample(device, seq, t_us, &sample),
            // What the handshake has said already.
            Arrival::Event { kind: EventKind::Started(_), .. } if self.counts.samples == 0 => return Ok(()),
            Arrival::Event { seq, t_us, kind } => (seq, t_us, words::event(&kind)),
            Arrival::Loss(loss) => (self.counts.last_seq, self.counts.last_us, words::loss(&loss)),
            Arrival::Log { level, text } => {
                let entry = Entry { t_us: None, level: words::level(level), message: text, place: None };
                return self.line(device, entry);
            }
            Arrival::Defmt { at, bytes } => return self.log(device, at, &bytes),
        };
        match severity {
            Severity::Note => tracing::info!("{text}"),
            Severity::Warning | Severity::Error => self.warnings.warn(&text),
        }
        self.writer.event(&Event { t_us, seq, severity, text })
    }

    fn log(&mut self, device: &Device, at: u32, bytes: &[u8]) -> Result<(), WriteError> {
        let Some(log) = &mut self.log else {
            if !std::mem::replace(&mut self.log_unread, true) {
                (self.tell)(News::LogUnread);
            }
            return Ok(());
        };
        for entry in log.feed(at, bytes) {
            self.line(device, entry)?;
        }
        Ok(())
    }

    fn line(&mut self, device: &Device, entry: Entry) -> Result<(), WriteError> {
        let Entry { t_us, level, message, place } = entry;
        let t_us = t_us.map_or(self.counts.last_us, |t_us| device.near_us(t_us));
        let line = LogLine { t_us, level, message, place };
        (self.tell)(News::Log(&line));
        self.writer.log(&line)
    }

    /// What became of the firmware's log.
    pub(super) fn log_counts(&self) -> LogCounts {
        self.log.as_ref().map(LogReader::counts).unwrap_or_default()
    }

    fn sample(&mut self, device: &Device, seq: u64, t_us: u64, sample: &Sample) -> Result<(), WriteError> {
        match self.writer.push(&self.scales.row(seq, t_us, sample)) {
            Ok(()) => self.counts.sample(seq, t_us, sample),
            Err(WriteError::Row(error)) => {
                // Its numbers differ from sample to sample; the first says what is wrong, the count is told at the end.
                if self.counts.refused == 0 {
                    tracing::warn!("a sample was left out: {error}");
                }
                self.counts.refused += 1;
            }
            Err(error) => return Err(error),
        }
        if t_us.saturating_sub(self.counts.balance_us) >= BALANCE_US {
            self.counts.balance_us = t_us;
            self.writer.balance(&device.balance())?;
        }
        Ok(())
    }
}

impl Counts {
    fn sample(&mut self, seq: u64, t_us: u64, sample: &Sample) {
        self.samples += 1;
        self.first_us.get_or_insert(t_us);
        self.first_seq.get_or_insert(seq);
        (self.last_seq, self.last_us) = (seq, t_us);
        if sample.flags.contains(Flags::RUNNING) {
            let phase = usize::from(sample.phase);
            self.begun_seq.get_or_insert(seq);
            if self.phase != Some(phase) {
                (self.phase, self.phase_us) = (Some(phase), t_us);
            }
        } else if self.phase.is_some() {
            self.ended_seq.get_or_insert(seq);
        }
    }

    /// The motion and its tail are over, or it never began.
    fn is_over(&self) -> bool {
        match (self.ended_seq, self.phase, self.first_seq) {
            (Some(ended), ..) => self.last_seq >= ended + TAIL_TICKS,
            (None, None, Some(first)) => self.last_seq >= self.due_seq(first) + START_TICKS,
            _ => false,
        }
    }

    /// Ticks since the first one of the motion.
    fn played_ticks(&self) -> u64 {
        self.begun_seq.map_or(0, |begun| self.last_seq.saturating_sub(begun))
    }

    /// The tick of the start, unwrapped, for a stream that began with the tick `first`.
    fn due_seq(&self, first: u64) -> u64 {
        // The device took the start, so its tick lay ahead: less than half the counter's range.
        let ahead = self.start_tick.map_or(0, |tick| tick.wrapping_sub(first as u32));
        first + u64::from(if ahead < 1 << 31 { ahead } else { 0 })
    }

    /// Ticks until that of the start.
    fn starts_in_ticks(&self) -> Option<u64> {
        let (None, Some(_), Some(first)) = (self.phase, self.start_tick, self.first_seq) else { return None };
        Some(self.due_seq(first).saturating_sub(self.last_seq))
    }

    fn progress<'a>(&self, motion: &'a Motion, rate_hz: f64, balance: LossBalance) -> Progress<'a> {
        let longest_s = |segment: &Segment| f64::from(segment.action.longest_ms()) * 1e-3;
        let segment = self.phase.and_then(|phase| motion.segments.get(phase));
        let before = &motion.segments[..self.phase.unwrap_or(0).min(motion.segments.len())];
        let in_phase_s = (self.last_us - self.phase_us) as f64 * 1e-6;
        Progress {
            stage: segment.and_then(|s| motion.stages.get(usize::from(s.stage))).map(|name| name.as_str()),
            done_s: before.iter().map(longest_s).sum::<f64>()
                + segment.map_or(0.0, |segment| in_phase_s.min(longest_s(segment))),
            total_s: motion.segments.iter().map(longest_s).sum(),
            starts_in_ticks: self.starts_in_ticks(),
            rate_hz,
            balance,
        }
    }

    pub(super) fn captured(&self, balance: LossBalance, log: LogCounts) -> Captured {
        let duration_s = (self.last_us - self.first_us.unwrap_or(self.last_us)) as f64 * 1e-6;
        Captured { samples: self.samples, duration_s, balance, refused: self.refused, log }
    }
}
