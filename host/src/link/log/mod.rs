//! The firmware's log: pieces of a defmt stream in, lines out.
//!
//! ```text
//!   { at, bytes } ─▶ pieces (nothing lost?) ─▶ frames between 0x00 ─▶ dictionary (indices → texts) ─▶ Entry
//! ```
//!
//! The firmware sends indices of texts that only its ELF file has. A file of another build would give other texts that
//! look as good, so the file must be that of the running program: [`Dictionary::fits`] compares the checksums of the
//! code. Frames have no checksum of their own, but the messages that carry them do, and `at` tells what is missing
//! between two of them: a frame that is not whole is never read.

mod dictionary;
mod pieces;
#[cfg(test)]
mod tests;

pub use dictionary::{Dictionary, ElfError};
use pieces::Pieces;

use crate::recording::{LogLevel, Place};

/// What became of the log.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct LogCounts {
    /// Lines read.
    pub lines: u64,
    /// Bytes that were lost on the way.
    pub lost_bytes: u64,
    /// Frames of which a part was lost, or from which no line could be made.
    pub unread_frames: u64,
}

/// A line as the firmware logged it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Entry {
    /// Device time as it stands in the frame, µs; wraps. `None` if the firmware stamps no time, or not in µs.
    pub t_us: Option<u32>,
    pub level: LogLevel,
    pub message: String,
    pub place: Option<Place>,
}

/// Reads the log of one device.
#[derive(Debug)]
pub(super) struct LogReader {
    dictionary: Dictionary,
    pieces: Pieces,
    counts: LogCounts,
}

impl LogReader {
    pub(super) fn new(dictionary: Dictionary) -> Self {
        Self { dictionary, pieces: Pieces::default(), counts: LogCounts::default() }
    }

    /// Takes the next bytes of the log, `at` of which came before them, and gives the lines that are now whole.
    pub(super) fn feed(&mut self, at: u32, bytes: &[u8]) -> Vec<Entry> {
        let (frames, lost) = self.pieces.feed(at, bytes);
        self.counts.lost_bytes += lost.bytes;
        self.counts.unread_frames += lost.frames;
        let mut entries = Vec::new();
        for frame in frames {
            match self.dictionary.read(&frame) {
                Some(entry) => entries.push(entry),
                None => self.counts.unread_frames += 1,
            }
        }
        self.counts.lines += entries.len() as u64;
        entries
    }

    pub(super) fn counts(&self) -> LogCounts {
        self.counts
    }
}
