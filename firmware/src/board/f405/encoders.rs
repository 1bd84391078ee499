//! Three quadrature encoders on the counters of TIM2, TIM3 and TIM4, all four edges counted.
//!
//! The inputs are filtered: a level counts once six samples at 42 MHz (half the timers' clock) agree, 0.14 µs. Doggy's
//! motors make at most 34,000 edges a second, one in 29 µs.

use firmware::driver::QuadratureCounter;
use stm32f4xx_hal::gpio::{Alternate, PA0, PA1, PB4, PB5, PB6, PB7};
use stm32f4xx_hal::pac::{TIM2, TIM3, TIM4};
use stm32f4xx_hal::rcc::{Enable, Rcc, Reset};

/// The encoders of the three joints.
pub struct Encoders {
    timers: (TIM2, TIM3, TIM4),
    latched: [u16; 3],
    counters: [QuadratureCounter; 3],
}

/// Both inputs are timer inputs 1 and 2, filtered; both edges of both count; 16 bits, so that all wrap alike.
macro_rules! count {
    ($timer:ident, $block:expr, $rcc:expr) => {{
        $timer::enable($rcc);
        $timer::reset($rcc);
        let timer = &$block;
        // Channels 1 and 2 as inputs of their own pins, filter fDTS/2 with N = 6.
        // SAFETY: CC1S = CC2S = 01, IC1F = IC2F = 0100, the rest 0: all defined.
        timer.ccmr1_input().write(|w| unsafe { w.bits(0b0100_00_01 << 8 | 0b0100_00_01) });
        timer.smcr().write(|w| w.sms().encoder_mode_3());
        timer.arr().write(|w| w.arr().set(0xFFFF));
        timer.cr1().write(|w| w.cen().enabled());
    }};
}

impl Encoders {
    /// Counters at zero.
    pub fn new(
        (timer2, pa0, pa1): (TIM2, PA0, PA1),
        (timer3, pb4, pb5): (TIM3, PB4<Alternate<0>>, PB5),
        (timer4, pb6, pb7): (TIM4, PB6, PB7),
        rcc: &mut Rcc,
    ) -> Self {
        // Pulled up: open collectors need it, and a broken wire stands still instead of counting noise.
        let _ = (pa0.into_alternate::<1>().internal_pull_up(true), pa1.into_alternate::<1>().internal_pull_up(true));
        // PB4 is the debug port's reset after a reset of ours; the two-wire debug port does not need it.
        let _ = (pb4.into_alternate::<2>().internal_pull_up(true), pb5.into_alternate::<2>().internal_pull_up(true));
        let _ = (pb6.into_alternate::<2>().internal_pull_up(true), pb7.into_alternate::<2>().internal_pull_up(true));
        count!(TIM2, timer2, rcc);
        count!(TIM3, timer3, rcc);
        count!(TIM4, timer4, rcc);
        let zero = QuadratureCounter::new(0);
        Encoders { timers: (timer2, timer3, timer4), latched: [0; 3], counters: [zero; 3] }
    }

    /// Reads the three counters, within a tenth of a microsecond.
    pub fn latch(&mut self) {
        let (timer2, timer3, timer4) = &self.timers;
        self.latched =
            [timer2.cnt().read().bits() as u16, timer3.cnt().read().bits() as u16, timer4.cnt().read().bits() as u16];
    }

    /// Counts as they were latched, extended past 16 bits. Once a tick.
    pub fn counts(&mut self) -> [i32; 3] {
        let mut counts = [0; 3];
        for ((counts, counter), raw) in counts.iter_mut().zip(&mut self.counters).zip(self.latched) {
            *counts = counter.update(raw);
        }
        counts
    }
}
