//! Rows in, columns out: the one place where samples become a [`Recording`], and where their order is checked.

use crate::robot::Robot;

use super::session;
use super::{Channel, Event, LogLine, LossBalance, Recording, Session, Source, Tick};

/// One sample.
#[derive(Debug, Clone, Copy)]
pub struct Row<'a> {
    /// Device time, unwrapped, µs.
    pub t_us: u64,
    /// Number of the tick, unwrapped.
    pub seq: u64,
    /// Segment of the motion, or [`NO_PHASE`](super::NO_PHASE).
    pub phase: u8,
    /// What the device says of the tick.
    pub tick: Tick,
    /// Input of each joint, in force from this tick to the next.
    pub duty: &'a [f64],
    /// A value for each of [`Robot::channels`](crate::robot::Robot::channels); NaN for no valid reading.
    pub values: &'a [f64],
}

/// Why a row cannot follow the rows before it.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum RowError {
    /// Another number of inputs or values than the robot has.
    #[error("{got} {what} where the robot has {expected}")]
    Width {
        /// "inputs" or "values".
        what: &'static str,
        /// By the robot's description.
        expected: usize,
        /// In the row.
        got: usize,
    },
    /// Time stands still or runs backwards.
    #[error("time {t_us} µs does not come after {before_us} µs")]
    Time {
        /// Of this row.
        t_us: u64,
        /// Of the row before.
        before_us: u64,
    },
    /// The tick's number does not rise.
    #[error("tick {seq} does not come after tick {before}")]
    Sequence {
        /// Of this row.
        seq: u64,
        /// Of the row before.
        before: u64,
    },
    /// The input is not a number, or infinite.
    #[error("input {} is {value}", joint + 1)]
    Input {
        /// Joint, 0-based.
        joint: usize,
        /// What came.
        value: f64,
    },
    /// A value is infinite.
    #[error("value {} is {value}", channel + 1)]
    Value {
        /// Index in the robot's channels.
        channel: usize,
        /// What came.
        value: f64,
    },
}

/// What every row is held against.
#[derive(Debug, Clone)]
pub(super) struct Order {
    joints: usize,
    channels: usize,
    before: Option<(u64, u64)>,
}

impl Order {
    pub(super) fn new(joints: usize, channels: usize) -> Self {
        Self { joints, channels, before: None }
    }

    /// Accepts the row as the next one, or says what is wrong with it and stays as it was.
    pub(super) fn accept(&mut self, row: &Row<'_>) -> Result<(), RowError> {
        let width = |what, expected, got| match expected == got {
            true => Ok(()),
            false => Err(RowError::Width { what, expected, got }),
        };
        width("inputs", self.joints, row.duty.len())?;
        width("values", self.channels, row.values.len())?;
        if let Some((t_us, seq)) = self.before {
            if row.t_us <= t_us {
                return Err(RowError::Time { t_us: row.t_us, before_us: t_us });
            }
            if row.seq <= seq {
                return Err(RowError::Sequence { seq: row.seq, before: seq });
            }
        }
        if let Some(joint) = row.duty.iter().position(|duty| !duty.is_finite()) {
            return Err(RowError::Input { joint, value: row.duty[joint] });
        }
        if let Some(channel) = row.values.iter().position(|value| value.is_infinite()) {
            return Err(RowError::Value { channel, value: row.values[channel] });
        }
        self.before = Some((row.t_us, row.seq));
        Ok(())
    }
}

/// Collects rows into a [`Recording`].
#[derive(Debug)]
pub struct Recorder {
    order: Order,
    recording: Recording,
}

impl Recorder {
    /// An empty recording of this session.
    pub fn new(session: Session) -> Self {
        let robot = session.robot;
        let robot = session::suited(robot, &session.gyro_times);
        let channels = robot.channels();
        let joints = robot.joints.len();
        let recording = Recording {
            source: Source { path: Default::default(), sha256: String::new() },
            imported_from: session.imported_from,
            period_s: session.period_s.unwrap_or(robot.sample_period_s),
            t_us: Vec::new(),
            part_of_us: None,
            seq: Vec::new(),
            duty: vec![Vec::new(); joints],
            phase: Vec::new(),
            ticks: Vec::new(),
            zero_rad: session.zero_rad,
            gyro_times: session.gyro_times,
            motion: session.motion,
            balance: None,
            events: Vec::new(),
            log: Vec::new(),
            firmware: session.firmware,
            damage: Vec::new(),
            robot,
            channels: channels.into_iter().map(|spec| Channel { spec, values: Vec::new() }).collect(),
        };
        Self { order: Order::new(joints, recording.channels.len()), recording }
    }

    /// Appends a sample.
    ///
    /// # Errors
    /// [`RowError`]; the recording stays as it was.
    pub fn push(&mut self, row: &Row<'_>) -> Result<(), RowError> {
        self.order.accept(row)?;
        let recording = &mut self.recording;
        recording.t_us.push(row.t_us);
        recording.seq.push(row.seq);
        recording.phase.push(row.phase);
        recording.ticks.push(row.tick);
        for (column, &duty) in recording.duty.iter_mut().zip(row.duty) {
            column.push(duty);
        }
        for (channel, &value) in recording.channels.iter_mut().zip(row.values) {
            channel.values.push(value);
        }
        Ok(())
    }

    /// Appends an event.
    pub fn event(&mut self, event: Event) {
        self.recording.events.push(event);
    }

    /// Appends a line of the firmware's log.
    pub fn log(&mut self, line: LogLine) {
        self.recording.log.push(line);
    }

    /// Sets the loss balance; the last one counts.
    pub fn balance(&mut self, balance: LossBalance) {
        self.recording.balance = Some(balance);
    }

    /// The robot whose samples are collected.
    pub fn robot(&self) -> &Robot {
        &self.recording.robot
    }

    /// Samples so far.
    pub fn len(&self) -> usize {
        self.recording.len()
    }

    /// Whether there is no sample yet.
    pub fn is_empty(&self) -> bool {
        self.recording.is_empty()
    }

    /// The recording, as read from `source`.
    pub fn finish(mut self, source: Source) -> Recording {
        self.recording.source = source;
        self.recording
    }
}
