//! Three motor drivers: PWM on TIM8, direction and enable on plain pins.
//!
//! The timer runs in one-pulse mode with a repetition counter: a restart in every period keeps it going, without one
//! it stops with its outputs inactive ([`firmware::wiring::pwm`] has the diagram). The drivers' enable pin is low
//! through reset and start (a pull-down on the board), goes high with the first duty of the first tick and stays
//! there, so that a motor at zero duty is shorted and brakes; a panic or a fault of the processor lets it go.

use firmware::wiring::pwm;
use protocol::Duty;
use stm32f4xx_hal::gpio::{Alternate, Output, PC1, PC6, PC7, PC8, PC9, PC10, PC11, PinState};
use stm32f4xx_hal::pac::{GPIOC, TIM8};
use stm32f4xx_hal::rcc::{Enable, Rcc, Reset};

/// Motors of the board.
pub const MOTORS: usize = 3;

/// The pins, all low.
pub struct DriverPins {
    enable: PC1<Output>,
    pwm: (PC6, PC7, PC8),
    direction: (PC9<Output>, PC10<Output>, PC11<Output>),
}

/// Takes the pins, drivers off: the first thing after a reset. The PWM pins stay inputs, held low by the board, until
/// the timer drives them.
pub fn pins(enable: PC1, pwm: (PC6, PC7, PC8), direction: (PC9, PC10, PC11)) -> DriverPins {
    let enable = enable.into_push_pull_output_in_state(PinState::Low);
    let direction =
        (direction.0.into_push_pull_output(), direction.1.into_push_pull_output(), direction.2.into_push_pull_output());
    DriverPins { enable, pwm, direction }
}

/// The motors.
pub struct Motors {
    timer: TIM8,
    enable: PC1<Output>,
    direction: (PC9<Output>, PC10<Output>, PC11<Output>),
    _pwm: (PC6<Alternate<3>>, PC7<Alternate<3>>, PC8<Alternate<3>>),
}

impl Motors {
    /// At zero duty, drivers off, the timer standing.
    pub fn new(timer: TIM8, pins: DriverPins, rcc: &mut Rcc) -> Self {
        TIM8::enable(rcc);
        TIM8::reset(rcc);
        // Stops after its repetitions; a restart by software does not count as one.
        timer.cr1().write(|w| w.opm().enabled().urs().counter_only().arpe().enabled());
        timer.arr().write(|w| w.arr().set(pwm::PERIOD as u16 - 1));
        timer.rcr().write(|w| w.rep().set(pwm::PERIODS_TO_STOP as u8 - 1));
        // PWM mode 2: inactive below the compare value, active from there to the end of the period. Preloaded, so
        // that all three channels change together at a restart.
        timer.ccmr1_output().write(|w| w.oc1m().pwm_mode2().oc1pe().enabled().oc2m().pwm_mode2().oc2pe().enabled());
        timer.ccmr2_output().write(|w| w.oc3m().pwm_mode2().oc3pe().enabled());
        for channel in 0..MOTORS {
            timer.ccr(channel).write(|w| w.ccr().set(pwm::OFF));
        }
        // The compare values count from here; before, they are 0, which in this mode is always active.
        timer.egr().write(|w| w.ug().update());
        timer.ccer().write(|w| w.cc1e().set_bit().cc2e().set_bit().cc3e().set_bit());
        // Off-state: driven to the idle level, low, instead of left open.
        timer.bdtr().write(|w| w.moe().enabled().ossr().idle_level().ossi().idle_level());
        let (a, b, c) = pins.pwm;
        let _pwm = (a.into_alternate::<3>(), b.into_alternate::<3>(), c.into_alternate::<3>());
        Motors { timer, enable: pins.enable, direction: pins.direction, _pwm }
    }

    /// Whether the last duties are still in force: false once the timer has stopped by itself, or before the first ones.
    pub fn driven(&self) -> bool {
        self.timer.cr1().read().cen().is_enabled()
    }

    /// These duties at once, until a period and a half from now.
    pub fn drive(&mut self, duty: [Duty; MOTORS]) {
        let forward = |duty: Duty| PinState::from(duty.0 >= 0);
        self.direction.0.set_state(forward(duty[0]));
        self.direction.1.set_state(forward(duty[1]));
        self.direction.2.set_state(forward(duty[2]));
        for (channel, duty) in duty.into_iter().enumerate() {
            self.timer.ccr(channel).write(|w| w.ccr().set(pwm::compare(duty)));
        }
        self.timer.egr().write(|w| w.ug().update());
        self.timer.cr1().modify(|_, w| w.cen().enabled());
        self.enable.set_high();
    }
}

/// Motors off, from anywhere and at any time: the timer's outputs to their idle level, the drivers' enable low.
pub fn motors_off() {
    // SAFETY: both accesses are single writes that turn something off; whoever is interrupted in between loses nothing
    // that counts. Before their clocks are on, the peripherals ignore them, and the pins are open.
    unsafe {
        (*TIM8::ptr()).bdtr().write(|w| w.moe().disabled_idle().ossi().idle_level());
        (*GPIOC::ptr()).bsrr().write(|w| w.br1().set_bit());
    }
}
