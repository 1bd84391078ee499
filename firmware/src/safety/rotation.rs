//! Do a gyro and the encoders before it tell of the same rotation?
//!
//! A gyro sits on a body that the joints 1 to n carry. From their positions and steps follows the body's rotation, and
//! the gyro measures it. The difference is summed as a vector in axes that turn with the gyro, and forgotten slowly:
//!
//! ```text
//!   encoders ─▶ ω of the body ─▶ mount ─┐ −
//!                                       ├───▶ Σ over 4 s ─▶ length > bound + give + part of the way: a mismatch
//!   gyro − its words at rest ───────────┤ +
//!                                       ╰───▶ Σ |ω| over 4 s: the way there and back
//! ```
//!
//! The sum is an angle, and so is what belts give way by, however fast they swing: the duty of the last seconds says how
//! much that may be. A delay of milliseconds is the way made meanwhile. What grows with the way is a scale or a mount that is
//! not exact, and swings of several belts about different axes, whose small rotations do not commute. The last part of the
//! bound is for these: a part of the way that is larger where more duty stretches the belts.
//!
//! The ticks only add words and steps up; one gyro is judged a tick, in turn. Angles of a judgement are in 2⁻³² turns,
//! directions and sines in 2⁻³⁰.

pub use protocol::description::Axis;
use protocol::{Duty, MAX_JOINTS};

use crate::config::GyroSetup;
use crate::constants;
use crate::motion::sine::{self, scaled};

/// A quarter turn.
const QUARTER: u32 = 1 << 30;
/// The sums forget with a time constant of 2¹² ticks, 4 s: longer than a move of the slow stage, which takes 2 s, and
/// short against the drift of a gyro's zero, 0.5°/s after 10 s of warming up, which then adds up to 0.03 rad. With half
/// of it a gear that is wrong by a half is found 0.1 rad later in the slow stage; with twice the drift counts twice.
const FORGET_SHIFT: u32 = 12;
/// The duty that stretched belts is forgotten with 2¹⁰ ticks, 1 s: so long they swing. Doggy's swings die out in 0.6 s.
const DRIVEN_FORGET_SHIFT: u32 = 10;
/// The zero of a gyro forgets with 2⁸ ticks, 0.26 s: a sixteenth of its noise, and settled when a hand lets go.
const REST_SHIFT: u32 = 8;
/// Words are summed in 2⁻¹² words: a tick adds less than 2²⁸, and the zero is right to a sixteenth of a word.
const WORD_SHIFT: u32 = 12;
/// The angle of a word is kept in 2⁻⁴³ turns: Doggy's to six digits, and one of 1 rad/s still fits.
const ANGLE_OF_WORD_SHIFT: u32 = 43;
/// The sums are angles in 2⁻²⁸ turns: ±8 turns fit, and what is too small to be forgotten is 10⁻⁴ rad.
const SUM_SHIFT: u32 = 28;
/// Duties are remembered in 2⁻¹⁶ steps: ±10⁴ fit 32 bits.
const DRIVEN_SHIFT: u32 = 16;
/// Lengths are compared in 2⁻¹⁶ turns, 10⁻⁴ rad.
const LENGTH_SHIFT: u32 = 16;

/// The part of the way without a duty, 2⁻¹⁶.
const OF_WAY_Q16: u32 = (constants::ROTATION_DIFFERS_OF_WAY << 16) / Duty::FULL.unsigned_abs() as u32;
/// What each step of the duty adds to it, 2⁻³²; times the largest duty it fits 32 bits.
const OF_WAY_PER_STEP_Q32: u32 = {
    let full = Duty::FULL.unsigned_abs() as u64;
    (((constants::ROTATION_DIFFERS_AT_FULL_DUTY as u64) << 32) / (full * full)) as u32
};

/// Largest step of a joint between two judgements that is reckoned with, 0.2 rad: three times the highest believable
/// speed over two ticks, and small enough that the steps of all joints add up to less than 2³⁰.
const MAX_STEP: i32 = 1 << 27;
const _: () = assert!(MAX_JOINTS < 8);

type Vector = [i32; 3];

/// A joint as the watch needs it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Turn {
    /// The axis, zero if the joint slides.
    axis: Vector,
    /// Angle of a count, 2⁻⁴⁸ turns.
    angle_of_count: i64,
}

