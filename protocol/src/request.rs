//! What the host asks for, and how the device answers.
//!
//! ```text
//!   host                              device
//!   Request { id: 7, Start }  ──────►  acts
//!                             ──✗────  Accepted { id: 7 }          lost on the line
//!   Request { id: 7, Start }  ──────►  knows 7: does not act again
//!                             ◄──────  Accepted { id: 7 }          the same answer
//! ```
//!
//! What may be done twice is done twice ([`Command::is_idempotent`]): a stop is never answered from memory.

use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

use heapless::Vec;

use crate::{
    description::{DESCRIPTION_PIECE, DescriptionError},
    event::{Fault, MotionEnd},
    motion::{Header, MotionError, Segment},
    units::{Duty, MotionId},
};

/// Device time without a heartbeat after which the device stops a motion, µs.
pub const HEARTBEAT_TIMEOUT_US: u32 = 100_000;
/// Host time between heartbeats, ms; they come sooner when samples come faster than in real time.
pub const HEARTBEAT_PERIOD_MS: u64 = 20;

/// Largest duty of a jog, magnitude.
pub const MAX_JOG_DUTY: Duty = Duty(1500);
/// Longest jog, ms.
pub const MAX_JOG_MS: u8 = 200;

/// A request.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Schema)]
#[allow(clippy::large_enum_variant, reason = "no allocator to put the large one behind")]
pub enum Command {
    /// Send samples every tick, or stop it. Switching on starts the counts of [`Status`] anew; switching off leaves them.
    Stream {
        /// Whether to send.
        on: bool,
    },
    /// Send a [`Status`], then the acknowledgement.
    Status,
    /// The robot is held in its marked pose: take the encoders' counts as zero. Refused while a motion runs.
    SetZero,
    /// A motion follows, in so many segments. Whatever motion was there is forgotten. Refused while a motion runs.
    UploadBegin {
        /// The host's number for it, not 0.
        motion: MotionId,
        /// All but the segments.
        header: Header,
        /// How many segments follow.
        segments: u8,
    },
    /// One segment; in order, each may be repeated.
    UploadSegment {
        /// Its index.
        index: u8,
        /// The segment.
        segment: Segment,
    },
    /// All segments were sent: check number, checksum ([`crate::Motion::checksum`]) and every rule, then keep it.
    UploadEnd {
        /// Of the motion that was sent.
        checksum: u32,
    },
    /// Play the uploaded motion.
    Start {
        /// Which one is meant; refused if another is there.
        motion: MotionId,
        /// The tick in which the first segment begins, or the next one.
        at_seq: Option<u32>,
    },
    /// One joint is driven by this duty for so long, then all motors are off. For a robot that is brought up: no zero
    /// positions are needed. Every watch is awake, as in a motion. Refused while a motion or another jog runs, while a fault
    /// is latched or something would stop a motion, and beyond [`MAX_JOG_DUTY`] and [`MAX_JOG_MS`].
    Jog {
        /// Index of the joint, from 0.
        joint: u8,
        /// Its duty.
        duty: Duty,
        /// How long, ms; 1 or more.
        duration_ms: u8,
    },
    /// Zero duty at once, the motion is over. Never refused.
    Stop,
    /// Forget the latched fault. Refused while its cause lasts.
    ClearFault,
    /// A description of a robot ([`crate::Description`]) follows, in so many pieces. An upload that was under way is forgotten.
    /// This and the end are refused where the board has no place for it, while a motion or a jog runs, while a fault is
    /// latched, and until the drivers are off after a motion.
    DescriptionBegin {
        /// How many pieces follow.
        pieces: u8,
    },
    /// The next bytes of the encoded description; in order, each may be repeated.
    DescriptionPiece {
        /// Its index.
        index: u8,
        /// The bytes.
        bytes: Vec<u8, DESCRIPTION_PIECE>,
    },
    /// All pieces were sent: check number, checksum and whether the firmware can run such a robot on this board, store it,
    /// then answer. The next start runs it. The device may be silent for up to two seconds before the answer.
    DescriptionEnd {
        /// CRC-32 over the encoded description.
        checksum: u32,
    },
}

