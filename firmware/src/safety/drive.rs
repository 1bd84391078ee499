//! Does a joint go the way in which its motor drives it?
//!
//! ```text
//!   speed ▲╲                  the duty turns its sign: the joint still moves the old way, and slows down
//!         │ ╲   healthy       ──▶ every tick that is slower than all before begins the sum anew
//!         ├──╲─────────────
//!         │   ╲╱ ▔▔▔▔ wrong   it slows down no more while the duty drives the other way
//!         └─────────────────▶ ──▶ Σ duty beyond the standing duty ≥ bound: the wrong way
//! ```
//!
//! Coasting adds nothing, for there the duty is zero. A load that gravity lowers against a duty that does not hold it
//! adds nothing either, for such a duty is below the standing duty. A belt that swings pulls its motor against the duty
//! for a quarter of its period; the bound is larger than that push.

use super::plausible::excess;

/// Bounds of a drive watch.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DriveBounds {
    /// Largest duty (magnitude, steps of 10⁻⁴) at which the joint may stand: friction, and gravity, hold it.
    pub standing_duty: i16,
    /// Speed from which on it moves, counts/s: below, a count to and fro looks like it.
    pub moving_counts_per_s: u32,
    /// Push, the sum over ticks of the duty beyond `standing_duty`, steps · ticks, that slows down every joint.
    pub wrong_way_push: u32,
}

/// Watches the direction of a joint.
#[derive(Clone, Copy, Debug)]
pub struct DriveWatch {
    bounds: DriveBounds,
    /// Slowest speed (magnitude, counts/s) since the duty is against it.
    slowest: u32,
    /// Push since it was so slow.
    push: u32,
}

impl DriveWatch {
    /// Nothing seen yet.
    pub const fn new(bounds: DriveBounds) -> Self {
        DriveWatch { bounds, slowest: u32::MAX, push: 0 }
    }

    /// The present push against the speed, as a part of that of the wrong way.
    pub fn nearness(&self) -> f32 {
        self.push as f32 / self.bounds.wrong_way_push.max(1) as f32
    }

    /// Takes speed (counts/s) and duty (steps of 10⁻⁴) of this tick, both positive with the joint. Whether the joint
    /// goes the wrong way.
    pub fn is_wrong_way(&mut self, speed: i32, duty: i16) -> bool {
        let added = excess(duty, self.bounds.standing_duty);
        let magnitude = speed.unsigned_abs();
        let moves = magnitude > self.bounds.moving_counts_per_s;
        if !moves || added == 0 || added.signum() == speed.signum() {
            (self.slowest, self.push) = (u32::MAX, 0);
        } else if magnitude < self.slowest {
            (self.slowest, self.push) = (magnitude, 0);
        } else {
            self.push = self.push.saturating_add(added.unsigned_abs());
        }
        self.push >= self.bounds.wrong_way_push
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const BOUNDS: DriveBounds = DriveBounds { standing_duty: 600, moving_counts_per_s: 700, wrong_way_push: 135_000 };

    /// Ticks until the joint goes the wrong way, none within a second.
    fn wrong_after(speed: impl Fn(i32) -> i32, duty: impl Fn(i32) -> i16) -> Option<i32> {
        let mut watch = DriveWatch::new(BOUNDS);
        (1..=1000).find(|k| watch.is_wrong_way(speed(*k), duty(*k)))
    }

    #[test]
    fn a_joint_that_speeds_up_against_its_duty_goes_the_wrong_way() {
        // 0.09 · 150 ms = 13.5 ms, from the tick on in which it moves.
        assert_eq!(wrong_after(|k| -25 * k, |_| 1500), Some(28 + 1 + 150));
        assert_eq!(wrong_after(|k| 1000 + 25 * k, |_| -9000), Some(1 + 17), "0.84 · 17 ms > 13.5 ms");
    }

    #[test]
    fn a_joint_that_slows_down_or_goes_with_its_duty_does_not() {
        assert_eq!(wrong_after(|k| (30_000 - 100 * k).max(-2000), |_| -9000), None, "a reversal");
        assert_eq!(wrong_after(|k| 4000 - 4 * (k / 40), |_| -1500), None, "slowly, and in steps");
        assert_eq!(wrong_after(|_| 4000, |_| 1500), None);
        assert_eq!(wrong_after(|_| -4000, |_| -1500), None);
    }

    #[test]
    fn what_gravity_or_nobody_drives_does_not() {
        assert_eq!(wrong_after(|k| -25 * k, |_| 600), None, "the duty holds no more than friction and gravity");
        assert_eq!(wrong_after(|k| -25 * k, |_| 0), None, "coasting, or pushed by hand");
        assert_eq!(wrong_after(|k| if k % 2 == 0 { 125 } else { -125 }, |_| 9000), None, "a count to and fro");
    }

    #[test]
    fn a_swing_against_the_duty_shorter_than_the_bound_does_not() {
        // The first tick against the duty begins the sum; 16 more are 13.44 ms.
        let swing = |k: i32| if k % 60 < 17 { -2000 - k % 60 } else { 2000 };
        assert_eq!(wrong_after(swing, |_| 9000), None);
        let longer = |k: i32| if k % 60 < 18 { -2000 - k % 60 } else { 2000 };
        assert!(wrong_after(longer, |_| 9000).is_some());
    }
}