impl Turn {
    /// A joint with so many counts a radian (or metre).
    pub fn new(axis: Axis, counts_per_unit: f32) -> Self {
        let Axis::Turns(axis) = axis else { return Turn::default() };
        let turns_of_count = 1.0 / (core::f64::consts::TAU * f64::from(counts_per_unit));
        Turn { axis: direction(axis), angle_of_count: (turns_of_count * (1u64 << 48) as f64) as i64 }
    }

    /// Angle of so many counts, 2⁻³² turns; whole turns fall away.
    fn angle(&self, counts: i32) -> i32 {
        (i64::from(counts).wrapping_mul(self.angle_of_count) >> 16) as i32
    }

    /// A vector of the body before the joint in axes of the body behind it, which are turned by `angle`.
    fn carried(&self, vector: Vector, angle: i32) -> Vector {
        if vector == [0; 3] {
            return vector;
        }
        // Rodrigues, backwards: v cos + (v × a) sin + a (a · v) (1 − cos).
        let (sin, cos) = (sine::sine(angle as u32), sine::sine((angle as u32).wrapping_add(QUARTER)));
        let [a, b, c] = self.axis;
        let [x, y, z] = vector;
        let across = [
            scaled(y, c).wrapping_sub(scaled(z, b)),
            scaled(z, a).wrapping_sub(scaled(x, c)),
            scaled(x, b).wrapping_sub(scaled(y, a)),
        ];
        let dot = dot(self.axis, vector);
        let along = dot.wrapping_sub(scaled(dot, cos));
        core::array::from_fn(|i| {
            scaled(vector[i], cos).wrapping_add(scaled(across[i], sin)).wrapping_add(scaled(self.axis[i], along))
        })
    }
}

/// Watches a gyro against the encoders of the joints that carry it. It takes words and steps in every tick, and is judged
/// every few ticks, by the position in the middle of the steps since then.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RotationWatch {
    /// Joints that carry the gyro.
    joints: usize,
    /// Angle of a word in a tick, 2⁻⁴³ turns.
    angle_of_word: i32,
    /// Largest difference without a duty and without a way, 2⁻¹⁶ turns.
    bound: u32,
    /// What each step of the duty adds to it, 2⁻³² turns.
    give_per_step: u32,
    /// Largest duty lately, 2⁻¹⁶ steps.
    driven: u32,
    /// Axes of the base, all joints at zero, to axes of the gyro.
    mount: [Vector; 3],
    /// Mean words while the joints rest, 2⁻¹² words.
    mean: [i32; 3],
    /// Largest distance of a word from them, forgotten with 2⁸ ticks; 2⁻¹² words.
    unrest: i32,
    /// Words of the gyro when its body last rested, 2⁻¹² words.
    zero: [i32; 3],
    has_zero: bool,
    /// How far from its zero a gyro may be in a pause, 2⁻¹² words.
    drift: i32,
    /// Ticks with words since the last judgement.
    ticks: i32,
    /// Words beyond the zero in these ticks, 2⁻¹² words.
    moved: [i32; 3],
    /// Steps of the joints in these ticks, counts.
    steps: [i32; MAX_JOINTS],
    /// What the gyro has turned by more than the encoders, 2⁻²⁸ turns.
    difference: [i32; 3],
    /// The part of the gyro's way, there and back, by which it may differ, 2⁻²⁸ turns.
    part_of_way: i32,
}

impl RotationWatch {
    /// For this gyro.
    pub fn new(gyro: &GyroSetup) -> Self {
        let turns_of_word = gyro.info.rad_s_per_lsb * f64::from(constants::TICK_US) * 1e-6 / core::f64::consts::TAU;
        let word = f64::from(1u32 << WORD_SHIFT);
        RotationWatch {
            joints: (usize::from(gyro.info.body) + 1).min(MAX_JOINTS),
            angle_of_word: (turns_of_word * (1u64 << ANGLE_OF_WORD_SHIFT) as f64) as i32,
            bound: ((constants::ROTATION_DIFFERS_RAD + gyro.sag_rad) / core::f32::consts::TAU
                * (1u32 << LENGTH_SHIFT) as f32) as u32,
            // The cast ends at the largest number.
            give_per_step: (constants::SWING_OF_GIVE * gyro.give_rad / (core::f32::consts::TAU * f32::from(Duty::FULL))
                * (1u64 << 32) as f32) as u32,
            driven: 0,
            mount: gyro.mount.map(direction),
            mean: [0; 3],
            unrest: 0,
            zero: [0; 3],
            has_zero: false,
            drift: (constants::ZERO_DRIFT_RAD_S / gyro.info.rad_s_per_lsb * word) as i32,
            ticks: 0,
            moved: [0; 3],
            steps: [0; MAX_JOINTS],
            difference: [0; 3],
            part_of_way: 0,
        }
    }

