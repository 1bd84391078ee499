//! The boards: the only rooms that touch a chip. The feature `emulated` picks the emulator's.
//!
//! Each has `start(core, device) -> Board`, `motors_off()` and `supply_fell()`, which may be called from anywhere, whether
//! its emergency stop must be tested (`STOP_TEST`), and the types that [`Board`] holds. What they share is here.

#[cfg(not(feature = "emulated"))]
mod f405;
#[cfg(not(feature = "emulated"))]
pub use f405::*;

#[cfg(feature = "emulated")]
mod emulated;
#[cfg(feature = "emulated")]
pub use emulated::*;

pub mod gyro;
pub mod log;
mod panic;

use protocol::ResetReason;
use protocol::hello::PanicPlace;

/// A board after its start: motors off, sensors set up, the period about to begin.
pub struct Board {
    /// Sensors and motors.
    pub pins: Pins,
    /// The transmitter.
    pub line_out: LineOut,
    /// The receiver.
    pub line_in: LineIn,
    /// Running already.
    pub watchdog: Watchdog,
    /// What `idle` does with gyros that are missing.
    pub search: gyro::Search<Bus>,
    /// Where a description of a robot is kept.
    pub store: Store,
    /// Why the processor started, and where the firmware panicked before.
    pub started: (ResetReason, Option<PanicPlace>),
}

/// CRC-32 over the section `.text` in flash, by which a host tells whether a file is the program that runs.
pub fn code_crc() -> u32 {
    unsafe extern "C" {
        static __stext: u8;
        static __etext: u8;
    }
    let (start, end) = (&raw const __stext, &raw const __etext);
    // SAFETY: the linker sets both symbols, around bytes in flash that nothing writes.
    let text = unsafe { core::slice::from_raw_parts(start, end as usize - start as usize) };
    protocol::frame::crc32(text)
}
