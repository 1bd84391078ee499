//! The end of a run that went wrong: motors off first, the place into RAM that a reset leaves alone, reset.

use core::cell::UnsafeCell;
use core::panic::PanicInfo;

use cortex_m::peripheral::SCB;
use cortex_m_rt::{ExceptionFrame, exception};
use firmware::wiring::panic_store::{self, BYTES};
use protocol::hello::PanicPlace;

struct Kept(UnsafeCell<[u8; BYTES]>);

// SAFETY: written with interrupts off by code that never returns, read and erased once before the first interrupt.
unsafe impl Sync for Kept {}

/// Neither zeroed nor loaded by the start-up code.
#[unsafe(link_section = ".uninit.panic")]
static KEPT: Kept = Kept(UnsafeCell::new([0; BYTES]));

/// The place of the last panic; forgets it. To be called once, before interrupts are on.
pub fn take() -> Option<PanicPlace> {
    let kept = KEPT.0.get();
    // SAFETY: see `Kept`; any bits are bytes. Volatile, because the compiler takes the static for what it was set to.
    let record = unsafe { kept.read_volatile() };
    // SAFETY: as above.
    unsafe { kept.write_volatile([0; BYTES]) };
    panic_store::decode(&record)
}

/// Motors off, keeps the place, resets.
fn end(file: &str, line: u32) -> ! {
    cortex_m::interrupt::disable();
    super::motors_off();
    // SAFETY: see `Kept`.
    unsafe { KEPT.0.get().write_volatile(panic_store::encode(file, line)) };
    SCB::sys_reset()
}

#[panic_handler]
fn panic(info: &PanicInfo<'_>) -> ! {
    let (file, line) = info.location().map_or(("unknown", 0), |place| (place.file(), place.line()));
    end(file, line)
}

/// A fault of the processor. The line is the address of the instruction, for `addr2line`.
///
/// # Safety
/// Called by the processor only.
#[exception]
unsafe fn HardFault(frame: &ExceptionFrame) -> ! {
    end("HardFault: the line is the address", frame.pc())
}

/// An interrupt that no task is bound to. The line is its number, negative for an exception of the core: the
/// non-maskable interrupt, which the failure of the crystal raises, is -14.
///
/// # Safety
/// Called by the processor only.
#[exception]
unsafe fn DefaultHandler(number: i16) -> ! {
    end("stray interrupt: the line is its number", i32::from(number) as u32)
}