impl Command {
    /// Whether doing it again does no harm: such a request is carried out as often as it comes. The parts of an upload are
    /// such: their line keeps its order, a second beginning comes before the first segment, and a segment that is there is
    /// not taken again.
    pub fn is_idempotent(&self) -> bool {
        match self {
            Self::Status
            | Self::Stop
            | Self::ClearFault
            | Self::UploadBegin { .. }
            | Self::UploadSegment { .. }
            | Self::DescriptionBegin { .. }
            | Self::DescriptionPiece { .. } => true,
            Self::Stream { .. }
            | Self::SetZero
            | Self::UploadEnd { .. }
            | Self::Start { .. }
            | Self::Jog { .. }
            | Self::DescriptionEnd { .. } => false,
        }
    }

    /// CRC-32 over its bytes on the wire: tells two commands under the same id apart.
    pub fn checksum(&self) -> u32 {
        crate::frame::crc32_of(&[], self)
    }
}

/// Why a request was not carried out.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema, thiserror::Error)]
pub enum Refusal {
    /// A start without zero positions.
    #[error("the zero positions are not set: hold the robot in its marked pose and set zero first")]
    NotZeroed,
    /// Not while a motion runs.
    #[error("a motion is running: stop it first")]
    Running,
    /// Not while a fault is latched.
    #[error("a fault is latched ({0}): remove its cause and clear it")]
    Fault(Fault),
    /// A start of another motion than the uploaded one.
    #[error("motion {asked} is not there (uploaded: {there}; 0 is none): upload it again", asked = asked.0, there = there.0)]
    NoSuchMotion {
        /// The one to start.
        asked: MotionId,
        /// The one that is there, complete and valid.
        there: MotionId,
    },
    /// A start in the past, or more than half the counter's range ahead.
    #[error("tick {asked} is not ahead of tick {now}")]
    Late {
        /// The tick asked for.
        asked: u32,
        /// The device's tick.
        now: u32,
    },
    /// A segment or a piece out of order, or an upload ended before its last one came.
    #[error("part {got} where part {expected} was due: upload it again")]
    UploadOrder {
        /// The part due.
        expected: u8,
        /// The part that came, or the number of parts for an end.
        got: u8,
    },
    /// A part or an end without a beginning.
    #[error("no upload has begun")]
    NoUpload,
    /// The checksum over the upload differs.
    #[error("the upload arrived with checksum {got:#010x} instead of {expected:#010x}: upload it again")]
    Checksum {
        /// The host's.
        expected: u32,
        /// The device's.
        got: u32,
    },
    /// The motion breaks a rule.
    #[error("the motion is not valid: {0}")]
    Motion(MotionError),
    /// A start before the emergency stop was seen to work, since the device started.
    #[error(
        "the emergency stop was not tested since the device started: press it once, release it, and clear the fault"
    )]
    StopNotTested,
    /// The robot moves, or a sensor is silent: no zero can be taken.
    #[error("the sensors are not quiet: hold the robot still and try again")]
    NotQuiet,
    /// A jog of a joint that is not there.
    #[error("there is no joint {}: the robot has {joints}", joint + 1)]
    NoSuchJoint {
        /// Which was asked for, from 0.
        joint: u8,
        /// How many there are.
        joints: u8,
    },
    /// A jog beyond its bounds.
    #[error(
        "a jog of duty {} for {duration_ms} ms is beyond its bounds: at most {} for 1 to {MAX_JOG_MS} ms",
        duty.fraction(), MAX_JOG_DUTY.fraction()
    )]
    JogBounds {
        /// The duty asked for.
        duty: Duty,
        /// For how long, ms.
        duration_ms: u8,
    },
    /// A description for a board that has no place for it.
    #[error("this board cannot store a description")]
    NoStore,
    /// A description while the drivers are enabled, half a second after a motion.
    #[error("the drivers are still enabled after a motion")]
    Armed,
    /// A description in more pieces than it can have, or one that is none of this version.
    #[error("what was sent is not a description of a robot")]
    Unreadable,
    /// A description that the firmware cannot run on this board.
    #[error("the firmware cannot run this robot: {0}")]
    Description(DescriptionError),
    /// The flash did not take the description. What was stored before is there still.
    #[error("the flash did not take the description; the one before is kept")]
    StoreFailed,
}