    /// A tick at rest: the sums begin anew, and the mean of the words is the gyro's zero, unless the body swings.
    pub fn at_rest(&mut self, words: Option<[i16; 3]>) {
        self.begin_anew();
        let Some(words) = words else { return };
        if !self.has_zero {
            self.mean = words.map(fine);
        }
        follow(&mut self.mean, words);
        self.unrest -= self.unrest >> REST_SHIFT;
        for (word, mean) in words.into_iter().zip(self.mean) {
            self.unrest = self.unrest.max((fine(word) - mean).abs());
        }
        if self.is_quiet() {
            (self.zero, self.has_zero) = (self.mean, true);
        }
    }

    /// Whether the body rests as well as the joints: a link that swings on its belts moves no encoder, and its words are
    /// no zero. Known while the joints are at rest.
    pub fn is_quiet(&self) -> bool {
        self.unrest <= self.drift
    }

    /// A tick of a pause in a motion, in which no joint moves and none is driven: the gyro's zero drifts, and is followed
    /// while it is not far from where it was.
    pub fn pauses(&mut self, words: Option<[i16; 3]>) {
        let Some(words) = words else { return };
        let near = |(word, zero): (i16, i32)| (fine(word) - zero).abs() <= self.drift;
        if self.has_zero && words.into_iter().zip(self.zero).all(near) {
            follow(&mut self.zero, words);
            self.mean = self.zero;
        }
    }

    /// A tick without a motion. The sums begin anew: nobody drives the joints, and hands may move them. Belts may still
    /// swing from the last motion.
    pub fn begin_anew(&mut self) {
        self.take_since_judged();
        (self.difference, self.part_of_way) = ([0; 3], 0);
        self.forget_driven(1);
    }

    fn forget_driven(&mut self, ticks: i32) {
        let forgotten = (self.driven >> DRIVEN_FORGET_SHIFT).saturating_mul(ticks.unsigned_abs());
        self.driven = self.driven.saturating_sub(forgotten);
    }

    /// A tick in motion: words of the gyro that can be believed, and steps of the joints since the last tick, counts. A
    /// tick without words is left out.
    pub fn moves(&mut self, words: Option<[i16; 3]>, steps: &[i32]) {
        let (Some(words), true) = (words, self.has_zero) else { return };
        self.ticks += 1;
        for ((moved, word), zero) in self.moved.iter_mut().zip(words).zip(self.zero) {
            *moved = moved.saturating_add(fine(word) - zero);
        }
        for (sum, step) in self.steps.iter_mut().zip(steps).take(self.joints) {
            *sum = sum.saturating_add(*step);
        }
    }

    /// Judges the ticks since the last judgement, with the present positions of the joints (counts) and the largest duty
    /// on one of them. Whether gyro and joints tell of different rotations.
    pub fn differs(&mut self, turns: &[Turn], positions: &[i32], duty: Duty) -> bool {
        let (ticks, moved, steps) = self.take_since_judged();
        if ticks > 0 {
            let mut turned = [0; 3];
            for ((turn, position), step) in turns.iter().zip(positions).zip(steps).take(self.joints) {
                turned = turn.carried(turned, turn.angle(position.wrapping_sub(step >> 1)));
                let step = turn.angle(step).clamp(-MAX_STEP, MAX_STEP);
                turned = core::array::from_fn(|i| turned[i].wrapping_add(scaled(turn.axis[i], step)));
            }
            let mut way = 0;
            for i in 0..3 {
                let moved = self.angle(moved[i]);
                way += moved.unsigned_abs();
                add(
                    &mut self.difference[i],
                    moved.saturating_sub(dot(self.mount[i], turned)) >> (32 - SUM_SHIFT),
                    ticks,
                );
            }
            let steps = u32::from(duty.0.unsigned_abs());
            self.forget_driven(ticks);
            self.driven = self.driven.max(steps << DRIVEN_SHIFT);
            let share_q16 = OF_WAY_Q16 + ((OF_WAY_PER_STEP_Q32 * steps) >> 16);
            let part = (u64::from(way) * u64::from(share_q16)) >> (16 + 32 - SUM_SHIFT);
            add(&mut self.part_of_way, part as i32, ticks);
        }
        let allowed = u64::from(self.allowed());
        squared(self.difference) > allowed * allowed
    }

