//! A serial device: open, handshake, frames, clock, loss balance.
//!
//! ```text
//!                 ┌─ serial reader ─ Decoder ─┬─▶ answers ──▶ Device::{upload, start, stop, …}
//!   port ─ read ──┘                           └─▶ inbox (bounded, counts what it drops) ──▶ Device::next ─▶ record
//!        ◀─ write ── Outgoing (whole frames) ◀─── requests · heartbeat thread · Stopper (Ctrl-C)
//! ```
//!
//! Three threads, so that nothing waits for what it must not: the reader never waits for the disk, the heartbeat waits
//! for nobody, whoever records may take its time. Time is the device's own, unwrapped; when a frame arrives says
//! nothing, since adapters hold bytes for milliseconds.

mod capture;
mod description;
mod device;
mod error;
mod exchange;
mod heartbeat;
mod inbox;
mod ledger;
mod log;
mod outgoing;
mod port;
mod reader;
mod repeats;
mod scales;
#[cfg(test)]
mod tests;
mod words;

pub use capture::{CaptureError, Captured, News, Progress, Ready, Zero, joint_limits, preset_motion};
pub use description::{Runs, fits, runs};
pub use device::{Device, Options, Stopper, probe};
pub use error::{LinkError, reset_name};
pub use inbox::Arrival;
pub use log::{Dictionary, ElfError, LogCounts};
pub use port::{PortInfo, list};
pub use scales::{ScaleError, Scales};
pub use words::{Restart, printable, restart};
