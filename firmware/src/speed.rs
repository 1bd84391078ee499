//! The speed of a joint from its encoder's counts.

use crate::constants::TICK_US;

/// Ticks over which the speed is taken: at 1 kHz one count in 8 ms is 125 counts/s, 0.018 rad/s on Doggy, and the
/// mean delay of 4 ms costs 0.02 rad of braking way at its 4 rad/s.
const WINDOW: usize = 8;
/// Windows in a second: counts in a window times this are counts a second.
const WINDOWS_PER_S: i32 = 1_000_000 / (WINDOW as i32 * TICK_US as i32);
const _: () = assert!(WINDOWS_PER_S * WINDOW as i32 * TICK_US as i32 == 1_000_000, "whole windows in a second");

/// Difference of positions over the last [`WINDOW`] ticks.
#[derive(Clone, Copy, Debug, Default)]
pub struct Speed {
    past: [i32; WINDOW],
    next: usize,
    filled: bool,
}

impl Speed {
    /// Takes the position of this tick, counts; gives the speed, counts/s. Zero until the window is full.
    pub fn update(&mut self, position: i32) -> i32 {
        let slot = self.next % WINDOW;
        let oldest = core::mem::replace(&mut self.past[slot], position);
        self.next = (slot + 1) % WINDOW;
        let ready = self.filled;
        self.filled |= self.next == 0;
        if ready { position.wrapping_sub(oldest).saturating_mul(WINDOWS_PER_S) } else { 0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_steady_motion_has_its_speed_after_the_window() {
        let mut speed = Speed::default();
        let seen: Vec<i32> = (0..12).map(|k| speed.update(-7 * k + 1000)).collect();
        assert_eq!(seen[..8], [0; 8]);
        assert_eq!(seen[8..], [-7000; 4]);
    }

    #[test]
    fn positions_may_wrap() {
        let mut speed = Speed::default();
        for k in 0..8 {
            speed.update((i32::MAX - 3).wrapping_add(k));
        }
        assert_eq!(speed.update((i32::MAX - 3).wrapping_add(8)), 1000);
    }
}
