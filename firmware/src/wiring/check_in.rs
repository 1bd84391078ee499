//! Who must live: every task below the tick checks in, and the tick feeds the watchdog only while all have lately.
//!
//! ```text
//!   tick        1   2   3   4   5   6  …   10  11                     the watchdog bites: reset, motors off
//!   telemetry   ✓   ✓   ✓   ·   ·   ·       ·   ·
//!   fed         ✓   ✓   ✓   ✓   ✓   ✓  …   ✓   ·   ·  …
//! ```

use core::sync::atomic::{AtomicU8, Ordering};

/// A task that checks in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Task {
    /// Frames to the line.
    Telemetry,
    /// Bytes from the line.
    Commands,
}

/// Ticks that a task may stay away. Both run in every tick; the longest a task may take is the parsing of what a full
/// receive buffer holds.
pub const BOUND_TICKS: u8 = 10;

/// Ticks since each task checked in.
#[derive(Debug, Default)]
pub struct CheckIns {
    away: [AtomicU8; 2],
}

impl CheckIns {
    /// All are here.
    pub const fn new() -> Self {
        CheckIns { away: [AtomicU8::new(0), AtomicU8::new(0)] }
    }

    /// The task lives.
    pub fn here(&self, task: Task) {
        self.away[task as usize].store(0, Ordering::Relaxed);
    }

    /// To be asked once a tick: whether all have checked in within [`BOUND_TICKS`] ticks.
    pub fn all_here(&self) -> bool {
        let mut all = true;
        for away in &self.away {
            // Only this task counts up, at a higher priority than those that set to zero: nothing comes in between.
            let ticks = away.load(Ordering::Relaxed).saturating_add(1);
            away.store(ticks, Ordering::Relaxed);
            all &= ticks <= BOUND_TICKS;
        }
        all
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_task_that_stays_away_is_enough() {
        let tasks = CheckIns::new();
        for _ in 0..1000 {
            assert!(tasks.all_here());
            tasks.here(Task::Telemetry);
            tasks.here(Task::Commands);
        }
        for tick in 1..=300 {
            tasks.here(Task::Telemetry);
            assert_eq!(tasks.all_here(), tick <= 10, "tick {tick}");
        }
        tasks.here(Task::Commands);
        assert!(tasks.all_here(), "late is better than never: the watchdog has the last word");
    }
}
