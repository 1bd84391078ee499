//! The stack's high-water mark: the start-up code has painted it.

use core::ptr;
use core::sync::atomic::{AtomicU32, Ordering::Relaxed};

unsafe extern "C" {
    static _stack_start: u32;
    static _stack_end: u32;
}

/// What the start-up code paints with.
const PAINT: u32 = 0xCCCC_CCCC;
/// Calls between two looks.
const PATIENCE: u32 = 64;

static CALLS: AtomicU32 = AtomicU32::new(0);
static DEEPEST: AtomicU32 = AtomicU32::new(0);

/// Bytes of the stack that were ever used, as of the last look.
pub fn deepest_bytes() -> u16 {
    let calls = CALLS.load(Relaxed);
    CALLS.store(calls.wrapping_add(1), Relaxed);
    if calls.is_multiple_of(PATIENCE) {
        DEEPEST.store(look(), Relaxed);
    }
    DEEPEST.load(Relaxed) as u16
}

fn look() -> u32 {
    let (top, mut word) = (ptr::addr_of!(_stack_start), ptr::addr_of!(_stack_end));
    // SAFETY: the words between the two symbols are the stack, aligned; reading what nobody uses disturbs nothing.
    while word < top && unsafe { word.read_volatile() } == PAINT {
        word = word.wrapping_add(1);
    }
    top as u32 - word as u32
}
