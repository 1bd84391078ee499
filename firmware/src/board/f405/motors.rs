//! Three motor drivers: PWM on TIM8, direction and enable on plain pins.
//!
//! The timer runs in one-pulse mode with a repetition counter: a restart in every period keeps it going, without one
//! it stops with its outputs inactive ([`firmware::wiring::pwm`] has the diagram). The drivers' enable pin is low
//! through reset and start (a pull-down on the board), high from the start of a motion until half a second after its end,
//! so that a motor at zero duty is shorted and brakes; a panic, a fault of the processor or a falling supply lets it go.
//!
//! ```text
//!   drive():  compare values ─▶ restart: the pulses' inactive heads begin, 4.8 µs at the largest duty ─▶ directions
//! ```
//!
//! So a direction changes only while no output is active, and never at zero duty.

use firmware::wiring::pwm;
use protocol::Duty;
use stm32f4xx_hal::gpio::{Alternate, Output, PC1, PC6, PC7, PC8, PC9, PC10, PC11, PinState};
use stm32f4xx_hal::pac::tim8::bdtr;
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
    armed: bool,
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
        timer.bdtr().write(outputs_off);
        let (a, b, c) = pins.pwm;
        let _pwm = (a.into_alternate::<3>(), b.into_alternate::<3>(), c.into_alternate::<3>());
        Motors { timer, enable: pins.enable, direction: pins.direction, armed: false, _pwm }
    }

    /// Whether the last duties are still in force: false once the timer has stopped by itself, or before the first ones.
    pub fn driven(&self) -> bool {
        self.timer.cr1().read().cen().is_enabled()
    }

    /// Enables the drivers, or lets them go. What [`motors_off`] let go stays so until the next motion arms anew.
    pub fn arm(&mut self, armed: bool) {
        if armed == self.armed {
            return;
        }
        self.armed = armed;
        if armed {
            self.timer.bdtr().modify(|_, w| w.moe().enabled());
            self.enable.set_high();
        } else {
            self.enable.set_low();
            self.timer.bdtr().modify(|_, w| w.moe().disabled_idle());
        }
    }

    /// These duties at once, until a period and a half from now.
    pub fn drive(&mut self, duty: [Duty; MOTORS]) {
        for (channel, duty) in duty.into_iter().enumerate() {
            self.timer.ccr(channel).write(|w| w.ccr().set(pwm::compare(duty)));
        }
        self.timer.egr().write(|w| w.ug().update());
        self.timer.cr1().modify(|_, w| w.cen().enabled());
        let [a, b, c] = duty.map(|duty| match duty.0 {
            0 => None,
            steps => Some(PinState::from(steps > 0)),
        });
        let (first, second, third) = &mut self.direction;
        a.into_iter().for_each(|way| first.set_state(way));
        b.into_iter().for_each(|way| second.set_state(way));
        c.into_iter().for_each(|way| third.set_state(way));
    }
}

/// The outputs' register with all of them off. Off-state: driven to the idle level, low, instead of left open. Break on: if
/// the crystal fails, the clock security system takes the outputs there without any software. No pin is mapped to the break
/// input, which is then low and, active high, at rest.
fn outputs_off(w: &mut bdtr::W) -> &mut bdtr::W {
    w.moe().disabled_idle().ossr().idle_level().ossi().idle_level().bke().enabled().bkp().active_high()
}

/// Motors off, from anywhere and at any time: the timer's outputs to their idle level, the drivers' enable low.
pub fn motors_off() {
    // SAFETY: both accesses are single writes that turn something off; whoever is interrupted in between loses nothing
    // that counts. Before their clocks are on, the peripherals ignore them, and the pins are open.
    unsafe {
        (*TIM8::ptr()).bdtr().write(outputs_off);
        (*GPIOC::ptr()).bsrr().write(|w| w.br1().set_bit());
    }
}
