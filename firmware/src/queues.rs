//! The queues between the three tasks of the core, and their ends.
//!
//! ```text
//!             bytes                                                         bytes
//!   line ───▶ Receiver ──commands──▶ ControlLoop::tick ──samples──▶ Telemetry ───▶ line
//!             low priority           highest priority    ──replies─▶ middle priority
//! ```
//!
//! Each queue has one writer and one reader, so that no task ever waits for another: what does not fit is counted
//! (samples) or asked for again by the host (answers).

use heapless::spsc::{Consumer, Producer, Queue};
use protocol::description::Stamp;
use protocol::motion::Motion;
use protocol::request::Status;
use protocol::{Event, Loss, MAX_ENCODERS, Refusal, Sample, ToDevice};

use crate::constants::{COMMAND_QUEUE, REPLY_QUEUE, SAMPLE_QUEUE};
use crate::store::Bytes;

/// What the tick sends to the host beside samples; telemetry turns it into a `protocol::Report`.
#[derive(Clone, Debug, PartialEq)]
pub enum Reply {
    /// Who we are, with the zero positions of this moment.
    Hello {
        /// Counts of the encoders at zero.
        zero: Option<[i32; MAX_ENCODERS]>,
        /// Which description is stored.
        stored: Option<Stamp>,
    },
    /// A request was carried out.
    Accepted {
        /// Of the request.
        id: u8,
    },
    /// A request was not carried out.
    Refused {
        /// Of the request.
        id: u8,
        /// Why.
        refusal: Refusal,
    },
    /// A heartbeat arrived.
    HeartbeatSeen {
        /// Of the heartbeat.
        count: u16,
        /// Device time of the tick that took it, µs.
        t_us: u32,
    },
    /// Where the device stands.
    Status(Status),
    /// Samples dropped.
    Loss(Loss),
    /// Something happened.
    Event(Event),
}

/// The queues, and the motion and the description that the host has sent: what is too large to pass over a stack, so that a board can have
/// it in a static. A queue has one more place than it can hold, as such queues are.
#[derive(Debug)]
pub struct Queues {
    commands: Queue<ToDevice, { COMMAND_QUEUE + 1 }>,
    samples: Queue<Sample, { SAMPLE_QUEUE + 1 }>,
    replies: Queue<Reply, { REPLY_QUEUE + 1 }>,
    motion: Motion,
    description: Bytes,
}

/// The ends that the tick holds.
pub struct TickEnds<'a> {
    /// Messages from the host.
    pub commands: Consumer<'a, ToDevice>,
    /// Samples for the host.
    pub samples: Producer<'a, Sample>,
    /// Everything else for the host.
    pub replies: Producer<'a, Reply>,
    /// The motion that was uploaded, or is being; nobody else looks at it.
    pub motion: &'a mut Motion,
    /// The encoded description that is being uploaded; nobody else looks at it.
    pub description: &'a mut Bytes,
}

/// The ends that telemetry holds.
pub struct TelemetryEnds<'a> {
    /// Samples for the host.
    pub samples: Consumer<'a, Sample>,
    /// Everything else for the host.
    pub replies: Consumer<'a, Reply>,
}

impl Default for Queues {
    fn default() -> Self {
        Self::new()
    }
}

impl Queues {
    /// Empty queues and an empty motion.
    pub const fn new() -> Self {
        Queues {
            commands: Queue::new(),
            samples: Queue::new(),
            replies: Queue::new(),
            motion: Motion::EMPTY,
            description: Bytes::new(),
        }
    }

    /// The ends for the tick, for telemetry and for the receiver. A board splits once, at start.
    pub fn split(&mut self) -> (TickEnds<'_>, TelemetryEnds<'_>, Producer<'_, ToDevice>) {
        let (command_in, commands) = self.commands.split();
        let (samples, samples_out) = self.samples.split();
        let (replies, replies_out) = self.replies.split();
        let telemetry = TelemetryEnds { samples: samples_out, replies: replies_out };
        let (motion, description) = (&mut self.motion, &mut self.description);
        (TickEnds { commands, samples, replies, motion, description }, telemetry, command_in)
    }
}
