//! Was the tick on time? What an overrun does.
//!
//! ```text
//!   called:  │─── T ───│─── T ──│──── T ────│· · · · · · · · 2T · · ·│       interval between calls
//!   jitter:           0        −         +                         +T  ▶ overrun
//! ```
//!
//! Policy: lateness is measured in every tick. A tick that comes half a period late or more, and a tick whose
//! predecessor ran longer than its period, is an overrun: the duty preloaded before was in force longer than it was
//! meant to be, so the motion stops. The sequence number counts the ticks that ran; the time stamp shows the hole.

/// Watches the period of the tick.
#[derive(Clone, Copy, Debug)]
pub struct Deadline {
    period_us: u32,
    last_us: Option<u32>,
}

/// What the clock says about this tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct OnTime {
    /// Called − one period after the last call, µs.
    pub jitter_us: i32,
    /// The tick came so late, or its predecessor ran so long, that the motion must stop.
    pub overrun: bool,
}

impl Deadline {
    /// For ticks every `period_us`.
    pub const fn new(period_us: u32) -> Self {
        Deadline { period_us, last_us: None }
    }

    /// To be asked once in every tick, with the device time at which the tick began and how long the tick before it
    /// ran.
    pub fn check(&mut self, now_us: u32, last_execution_us: u32) -> OnTime {
        let interval = self.last_us.map_or(self.period_us, |last| now_us.wrapping_sub(last));
        self.last_us = Some(now_us);
        let jitter_us = i64::from(interval) - i64::from(self.period_us);
        let late = jitter_us >= i64::from(self.period_us / 2);
        OnTime {
            jitter_us: jitter_us.min(i64::from(i32::MAX)) as i32,
            overrun: late || last_execution_us > self.period_us,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn jitter_is_measured_from_tick_to_tick_over_the_wrap() {
        let mut deadline = Deadline::new(1000);
        let mut now = u32::MAX - 1500;
        assert_eq!(deadline.check(now, 0), OnTime { jitter_us: 0, overrun: false });
        for jitter_us in [3, -5, 12, 0, 499, -499] {
            now = now.wrapping_add_signed(1000 + jitter_us);
            assert_eq!(deadline.check(now, 60), OnTime { jitter_us, overrun: false });
        }
    }

    #[test]
    fn a_missed_tick_is_an_overrun_once() {
        let mut deadline = Deadline::new(1000);
        deadline.check(0, 0);
        assert_eq!(deadline.check(2000, 60), OnTime { jitter_us: 1000, overrun: true });
        assert_eq!(deadline.check(3000, 60), OnTime { jitter_us: 0, overrun: false });
        assert!(deadline.check(4500, 60).overrun, "half a period late");
        assert!(!deadline.check(5000, 60).overrun, "back on time");
    }

    #[test]
    fn a_tick_that_ran_too_long_is_an_overrun() {
        let mut deadline = Deadline::new(1000);
        deadline.check(0, 0);
        assert!(!deadline.check(1000, 1000).overrun);
        assert!(deadline.check(2000, 1001).overrun);
    }
}