/// What the device is doing.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub enum State {
    /// Zero duty, ready.
    Idle,
    /// A start was accepted and its tick has not come.
    Waiting {
        /// The tick of the start.
        at_seq: u32,
    },
    /// A motion is being played.
    Running {
        /// Index of the segment.
        phase: u8,
    },
    /// Zero duty, a fault is latched.
    Fault(Fault),
    /// One joint is driven for a moment.
    Jogging {
        /// Index of the joint, from 0.
        joint: u8,
    },
}

/// Where the device stands. Sent on [`Command::Status`].
///
/// It closes the balance of a stream: `end_seq − first_seq` ticks were offered to telemetry, `dropped` of them never
/// left the device, all others were sent.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct Status {
    /// What it is doing.
    pub state: State,
    /// Whether the stream is on.
    pub streaming: bool,
    /// First tick of the stream.
    pub first_seq: u32,
    /// One past the last tick of the stream: the next tick while it is on.
    pub end_seq: u32,
    /// Samples of the stream that the device dropped.
    pub dropped: u32,
    /// The motion that is there, complete and valid.
    pub motion: MotionId,
    /// How the last motion ended.
    pub last_end: Option<(MotionId, MotionEnd)>,
}

/// A host's sign of life.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct Heartbeat {
    /// One more every heartbeat; wraps.
    pub count: u16,
    /// Number of the last tick that the host has worked off. A simulated device need not run further ahead of it than
    /// the host's queue is long; a real one does not care.
    pub seen_seq: u32,
}

/// What a device said about the last request, so that a repeated one is answered and not acted on again.
///
/// The host uses one id for all attempts of a request and the next id for the next. A handshake forgets. A client that
/// uses an id again for another command is no repetition: the command's checksum tells.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Memory {
    last: Option<(u8, u32, Result<(), Refusal>)>,
}

impl Memory {
    /// Nothing asked yet.
    pub const fn new() -> Self {
        Self { last: None }
    }

    /// The answer given to the last request, if this is a repetition of it: the same id and the same command, which may
    /// not be done twice.
    pub fn recall(&self, id: u8, command: &Command) -> Option<Result<(), Refusal>> {
        let (known, checksum, answer) = self.last?;
        (known == id && !command.is_idempotent() && checksum == command.checksum()).then_some(answer)
    }

    /// Remembers the answer to a request; of one that may be done twice only that it was the last.
    pub fn keep(&mut self, id: u8, command: &Command, answer: Result<(), Refusal>) {
        self.last = (!command.is_idempotent()).then(|| (id, command.checksum(), answer));
    }

    /// Forgets: a host has greeted, its ids begin anew.
    pub fn forget(&mut self) {
        self.last = None;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const START: Command = Command::Start { motion: MotionId(3), at_seq: None };

    #[test]
    fn a_repeated_request_is_recalled_and_another_one_is_not() {
        let mut memory = Memory::new();
        assert_eq!(memory.recall(7, &START), None);
        memory.keep(7, &START, Err(Refusal::Running));
        assert_eq!(memory.recall(7, &START), Some(Err(Refusal::Running)));
        assert_eq!(memory.recall(8, &START), None, "another request");
        assert_eq!(memory.recall(7, &Command::Start { motion: MotionId(4), at_seq: None }), None, "another motion");
        assert_eq!(memory.recall(7, &Command::SetZero), None, "another command under a known id");
        memory.forget();
        assert_eq!(memory.recall(7, &START), None);
    }

    #[test]
    fn what_may_be_done_twice_is_never_recalled() {
        let header = Header { name: Default::default(), stages: Default::default(), gain: Default::default() };
        let begin = Command::UploadBegin { motion: MotionId(3), header, segments: 1 };
        let describe = Command::DescriptionBegin { pieces: 3 };
        for command in [Command::Stop, Command::Status, Command::ClearFault, begin, describe] {
            let mut memory = Memory::new();
            memory.keep(7, &command, Ok(()));
            assert_eq!(memory.recall(7, &command), None, "{command:?}");
            memory.keep(6, &START, Ok(()));
            memory.keep(7, &command, Ok(()));
            assert_eq!(memory.recall(6, &START), None, "only the last request is remembered");
        }
    }
}