    /// The present difference, as a part of what is allowed.
    pub fn nearness(&self) -> f32 {
        squared(self.difference).isqrt() as f32 / self.allowed().max(1) as f32
    }

    /// Ticks, words and steps since the last judgement, which begin anew.
    fn take_since_judged(&mut self) -> (i32, [i32; 3], [i32; MAX_JOINTS]) {
        use core::mem::take;
        (take(&mut self.ticks), take(&mut self.moved), take(&mut self.steps))
    }

    /// Of a sum of words, 2⁻³² turns; at most an eighth of a turn, 390 rad/s over two ticks.
    fn angle(&self, words: i32) -> i32 {
        let angle = (i64::from(words) * i64::from(self.angle_of_word)) >> (ANGLE_OF_WORD_SHIFT + WORD_SHIFT - 32);
        angle.clamp(-(1 << 29), 1 << 29) as i32
    }

    /// In 2⁻¹⁶ turns.
    fn allowed(&self) -> u32 {
        let give = u64::from(self.give_per_step) * u64::from(self.driven >> DRIVEN_SHIFT);
        let give = (give >> (32 - LENGTH_SHIFT)) as u32;
        self.bound.saturating_add(give).saturating_add(self.part_of_way.unsigned_abs() >> (SUM_SHIFT - LENGTH_SHIFT))
    }
}

/// A word in 2⁻¹² words.
fn fine(word: i16) -> i32 {
    i32::from(word) << WORD_SHIFT
}

/// A mean that forgets, in 2⁻¹² words.
fn follow(mean: &mut [i32; 3], words: [i16; 3]) {
    for (mean, word) in mean.iter_mut().zip(words) {
        *mean += (fine(word) - *mean) >> REST_SHIFT;
    }
}

/// To a sum that forgets, what came in so many ticks.
fn add(sum: &mut i32, more: i32, ticks: i32) {
    *sum = sum.saturating_add(more - (*sum >> FORGET_SHIFT) * ticks);
}

/// Of a unit vector.
fn direction(vector: [f32; 3]) -> Vector {
    vector.map(|part| (f64::from(part) * f64::from(sine::ONE)) as i32)
}

fn dot([a, b, c]: Vector, [x, y, z]: Vector) -> i32 {
    scaled(a, x).wrapping_add(scaled(b, y)).wrapping_add(scaled(c, z))
}

/// The squared length of a sum, 2⁻³² turns².
fn squared(sum: [i32; 3]) -> u64 {
    let square = |part: i32| {
        let part = u64::from((part >> (SUM_SHIFT - LENGTH_SHIFT)).unsigned_abs());
        part * part
    };
    square(sum[0]) + square(sum[1]) + square(sum[2])
}

#[cfg(test)]
mod tests {
    use super::*;
    use protocol::GyroInfo;

    const COUNTS_PER_RAD: f32 = 6859.93;
    /// ±1000°/s.
    const RAD_S_PER_LSB: f64 = 5.326_322e-4;
    const AXES: [[f32; 3]; 3] = [[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]];
    /// Words of the gyro at rest.
    const ZERO: [i16; 3] = [85, -3, 20];

    /// Mounted with another axis up: z, −x, −y.
    fn gyro(body: u8) -> GyroSetup {
        let info = GyroInfo {
            body,
            rad_s_per_lsb: RAD_S_PER_LSB,
            saturated_at: 32_700,
            offset_us: 0,
            filter_delay_us: None,
            output_rate_hz: None,
        };
        GyroSetup { info, mount: [[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]], give_rad: 0.0, sag_rad: 0.0 }
    }

    fn turns() -> [Turn; 3] {
        AXES.map(|axis| Turn::new(Axis::Turns(axis), COUNTS_PER_RAD))
    }

    /// Rates of the third body in its own axes, rad/s, in floating point and by another way: Rz(q₁) Ry(q₂) Rx(−q₃).
    fn rates(q: [f64; 3], qd: [f64; 3]) -> [f64; 3] {
        let (s2, c2, s3, c3) = (q[1].sin(), q[1].cos(), q[2].sin(), q[2].cos());
        // In axes of the second body, then turned by −q₃ about x.
        let [x, y, z] = [-s2 * qd[0] - qd[2], qd[1], c2 * qd[0]];
        [x, c3 * y - s3 * z, s3 * y + c3 * z]
    }

