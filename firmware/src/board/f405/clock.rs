//! The crystal, the device's time, the period, and the processor's own cycles.
//!
//! ```text
//!   HSE 8 MHz ─▶ PLL ─▶ 168 MHz core, SysTick, TIM8 ─▶ APB2 84 MHz: SPI1, USART1
//!                                │                  ╰▶ APB1 42 MHz: I²C1
//!                                ╰▶ TIM5 84 MHz / 84 = 1 MHz: device time, and the tick 600 µs into the period
//! ```
//!
//! TIM5 also captures the edges of the gyros' "data ready", channel 3 of gyro 1 and channel 4 of gyro 2, in device time.
//!
//! All from one crystal, so they never drift apart. If it fails, the clock security system raises the non-maskable
//! interrupt: motors off and reset.

use cortex_m::peripheral::syst::SystClkSource;
use cortex_m::peripheral::{DCB, DWT, NVIC, SYST};
use embedded_hal::delay::DelayNs;
use firmware::constants::TICK_US;
use stm32f4xx_hal::gpio::{PA2, PA3, Pull};
use stm32f4xx_hal::pac::{FLASH, Interrupt, TIM5, TIM11};
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
/// The internal oscillator, MHz, right to 1 % at 25 °C and to 8 % over all temperatures, and the PLL's divider for it.
const HSI_MHZ: u32 = 16;
const HSI_PLL_M: u8 = 8;
const _: () = assert!(HSI_MHZ / HSI_PLL_M as u32 == HSE_MHZ / PLL_M as u32, "the same from there on");
/// How far the crystal may seem to be off, per cent: the internal oscillator's error and more, and a sixth of the way to
/// the next usual crystal, of 12 MHz. With half of it a hot board may not start.
const CRYSTAL_PERCENT: u32 = 10;
/// Looks at a flag before a crystal counts as broken, a microsecond or less each: crystals start within some milliseconds.
const CRYSTAL_PATIENCE: u32 = 100_000;
/// Periods of the crystal / 16 that are measured, eight a capture.
const CAPTURES: u32 = 32;

/// Clock of TIM5 before its prescaler: twice that of APB1.
const TIM5_MHZ: u16 = 84;
const _: () = assert!(firmware::wiring::pwm::TIMER_HZ == CYCLES_PER_US * 1_000_000, "TIM8 runs at the core's clock");

/// What the board runs on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Source {
    /// The crystal, as it should be.
    Crystal,
    /// The internal oscillator: there is no crystal of 8 MHz. Good enough for the line to the host and the log; nothing may
    /// move.
    Internal {
        /// The crystal as measured, kHz; 0: it does not swing.
        crystal_khz: u32,
    },
}

/// From the internal oscillator to 168 MHz.
pub fn start(flash: &FLASH, rcc: &mut Rcc, timer: &TIM11) -> Source {
    let source = match crystal_khz(rcc, timer) {
        khz if khz.abs_diff(HSE_MHZ * 1000) <= HSE_MHZ * 10 * CRYSTAL_PERCENT => Source::Crystal,
        crystal_khz => Source::Internal { crystal_khz },
    };
    let from_crystal = source == Source::Crystal;
    rcc.pllcfgr().write(|w| {
        let m = if from_crystal { PLL_M } else { HSI_PLL_M };
        // SAFETY: dividers and multiplier within their bounds, see above; Q / 7 = 48 MHz, unused.
        unsafe { w.pllm().bits(m).plln().bits(PLL_N).pllq().bits(7) };
        w.pllp().div2().pllsrc().bit(from_crystal)
    });
    rcc.cr().modify(|_, w| w.pllon().on());
    while rcc.cr().read().pllrdy().is_not_ready() {}
    // Five wait states at 3.3 V, before the clock rises, and the caches that hide them.
    flash.acr().write(|w| w.latency().ws5().prften().enabled().icen().enabled().dcen().enabled());
    rcc.cfgr().modify(|_, w| w.hpre().div1().ppre1().div4().ppre2().div2());
    rcc.cfgr().modify(|_, w| w.sw().pll());
    while !rcc.cfgr().read().sws().is_pll() {}
    if from_crystal {
        rcc.cr().modify(|_, w| w.csson().on());
    }
    source
}

