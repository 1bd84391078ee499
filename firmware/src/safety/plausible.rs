//! Can a sensor be believed? One watch per sensor, fed once a tick.

use crate::driver::{GyroReading, INVALID_WORD};

/// Bounds of an encoder watch.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct EncoderBounds {
    /// Most counts from one tick to the next.
    pub max_step_counts: i32,
    /// Largest duty (magnitude, steps of 10⁻⁴) at which the joint may stand: friction, and gravity, hold it.
    pub standing_duty: i16,
    /// Push, the sum over ticks of the duty beyond `standing_duty` in one direction, steps · ticks, under which the
    /// count must have moved by more than [`STILL_COUNTS`]; 0: never.
    pub stuck_push: u32,
    /// Square of the push for which a belt that swings may hold the motor at a standstill, for each step of the largest
    /// duty in it, (steps · ticks)² / step.
    pub held_push_squared: u64,
    /// Ticks without a reading after which the encoder does not answer.
    pub stale_ticks: u16,
}

/// A quadrature counter with one open phase goes to and fro by a count, and noise at an edge by another one: a count
/// that stays within so many counts of where it was has not moved.
pub const STILL_COUNTS: u32 = 2;

/// What a tick has of a gyroscope.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum GyroInput {
    /// New words.
    Words([i16; 3]),
    /// The part answered, but has not converted since the last tick.
    #[default]
    NotReady,
    /// The part or its bus did not answer.
    BusError,
}

impl<E> From<Result<GyroReading, E>> for GyroInput {
    fn from(reading: Result<GyroReading, E>) -> Self {
        match reading {
            Ok(GyroReading { raw, fresh: true }) => GyroInput::Words(raw),
            Ok(_) => GyroInput::NotReady,
            Err(_) => GyroInput::BusError,
        }
    }
}

/// What a reading looks like.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// Believable.
    Good,
    /// No new reading in this tick.
    Missing,
    /// No new reading for too many ticks: the sensor does not answer.
    Stale,
    /// As stale, and it is the bus that fails.
    BusHang,
    /// The same reading for too long: the sensor, or what it measures, hangs.
    Stuck,
    /// At the end of its range in this tick.
    Saturated,
    /// Out of range for too long, or by a step that no motion makes.
    OutOfRange,
}

/// Watches an encoder.
///
/// ```text
///   duty ──▶ − standing duty ──▶ Σ over ticks, as long as the count stays within ±2 of the anchor ──▶ ≥ bound: stuck
///                                 anew where the count leaves it, the duty falls below or changes its sign
/// ```
///
/// What moves a joint is the push in one direction: a duty that alternates faster than the joint can follow adds up to
/// nothing, and carries it nowhere.
///
/// A belt at the top of its swing may hold a motor against its duty u: while its torque u τ cos ω t is within twice the
/// friction μ of the motor's, friction does the rest. That takes 4 √(μ / u τ) / ω, a push of 4 √(u μ / τ) / ω.
#[derive(Clone, Copy, Debug)]
pub struct EncoderWatch {
    bounds: EncoderBounds,
    last: Option<i32>,
    /// Where the count stood when the present push began.
    anchor: i32,
    /// Duty beyond the standing duty, summed over ticks, steps; with its sign.
    push: i64,
    /// Largest duty in this push, magnitude.
    strongest: u16,
    missing: u16,
}

impl EncoderWatch {
    /// Nothing seen yet.
    pub const fn new(bounds: EncoderBounds) -> Self {
        EncoderWatch { bounds, last: None, anchor: 0, push: 0, strongest: 0, missing: 0 }
    }

    /// Takes the counts of this tick, or `None` if there are none, and the duty (steps of 10⁻⁴) that drives
    /// its joint.
    pub fn check(&mut self, counts: Option<i32>, duty_in_force: i16) -> Verdict {
        let Some(counts) = counts else {
            self.missing = self.missing.saturating_add(1);
            return if self.missing >= self.bounds.stale_ticks { Verdict::Stale } else { Verdict::Missing };
        };
        let ticks = i32::from(core::mem::take(&mut self.missing)) + 1;
        let Some(last) = self.last.replace(counts) else {
            return Verdict::Good;
        };
        let step = counts.wrapping_sub(last);
        let reach = self.bounds.max_step_counts.saturating_mul(ticks);
        if step.unsigned_abs() > reach.unsigned_abs() {
            return Verdict::OutOfRange;
        }
        if self.is_stuck(counts, duty_in_force) { Verdict::Stuck } else { Verdict::Good }
    }

    /// The present push, as a part of that under which the count must have moved.
    pub fn nearness(&self) -> f32 {
        let held = self.bounds.held_push_squared.saturating_mul(self.strongest.into()).isqrt();
        self.push.unsigned_abs() as f32 / held.max(self.bounds.stuck_push.into()).max(1) as f32
    }

