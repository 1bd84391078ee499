//! What duty a joint may have: limits of position, duty and slew. It can only lower.
//!
//! ```text
//!  outward
//!   duty ▲
//!   max  ┤───────────╮                     the duty fades over `fade` and is zero where the joint,
//!        │            ╲                    left alone, would come to rest at the limit:
//!      0 ┼─────────────╲────────┬────────▶   position + speed × coast time = limit
//!        │             ◀ fade ▶limit − speed × coast
//! ```
//!
//! At zero duty the bridge shorts the motor, whose back-EMF then brakes it: the speed dies with the time constant
//! b/k_mi, so the way to rest is speed × that constant. Duty away from the limit is never touched. A joint that
//! passes its limit by more than `overtravel` all the same is stopped by the control loop.

use protocol::Duty;

/// Limits of one joint. Positions in counts of its motor encoder from the zero position.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct JointLimits {
    /// Lowest position, counts.
    pub lower_counts: i32,
    /// Highest position, counts.
    pub upper_counts: i32,
    /// How far beyond a limit the joint may be carried before the motion is stopped, counts.
    pub overtravel_counts: i32,
    /// Way over which the outward duty fades to zero, counts; at least 1.
    pub fade_counts: i32,
    /// Time constant of the speed at zero duty (inertia over back-EMF constant), 2⁻¹⁶ s.
    pub coast_q16_s: u32,
    /// Largest duty.
    pub max_duty: Duty,
    /// Largest rise of the duty's magnitude from one tick to the next. Falling is never limited.
    pub max_rise: Duty,
}

/// A duty after the limits, and which of them lowered it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Lowered {
    /// The duty allowed: the sign of the duty asked for, or zero; never larger.
    pub duty: Duty,
    /// The duty ceiling lowered it.
    pub by_ceiling: bool,
    /// The approach to a joint limit lowered it.
    pub by_position: bool,
    /// The slew limit lowered it.
    pub by_slew: bool,
}

impl JointLimits {
    /// Lowers `asked` to what is allowed at this position (counts) and speed (counts/s) after the duty `before` of
    /// the last tick.
    pub fn lower(&self, asked: Duty, before: Duty, position: i32, speed: i32) -> Lowered {
        let capped = asked.limited_to(self.max_duty);
        let faded = self.fade(capped, position, speed);
        let rise = i32::from(self.max_rise.0).abs();
        let (from, to) = (i32::from(before.0.min(0)) - rise, i32::from(before.0.max(0)) + rise);
        // The range holds zero, so the result lies between zero and `faded`, which is an i16.
        let slewed = Duty(i32::from(faded.0).clamp(from, to) as i16);
        Lowered { duty: slewed, by_ceiling: capped != asked, by_position: faded != capped, by_slew: slewed != faded }
    }

    /// The position in the middle of the range, counts.
    pub fn middle(&self) -> i32 {
        self.lower_counts / 2 + self.upper_counts / 2
    }

    /// How far the joint is beyond a limit, counts; zero within.
    pub fn beyond(&self, position: i32) -> i32 {
        let above = position.saturating_sub(self.upper_counts);
        let below = self.lower_counts.saturating_sub(position);
        above.max(below).max(0)
    }

    /// Scales a duty that drives towards a limit.
    fn fade(&self, duty: Duty, position: i32, speed: i32) -> Duty {
        let (way, outward_speed) = if duty.0 >= 0 {
            (i64::from(self.upper_counts) - i64::from(position), i64::from(speed))
        } else {
            (i64::from(position) - i64::from(self.lower_counts), -i64::from(speed))
        };
        let coast = (outward_speed.max(0) * i64::from(self.coast_q16_s)) >> 16;
        let fade = i64::from(self.fade_counts.max(1));
        let room = (way - coast).max(0);
        if room >= fade {
            return duty;
        }
        // |duty × room / fade| ≤ |duty|, an i16.
        Duty((i64::from(duty.0) * room / fade) as i16)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Doggy's pitch: ±0.6 rad at 6860 counts a radian, full duty in 10 ms.
    fn pitch() -> JointLimits {
        JointLimits {
            lower_counts: -4116,
            upper_counts: 4116,
            overtravel_counts: 343,
            fade_counts: 686,
            coast_q16_s: 5243, // 80 ms
            max_duty: Duty(9000),
            max_rise: Duty(1000),
        }
    }

    #[test]
    fn full_duty_passes_in_the_middle() {
        let lowered = pitch().lower(Duty(9000), Duty(9000), 0, 20_000);
        assert_eq!(lowered, Lowered { duty: Duty(9000), ..Lowered::default() });
    }

    #[test]
    fn the_ceiling_and_the_slew_say_so() {
        let lowered = pitch().lower(Duty(10_000), Duty(9000), 0, 0);
        assert!(lowered.duty == Duty(9000) && lowered.by_ceiling && !lowered.by_slew);
        let lowered = pitch().lower(Duty(-9000), Duty(9000), 0, 0);
        assert!(lowered.duty == Duty(-1000) && lowered.by_slew, "a reversal passes zero at once and then rises");
        assert_eq!(pitch().lower(Duty(0), Duty(9000), 0, 0).duty, Duty(0), "falling is never limited");
    }

    #[test]
    fn a_fast_approach_is_cut_earlier_than_a_slow_one() {
        let outward = |position, speed| pitch().lower(Duty(9000), Duty(9000), position, speed).duty;
        assert_eq!(outward(3000, 0), Duty(9000));
        assert_eq!(outward(3773, 0), Duty(4500), "halfway through the fade");
        assert_eq!(outward(4116, 0), Duty(0));
        assert_eq!(outward(2116, 25_000), Duty(0), "2000 counts of way, 2000 of coasting");
        assert_eq!(outward(2116, -25_000), Duty(9000), "moving away");
        assert_eq!(pitch().lower(Duty(-9000), Duty(-9000), 4200, 0).duty, Duty(-9000), "back from beyond");
    }

    #[test]
    fn beyond_counts_from_either_limit() {
        assert_eq!(pitch().beyond(4116), 0);
        assert_eq!(pitch().beyond(4120), 4);
        assert_eq!(pitch().beyond(-4200), 84);
        assert_eq!(pitch().beyond(i32::MIN), 2_147_479_532);
    }

    proptest! {
        /// Whatever the state: the magnitude never grows, the sign never turns, and beyond a limit nothing drives out.
        #[test]
        fn it_only_lowers(asked: i16, before: i16, position: i32, speed: i32) {
            let Lowered { duty, .. } = pitch().lower(Duty(asked), Duty(before), position, speed);
            prop_assert!(duty.0.unsigned_abs() <= asked.unsigned_abs().min(9000));
            prop_assert!(i32::from(duty.0) * i32::from(asked) >= 0);
            prop_assert!(duty.0.unsigned_abs() <= before.unsigned_abs().saturating_add(1000));
            prop_assert!(!(position >= 4116 && duty.0 > 0));
            prop_assert!(!(position <= -4116 && duty.0 < 0));
        }
    }
}
