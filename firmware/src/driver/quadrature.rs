//! A 16-bit quadrature counter, extended past its wrap.
//!
//! A timer in encoder mode counts modulo 2¹⁶ and wraps whenever the joint passes a multiple of 65536 counts.
//! The difference of two readings, taken modulo 2¹⁶ as a signed number, is the motion in between as long as it
//! is shorter than 32768 counts: at one reading a millisecond that is 32 million counts per second, three
//! hundred times what Doggy's motors reach.

/// Extends a wrapping 16-bit count to 32 bits.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct QuadratureCounter {
    last: u16,
    total: i32,
}

impl QuadratureCounter {
    /// Starts at zero counts with the hardware counter at `raw`.
    pub const fn new(raw: u16) -> Self {
        QuadratureCounter { last: raw, total: 0 }
    }

    /// Takes the hardware counter's present value; returns counts since [`new`](Self::new), positive and
    /// negative, wrapping only after ±2³¹.
    pub fn update(&mut self, raw: u16) -> i32 {
        let moved = raw.wrapping_sub(self.last) as i16;
        self.last = raw;
        self.total = self.total.wrapping_add(i32::from(moved));
        self.total
    }

    /// Counts at the last update.
    pub const fn counts(&self) -> i32 {
        self.total
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// Any walk of steps shorter than half the counter's range is followed exactly, from any start.
        #[test]
        fn follows_every_walk(start: u16, steps in prop::collection::vec(-32767i32..=32767, 0..400)) {
            let mut counter = QuadratureCounter::new(start);
            let mut truth = 0i32;
            for step in steps {
                truth += step;
                let hardware = (i32::from(start) + truth).rem_euclid(65536) as u16;
                prop_assert_eq!(counter.update(hardware), truth);
            }
        }
    }

    #[test]
    fn passes_the_wrap_both_ways() {
        let mut counter = QuadratureCounter::new(65530);
        assert_eq!(counter.update(4), 10);
        assert_eq!(counter.update(65530), 0);
        assert_eq!(counter.update(65520), -10);
        assert_eq!(counter.counts(), -10);
    }
}
