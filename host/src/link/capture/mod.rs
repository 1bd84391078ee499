//! A motion played and recorded from its first tick to its last.
//!
//! ```text
//!   prepare   settle → zero → scales agree? → motion valid? → upload          nothing moves, nothing is written
//!   run       file created → stream on → start → samples into the file … motion ends → a quarter second more
//!   close     stream off → the device's count → balance → file closed
//! ```
//!
//! Whatever goes wrong after the start, the stop goes out first; then the file is closed as well as it can be.

mod error;
mod progress;
mod recorder;

pub use error::CaptureError;
pub use progress::{Captured, News, Progress};

use std::fs::File;
use std::sync::atomic::AtomicBool;

use firmware::motion::preset;
use protocol::motion::Limits;
use protocol::{Motion, MotionEnd, State, Status};

use super::log::{Dictionary, LogReader};
use super::{Device, Scales, words};
use crate::recording::mcap::{Disk, Writer};
use crate::recording::{GyroTime, MotionFile, Session};
use crate::robot::Robot;
use recorder::{MOTION, Recorder};

/// A device made ready: zero known, motion uploaded, nothing moving.
pub struct Ready<'a> {
    device: &'a mut Device,
    motion: &'a Motion,
    scales: Scales,
    session: Session,
    start_tick: Option<u32>,
    log: Option<LogReader>,
}

/// Whether the pose at hand is to be taken as zero.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Zero {
    /// Take it: the robot is held in its marked pose.
    Set,
    /// Use the zero that the device has.
    Keep,
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
        let mut recorder = Recorder::new(Writer::new(Disk::new(file), &session)?, scales, log, start_tick, &mut tell);
        let played = recorder.play(device, motion, stop);
        if played.is_err() {
            // Before anything that may take its time.
            device.stopper().stop();
        }
        let status = recorder.end_stream(device);
        let balance = device.balance();
        let (counts, log) = (recorder.counts, recorder.log_counts());
        let filed = recorder.close(&balance);
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
