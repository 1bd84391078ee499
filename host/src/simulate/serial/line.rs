//! The line from the device to the host: takes whole frames, loses and damages some, and counts exactly what that does.
//!
//! ```text
//!   frame ──┬─ dropped: nothing of it comes out
//!           ├─ corrupted: one to three of its bytes change, the delimiter among them
//!           └─ as it is
//! ```
//!
//! A changed delimiter melts a frame and the next into one damaged piece; a byte that becomes a delimiter cuts one
//! frame into two pieces. Both are counted as a receiver sees them.

use protocol::frame::DELIMITER;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use serde::Serialize;

use crate::simulate::noise::{Purpose, stream};

/// What the line did.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
pub struct LineCounts {
    /// Frames that the device sent.
    pub frames: u64,
    /// Samples among them.
    pub samples: u64,
    /// Frames dropped whole.
    pub dropped_frames: u64,
    /// Samples among them.
    pub dropped_samples: u64,
    /// Frames with changed bytes.
    pub corrupted_frames: u64,
    /// Samples that were not dropped and still cannot be read: corrupted, or melted with a corrupted neighbour.
    pub spoiled_samples: u64,
    /// Pieces between delimiters that are no frame: what a receiver counts as damaged.
    pub damaged_pieces: u64,
}

impl LineCounts {
    /// Samples that the line took from the host.
    pub fn lost_samples(&self) -> u64 {
        self.dropped_samples + self.spoiled_samples
    }
}

/// The line from the device to the host.
#[derive(Debug)]
pub struct Line {
    drop: f64,
    corrupt: f64,
    rng: ChaCha8Rng,
    frame: Vec<u8>,
    /// The receiver has begun a piece whose delimiter it has not seen.
    open: bool,
    counts: LineCounts,
}

impl Line {
    /// A line that drops and corrupts frames at these rates (0 … 1).
    pub fn new(drop: f64, corrupt: f64, seed: u64) -> Self {
        let rng = stream(seed, Purpose::Line);
        Self { drop, corrupt, rng, frame: Vec::new(), open: false, counts: LineCounts::default() }
    }

    /// Takes bytes of the device and appends what arrives at the host.
    pub fn carry(&mut self, bytes: &[u8], arrived: &mut Vec<u8>) {
        for byte in bytes {
            self.frame.push(*byte);
            if *byte == DELIMITER {
                let frame = std::mem::take(&mut self.frame);
                self.carry_frame(frame, arrived);
            }
        }
    }

    /// The device starts anew: a frame it had not finished is cut off and melts with the next.
    pub fn cut(&mut self, arrived: &mut Vec<u8>) {
        let torn = std::mem::take(&mut self.frame);
        if !torn.is_empty() {
            arrived.extend_from_slice(&torn);
            self.counts.frames += 1;
            self.counts.samples += u64::from(is_sample(&torn));
            self.receive(&torn, u64::from(is_sample(&torn)));
        }
    }

    /// What the line did so far.
    pub fn counts(&self) -> LineCounts {
        self.counts
    }

    fn carry_frame(&mut self, mut frame: Vec<u8>, arrived: &mut Vec<u8>) {
        let samples = u64::from(is_sample(&frame));
        self.counts.frames += 1;
        self.counts.samples += samples;
        if self.drop > 0.0 && self.rng.random_bool(self.drop) {
            self.counts.dropped_frames += 1;
            self.counts.dropped_samples += samples;
            return;
        }
        if self.corrupt > 0.0 && self.rng.random_bool(self.corrupt) {
            self.counts.corrupted_frames += 1;
            self.damage(&mut frame);
            self.receive(&frame, samples);
        } else if self.open {
            self.receive(&frame, samples);
        }
        arrived.extend_from_slice(&frame);
    }

    /// Changes one to three bytes, each a different one.
    fn damage(&mut self, frame: &mut [u8]) {
        let count = self.rng.random_range(1..=3).min(frame.len());
        for place in rand::seq::index::sample(&mut self.rng, frame.len(), count) {
            frame[place] ^= self.rng.random_range(1..=255u8);
        }
    }

    /// Counts what a receiver makes of bytes that are not a whole frame of their own.
    fn receive(&mut self, bytes: &[u8], samples: u64) {
        self.counts.spoiled_samples += samples;
        for byte in bytes {
            match (*byte == DELIMITER, self.open) {
                (true, true) => {
                    self.counts.damaged_pieces += 1;
                    self.open = false;
                }
                // An empty piece is nothing.
                (true, false) => {}
                (false, _) => self.open = true,
            }
        }
    }
}

/// COBS leaves a first byte that is not zero in the second place.
fn is_sample(frame: &[u8]) -> bool {
    frame.len() > 2 && frame[0] > 1 && frame[1] == protocol::sample::TAG
}

#[cfg(test)]
mod tests {
    use protocol::frame::Decoder;
    use protocol::message::{self, read_to_host, write_sample};
    use protocol::sample::Layout;
    use protocol::{Sample, ToHost};

    use super::*;

    fn frame(seq: u32) -> Vec<u8> {
        let mut bytes = vec![0; message::MAX_SAMPLE_FRAME];
        let n = write_sample(&Sample { seq, ..Sample::default() }, &Layout::DOGGY, &mut bytes).unwrap();
        bytes.truncate(n);
        bytes
    }

    /// The receiver's own decoder agrees with the line's count, whatever was hit.
    #[test]
    fn the_count_is_what_a_receiver_finds() {
        for (drop, corrupt, seed) in [(0.0, 0.0, 1), (0.01, 0.001, 2), (0.2, 0.5, 3), (0.0, 1.0, 4), (1.0, 1.0, 5)] {
            let mut line = Line::new(drop, corrupt, seed);
            let mut decoder = Decoder::<{ message::MAX_TO_HOST_FRAME }>::new();
            let (mut read, mut damaged, mut arrived) = (0, 0, Vec::new());
            let sent = 20_000;
            for seq in 0..sent {
                line.carry(&frame(seq), &mut arrived);
            }
            // A last whole frame closes what is open.
            arrived.push(DELIMITER);
            let open = u64::from(line.open);
            for byte in &arrived {
                match decoder.feed(*byte) {
                    None => {}
                    Some(Err(_)) => damaged += 1,
                    Some(Ok(payload)) => {
                        assert!(matches!(read_to_host(payload, Some(&Layout::DOGGY)), Ok(ToHost::Sample(_))));
                        read += 1;
                    }
                }
            }
            let counts = line.counts();
            assert_eq!(counts.samples, u64::from(sent));
            assert_eq!(read, u64::from(sent) - counts.lost_samples(), "rates {drop}, {corrupt}");
            assert_eq!(damaged, counts.damaged_pieces + open, "rates {drop}, {corrupt}");
            let share = counts.dropped_frames as f64 / f64::from(sent);
            assert!((share - drop).abs() < 0.015, "{share} of {drop} dropped");
        }
    }

    #[test]
    fn one_seed_one_fate() {
        let fate = |seed| {
            let (mut line, mut arrived) = (Line::new(0.1, 0.1, seed), Vec::new());
            (0..1000).for_each(|seq| line.carry(&frame(seq), &mut arrived));
            arrived
        };
        assert_eq!(fate(8), fate(8));
        assert_ne!(fate(8), fate(9));
    }
}
