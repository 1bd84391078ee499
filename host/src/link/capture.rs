//! A motion played and recorded from its first tick to its last.
//!
//! ```text
//!   prepare   settle → zero → scales agree? → motion valid? → upload          nothing moves, nothing is written
//!   run       file created → stream on → start → samples into the file … motion ends → a quarter second more
//!   close     stream off → the device's count → balance → file closed
//! ```
//!
//! Whatever goes wrong after the start, the stop goes out first; then the file is closed as well as it can be.

use std::fs::File;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::time::{Duration, Instant};

use protocol::motion::Limits;
use protocol::{Fault, Flags, Motion, MotionEnd, MotionError, MotionId, Sample, Segment, State, Status};

use super::{Arrival, Device, LinkError, ScaleError, Scales, words};
use crate::recording::mcap::{Disk, WriteError, Writer};
use crate::recording::{Event, LossBalance, MotionFile, Session, Severity};
use crate::robot::Robot;

/// The number under which motions are uploaded.
const MOTION: MotionId = MotionId(1);
/// How long samples may stay away.
const SILENCE: Duration = Duration::from_secs(2);
/// How often the caller is told of progress, and looked at for a wish to stop.
const LOOK: Duration = Duration::from_millis(100);
/// Ticks that are recorded after the end of the motion.
const TAIL_TICKS: u64 = 250;
/// Device time between two balances in the file, for a reader of a recording that was cut off, µs.
const BALANCE_US: u64 = 1_000_000;
/// Ticks within which an accepted start must be seen in the samples.
const START_TICKS: u64 = 2000;

/// Why a recording was not made, or not to its end.
#[derive(Debug, thiserror::Error)]
pub enum CaptureError {
    /// The device or the line.
    #[error(transparent)]
    Link(#[from] LinkError),
    /// Device and description are not the same robot.
    #[error("device and robot description disagree")]
    Scale(#[from] ScaleError),
    /// The motion does not fit the robot.
    #[error("the motion \"{motion}\" does not fit the robot {robot}")]
    Motion {
        /// Its name.
        motion: String,
        /// The robot's name.
        robot: String,
        /// The rule that it breaks.
        source: MotionError,
    },
    /// The file cannot be written any more.
    #[error(transparent)]
    Write(#[from] WriteError),
    /// The motion ended before its end.
    #[error("the motion was stopped in segment {phase} of {segments}: {why}")]
    Stopped {
        /// The segment, from 1.
        phase: usize,
        /// Segments of the motion.
        segments: usize,
        /// By whom or what.
        why: String,
        /// How the device says that it ended.
        end: MotionEnd,
    },
    /// The caller wished to stop.
    #[error("stopped by request")]
    Interrupted,
    /// An accepted start that never happened.
    #[error("the device accepted the start but does not play the motion")]
    NeverStarted,
}

/// A device made ready: zero known, motion uploaded, nothing moving.
pub struct Ready<'a> {
    device: &'a mut Device,
    motion: &'a Motion,
    scales: Scales,
    session: Session,
    start_tick: Option<u32>,
}

impl CaptureError {
    /// What the user can do about it.
    pub fn advice(&self) -> &'static str {
        match self {
            Self::Link(error) => error.advice(),
            Self::Scale(error) => error.advice(),
            Self::Motion { .. } => "change the motion file, or name the robot that is connected with --robot",
            Self::Write(_) => "check that the disk has room; the robot was stopped",
            Self::Stopped { end: MotionEnd::Fault(Fault::HeartbeatLost), .. } => {
                "the line from the host to the device was interrupted, or this machine stood still; the file holds what \
                 was recorded until then"
            }
            Self::Stopped { .. } => "remove the cause and record again; the file holds what was recorded until then",
            Self::Interrupted => "the robot was stopped; the file holds what was recorded until then",
            Self::NeverStarted => "reset the device and try again",
        }
    }
}

/// Whether the pose at hand is to be taken as zero.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Zero {
    /// Take it: the robot is held in its marked pose.
    Set,
    /// Use the zero that the device has.
    Keep,
}

/// How far it is, a few times a second.
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
}

impl<'a> Ready<'a> {
    /// Makes a device ready to play a motion. `motion_text` is the motion as a file, for the recording.
    ///
    /// # Errors
    /// [`CaptureError`]; nothing has moved.
    pub fn prepare(
        device: &'a mut Device,
        robot: &Robot,
        motion: &'a Motion,
        motion_text: String,
        zero: Zero,
    ) -> Result<Self, CaptureError> {
        device.settle()?;
        if zero == Zero::Set {
            device.set_zero()?;
        }
        let scales = Scales::new(device.hello(), robot)?;
        motion.validate(&joint_limits(robot)).map_err(|source| CaptureError::Motion {
            motion: motion.name.as_str().to_owned(),
            robot: robot.name.clone(),
            source,
        })?;
        device.upload(MOTION, motion)?;
        let mut session = Session::of(robot.clone());
        session.motion = Some(MotionFile { name: motion.name.as_str().to_owned(), toml: motion_text });
        session.zero_rad = scales.zero().to_vec();
        session.firmware = Some(words::firmware(device.hello()));
        Ok(Self { device, motion, scales, session, start_tick: None })
    }

    /// The motion starts in this tick of the device instead of at once; what comes before is recorded as well. A device
    /// that is past it refuses, and nothing moves.
    #[must_use]
    pub fn starting_at(self, tick: u32) -> Self {
        Self { start_tick: Some(tick), ..self }
    }

