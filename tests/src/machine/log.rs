//! What the pins showed, period by period.

use firmware::lockstep::Sensors;
use protocol::{Duty, ResetReason};

/// Everything since power-on.
#[derive(Debug, Clone, Default)]
pub struct Log {
    /// The periods in order, those after a reset behind those before it.
    pub periods: Vec<Period>,
    /// Every byte that the USART sent.
    pub sent: Vec<u8>,
    /// Why the processor started, each time, by its reset flags alone.
    pub starts: Vec<ResetReason>,
    /// First tick of the first motion, as an index into the periods.
    pub motion: Option<usize>,
}

/// A period at the pins.
#[derive(Debug, Clone)]
pub struct Period {
    /// Ticks since the processor started.
    pub seq: u32,
    /// Device time, µs.
    pub t_us: u32,
    /// Duty from its beginning on.
    pub duty: [Duty; firmware::lockstep::MOTORS],
    /// The drivers are enabled.
    pub armed: bool,
    /// The duty fell to zero within it.
    pub stopped: bool,
    /// What the world answered.
    pub sensors: Sensors,
    /// Cycles of the period before, first and second phase.
    pub cycles: [u32; 2],
    /// High-water mark of the stack, bytes.
    pub stack_bytes: u16,
}

impl Log {
    /// The periods from that `ticks` after the beginning of the motion on.
    ///
    /// # Panics
    /// If the motion did not come so far.
    pub fn motion_from(&self, ticks: u32) -> &[Period] {
        let start = self.motion.expect("a motion began");
        &self.periods[start + ticks as usize..]
    }

    /// Ticks from `at` (after the beginning of the motion) until the duty of every motor is zero and stays so: 0 if it
    /// falls to zero within that tick.
    ///
    /// # Panics
    /// If the motion did not come so far, or the duty is not zero in the end.
    pub fn ticks_to_zero(&self, at: u32) -> usize {
        let periods = self.motion_from(at);
        let driven = periods.iter().rposition(|period| period.duty.iter().any(|duty| *duty != Duty::ZERO));
        let Some(last) = driven else { return 0 };
        if periods[last].stopped {
            return last;
        }
        assert!(last + 1 < periods.len(), "the motors are driven to the end");
        last + 1
    }
}