    /// A tick without a duty, judged at once.
    fn tick(
        watch: &mut RotationWatch,
        words: Option<[i16; 3]>,
        turns: &[Turn],
        positions: &[i32],
        steps: &[i32],
    ) -> bool {
        watch.moves(words, steps);
        watch.differs(turns, positions, Duty(0))
    }

    /// Ticks until gyro and encoders of joints that sway differ, of at most a minute; words and counts are scaled, and
    /// every so many ticks are judged.
    fn sway(scale: f64, counts_scale: f64, every: u32) -> Option<u32> {
        let q = |t: f64| [0.8 * (1.1 * t).sin(), 0.5 * (1.7 * t).sin(), 0.4 * (2.3 * t).sin()];
        let qd = |t: f64| [0.88 * (1.1 * t).cos(), 0.85 * (1.7 * t).cos(), 0.92 * (2.3 * t).cos()];
        let counts = |t: f64| q(t).map(|q| (q * f64::from(COUNTS_PER_RAD) * counts_scale) as i32);
        let mut watch = RotationWatch::new(&gyro(2));
        (0..300).for_each(|_| watch.at_rest(Some(ZERO)));
        (1..60_000).find(|k| {
            let t = f64::from(*k) * 1e-3;
            let rates = rates(q(t), qd(t));
            let seen = [rates[2], -rates[0], -rates[1]];
            let words = core::array::from_fn(|i| (seen[i] * scale / RAD_S_PER_LSB) as i16 + ZERO[i]);
            let (now, before) = (counts(t), counts(t - 1e-3));
            let steps: [i32; 3] = core::array::from_fn(|i| now[i] - before[i]);
            watch.moves(Some(words), &steps);
            k % every == 0 && watch.differs(&turns(), &now, Duty(9000))
        })
    }

    #[test]
    fn a_gyro_and_encoders_that_tell_the_same_do_not_differ() {
        assert_eq!([1, 2, 8].map(|every| sway(1.0, 1.0, every)), [None; 3]);
    }

    #[test]
    fn encoders_that_count_half_or_twice_differ_within_a_move() {
        for counts_scale in [0.5, 2.0] {
            let found = sway(1.0, counts_scale, 1).unwrap();
            assert!(found < 600, "{counts_scale}: after {found} ms, the body turns by 1.5 rad/s");
            let later = sway(1.0, counts_scale, 2).unwrap();
            assert!((found - 1..=found + 2).contains(&later), "after {later} ms in place of {found} ms");
        }
    }

    #[test]
    fn a_gyro_may_be_wrong_by_a_tenth_and_not_by_a_half() {
        assert_eq!((sway(1.1, 1.0, 2), sway(0.9, 1.0, 2)), (None, None));
        assert!(sway(1.5, 1.0, 2).is_some() && sway(0.5, 1.0, 2).is_some());
    }

    #[test]
    fn ticks_without_words_are_left_out_of_both_sums() {
        let mut watch = RotationWatch::new(&gyro(0));
        assert!(!tick(&mut watch, Some([30_000; 3]), &turns(), &[0], &[0]), "its zero is not known yet");
        watch.at_rest(Some(ZERO));
        for k in 0..1000 {
            assert!(!tick(&mut watch, None, &turns(), &[20 * k], &[20]));
        }
        let found = (0..1000).find(|k| tick(&mut watch, Some(ZERO), &turns(), &[20 * k], &[20]));
        // 0.04 rad at 2.9 mrad a tick.
        assert!((13..16).contains(&found.unwrap()), "{found:?}");
        watch.at_rest(None);
        assert!(!tick(&mut watch, Some(ZERO), &turns(), &[0], &[0]), "begun anew");
    }

    #[test]
    fn a_zero_that_drifts_is_followed_in_pauses_and_a_rotation_is_not() {
        let mut watch = RotationWatch::new(&gyro(0));
        watch.at_rest(Some([0; 3]));
        // 0.04 rad/s are 75 words.
        for _ in 0..2000 {
            watch.pauses(Some([75, 0, -75]));
        }
        assert!(!(0..20_000).any(|_| tick(&mut watch, Some([75, 0, -75]), &turns(), &[0], &[0])));
        for _ in 0..2000 {
            watch.pauses(Some([75 + 188, 0, -75]));
        }
        let found = (0..20_000).find(|_| tick(&mut watch, Some([75 + 188, 0, -75]), &turns(), &[0], &[0]));
        assert!(found.unwrap() < 600, "0.04 rad at 0.1 rad/s: {found:?}");
    }

