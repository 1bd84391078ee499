//! The emergency stop and the supply: what the tick looks at before it moves anything.

use core::sync::atomic::{AtomicBool, Ordering::Relaxed};

use stm32f4xx_hal::gpio::{Input, PC0};
use stm32f4xx_hal::pac::{EXTI, FLASH, PWR};
use stm32f4xx_hal::rcc::{Enable, Rcc};

/// Level 7 of the voltage detector: 2.9 V falling (typical), where the supply is 3.3 V.
const DETECTOR_LEVEL: u8 = 7;

/// The supply fell since the last tick.
static FELL: AtomicBool = AtomicBool::new(false);

/// The interrupt of the detector: motors off at once, whatever else runs; the tick finds the brown-out. They stay off until
/// a motion arms them anew.
pub fn fell() {
    super::motors_off();
    FELL.store(true, Relaxed);
    // SAFETY: one write that clears this line's own flag.
    unsafe { (*EXTI::ptr()).pr().write(|w| w.pr16().clear()) };
}

/// Whether the chip holds itself in reset below 2.7 V (option byte BOR_LEV, level 3), as it must at 168 MHz with five wait
/// states: below, the flash is not specified, and the processor executes anything.
pub fn resets_in_time(flash: &FLASH) -> bool {
    flash.optcr().read().bor_lev().bits() == 0
}

/// The emergency stop's pin and the voltage detector.
pub struct Supply {
    power: PWR,
    stop: PC0<Input>,
}

impl Supply {
    /// Switches the detector on. The stop is a closed contact to ground; pulled up, so that an open contact, a broken
    /// wire and a pulled plug are all a stop.
    pub fn new(power: PWR, stop: PC0, events: &EXTI, rcc: &mut Rcc) -> Self {
        PWR::enable(rcc);
        // The detector's output is line 16: rising where the supply falls.
        events.rtsr().modify(|_, w| w.tr16().enabled());
        events.imr().modify(|_, w| w.mr16().unmasked());
        power.cr().modify(|_, w| w.pls().set(DETECTOR_LEVEL).pvde().enabled());
        Supply { power, stop: stop.into_pull_up_input() }
    }

    /// The stop is pressed, or its wire is broken.
    pub fn emergency_stop(&self) -> bool {
        self.stop.is_high()
    }

    /// The supply is below the detector's level, or was since this was asked last, however shortly.
    pub fn brown_out(&self) -> bool {
        FELL.swap(false, Relaxed) | self.power.csr().read().pvdo().bit_is_set()
    }
}
