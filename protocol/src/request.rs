//! What the host asks for, and how the device answers.
//!
//! ```text
//!   host                              device
//!   Request { id: 7, Start }  ──────►  acts
//!                             ──✗────  Accepted { id: 7 }          lost on the line
//!   Request { id: 7, Start }  ──────►  knows 7: does not act again
//!                             ◄──────  Accepted { id: 7 }          the same answer
//! ```

use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

use crate::{
    event::{Fault, MotionEnd},
    motion::{Header, MotionError, Segment},
    units::MotionId,
};

/// Device time without a heartbeat after which the device stops a motion, µs.
pub const HEARTBEAT_TIMEOUT_US: u32 = 100_000;
/// Host time between heartbeats, ms; they come sooner when samples come faster than in real time.
pub const HEARTBEAT_PERIOD_MS: u64 = 20;

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
    /// Zero duty at once, the motion is over. Never refused.
    Stop,
    /// Forget the latched fault. Refused while its cause lasts.
    ClearFault,
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
    /// A segment out of order, or a motion ended before its last segment came.
    #[error("segment {got} where segment {expected} was due: upload the motion again")]
    UploadOrder {
        /// The segment due.
        expected: u8,
        /// The segment that came, or the number of segments for an end.
        got: u8,
    },
    /// A segment or an end without a beginning.
    #[error("no upload has begun")]
    NoUpload,
    /// The checksum over the motion differs.
    #[error("the motion arrived with checksum {got:#010x} instead of {expected:#010x}: upload it again")]
    Checksum {
        /// The host's.
        expected: u32,
        /// The device's.
        got: u32,
    },
    /// The motion breaks a rule.
    #[error("the motion is not valid: {0}")]
    Motion(MotionError),
    /// The robot moves, or a sensor is silent: no zero can be taken.
    #[error("the sensors are not quiet: hold the robot still and try again")]
    NotQuiet,
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
/// The host uses one id for all attempts of a request and the next id for the next. A handshake forgets.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Memory {
    last: Option<(u8, Result<(), Refusal>)>,
}

impl Memory {
    /// Nothing asked yet.
    pub const fn new() -> Self {
        Self { last: None }
    }

    /// The answer to a request, from memory if it has this id, otherwise by `act`.
    pub fn answer(&mut self, id: u8, act: impl FnOnce() -> Result<(), Refusal>) -> Result<(), Refusal> {
        match self.last {
            Some((known, answer)) if known == id => answer,
            _ => {
                let answer = act();
                self.last = Some((id, answer));
                answer
            }
        }
    }

    /// Forgets: a host has greeted, its ids begin anew.
    pub fn forget(&mut self) {
        self.last = None;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_repeated_request_is_answered_and_not_acted_on() {
        let mut memory = Memory::new();
        let mut acts = 0;
        for (id, expected) in [(7, 1), (7, 1), (8, 2), (7, 3)] {
            let answer = memory.answer(id, || {
                acts += 1;
                Err(Refusal::Running)
            });
            assert_eq!((answer, acts), (Err(Refusal::Running), expected));
        }
        memory.forget();
        assert_eq!(memory.answer(7, || Ok(())), Ok(()));
    }
}
