//! From a duty to the compare register of a PWM timer that stops by itself.
//!
//! ```text
//!   begin()                                                        begin()          no begin() any more
//!   │▁▁▔▔│▁▁▔▔│ …                               │▁▁▔▔│▁▁▔▔│▁▁▔▔│▁│▁▁▔▔│ …   │▁▁▔▔│▁▁▔▔│▁▁▔▔│▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁
//!    1    2                                      18   19   20   ╰ slack, inactive   28   29   30: the timer stops
//! ```
//!
//! Every pulse lies at the end of its period. `begin` restarts the timer after 20 periods and a slack of 2 µs, which
//! falls into the inactive head of the 21st: neither the slack nor a start that is 2 µs early or late changes a
//! pulse. Without a restart the timer stops by itself after 30 periods, where a tick is an overrun too, with its
//! outputs inactive: no software, and not even a running processor, is needed to let go of the motors.

use protocol::Duty;

use crate::constants::{MAX_DUTY, TICK_US};

/// Clock of the timer, Hz.
pub const TIMER_HZ: u32 = 168_000_000;
/// Pulses in a tick: 20 kHz, above what people hear.
pub const PULSES_PER_TICK: u32 = 20;
/// A twentieth of the tick, timer clocks: a pulse of full duty.
pub const FULL_WIDTH: u32 = TIMER_HZ / 1_000_000 * TICK_US / PULSES_PER_TICK;
/// A period of the timer, timer clocks; 20 are shorter than a tick by the slack.
pub const PERIOD: u32 = FULL_WIDTH - 17;
/// Periods after which the timer stops unless it is restarted.
pub const PERIODS_TO_STOP: u32 = 30;
/// The compare value of a duty of zero: never reached.
pub const OFF: u16 = PERIOD as u16;

const _: () = {
    let slack = TIMER_HZ / 1_000_000 * TICK_US - PULSES_PER_TICK * PERIOD;
    assert!(slack == 340, "2.02 µs");
    // The inactive head of the 21st period at the largest duty outlasts the slack and 2 µs more.
    assert!(PERIOD - FULL_WIDTH * MAX_DUTY as u32 / 10_000 > 2 * slack);
    // A direction may change in the inactive head of a period: a hundred clocks and more after a restart.
    assert!(PERIOD - FULL_WIDTH * MAX_DUTY as u32 / 10_000 > 700);
    // The timer has stopped when a tick that is half a period late finds its overrun.
    assert!(PERIODS_TO_STOP * PERIOD <= TIMER_HZ / 1_000_000 * TICK_US * 3 / 2);
    assert!(PERIODS_TO_STOP * PERIOD > TIMER_HZ / 1_000_000 * (TICK_US + TICK_US / 3));
};

/// Compare value for the magnitude of a duty: the output is active from there to the end of the period. At least 1, so
/// that the output of a stopped timer, which stands at 0, is inactive.
pub fn compare(duty: Duty) -> u16 {
    let width = u32::from(duty.0.unsigned_abs()) * FULL_WIDTH / 10_000;
    // PERIOD < 2¹⁶, so the difference fits.
    PERIOD.saturating_sub(width).max(1) as u16
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn zero_is_off_and_the_largest_duty_is_a_pulse_of_its_share() {
        assert_eq!(compare(Duty::ZERO), OFF);
        for sign in [1, -1] {
            let active = PERIOD - u32::from(compare(Duty(sign * MAX_DUTY)));
            assert_eq!(active * PULSES_PER_TICK, 168_000 * 9 / 10);
        }
    }

    proptest! {
        /// Over a tick the output is active for the duty's share, short by less than a clock a pulse; whatever the
        /// duty, a stopped timer is inactive.
        #[test]
        fn a_duty_is_a_share_of_the_tick(duty: i16) {
            let compare = u32::from(compare(Duty(duty)));
            prop_assert!((1..=u32::from(OFF)).contains(&compare));
            let share = f64::from(PERIOD - compare) * f64::from(PULSES_PER_TICK) / 168_000.0;
            let wanted = f64::from(duty.unsigned_abs()) * 1e-4;
            if duty.unsigned_abs() <= MAX_DUTY.unsigned_abs() {
                prop_assert!(share <= wanted && wanted - share < 1.2e-4, "{} for {}", share, wanted);
            }
        }
    }
}
