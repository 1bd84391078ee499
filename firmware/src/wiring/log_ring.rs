//! The log's bytes on their way to the line: whole frames or none.
//!
//! ```text
//!          taken        whole        open
//!   ───────┬────────────┬────────────┬───────────────  N bytes, round and round
//!          │ frames to  │ the frame  │ room
//!          │ be sent    │ being written: given up as a whole if it finds no room, and counted
//! ```

/// A ring of `N` bytes.
#[derive(Debug)]
pub struct LogRing<const N: usize> {
    bytes: [u8; N],
    /// Bytes taken, whole and written since the start; they wrap, and differ by at most `N`.
    taken: usize,
    whole: usize,
    open: usize,
    /// The open frame found no room.
    spoiled: bool,
    lost: u32,
}

impl<const N: usize> LogRing<N> {
    /// Empty. `N` must be a power of two.
    pub const fn new() -> Self {
        assert!(N.is_power_of_two(), "so that the counters may wrap");
        LogRing { bytes: [0; N], taken: 0, whole: 0, open: 0, spoiled: false, lost: 0 }
    }

    /// Opens a frame.
    pub fn begin(&mut self) {
        (self.open, self.spoiled) = (self.whole, false);
    }

    /// Writes into the open frame.
    pub fn push(&mut self, bytes: &[u8]) {
        for byte in bytes {
            if self.spoiled || self.open.wrapping_sub(self.taken) >= N {
                self.spoiled = true;
                return;
            }
            self.bytes[self.open % N] = *byte;
            self.open = self.open.wrapping_add(1);
        }
    }

    /// Closes the frame: it is to be sent, or it is counted as lost.
    pub fn end(&mut self) {
        if self.spoiled {
            self.lost = self.lost.saturating_add(1);
        } else {
            self.whole = self.open;
        }
    }

    /// Takes bytes of whole frames, at most what `out` holds; returns how many.
    pub fn take(&mut self, out: &mut [u8]) -> usize {
        let n = self.whole.wrapping_sub(self.taken).min(out.len());
        for byte in &mut out[..n] {
            *byte = self.bytes[self.taken % N];
            self.taken = self.taken.wrapping_add(1);
        }
        n
    }

    /// Frames lost since this was asked last, once half of the ring is free again to say so.
    pub fn take_lost(&mut self) -> Option<u32> {
        let room = self.whole.wrapping_sub(self.taken) <= N / 2;
        (room && self.lost > 0).then(|| core::mem::take(&mut self.lost))
    }
}

impl<const N: usize> Default for LogRing<N> {
    fn default() -> Self {
        Self::new()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn write<const N: usize>(ring: &mut LogRing<N>, frame: &[u8]) {
        ring.begin();
        // In pieces, as the encoder writes.
        frame.chunks(2).for_each(|piece| ring.push(piece));
        ring.end();
    }

    proptest! {
        /// What comes out is a sequence of whole frames; what does not is counted.
        #[test]
        fn frames_come_whole_or_are_counted(
            steps in prop::collection::vec((prop::collection::vec(1u8.., 0..12), 0usize..20), 0..60),
        ) {
            let mut ring = LogRing::<32>::new();
            let (mut sent, mut got, mut lost) = (Vec::new(), Vec::new(), 0);
            for (mut frame, room) in steps {
                frame.push(0);
                write(&mut ring, &frame);
                sent.push(frame);
                let mut out = vec![0; room];
                let n = ring.take(&mut out);
                got.extend_from_slice(&out[..n]);
                lost += ring.take_lost().unwrap_or_default();
            }
            let mut out = [0; 32];
            let n = ring.take(&mut out);
            got.extend_from_slice(&out[..n]);
            lost += ring.take_lost().unwrap_or_default();
            prop_assert_eq!(lost as usize + got.iter().filter(|byte| **byte == 0).count(), sent.len());
            let mut written = sent.iter();
            for frame in got.split_inclusive(|byte| *byte == 0) {
                prop_assert!(written.any(|sent| sent == frame), "{:?} was written, in this order", frame);
            }
        }
    }

    #[test]
    fn a_frame_too_long_for_the_ring_is_lost_and_told_when_there_is_room() {
        let mut ring = LogRing::<8>::new();
        write(&mut ring, &[1; 5]);
        write(&mut ring, &[2; 4]);
        assert_eq!(ring.take_lost(), None, "no room yet to say so");
        let mut out = [0; 8];
        assert_eq!(ring.take(&mut out), 5);
        assert_eq!(out[..5], [1; 5]);
        assert_eq!(ring.take_lost(), Some(1));
        assert_eq!(ring.take_lost(), None);
    }
}
