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
            let Ok(payload) = frame else {
                self.counts.damaged = self.counts.damaged.wrapping_add(1);
                continue;
            };
            // A greeting of another version is longer or shorter than ours, but begins alike.
            let message = read_to_device(payload).ok().or_else(|| peek_greeting(payload).map(ToDevice::Hello));
            let Some(message) = message else {
                self.counts.unknown = self.counts.unknown.wrapping_add(1);
                continue;
            };
            let taken = commands.enqueue(message).is_ok();
            let count = if taken { &mut self.counts.taken } else { &mut self.counts.dropped };
            *count = count.wrapping_add(1);
        }
    }

    /// What became of the frames so far; wraps.
    pub const fn counts(&self) -> ReceiveCounts {
        self.counts
    }
}
