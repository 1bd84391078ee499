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
use std::sync::atomic::AtomicBool;

use firmware::motion::preset;
use protocol::motion::Limits;
use protocol::{Fault, Motion, MotionEnd, MotionError, MotionId, State, Status};

use super::log::{Dictionary, LogCounts, LogReader};
use super::take::Take;
use super::{Device, LinkError, ScaleError, Scales, words};
use crate::recording::mcap::{Disk, WriteError, Writer};
use crate::recording::{GyroTime, LogLine, LossBalance, MotionFile, Session};
use crate::robot::Robot;

/// The number under which motions are uploaded.
pub(super) const MOTION: MotionId = MotionId(1);

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
    /// The device goes on when every segment must be over.
    #[error(
        "the motion is not over after {longest_s} s, the longest that its segments can take, and 2 s more: the device was stopped"
    )]
    Endless {
        /// What its segments can take, s.
        longest_s: f64,
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
    log: Option<LogReader>,
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
            Self::Stopped { end: MotionEnd::Fault(Fault::WrongWay { .. }), .. } => {
                "swap the leads of that motor or the two phases of its encoder, or give its counts per turn the other sign; \
                 the file holds what was recorded until then"
            }
            Self::Stopped { end: MotionEnd::Fault(Fault::EncoderStuck { .. }), .. } => {
                "is a wire of that encoder broken, does it belong to that motor, and is the joint free to move? The file holds \
                 what was recorded until then"
            }
            Self::Stopped { end: MotionEnd::Fault(Fault::RotationMismatch { .. }), .. } => {
                "was the robot in its marked pose when its zero was set? Check the encoders' wires, counts per turn and gears, \
                 the belts for slip, and the gyro's axes and range in the firmware's robot; the file holds what was recorded \
                 until then"
            }
            Self::Stopped { .. } => "remove the cause and record again; the file holds what was recorded until then",
            Self::Endless { .. } => {
                "is the firmware the one that belongs to this program? Reset the device and flash it again"
            }
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

/// What the caller is told while a recording is made.
#[derive(Debug, Clone, Copy)]
pub enum News<'a> {
    /// How far it is, a few times a second.
    Progress(Progress<'a>),
    /// The firmware logged a line, which is in the file as well.
    Log(&'a LogLine),
    /// The firmware logs and there is no [`Dictionary`] to read it with. Told once.
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
        session.gyro_times = GyroTime::of(&device.hello().gyros);
        session.firmware = Some(words::firmware(device.hello()));
        Ok(Self { device, motion, scales, session, start_tick: None, log: None })
    }

    /// The motion starts in this tick of the device instead of at once; what comes before is recorded as well. A device
    /// that is past it refuses, and nothing moves.
    #[must_use]
    pub fn starting_at(self, tick: u32) -> Self {
        Self { start_tick: Some(tick), ..self }
    }

    /// The firmware's log is read with this dictionary, which [fits](Dictionary::fits) the device.
    #[must_use]
    pub fn reading_log(self, dictionary: Dictionary) -> Self {
        Self { log: Some(LogReader::new(dictionary)), ..self }
    }

    /// Plays the motion and records it into a new, empty file. `tell` is told of progress and of the firmware's log;
    /// `stop` ends it early.
    ///
    /// # Errors
    /// [`CaptureError`]. The robot is stopped, and the file holds what was recorded until then with its balance.
    pub fn run(self, file: File, stop: &AtomicBool, mut tell: impl FnMut(News<'_>)) -> Result<Captured, CaptureError> {
        let Self { device, motion, scales, session, start_tick, log } = self;
        let mut take = Take::new(Writer::new(Disk::new(file), &session)?, scales, log, start_tick, &mut tell);
        let played = take.play(device, motion, stop);
        if played.is_err() {
            // Before anything that may take its time.
            device.stopper().stop();
        }
        let status = take.end_stream(device);
        let balance = device.balance();
        let (counts, log) = (take.counts, take.log_counts());
        let filed = take.close(&balance);
        let captured = counts.captured(balance, log);
        tell(News::Closed(&captured));
        played?;
        filed?;
        let end = match status? {
            Status { last_end: Some((MOTION, end)), .. } => end,
            Status { state: State::Fault(fault), .. } => MotionEnd::Fault(fault),
            _ => return Err(CaptureError::NeverStarted),
        };
        let why = match end {
            MotionEnd::Finished => return Ok(captured),
            MotionEnd::Stopped => "by a request of the host".to_owned(),
            MotionEnd::Fault(fault) => fault.to_string(),
        };
        let phase = counts.phase.map_or(0, |phase| phase + 1);
        Err(CaptureError::Stopped { phase, segments: motion.segments.len(), why, end })
    }
}

/// The firmware's motion of this name, `calibration` or `validation`, for a robot; and the text of its file.
pub fn preset_motion(name: &str, robot: &Robot) -> Option<(Motion, Result<String, toml::ser::Error>)> {
    let limits = joint_limits(robot);
    let motion = match name {
        "calibration" => preset::calibration(&limits),
        "validation" => preset::validation(&limits),
        _ => return None,
    };
    let text = toml::to_string(&motion);
    Some((motion, text))
}

/// Where the joints of a robot may be, as motions know it.
pub fn joint_limits(robot: &Robot) -> Vec<Limits> {
    robot.joints.iter().map(|joint| Limits { min: joint.limits[0] as f32, max: joint.limits[1] as f32 }).collect()
}