/// The crystal's frequency by the internal oscillator, on which the processor runs here; 0 if it does not swing. TIM11 counts
/// the oscillator and captures every eighth edge of the crystal / 16, which is wired to its channel 1 inside the chip.
fn crystal_khz(rcc: &mut Rcc, timer: &TIM11) -> u32 {
    rcc.cr().modify(|_, w| w.hseon().on());
    if !(0..CRYSTAL_PATIENCE).any(|_| rcc.cr().read().hserdy().is_ready()) {
        return 0;
    }
    // SAFETY: 16 is a divider of the field.
    rcc.cfgr().modify(|_, w| unsafe { w.rtcpre().bits(16) });
    TIM11::enable(rcc);
    TIM11::reset(rcc);
    // SAFETY: 0b10 is the crystal's share for the real-time clock; CC1S = 01 and IC1PSC = 11: an input, every eighth edge.
    unsafe {
        timer.or().write(|w| w.bits(0b10));
        timer.ccmr1_input().write(|w| w.bits(0b1101));
    }
    timer.ccer().write(|w| w.cc1e().set_bit());
    timer.cr1().write(|w| w.cen().enabled());
    let mut clocks = 0;
    let mut last = None;
    for _ in 0..=CAPTURES {
        if !(0..CRYSTAL_PATIENCE).any(|_| timer.sr().read().cc1if().bit_is_set()) {
            return 0;
        }
        let now = timer.ccr1().read().bits() as u16;
        clocks += last.replace(now).map_or(0, |last: u16| u32::from(now.wrapping_sub(last)));
    }
    TIM11::reset(rcc);
    TIM11::disable(rcc);
    // clocks / 16 MHz = captures · 8 · 16 / crystal
    (CAPTURES * 8 * 16 * HSI_MHZ * 1000).checked_div(clocks).unwrap_or(0)
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
    pub fn start(timer: TIM5, mut period: SYST, (ready1, ready2): (PA2, PA3), rcc: &mut Rcc) -> Self {
        // A wire that is not there is low, and shows no edge.
        let _ = ready1.into_alternate::<2>().internal_resistor(Pull::Down);
        let _ = ready2.into_alternate::<2>().internal_resistor(Pull::Down);
        TIM5::enable(rcc);
        TIM5::reset(rcc);
        timer.psc().write(|w| w.psc().set(TIM5_MHZ - 1));
        // The prescaler counts from the next update on.
        timer.egr().write(|w| w.ug().update());
        // SAFETY: CC3S = CC4S = 01: inputs of their own pins; IC3F = IC4F = 0011: eight samples at 84 MHz, 0.1 µs.
        timer.ccmr2_input().write(|w| unsafe { w.bits(0b0011_0001 << 8 | 0b0011_0001) });
        timer.ccer().write(|w| w.cc3e().set_bit().cc4e().set_bit());
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
        // A tick that was pending since the last period, because something blocked it or a debugger halted it, must not run
        // on transfers that just begin.
        NVIC::unpend(Interrupt::TIM5);
        self.timer.dier().write(|w| w.cc1ie().enabled());
        now_us
    }

    /// When "data ready" of each gyro rose last, µs; none if it did not since the last call.
    pub fn edges_us(&mut self) -> [Option<u32>; 2] {
        let flags = self.timer.sr().read();
        // The read takes the flag back.
        [
            flags.cc3if().bit_is_set().then(|| self.timer.ccr3().read().bits()),
            flags.cc4if().bit_is_set().then(|| self.timer.ccr4().read().bits()),
        ]
    }

    /// Takes the tick's interrupt back. Ones leave the other flags alone: an edge may come between a read and a write.
    pub fn acknowledge(&mut self) {
        self.timer.sr().write(|w| {
            // SAFETY: flags are cleared by zeros only.
            unsafe { w.bits(!0) };
            w.cc1if().clear()
        });
    }
}
