//! The emergency stop and the supply: what the tick looks at before it moves anything.

use stm32f4xx_hal::gpio::{Input, PC0};
use stm32f4xx_hal::pac::PWR;
use stm32f4xx_hal::rcc::{Enable, Rcc};

/// Level 7 of the voltage detector: 2.9 V falling (typical), where the supply is 3.3 V.
const DETECTOR_LEVEL: u8 = 7;

/// The emergency stop's pin and the voltage detector.
pub struct Supply {
    power: PWR,
    stop: PC0<Input>,
}

impl Supply {
    /// Switches the detector on. The stop is a closed contact to ground; pulled up, so that an open contact, a broken
    /// wire and a pulled plug are all a stop.
    pub fn new(power: PWR, stop: PC0, rcc: &mut Rcc) -> Self {
        PWR::enable(rcc);
        power.cr().modify(|_, w| w.pls().set(DETECTOR_LEVEL).pvde().enabled());
        Supply { power, stop: stop.into_pull_up_input() }
    }

    /// The stop is pressed, or its wire is broken.
    pub fn emergency_stop(&self) -> bool {
        self.stop.is_high()
    }

    /// The supply is below the detector's level.
    pub fn brown_out(&self) -> bool {
        self.power.csr().read().pvdo().bit_is_set()
    }
}