    fn is_stuck(&mut self, counts: i32, duty_in_force: i16) -> bool {
        let added = i64::from(excess(duty_in_force, self.bounds.standing_duty));
        let moved = counts.wrapping_sub(self.anchor).unsigned_abs() > STILL_COUNTS;
        if moved || added == 0 || added.signum() != self.push.signum() {
            (self.anchor, self.push, self.strongest) = (counts, added, 0);
        } else {
            self.push = self.push.saturating_add(added);
        }
        self.strongest = self.strongest.max(duty_in_force.unsigned_abs());
        let push = self.push.unsigned_abs();
        self.bounds.stuck_push > 0 && push >= u64::from(self.bounds.stuck_push) && {
            let held = self.bounds.held_push_squared.saturating_mul(self.strongest.into());
            push.saturating_mul(push) >= held
        }
    }
}

/// What of a duty is beyond the one at which a joint may stand, with its sign; zero below.
pub(super) fn excess(duty: i16, standing_duty: i16) -> i32 {
    let beyond = i32::from(duty).abs() - i32::from(standing_duty).abs();
    beyond.max(0) * i32::from(duty).signum()
}

/// Bounds of a gyroscope watch.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct GyroBounds {
    /// Ticks without a new reading after which the sensor does not answer.
    pub stale_ticks: u16,
    /// Ticks with the very same words on all axes after which the sensor hangs, for its noise moves them; 0: never.
    pub stuck_ticks: u16,
    /// Ticks at the end of the range after which the reading is out of range.
    pub saturated_ticks: u16,
    /// Largest magnitude of a word that is a measurement.
    pub max_word: i16,
}

/// Watches a gyroscope.
#[derive(Clone, Copy, Debug)]
pub struct GyroWatch {
    bounds: GyroBounds,
    last: Option<[i16; 3]>,
    missing: u16,
    same: u16,
    saturated: u16,
}

impl GyroWatch {
    /// Nothing seen yet.
    pub const fn new(bounds: GyroBounds) -> Self {
        GyroWatch { bounds, last: None, missing: 0, same: 0, saturated: 0 }
    }

