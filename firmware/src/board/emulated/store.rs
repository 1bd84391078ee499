//! The flash of the emulated board: RAM beyond what `memory.x` grants, which a reset leaves alone.
//!
//! The emulator's flash cannot be written. When it starts its RAM is zero, which is no description.

use core::sync::atomic::{AtomicBool, Ordering};

use firmware::store::{AREA_BYTES, RamFlash};

/// 64 KiB into the SRAM of 128 KiB; the image ends at 24 KiB.
const BEGIN: usize = 0x2001_0000;
const BYTES: usize = 2 * AREA_BYTES;

/// The two areas.
pub type Store = RamFlash<&'static mut [u8]>;

static TAKEN: AtomicBool = AtomicBool::new(false);

/// The store. To be called once, at the start.
pub fn take() -> Store {
    assert!(!TAKEN.swap(true, Ordering::Relaxed), "`start` runs once");
    // SAFETY: this RAM is there (128 KiB of SRAM), no section of the image lies in it, and nobody else has it: see `TAKEN`.
    RamFlash(unsafe { core::slice::from_raw_parts_mut(BEGIN as *mut u8, BYTES) })
}
