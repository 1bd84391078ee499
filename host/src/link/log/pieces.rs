//! Pieces of a stream become whole frames, or are known not to.

/// Longest frame that is waited for; the firmware's own ring holds less.
const MAX_FRAME: usize = 4096;

/// Puts pieces together.
#[derive(Debug, Default)]
pub(super) struct Pieces {
    /// Bytes of the stream so far, as the device counts; wraps.
    expected: Option<u32>,
    /// A frame under way, if its beginning was seen.
    frame: Option<Vec<u8>>,
}

/// What was not there.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) struct Lost {
    /// Bytes that never came.
    pub bytes: u64,
    /// Frames that were begun and not ended, or grew beyond all bounds.
    pub frames: u64,
}

impl Pieces {
    /// Takes the bytes that follow `at` earlier ones; gives the frames that they complete, without delimiters.
    pub(super) fn feed(&mut self, at: u32, bytes: &[u8]) -> (Vec<Vec<u8>>, Lost) {
        let mut lost = Lost::default();
        if self.expected != Some(at) {
            // A step back is a device that started anew: nothing is known of what it did not send.
            let missing = self.expected.map(|expected| at.wrapping_sub(expected)).filter(|missing| *missing < 1 << 31);
            lost.bytes = missing.map_or(0, u64::from);
            lost.frames += u64::from(self.frame.take().is_some_and(|frame| !frame.is_empty()));
        }
        self.expected = Some(at.wrapping_add(bytes.len() as u32));
        let mut frames = Vec::new();
        for &byte in bytes {
            if byte == 0 {
                frames.extend(self.frame.replace(Vec::new()).filter(|frame| !frame.is_empty()));
            } else if let Some(frame) = &mut self.frame {
                frame.push(byte);
                if frame.len() > MAX_FRAME {
                    self.frame = None;
                    lost.frames += 1;
                }
            }
        }
        (frames, lost)
    }
}