    #[test]
    fn a_body_that_swings_on_its_belts_is_not_quiet() {
        let mut watch = RotationWatch::new(&gyro(0));
        // 3 Hz; a swing of 0.04 rad/s is as small as a drift.
        let quiet = |watch: &mut RotationWatch, rad_s: f64, ticks: u32| {
            let word = |k: u32| (rad_s / RAD_S_PER_LSB * (0.0188 * f64::from(k)).sin()) as i16 + ZERO[0];
            (0..ticks)
                .filter(|k| {
                    watch.at_rest(Some([word(*k), ZERO[1], ZERO[2]]));
                    !watch.is_quiet()
                })
                .count()
        };
        assert_eq!(quiet(&mut watch, 0.04, 3000), 0);
        assert!(quiet(&mut watch, 0.2, 3000) > 2900);
        assert!((200..400).contains(&quiet(&mut watch, 0.0, 3000)), "forgotten with 0.26 s");
        assert!(watch.is_quiet());
    }

    /// A link that swings with 0.5 rad/s at 3 Hz, on belts that gave way by 0.05 rad under full duty before.
    #[test]
    fn a_body_that_still_swings_when_a_motion_begins_has_the_zero_from_before() {
        let mut watch = RotationWatch::new(&GyroSetup { give_rad: 0.05, ..gyro(0) });
        let swing = |k: u32| {
            let word = (0.5 / RAD_S_PER_LSB * (0.0188 * f64::from(k)).sin()) as i16 + ZERO[0];
            Some([word, ZERO[1], ZERO[2]])
        };
        (0..300).for_each(|_| watch.at_rest(Some(ZERO)));
        watch.moves(Some(ZERO), &[0]);
        assert!(!watch.differs(&turns(), &[0], Duty(9000)));
        (0..90).for_each(|k| watch.at_rest(swing(k)));
        assert!(!watch.is_quiet());
        assert!(!(90..10_000).any(|k| tick(&mut watch, swing(k), &turns(), &[0], &[0])));
    }

    #[test]
    fn belts_give_way_as_much_as_the_duty_lately_lets_them() {
        // 0.04 rad and 2 · 0.1 rad · 0.9, less what is forgotten on the way, at 2.9 mrad a tick; a second later 0.066 rad of
        // that are left.
        for (ticks_between, found) in [(0, 68..76), (1024, 33..40)] {
            let mut watch = RotationWatch::new(&GyroSetup { give_rad: 0.1, ..gyro(0) });
            watch.at_rest(Some(ZERO));
            watch.moves(Some(ZERO), &[0]);
            watch.differs(&turns(), &[0], Duty(-9000));
            (0..ticks_between).for_each(|_| watch.begin_anew());
            let after = (0..1000).find(|k| tick(&mut watch, Some(ZERO), &turns(), &[20 * k], &[20]));
            assert!(found.contains(&after.unwrap()), "{after:?}");
        }
    }

    #[test]
    fn a_joint_that_slides_turns_nothing() {
        let turns = [Turn::new(Axis::Slides, COUNTS_PER_RAD), Turn::new(Axis::Turns(AXES[1]), COUNTS_PER_RAD)];
        let mut watch = RotationWatch::new(&gyro(1));
        watch.at_rest(Some(ZERO));
        for k in 0..1000 {
            assert!(!tick(&mut watch, Some(ZERO), &turns, &[100 * k, 0], &[100, 0]));
        }
    }

    #[test]
    fn hostile_inputs_are_survived() {
        let turns = [1e-30, 1e30].map(|counts| Turn::new(Axis::Turns([0.6, 0.0, -0.8]), counts));
        let mut watch = RotationWatch::new(&GyroSetup {
            info: GyroInfo { body: 255, rad_s_per_lsb: 0.999, ..gyro(0).info },
            ..gyro(0)
        });
        for words in [[i16::MIN; 3], [i16::MAX; 3], [0; 3]] {
            watch.at_rest(Some(words));
            for k in 0..20_000 {
                watch.moves(Some([i16::MAX, i16::MIN, k as i16]), &[i32::MAX, i32::MIN]);
                if k % 3 == 0 {
                    watch.differs(&turns, &[i32::MIN, i32::MAX], Duty(i16::MIN));
                }
            }
        }
    }
}