    /// Takes what this tick has.
    pub fn check(&mut self, input: GyroInput) -> Verdict {
        let words = match input {
            GyroInput::Words(words) if !words.contains(&INVALID_WORD) => words,
            silent => {
                self.missing = self.missing.saturating_add(1);
                return match silent {
                    _ if self.missing < self.bounds.stale_ticks => Verdict::Missing,
                    GyroInput::BusError => Verdict::BusHang,
                    _ => Verdict::Stale,
                };
            }
        };
        self.missing = 0;
        self.same = if self.last == Some(words) { self.same.saturating_add(1) } else { 0 };
        self.last = Some(words);
        let at_end = words.iter().any(|word| word.unsigned_abs() >= self.bounds.max_word.unsigned_abs());
        self.saturated = if at_end { self.saturated.saturating_add(1) } else { 0 };
        if self.saturated >= self.bounds.saturated_ticks.max(1) {
            Verdict::OutOfRange
        } else if self.bounds.stuck_ticks > 0 && self.same >= self.bounds.stuck_ticks {
            Verdict::Stuck
        } else if at_end {
            Verdict::Saturated
        } else {
            Verdict::Good
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ENCODER: EncoderBounds = EncoderBounds {
        max_step_counts: 200,
        standing_duty: 600,
        stuck_push: 135_000,
        held_push_squared: 0,
        stale_ticks: 3,
    };
    const GYRO: GyroBounds = GyroBounds { stale_ticks: 3, stuck_ticks: 50, saturated_ticks: 20, max_word: 32_767 };

    #[test]
    fn an_encoder_jumps_when_a_tick_moves_it_too_far() {
        let mut watch = EncoderWatch::new(ENCODER);
        assert_eq!(watch.check(Some(1_000_000), 0), Verdict::Good, "the first reading may be anything");
        assert_eq!(watch.check(Some(1_000_200), 0), Verdict::Good);
        assert_eq!(watch.check(Some(999_999), 0), Verdict::OutOfRange);
        assert_eq!(watch.check(Some(999_998), 0), Verdict::Good, "judged from where it is now");
        assert_eq!(watch.check(Some(i32::MIN), 0), Verdict::OutOfRange);
    }

    /// Ticks at this duty until an encoder that says `count(k)` is stuck; none within a second.
    fn stuck_after(duty: i16, count: impl Fn(i32) -> i32) -> Option<i32> {
        let mut watch = EncoderWatch::new(ENCODER);
        watch.check(Some(count(0)), 0);
        (1..=1000).find(|k| watch.check(Some(count(*k)), duty) == Verdict::Stuck)
    }

    #[test]
    fn a_count_that_stands_is_stuck_the_sooner_the_more_the_motor_is_driven() {
        for count in [|_| 7, |k: i32| 7 + (k & 1), |k: i32| i32::MAX.wrapping_add(k & 1)] {
            assert_eq!(stuck_after(9000, count), Some(17), "0.84 · 17 ms > 13.5 ms");
            assert_eq!(stuck_after(-1500, count), Some(150), "0.09 · 150 ms = 13.5 ms");
            assert_eq!(stuck_after(600, count), None, "friction may hold it");
        }
    }

    /// A belt that holds the motor for a push of 25 ms at full duty.
    #[test]
    fn a_count_that_a_belt_may_hold_is_stuck_later() {
        let held = EncoderBounds { held_push_squared: 250_000 * 250_000 / 10_000, ..ENCODER };
        let stuck_after = |duty| {
            let mut watch = EncoderWatch::new(held);
            watch.check(Some(7), 0);
            (1..=1000).find(|_| watch.check(Some(7), duty) == Verdict::Stuck)
        };
        assert_eq!(stuck_after(9000), Some(29), "25 ms · √0.9 at 0.84");
        assert_eq!(stuck_after(1500), Some(150), "25 ms · √0.15 are less than 13.5 ms");
    }

    #[test]
    fn a_count_that_moves_by_three_within_the_push_is_not_stuck() {
        assert_eq!(stuck_after(9000, |k| 7 - k / 5), None, "three counts in 15 ticks");
        assert_eq!(stuck_after(9000, |k| 7 - k / 6), Some(17), "two in 17");
    }

    #[test]
    fn pushes_to_and_fro_do_not_add_up() {
        let mut watch = EncoderWatch::new(ENCODER);
        for k in 0..1000 {
            // 16 ticks of 0.84 each way: 13.44 ms.
            let duty = if k / 16 % 2 == 0 { 9000 } else { -9000 };
            assert_eq!(watch.check(Some(7), duty), Verdict::Good, "tick {k}");
        }
        for _ in 0..16 {
            watch.check(Some(7), 9000);
        }
        assert_eq!(watch.check(Some(7), 9000), Verdict::Stuck);
        assert_eq!(watch.check(Some(10), 9000), Verdict::Good);
    }

    #[test]
    fn a_gyroscope_that_does_not_answer_is_stale_after_three_ticks_and_recovers() {
        let mut watch = GyroWatch::new(GYRO);
        assert_eq!(watch.check(GyroInput::Words([1, 2, 3])), Verdict::Good);
        let silent: Vec<_> = (0..4).map(|_| watch.check(GyroInput::NotReady)).collect();
        assert_eq!(silent, [Verdict::Missing, Verdict::Missing, Verdict::Stale, Verdict::Stale]);
        assert_eq!(
            watch.check(GyroInput::Words([1, 2, INVALID_WORD])),
            Verdict::Stale,
            "an invalid word is no reading"
        );
        assert_eq!(watch.check(GyroInput::BusError), Verdict::BusHang);
        assert_eq!(watch.check(GyroInput::Words([1, 2, 4])), Verdict::Good);
    }

    #[test]
    fn an_encoder_that_does_not_answer_is_stale_and_may_then_have_moved_further() {
        let mut watch = EncoderWatch::new(ENCODER);
        watch.check(Some(0), 0);
        let silent: Vec<_> = (0..3).map(|_| watch.check(None, 0)).collect();
        assert_eq!(silent, [Verdict::Missing, Verdict::Missing, Verdict::Stale]);
        assert_eq!(watch.check(Some(800), 0), Verdict::Good, "four ticks of 200");
        assert_eq!(watch.check(Some(1001), 0), Verdict::OutOfRange, "one tick of 201");
    }

    #[test]
    fn a_drivers_reading_becomes_an_input() {
        let reading = |fresh| Ok::<_, ()>(GyroReading { raw: [1, 2, 3], fresh });
        assert_eq!(GyroInput::from(reading(true)), GyroInput::Words([1, 2, 3]));
        assert_eq!(GyroInput::from(reading(false)), GyroInput::NotReady);
        assert_eq!(GyroInput::from(Err::<GyroReading, _>("bus")), GyroInput::BusError);
    }

    #[test]
    fn a_gyroscope_without_noise_is_stuck() {
        let mut watch = GyroWatch::new(GYRO);
        for _ in 0..50 {
            assert_eq!(watch.check(GyroInput::Words([5, -6, 7])), Verdict::Good);
        }
        assert_eq!(watch.check(GyroInput::Words([5, -6, 7])), Verdict::Stuck);
        assert_eq!(watch.check(GyroInput::Words([5, -6, 8])), Verdict::Good);
    }

    #[test]
    fn saturation_is_told_at_once_and_stops_when_it_lasts() {
        let mut watch = GyroWatch::new(GYRO);
        for k in 0..19 {
            assert_eq!(watch.check(GyroInput::Words([k, -32_767, 7])), Verdict::Saturated);
        }
        assert_eq!(watch.check(GyroInput::Words([19, 32_767, 7])), Verdict::OutOfRange);
        assert_eq!(watch.check(GyroInput::Words([20, 32_766, 7])), Verdict::Good);
    }
}
