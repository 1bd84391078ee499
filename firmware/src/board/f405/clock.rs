//! The crystal, the device's time, the period, and the processor's own cycles.
//!
//! ```text
//!   HSE 8 MHz ─▶ PLL ─▶ 168 MHz core, SysTick, TIM8 ─▶ APB2 84 MHz: SPI1, USART1
//!                                │                  ╰▶ APB1 42 MHz: I²C1
//!                                ╰▶ TIM5 84 MHz / 84 = 1 MHz: device time, and the tick 600 µs into the period
//! ```
//!
//! All from one crystal, so they never drift apart. If it fails, the clock security system raises the non-maskable
//! interrupt: motors off and reset.

use cortex_m::peripheral::syst::SystClkSource;
use cortex_m::peripheral::{DCB, DWT, SYST};
use embedded_hal::delay::DelayNs;
use firmware::constants::TICK_US;
use stm32f4xx_hal::pac::{FLASH, TIM5};
use stm32f4xx_hal::rcc::{Enable, Rcc, Reset};

/// Clock of the core, cycles per µs.
pub const CYCLES_PER_US: u32 = 168;
/// The crystal, MHz, and what the PLL makes of it: / 4 = 2 MHz, × 168 = 336 MHz, / 2 = 168 MHz.
const HSE_MHZ: u32 = 8;
const PLL_M: u8 = 4;
const PLL_N: u16 = 168;
const _: () = {
    // RM0090 7.3.2: 1 to 2 MHz into the PLL, 100 to 432 MHz out of it before the last divider.
    assert!(HSE_MHZ / PLL_M as u32 == 2 && PLL_N as u32 * 2 == 336);
    assert!(HSE_MHZ / PLL_M as u32 * PLL_N as u32 / 2 == CYCLES_PER_US);
};
/// Clock of TIM5 before its prescaler: twice that of APB1.
const TIM5_MHZ: u16 = 84;
const _: () = assert!(firmware::wiring::pwm::TIMER_HZ == CYCLES_PER_US * 1_000_000, "TIM8 runs at the core's clock");

/// From the internal oscillator to the crystal. Does not return without one; the watchdog runs already.
pub fn start(flash: &FLASH, rcc: &mut Rcc) {
    rcc.cr().modify(|_, w| w.hseon().on());
    while rcc.cr().read().hserdy().is_not_ready() {}
    rcc.pllcfgr().write(|w| {
        // SAFETY: dividers and multiplier within their bounds, see above; Q / 7 = 48 MHz, unused.
        unsafe { w.pllm().bits(PLL_M).plln().bits(PLL_N).pllq().bits(7) };
        w.pllp().div2().pllsrc().hse()
    });
    rcc.cr().modify(|_, w| w.pllon().on());
    while rcc.cr().read().pllrdy().is_not_ready() {}
    // Five wait states at 3.3 V, before the clock rises, and the caches that hide them.
    flash.acr().write(|w| w.latency().ws5().prften().enabled().icen().enabled().dcen().enabled());
    rcc.cfgr().modify(|_, w| w.hpre().div1().ppre1().div4().ppre2().div2());
    rcc.cfgr().modify(|_, w| w.sw().pll());
    while !rcc.cfgr().read().sws().is_pll() {}
    rcc.cr().modify(|_, w| w.csson().on());
}

/// Starts the counter of the core's cycles; gives a delay that runs on them.
pub fn cycles(mut dcb: DCB, mut dwt: DWT) -> CycleDelay {
    dcb.enable_trace();
    dwt.enable_cycle_counter();
    CycleDelay
}

/// A delay by the cycle counter, for the start only.
#[derive(Clone, Copy)]
pub struct CycleDelay;

impl DelayNs for CycleDelay {
    fn delay_ns(&mut self, ns: u32) {
        self.delay_us(ns.div_ceil(1000));
    }

    fn delay_us(&mut self, us: u32) {
        for _ in 0..us {
            let since = DWT::cycle_count();
            while DWT::cycle_count().wrapping_sub(since) < CYCLES_PER_US {}
        }
    }

    fn delay_ms(&mut self, ms: u32) {
        self.delay_us(ms.saturating_mul(1000));
    }
}

/// Adds up the cycles of the two halves of a tick.
#[derive(Default)]
pub struct Stopwatch {
    since: u32,
    cycles: u32,
}

impl Stopwatch {
    /// Runs on.
    pub fn go(&mut self) {
        self.since = DWT::cycle_count();
    }

    /// Stands.
    pub fn halt(&mut self) {
        self.cycles = self.cycles.wrapping_add(DWT::cycle_count().wrapping_sub(self.since));
    }

    /// Time since the last lap, µs, rounded up. To be asked between the halves of a tick: the second half of the last
    /// one and the first of this, which is always the same.
    pub fn lap_us(&mut self) -> u32 {
        core::mem::take(&mut self.cycles).div_ceil(CYCLES_PER_US)
    }
}

/// Device time, and when what happens.
pub struct Clock {
    timer: TIM5,
}

impl Clock {
    /// Starts time at zero and the period; its first interrupt comes a period from now, once interrupts are on.
    pub fn start(timer: TIM5, mut period: SYST, rcc: &mut Rcc) -> Self {
        TIM5::enable(rcc);
        TIM5::reset(rcc);
        timer.psc().write(|w| w.psc().set(TIM5_MHZ - 1));
        // The prescaler counts from the next update on.
        timer.egr().write(|w| w.ug().update());
        timer.cr1().write(|w| w.cen().enabled());
        period.set_clock_source(SystClkSource::Core);
        period.set_reload(CYCLES_PER_US * TICK_US - 1);
        period.clear_current();
        period.enable_counter();
        period.enable_interrupt();
        Clock { timer }
    }

    /// The device time, µs; the tick's interrupt comes so much later.
    pub fn begin(&mut self, tick_after_us: u32) -> u32 {
        let now_us = self.timer.cnt().read().bits();
        self.timer.ccr1().write(|w| w.ccr().set(now_us.wrapping_add(tick_after_us)));
        self.acknowledge();
        self.timer.dier().write(|w| w.cc1ie().enabled());
        now_us
    }

    /// Takes the tick's interrupt back.
    pub fn acknowledge(&mut self) {
        self.timer.sr().modify(|_, w| w.cc1if().clear());
    }
}
