//! The log: defmt frames into a ring, taken from there by the telemetry task.
//!
//! Anything above or below may log; a frame is written with interrupts off, which takes a few microseconds. Frames that
//! find no room are dropped whole and counted.

use core::cell::UnsafeCell;
use core::sync::atomic::{AtomicU32, Ordering::Relaxed};

use firmware::wiring::log_ring::LogRing;

/// Sixteen frames and more: what a start says with everything wrong.
const RING: usize = 256;

/// Device time of the present tick, µs.
static NOW_US: AtomicU32 = AtomicU32::new(0);

defmt::timestamp!("{=u32:us}", NOW_US.load(Relaxed));

struct State {
    ring: LogRing<RING>,
    encoder: defmt::Encoder,
    restore: critical_section::RestoreState,
}

struct Shared(UnsafeCell<State>);

// SAFETY: the state is touched within a critical section only: between `acquire` and `release` of the logger, and in
// `with_ring`; the chip has one core.
unsafe impl Sync for Shared {}

static LOG: Shared = Shared(UnsafeCell::new(State {
    ring: LogRing::new(),
    encoder: defmt::Encoder::new(),
    restore: critical_section::RestoreState::invalid(),
}));

#[defmt::global_logger]
struct Logger;

// SAFETY: `acquire` enters a critical section that `release` leaves, so nobody else acquires in between; nothing in
// between logs.
unsafe impl defmt::Logger for Logger {
    fn acquire() {
        // SAFETY: paired with the release in `Logger::release`, which defmt calls once for every acquire.
        let restore = unsafe { critical_section::acquire() };
        // SAFETY: within the critical section.
        let state = unsafe { &mut *LOG.0.get() };
        state.restore = restore;
        state.ring.begin();
        let State { ring, encoder, .. } = state;
        encoder.start_frame(|bytes| ring.push(bytes));
    }

    unsafe fn flush() {}

    unsafe fn release() {
        // SAFETY: within the critical section of `acquire`.
        let State { ring, encoder, restore } = unsafe { &mut *LOG.0.get() };
        encoder.end_frame(|bytes| ring.push(bytes));
        ring.end();
        let restore = *restore;
        // SAFETY: paired with `acquire`.
        unsafe { critical_section::release(restore) };
    }

    unsafe fn write(bytes: &[u8]) {
        // SAFETY: within the critical section of `acquire`.
        let State { ring, encoder, .. } = unsafe { &mut *LOG.0.get() };
        encoder.write(bytes, |bytes| ring.push(bytes));
    }
}

/// A tick begins: what is logged from now on is stamped with its time.
pub fn tick(now_us: u32) {
    NOW_US.store(now_us, Relaxed);
}

/// Device time of the present tick, µs.
pub fn now_us() -> u32 {
    NOW_US.load(Relaxed)
}

/// Takes bytes of whole frames, at most what `out` holds; returns how many.
pub fn take(out: &mut [u8]) -> usize {
    with_ring(|ring| ring.take(out))
}

/// Frames lost since this was asked last.
pub fn take_lost() -> Option<u32> {
    with_ring(LogRing::take_lost)
}

fn with_ring<T>(f: impl FnOnce(&mut LogRing<RING>) -> T) -> T {
    critical_section::with(|_| {
        // SAFETY: within a critical section, and `f` does not log.
        f(unsafe { &mut (*LOG.0.get()).ring })
    })
}
