//! Recordings as MCAP files: one self-contained file that survives the death of its writer.
//!
//! ```text
//!   magic │ header │ attachments: robot.toml, session.json, motion.toml │ chunk │ chunk │ … │ data end │ summary │ magic
//!                    ╰── what a reader needs, before the first sample      │
//!                                             ≤ 64 KiB or 0.25 s of samples, CRC-32, zstd
//! ```
//!
//! Every byte is appended, none is rewritten: a file cut off anywhere is a whole file up to its last whole chunk.
//! Attachments and chunks have checksums of their own, and nothing outside of them is believed.
//!
//! | topic | message | when |
//! |---|---|---|
//! | `/sample` | `t_us seq phase flags execution_us jitter_us`, then `u1…` and every channel by its column name | every tick |
//! | `/event` | `t_us seq severity text` | as they happen |
//! | `/log` | `t_us level message file line`: the firmware's log, `file` and `line` where known | as it comes |
//! | `/balance` | the fields of [`LossBalance`](super::LossBalance) | from time to time; the last one counts |
//!
//! Messages are protobuf with the schema in the file, so any MCAP viewer can plot them. Time of the file's log is the
//! device's time.

mod error;
mod protobuf;
mod reader;
pub(super) mod records;
mod schema;
#[cfg(test)]
mod tests;
mod writer;

pub use error::{Damage, ReadError};
pub use reader::{parse, read};
pub use writer::{Disk, WriteError, Writer, write};

/// Raised when a reader of the version before would misunderstand the file.
const FORMAT_VERSION: u32 = 1;
/// Who made a file, in its MCAP header; a file of another profile is not ours.
pub(super) const PROFILE: &str = "flexible-joint-recording";

const ROBOT_FILE: &str = "robot.toml";
const MOTION_FILE: &str = "motion.toml";
const SESSION_FILE: &str = "session.json";
