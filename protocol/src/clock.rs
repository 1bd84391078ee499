//! The device's clock and tick counter, unwrapped to 64 bits.
//!
//! ```text
//!   device, u32 µs:  … 0xffff_fe0c  0x0000_01f4 …      wraps every 4294.967296 s (71.6 min)
//!   host,   u64 µs:  …  4294966796   4294967796 …      never
//! ```
//!
//! The wrap rule: from one reading to the next the device's clock advances by less than 2³¹ µs (35.8 min). A step of
//! 2³¹ or more is therefore a step backwards, which only a restart of the device makes. The tick counter follows the
//! same rule. The time at which a frame arrives is never used as a time base: adapters hold bytes for milliseconds.

/// The clock or counter went backwards: the device restarted, or frames of two devices are mixed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the device's counter went back by {by}, to {to}: it restarted")]
pub struct Backwards {
    /// By how much it went back.
    pub by: u32,
    /// The raw value read.
    pub to: u32,
}

/// Unwraps a 32-bit clock or counter to 64 bits. The first reading is taken as it is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Unwrapped {
    last: Option<u64>,
}

impl Unwrapped {
    /// A clock not read yet.
    pub const fn new() -> Self {
        Self { last: None }
    }

    /// The 64-bit value of a reading.
    ///
    /// # Errors
    /// [`Backwards`] if the reading lies before the last one by the wrap rule; the clock is left as it was.
    pub fn advance(&mut self, raw: u32) -> Result<u64, Backwards> {
        let Some(last) = self.last else {
            self.last = Some(u64::from(raw));
            return Ok(u64::from(raw));
        };
        // The low word of the last value is what the device showed then.
        let step = raw.wrapping_sub(last as u32);
        if step >= 1 << 31 {
            return Err(Backwards { by: step.wrapping_neg(), to: raw });
        }
        let now = last.wrapping_add(u64::from(step));
        self.last = Some(now);
        Ok(now)
    }

    /// The 64-bit value of a reading that is near the last one, before or after it: the time of an event, say. The
    /// clock is left as it was. Before the first reading, and before time 0, it is the raw value.
    pub fn near(&self, raw: u32) -> u64 {
        let Some(last) = self.last else {
            return u64::from(raw);
        };
        let step = raw.wrapping_sub(last as u32);
        if step < 1 << 31 {
            last.wrapping_add(u64::from(step))
        } else {
            last.checked_sub(u64::from(step.wrapping_neg())).unwrap_or(u64::from(raw))
        }
    }

    /// The last value, if any was read.
    pub fn last(&self) -> Option<u64> {
        self.last
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn follows_any_clock_that_keeps_the_wrap_rule(
            start: u32,
            steps in prop::collection::vec(0u32..1 << 31, 0..100),
        ) {
            let mut truth = u64::from(start);
            let mut clock = Unwrapped::new();
            prop_assert_eq!(clock.advance(start), Ok(truth));
            for step in steps {
                truth += u64::from(step);
                prop_assert_eq!(clock.advance(truth as u32), Ok(truth));
            }
        }

        #[test]
        fn a_time_near_the_last_reading_is_found_on_both_sides(
            start in 1u64 << 33..1 << 40, apart in -(1i64 << 31) + 1..1 << 31,
        ) {
            let clock = Unwrapped { last: Some(start) };
            let truth = start.checked_add_signed(apart).unwrap();
            prop_assert_eq!(clock.near(truth as u32), truth);
        }

        #[test]
        fn a_step_back_is_reported_and_forgotten(start: u32, by in 1u32..=1 << 31) {
            let mut clock = Unwrapped::new();
            clock.advance(start).unwrap();
            let to = start.wrapping_sub(by);
            prop_assert_eq!(clock.advance(to), Err(Backwards { by, to }));
            prop_assert_eq!(clock.last(), Some(u64::from(start)));
            prop_assert_eq!(clock.advance(start.wrapping_add(1)), Ok(u64::from(start) + 1));
        }
    }
}
