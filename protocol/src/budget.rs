//! The link budget: bytes × rate × 10 bits (start, eight, stop) against the baud rate, checked at compile time.
//!
//! | device → host, Doggy at 921,600 baud | bytes | per s | bit/s | share |
//! |---|---|---|---|---|
//! | samples | 55 | 1000 | 550,000 | 59.7 % |
//! | heartbeats seen | 15 | 100 | 15,000 | 1.6 % |
//! | answers, status, events, losses | 64 | 100 | 64,000 | 6.9 % |
//! | log, defmt | 91 | 50 | 45,500 | 4.9 % |
//! | together | | | 674,500 | 73.2 % |
//!
//! The widest layout (7 joints with 14 encoders, 2 gyros: 107 bytes) needs 2,000,000 baud at 1 kHz. In the other
//! direction heartbeats are the only steady traffic; the longest request (224 bytes) takes 2.5 ms.

use crate::{
    frame,
    message::{MAX_TO_DEVICE_FRAME, MAX_TO_DEVICE_PAYLOAD},
    sample::Layout,
};

/// The slowest rate that carries Doggy.
pub const BAUD: u32 = 921_600;
/// The rate for the widest layout.
pub const FAST_BAUD: u32 = 2_000_000;
/// Bits on the line for a byte: start bit, eight bits, stop bit.
pub const BITS_PER_BYTE: u32 = 10;
/// Most of the line that samples may take, per mille.
pub const SAMPLE_SHARE: u64 = 600;
/// Most of the line that everything together may take, per mille.
pub const TOTAL_SHARE: u64 = 800;

/// A kind of traffic beside the samples: what a device may send at most.
#[derive(Clone, Copy, Debug)]
pub struct Traffic {
    /// Longest payload.
    pub payload: usize,
    /// Messages per second.
    pub per_s: u32,
}

/// Answers to heartbeats.
pub const HEARTBEATS_SEEN: Traffic = Traffic { payload: 9, per_s: 100 };
/// Answers to requests, status, events and losses. A handshake comes while no motion runs.
pub const ANSWERS: Traffic = Traffic { payload: 58, per_s: 100 };
/// Lines of the log, or pieces of a defmt stream.
pub const LOG: Traffic = Traffic { payload: 85, per_s: 50 };

/// Bit/s of so many payloads of this length a second.
pub const fn bit_per_s(payload: usize, per_s: u32) -> u64 {
    frame::wire_len(payload) as u64 * BITS_PER_BYTE as u64 * per_s as u64
}

/// Share of the line that the samples take, per mille. The rate is not 0.
pub const fn sample_share(layout: &Layout, ticks_per_s: u32, baud: u32) -> u64 {
    bit_per_s(layout.payload_len(), ticks_per_s) * 1000 / baud as u64
}

/// Share of the line that everything takes, per mille. The rate is not 0.
pub const fn total_share(layout: &Layout, ticks_per_s: u32, baud: u32) -> u64 {
    let bits = bit_per_s(layout.payload_len(), ticks_per_s)
        + bit_per_s(HEARTBEATS_SEEN.payload, HEARTBEATS_SEEN.per_s)
        + bit_per_s(ANSWERS.payload, ANSWERS.per_s)
        + bit_per_s(LOG.payload, LOG.per_s);
    bits * 1000 / baud as u64
}

/// Whether a line of this rate carries a device. A line of 0 baud carries nothing.
pub const fn carries(layout: &Layout, ticks_per_s: u32, baud: u32) -> bool {
    baud > 0
        && sample_share(layout, ticks_per_s, baud) <= SAMPLE_SHARE
        && total_share(layout, ticks_per_s, baud) <= TOTAL_SHARE
}

const _: () = {
    assert!(frame::wire_len(Layout::DOGGY.payload_len()) == 55);
    assert!(carries(&Layout::DOGGY, 1000, BAUD));
    assert!(carries(&Layout::WIDEST, 1000, FAST_BAUD));
    // The longest request leaves the line long before the next heartbeat is due.
    assert!(MAX_TO_DEVICE_FRAME as u32 * BITS_PER_BYTE * 1000 / BAUD <= 5);
    assert!(MAX_TO_DEVICE_PAYLOAD <= frame::MAX_PAYLOAD);
};

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_budget_of_the_table() {
        assert_eq!(sample_share(&Layout::DOGGY, 1000, BAUD), 596);
        assert_eq!(total_share(&Layout::DOGGY, 1000, BAUD), 731);
        assert_eq!(sample_share(&Layout::WIDEST, 1000, FAST_BAUD), 535);
    }

    #[test]
    fn a_slow_line_is_refused() {
        assert!(!carries(&Layout::DOGGY, 1000, 0));
        assert!(!carries(&Layout::DOGGY, 1000, 115_200));
        assert!(!carries(&Layout::DOGGY, 1000, 460_800));
        assert!(!carries(&Layout::WIDEST, 1000, BAUD));
    }
}
