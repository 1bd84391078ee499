//! What can be wrong with a file: damage that leaves a usable recording, and reasons why there is none.

use std::fmt;
use std::io;
use std::path::PathBuf;

use crate::recording::RowError;
use crate::robot::RobotError;

/// What is wrong with a file that could be read all the same.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Damage {
    /// The file ends without its closing part.
    CutOff {
        /// Where the last whole record ends, bytes.
        at_byte: u64,
        /// Bytes after it that nothing could be made of.
        lost_bytes: u64,
    },
    /// A record was left out; if it held samples, they are missing like ticks that were lost on the line.
    Record {
        /// "chunk", "attachment", …
        what: &'static str,
        /// Where it begins, bytes.
        at_byte: u64,
        /// What is wrong with it.
        reason: String,
    },
}

impl fmt::Display for Damage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::CutOff { at_byte, lost_bytes: 0 } => {
                write!(f, "the file ends at byte {at_byte} without its closing part; no sample in it is lost")
            }
            Self::CutOff { at_byte, lost_bytes } => {
                write!(
                    f,
                    "the file was cut off: nothing could be made of its last {lost_bytes} bytes (from byte {at_byte})"
                )
            }
            Self::Record { what, at_byte, reason } => {
                write!(f, "the {what} at byte {at_byte} was left out: {reason}")
            }
        }
    }
}

/// Why a file is no usable recording.
#[derive(Debug, thiserror::Error)]
pub enum ReadError {
    /// The file could not be opened or read.
    #[error("cannot read {}", path.display())]
    Open {
        /// The file asked for.
        path: PathBuf,
        /// What the operating system said.
        source: io::Error,
    },
    /// No byte in it.
    #[error("the file is empty")]
    Empty,
    /// Another kind of file.
    #[error("this is not a recording but {found}")]
    Foreign {
        /// What it looks like.
        found: &'static str,
        /// What to do with such a file.
        advice: &'static str,
    },
    /// Cut off, or damaged, before the first sample.
    #[error("the file ends or is damaged at byte {at_byte}, before {missing}")]
    NothingUsable {
        /// Where sense ends.
        at_byte: u64,
        /// What should have come.
        missing: &'static str,
    },
    /// Several files, one behind the other.
    #[error("a second file begins at byte {at_byte}: several recordings were put one behind the other")]
    Several {
        /// Where the second begins.
        at_byte: u64,
    },
    /// Made by a later version of the program.
    #[error("the recording has format {file}, and this program reads up to {ours}")]
    Version {
        /// Of the file.
        file: u32,
        /// The newest that is known here.
        ours: u32,
    },
    /// The robot description in the file is refused.
    #[error("the robot description in the recording is not accepted")]
    Robot(#[from] RobotError),
    /// The samples in the file do not have what the robot in the file has.
    #[error("the samples have no column `{column}`, which the robot description in the same file asks for")]
    Column {
        /// The missing one.
        column: String,
    },
    /// Checksums fit and the content makes no sense: a faulty writer.
    #[error("the {what} at byte {at_byte} makes no sense")]
    Senseless {
        /// "sample", "event", …
        what: &'static str,
        /// Where the chunk with it begins, bytes.
        at_byte: u64,
        /// What is wrong, if it is the order of samples.
        source: Option<RowError>,
    },
}

impl ReadError {
    /// What the user can do.
    pub fn advice(&self) -> String {
        match self {
            Self::Several { at_byte } => {
                return format!(
                    "cut it apart and give both: head -c {at_byte} FILE > first.mcap; tail -c +{} FILE > second.mcap",
                    at_byte + 1
                );
            }
            Self::Open { .. } => "check the path and that you may read the file",
            Self::Empty => "record or import again: there is nothing in this file to repair",
            Self::Foreign { advice, .. } => advice,
            Self::NothingUsable { .. } => "there is no sample in it to save: record or import again",
            Self::Version { .. } => "read it with the program that wrote it, or a newer one",
            Self::Robot(_) => {
                "the file was written by another version of the program: read it with that version, or export and import it"
            }
            Self::Column { .. } | Self::Senseless { .. } => {
                "the file was changed or written by a faulty program: record or import again"
            }
        }
        .to_owned()
    }

    /// Whether the operating system refused, rather than the content being unusable.
    pub fn is_io(&self) -> bool {
        matches!(self, Self::Open { .. })
    }
}
