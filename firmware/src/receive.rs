//! Bytes from the host become messages for the tick.

use heapless::spsc::Producer;
use protocol::ToDevice;
use protocol::frame::{CRC_BYTES, Decoder};
use protocol::message::{MAX_TO_DEVICE_PAYLOAD, peek_greeting, read_to_device};

/// Decodes the line's bytes. Work is bounded by the number of bytes given.
#[derive(Debug, Default)]
pub struct Receiver {
    decoder: Decoder<{ MAX_TO_DEVICE_PAYLOAD + CRC_BYTES }>,
    counts: ReceiveCounts,
}

/// What became of a frame.
enum Taken {
    Queued,
    Dropped,
    Unknown,
}

/// Gives the message of a payload to the tick. On its own, so that its message is on the stack only while it runs.
#[inline(never)]
fn take(payload: &[u8], commands: &mut Producer<'_, ToDevice>) -> Taken {
    let queued = match read_to_device(payload) {
        Ok(message) => commands.enqueue(message).is_ok(),
        // A greeting of another version is longer or shorter than ours, but begins alike.
        Err(_) => match peek_greeting(payload) {
            Some(greeting) => commands.enqueue(ToDevice::Hello(greeting)).is_ok(),
            None => return Taken::Unknown,
        },
    };
    if queued { Taken::Queued } else { Taken::Dropped }
}

/// What the receiver made of the line.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ReceiveCounts {
    /// Messages given to the tick.
    pub taken: u32,
    /// Frames that arrived damaged.
    pub damaged: u32,
    /// Whole frames that are no message of this version.
    pub unknown: u32,
    /// Messages that found the queue full; the host asks again.
    pub dropped: u32,
}

impl Receiver {
    /// At the beginning of a frame.
    pub const fn new() -> Self {
        Receiver { decoder: Decoder::new(), counts: ReceiveCounts { taken: 0, damaged: 0, unknown: 0, dropped: 0 } }
    }

    /// Takes bytes as they came; whole messages go to the tick. Any bytes are survived.
    pub fn receive(&mut self, bytes: &[u8], commands: &mut Producer<'_, ToDevice>) {
        for byte in bytes {
            let Some(frame) = self.decoder.feed(*byte) else { continue };
            let counts = &mut self.counts;
            let count = match frame.map(|payload| take(payload, commands)) {
                Err(_) => &mut counts.damaged,
                Ok(Taken::Unknown) => &mut counts.unknown,
                Ok(Taken::Dropped) => &mut counts.dropped,
                Ok(Taken::Queued) => &mut counts.taken,
            };
            *count = count.wrapping_add(1);
        }
    }

    /// What became of the frames so far; wraps.
    pub const fn counts(&self) -> ReceiveCounts {
        self.counts
    }
}
