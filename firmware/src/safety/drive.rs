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
//! adds nothing either, for such a duty is below the standing duty.
//!
//! Links that are on their way pull a motor against its duty: its own link through the belt, the others through the chain.
//! A motor is pulled until its push has turned their momentum over:
//!
//! ```text
//!   ∫ τ u dt ≤ 2 Σ |M_jk| · speed of joint k      speeds lately; of the joint itself, before the duty was against it
//! ```
//!
//! The bound is larger by this push. A joint that goes the wrong way from rest has no momentum before, and gets nothing of
//! its own.

use protocol::MAX_JOINTS;

use super::plausible::excess;
use crate::constants;

/// Speeds are forgotten with a time constant of 2¹⁰ ticks, 1 s: so long a link swings on its belt. Doggy's swings die out
/// in 0.6 s. Half of it is shorter than they, and twice only widens the bound after a fast motion.
const FASTEST_SHIFT: u32 = 10;
/// What is carried is kept in 2⁻¹⁶ of a push for each count a second.
const CARRIED_SHIFT: u32 = 16;

/// Bounds of a drive watch.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DriveBounds {
    /// Largest duty (magnitude, steps of 10⁻⁴) at which the joint may stand: friction, and gravity, hold it.
    pub standing_duty: i16,
    /// Speed from which on it moves, counts/s: below, a count to and fro looks like it.
    pub moving_counts_per_s: u32,
    /// Push, the sum over ticks of the duty beyond `standing_duty`, steps · ticks, that slows down every joint.
    pub wrong_way_push: u32,
    /// How much larger the push may be for each count a second of a joint, 2⁻¹⁶.
    pub carried: [u32; MAX_JOINTS],
}

impl DriveBounds {
    /// Torque that the acceleration of each link puts on the joint, over its torque at full duty (s²), and the counts of
    /// each joint for a radian or metre.
    pub fn carry(&mut self, carried_s2: &[f32; MAX_JOINTS], counts_per_unit: &[f32; MAX_JOINTS]) {
        let full_push_per_s = f32::from(protocol::Duty::FULL) * 1e6 / constants::TICK_US as f32;
        for (carried, (s2, counts)) in self.carried.iter_mut().zip(carried_s2.iter().zip(counts_per_unit)) {
            // The cast ends at the largest number.
            *carried = (2.0 * s2 / counts * full_push_per_s * (1u32 << CARRIED_SHIFT) as f32) as u32;
        }
    }

    /// The push that turns the momentum over which joints of these speeds (counts/s) carry.
    fn carried_push(&self, fastest: &[u32; MAX_JOINTS]) -> u32 {
        let push = |(carried, speed): (&u32, &u32)| (u64::from(*carried) * u64::from(*speed)) >> CARRIED_SHIFT;
        let sum: u64 = self.carried.iter().zip(fastest).map(push).sum();
        u32::try_from(sum).unwrap_or(u32::MAX)
    }
}

/// Watches the direction of a joint.
#[derive(Clone, Copy, Debug)]
pub struct DriveWatch {
    bounds: DriveBounds,
    /// Slowest speed (magnitude, counts/s) since the duty is against it.
    slowest: u32,
    /// Push since it was so slow.
    push: u32,
    /// The bound of this push.
    bound: u32,
}

impl DriveWatch {
    /// Nothing seen yet.
    pub const fn new(bounds: DriveBounds) -> Self {
        DriveWatch { bounds, slowest: u32::MAX, push: 0, bound: bounds.wrong_way_push }
    }

    /// The present push against the speed, as a part of that of the wrong way.
    pub fn nearness(&self) -> f32 {
        self.push as f32 / self.bound.max(1) as f32
    }

    /// Takes speed (counts/s) and duty (steps of 10⁻⁴) of this tick, both positive with the joint, and the speeds of all
    /// joints lately, of which `joint` is its own. Whether the joint goes the wrong way.
    pub fn is_wrong_way(&mut self, speed: i32, duty: i16, joint: usize, fastest: &mut [u32; MAX_JOINTS]) -> bool {
        let added = excess(duty, self.bounds.standing_duty);
        let magnitude = speed.unsigned_abs();
        let moves = magnitude > self.bounds.moving_counts_per_s;
        if !moves || added == 0 || added.signum() == speed.signum() {
            (self.slowest, self.push) = (u32::MAX, 0);
        } else if magnitude < self.slowest {
            (self.slowest, self.push) = (magnitude, 0);
        } else {
            self.push = self.push.saturating_add(added.unsigned_abs());
            self.bound = self.bounds.wrong_way_push.saturating_add(self.bounds.carried_push(fastest));
        }
        if self.slowest == u32::MAX {
            remember(&mut fastest[joint], magnitude);
        }
        self.push >= self.bound
    }
}

/// The fastest speed lately.
fn remember(fastest: &mut u32, magnitude: u32) {
    *fastest = fastest.saturating_sub((*fastest >> FASTEST_SHIFT) + 1).max(magnitude);
}

#[cfg(test)]
mod tests {
    use super::*;

    const BOUNDS: DriveBounds =
        DriveBounds { standing_duty: 600, moving_counts_per_s: 700, wrong_way_push: 135_000, carried: [0; MAX_JOINTS] };

    /// Ticks until the joint goes the wrong way, none within a second.
    fn wrong_after(speed: impl Fn(i32) -> i32, duty: impl Fn(i32) -> i16) -> Option<i32> {
        let (mut watch, mut fastest) = (DriveWatch::new(BOUNDS), [0; MAX_JOINTS]);
        (1..=1000).find(|k| watch.is_wrong_way(speed(*k), duty(*k), 0, &mut fastest))
    }

    /// A link of 3 kg m² at a motor of 48 N m, and another joint's that puts 1 kg m² on it; 32,595 counts a radian.
    #[test]
    fn a_heavy_link_may_pull_its_motor_for_longer_the_faster_it_was() {
        let mut bounds = BOUNDS;
        bounds
            .carry(&core::array::from_fn(|k| [3.0 / 48.0, 1.0 / 48.0].get(k).copied().unwrap_or(0.0)), &[32_595.0; 7]);
        let wrong_after = |before: i32, other: u32| {
            let (mut watch, mut fastest) = (DriveWatch::new(bounds), [0; MAX_JOINTS]);
            watch.is_wrong_way(-before, 0, 0, &mut fastest);
            fastest[1] = other;
            (1..=1000).find(|k| watch.is_wrong_way(-10_000 - k, 2000, 0, &mut fastest))
        };
        // 13.5 ms of full duty at 0.14: 97 ticks, after the one that begins.
        assert_eq!(wrong_after(0, 0), Some(98));
        // 0.6 rad/s: 2 · 3 · 0.6 / 48 = 75 ms of full duty, 536 ticks.
        assert!((630..=640).contains(&wrong_after(19_557, 0).unwrap()), "{:?}", wrong_after(19_557, 0));
        // The other joint's 0.6 rad/s: 25 ms, 179 ticks.
        assert!((270..=280).contains(&wrong_after(0, 19_557).unwrap()), "{:?}", wrong_after(0, 19_557));
    }

    #[test]
    fn speeds_are_forgotten() {
        let mut fastest = 100_000;
        (0..1024).for_each(|_| remember(&mut fastest, 0));
        assert!((35_000..38_000).contains(&fastest), "{fastest}");
        (0..10_000).for_each(|_| remember(&mut fastest, 0));
        assert_eq!(fastest, 0);
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
