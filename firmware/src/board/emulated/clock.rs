//! SysTick: the period, and cycles within it.
//!
//! ```text
//!   counter   168,000 ╲         ╲         ╲         it counts down; the interrupt comes as it starts again
//!                   0  ╲_________╲_________╲
//!   device time    1000 k      1000 (k+1)           + (168,000 − counter) / 168 within a period
//! ```

use core::sync::atomic::{AtomicU32, Ordering::Relaxed};

use cortex_m::peripheral::syst::SystClkSource;
use cortex_m::peripheral::{SCB, SYST};
use firmware::constants::TICK_US;

/// The machine's clock: 168 MHz.
pub const CYCLES_PER_US: u32 = 168;
const PERIOD: u32 = CYCLES_PER_US * TICK_US;

/// Periods begun.
static PERIODS: AtomicU32 = AtomicU32::new(0);
/// Device time t_k of the present one, µs.
static PERIOD_US: AtomicU32 = AtomicU32::new(0);

/// A moment, to measure from.
#[derive(Clone, Copy)]
pub struct Moment(u32);

/// The first period begins a millisecond from now.
pub fn start(syst: &mut SYST) {
    syst.set_clock_source(SystClkSource::Core);
    syst.set_reload(PERIOD - 1);
    syst.clear_current();
    syst.enable_interrupt();
    syst.enable_counter();
}

/// A period begins: its time, µs. Wraps.
pub fn begin_period() -> u32 {
    let late_us = (PERIOD - 1 - SYST::get_current()) / CYCLES_PER_US;
    let periods = PERIODS.load(Relaxed);
    PERIODS.store(periods.wrapping_add(1), Relaxed);
    let t_us = periods.wrapping_mul(TICK_US).wrapping_add(late_us);
    PERIOD_US.store(t_us, Relaxed);
    t_us
}

/// Time of the present period, µs.
pub fn period_us() -> u32 {
    PERIOD_US.load(Relaxed)
}

/// Whether the next period is due already.
pub fn next_is_due() -> bool {
    SCB::is_pendst_pending()
}

/// Now.
pub fn now() -> Moment {
    Moment(SYST::get_current())
}

impl Moment {
    /// Cycles since then, if less than a period has passed.
    pub fn cycles(self) -> u32 {
        let now = SYST::get_current();
        if self.0 >= now { self.0 - now } else { self.0 + PERIOD - now }
    }
}

/// Does nothing for so long.
pub fn spin_us(us: u16) {
    for _ in 0..us {
        let start = now();
        while start.cycles() < CYCLES_PER_US {}
    }
}