    /// Plays the motion and records it into a new, empty file. `watch` is told of progress a few times a second; `stop`
    /// ends it early.
    ///
    /// # Errors
    /// [`CaptureError`]. The robot is stopped, and the file holds what was recorded until then with its balance.
    pub fn run(
        self,
        file: File,
        stop: &AtomicBool,
        mut watch: impl FnMut(&Progress<'_>),
    ) -> Result<Captured, CaptureError> {
        let Self { device, motion, scales, session, start_tick } = self;
        let mut take = Take::new(Writer::new(Disk::new(file), &session)?, scales);
        take.counts.start_tick = start_tick;
        let played = take.play(device, motion, stop, &mut watch);
        if played.is_err() {
            // Before anything that may take its time.
            device.stopper().stop();
        }
        let status = take.end_stream(device);
        let balance = device.balance();
        let counts = take.counts;
        let filed = take.close(&balance);
        played?;
        filed?;
        let end = match status? {
            Status { last_end: Some((MOTION, end)), .. } => end,
            Status { state: State::Fault(fault), .. } => MotionEnd::Fault(fault),
            _ => return Err(CaptureError::NeverStarted),
        };
        let why = match end {
            MotionEnd::Finished => return Ok(counts.captured(balance)),
            MotionEnd::Stopped => "by a request of the host".to_owned(),
            MotionEnd::Fault(fault) => fault.to_string(),
        };
        let phase = counts.phase.map_or(0, |phase| phase + 1);
        Err(CaptureError::Stopped { phase, segments: motion.segments.len(), why, end })
    }
}

/// Where the joints of a robot may be, as motions know it.
pub fn joint_limits(robot: &Robot) -> Vec<Limits> {
    robot.joints.iter().map(|joint| Limits { min: joint.limits[0] as f32, max: joint.limits[1] as f32 }).collect()
}

/// A recording under way.
struct Take {
    writer: Writer<Disk>,
    scales: Scales,
    counts: Counts,
}

/// Where it stands.
#[derive(Debug, Clone, Copy, Default)]
struct Counts {
    samples: u64,
    refused: u64,
    /// Where the motion is to start, as the device counts.
    start_tick: Option<u32>,
    first_us: Option<u64>,
    last_us: u64,
    first_seq: Option<u64>,
    last_seq: u64,
    /// Segment, and when it began.
    phase: Option<usize>,
    phase_us: u64,
    /// First tick after the motion.
    ended_seq: Option<u64>,
    balance_us: u64,
}

impl Take {
    fn new(writer: Writer<Disk>, scales: Scales) -> Self {
        Self { writer, scales, counts: Counts::default() }
    }

    /// From the first sample to the last of the motion, and a little more.
    fn play(
        &mut self,
        device: &mut Device,
        motion: &Motion,
        stop: &AtomicBool,
        watch: &mut impl FnMut(&Progress<'_>),
    ) -> Result<(), CaptureError> {
        device.stream()?;
        device.start(MOTION, self.counts.start_tick)?;
        let (mut looked, mut looked_samples, mut heard) = (Instant::now(), 0, Instant::now());
        loop {
            let arrival = device.next(LOOK)?;
            let now = Instant::now();
            match arrival {
                Some(arrival) => {
                    if matches!(arrival, Arrival::Sample { .. }) {
                        heard = now;
                    }
                    self.keep(device, arrival)?;
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
            if now - looked >= LOOK {
                let rate_hz = (self.counts.samples - looked_samples) as f64 / (now - looked).as_secs_f64();
                (looked, looked_samples) = (now, self.counts.samples);
                watch(&self.counts.progress(motion, rate_hz, device.balance()));
            }
        }
    }

    /// Ends the stream and takes what is still under way.
    fn end_stream(&mut self, device: &mut Device) -> Result<Status, LinkError> {
        let status = device.end_stream();
        while let Ok(Some(arrival)) = device.next(Duration::ZERO) {
            if let Err(error) = self.keep(device, arrival) {
                // The file fails; closing it will say so again.
                tracing::warn!("{error}");
                break;
            }
        }
        status
    }

    /// Writes the balance and closes the file.
    fn close(mut self, balance: &LossBalance) -> Result<(), WriteError> {
        self.writer.balance(balance)?;
        self.writer.finish()?.sync().map_err(|error| WriteError::File(error.into()))
    }

    fn keep(&mut self, device: &Device, arrival: Arrival) -> Result<(), WriteError> {
        let (seq, t_us, (severity, text)) = match arrival {
            Arrival::Sample { seq, t_us, sample } => return self.sample(device, seq, t_us, &sample),
            Arrival::Event { seq, t_us, kind } => (seq, t_us, words::event(&kind)),
            Arrival::Loss(loss) => (self.counts.last_seq, self.counts.last_us, words::loss(&loss)),
            Arrival::Log { level, text } => (self.counts.last_seq, self.counts.last_us, (words::level(level), text)),
            // Only the firmware's image tells what they mean.
            Arrival::Defmt { bytes, .. } => {
                tracing::debug!("{} bytes of the device's defmt log", bytes.len());
                return Ok(());
            }
        };
        match severity {
            Severity::Note => tracing::info!("{text}"),
            Severity::Warning | Severity::Error => tracing::warn!("{text}"),
        }
        self.writer.event(&Event { t_us, seq, severity, text })
    }

    fn sample(&mut self, device: &Device, seq: u64, t_us: u64, sample: &Sample) -> Result<(), WriteError> {
        match self.writer.push(&self.scales.row(seq, t_us, sample)) {
            Ok(()) => self.counts.sample(seq, t_us, sample),
            Err(WriteError::Row(error)) => {
                tracing::warn!("a sample was left out: {error}");
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

    fn captured(&self, balance: LossBalance) -> Captured {
        let duration_s = (self.last_us - self.first_us.unwrap_or(self.last_us)) as f64 * 1e-6;
        Captured { samples: self.samples, duration_s, balance, refused: self.refused }
    }
}
