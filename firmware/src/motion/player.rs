//! The motion player: plays uploaded segments, one duty per joint and tick.
//!
//! ```text
//!   segment (rad, Hz, duty) ── at its first tick ──▶ plan (counts, 2⁻³² turns, duty steps) ── every tick ──▶ duty
//! ```
//!
//! In the tick everything is integer: positions in counts from zero, duties in steps of 10⁻⁴, gains in steps per
//! count times 2¹⁶, angles in 2⁻³² turns. The few conversions from `f32` at a segment's first tick are single
//! roundings of IEEE arithmetic. So the same inputs give the same duties on every machine, bit for bit.

use protocol::motion::{Action, Motion};
use protocol::{Duty, JointSet, MAX_JOINTS};

use super::sine::wave;
use crate::constants::SETTLE_US;

/// Positions of the joints, counts from zero; unused places are zero.
pub type Positions = [i32; MAX_JOINTS];

/// What the player wants in a tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step {
    /// A segment is played.
    Playing {
        /// Its index.
        phase: u8,
        /// The duty that it asks for.
        duty: [Duty; MAX_JOINTS],
        /// This was the segment's last tick, and its move has not arrived.
        timed_out: bool,
    },
    /// The last segment is done.
    Finished,
}

/// A quarter turn, 2⁻³² turns.
const QUARTER: u32 = 1 << 30;
/// One in the fixed point of the gains.
const GAIN_ONE: f32 = 65_536.0;

/// Plays one motion.
#[derive(Clone, Debug)]
pub struct Player {
    tick_us: u32,
    counts_per_unit: [f32; MAX_JOINTS],
    gain: [i32; MAX_JOINTS],
    targets: Positions,
    segment: usize,
    tick: u32,
    settled: u32,
    plan: Plan,
}

/// The present segment in raw codes.
#[derive(Clone, Copy, Debug)]
struct Plan {
    ticks: u32,
    ceiling: Duty,
    kind: Kind,
}

#[derive(Clone, Copy, Debug)]
enum Kind {
    Zero,
    Hold,
    MoveTo { joints: JointSet, tolerance: Positions },
    Chirp { joints: JointSet, start: Positions, centring: [i32; MAX_JOINTS], sweep: [Sweep; MAX_JOINTS] },
    Sine { joints: JointSet, amplitude: Positions, sweep: [Sweep; MAX_JOINTS] },
}

/// An angle that advances by a step which itself grows linearly, 2⁻³² turns.
#[derive(Clone, Copy, Debug, Default)]
struct Sweep {
    from: u32,
    to: u32,
    angle: u32,
}

impl Sweep {
    /// From one frequency to another, Hz.
    fn new(from_hz: f32, to_hz: f32, tick_us: u32) -> Self {
        // A frequency of at most 100 Hz is below 2³² steps of a tick; the casts saturate in any case.
        let steps = |hz: f32| (hz * (4_294.967_3 * tick_us as f32)) as u32;
        Sweep { from: steps(from_hz), to: steps(to_hz), angle: 0 }
    }

    /// The angle of tick `tick` of `ticks`; then advances.
    fn advance(&mut self, tick: u32, ticks: u32) -> u32 {
        let angle = self.angle;
        let span = i64::from(self.to) - i64::from(self.from);
        let step = i64::from(self.from) + span * i64::from(tick) / i64::from(ticks.max(1));
        self.angle = angle.wrapping_add(step as u32);
        angle
    }
}

impl Player {
    /// At the first segment of a valid motion, with the joints at `positions`.
    pub fn new(motion: &Motion, counts_per_unit: [f32; MAX_JOINTS], positions: &Positions, tick_us: u32) -> Self {
        let mut gain = [0; MAX_JOINTS];
        for ((gain, asked), scale) in gain.iter_mut().zip(&motion.gain).zip(counts_per_unit) {
            *gain = fixed_gain(*asked, scale);
        }
        Player {
            tick_us,
            counts_per_unit,
            gain,
            targets: *positions,
            segment: 0,
            tick: 0,
            settled: 0,
            plan: Plan { ticks: 0, ceiling: Duty::ZERO, kind: Kind::Zero },
        }
    }

    /// One tick. Bounded: a pass over the joints.
    pub fn step(&mut self, motion: &Motion, positions: &Positions) -> Step {
        let Some(segment) = motion.segments.get(self.segment) else {
            return Step::Finished;
        };
        if self.tick == 0 {
            self.enter(&segment.action, positions);
        }
        let phase = self.phase();
        let duty = self.duty(positions);
        let arrived = self.arrived(positions);
        self.tick += 1;
        let over = self.tick >= self.plan.ticks;
        if over || arrived {
            self.leave(positions);
        }
        let timed_out = over && !arrived && matches!(self.plan.kind, Kind::MoveTo { .. });
        Step::Playing { phase, duty, timed_out }
    }

    /// Index of the segment being played.
    pub fn phase(&self) -> u8 {
        self.segment as u8 // A motion has fewer than 256 segments.
    }

    /// Turns a segment into raw codes.
    fn enter(&mut self, action: &Action, positions: &Positions) {
        self.settled = 0;
        let ticks = (u64::from(action.longest_ms()) * 1000 / u64::from(self.tick_us.max(1))).max(1);
        let (ceiling, kind) = match action {
            Action::Zero { .. } => (Duty::ZERO, Kind::Zero),
            Action::Hold { ceiling, .. } => (*ceiling, Kind::Hold),
            Action::MoveTo { joints, targets, ceiling, tolerance, .. } => {
                for (joint, target) in joints.iter().zip(targets) {
                    self.targets[joint] = round(target * self.counts_per_unit[joint]);
                }
                (*ceiling, Kind::MoveTo { joints: *joints, tolerance: self.in_counts(*tolerance) })
            }
            Action::Chirp { joints, amplitude, from_hz, to_hz, spread, centring, .. } => {
                let sweep = self.sweeps(*joints, *from_hz, *to_hz, *spread);
                let centring = self.counts_per_unit.map(|scale| fixed_gain(*centring, scale));
                (*amplitude, Kind::Chirp { joints: *joints, start: *positions, centring, sweep })
            }
            Action::Sine { joints, amplitude, frequency_hz, spread, ceiling, .. } => {
                let sweep = self.sweeps(*joints, *frequency_hz, *frequency_hz, *spread);
                (*ceiling, Kind::Sine { joints: *joints, amplitude: self.in_counts(*amplitude), sweep })
            }
        };
        self.plan = Plan { ticks: u32::try_from(ticks).unwrap_or(u32::MAX), ceiling, kind };
    }

    /// The next segment is due.
    fn leave(&mut self, positions: &Positions) {
        match self.plan.kind {
            Kind::Zero => self.targets = *positions,
            Kind::Chirp { joints, .. } => {
                for joint in joints.iter() {
                    self.targets[joint] = positions[joint];
                }
            }
            _ => {}
        }
        self.segment += 1;
        self.tick = 0;
    }

    fn duty(&mut self, positions: &Positions) -> [Duty; MAX_JOINTS] {
        let mut duty = [Duty::ZERO; MAX_JOINTS];
        let Plan { ticks, ceiling, kind } = &mut self.plan;
        if matches!(kind, Kind::Zero) {
            return duty;
        }
        let bound = i64::from(ceiling.0.unsigned_abs().min(Duty::FULL as u16));
        for (joint, duty) in duty.iter_mut().enumerate() {
            let position = positions[joint];
            let steps = match kind {
                Kind::Chirp { joints, start, centring, sweep } if joints.contains(joint) => {
                    let angle = sweep[joint].advance(self.tick, *ticks).wrapping_add(QUARTER);
                    let swing = wave(i32::from(ceiling.0), angle);
                    i64::from(swing) + proportional(centring[joint], start[joint], position)
                }
                Kind::Sine { joints, amplitude, sweep } if joints.contains(joint) => {
                    let swing = wave(amplitude[joint], sweep[joint].advance(self.tick, *ticks));
                    proportional(self.gain[joint], self.targets[joint].saturating_add(swing), position)
                }
                _ => proportional(self.gain[joint], self.targets[joint], position),
            };
            // The bound is at most a full duty.
            *duty = Duty(steps.clamp(-bound, bound) as i16);
        }
        duty
    }

    fn arrived(&mut self, positions: &Positions) -> bool {
        let Kind::MoveTo { joints, tolerance } = &self.plan.kind else {
            return false;
        };
        let near = |joint: usize| self.targets[joint].abs_diff(positions[joint]) <= tolerance[joint].unsigned_abs();
        self.settled = if joints.iter().all(near) { self.settled + 1 } else { 0 };
        self.settled > SETTLE_US / self.tick_us.max(1)
    }

    fn in_counts(&self, units: f32) -> Positions {
        self.counts_per_unit.map(|scale| round(units * scale))
    }

    fn sweeps(&self, joints: JointSet, from_hz: f32, to_hz: f32, spread: f32) -> [Sweep; MAX_JOINTS] {
        let mut sweeps = [Sweep::default(); MAX_JOINTS];
        for (rank, joint) in joints.iter().enumerate() {
            let factor = 1.0 + rank as f32 * spread;
            sweeps[joint] = Sweep::new(from_hz * factor, to_hz * factor, self.tick_us);
        }
        sweeps
    }
}

/// Gain (full duties per rad or m) as duty steps per count times 2¹⁶.
fn fixed_gain(gain: f32, counts_per_unit: f32) -> i32 {
    round(gain * f32::from(Duty::FULL) / counts_per_unit * GAIN_ONE)
}

/// gain · (target − position), in duty steps, rounded.
fn proportional(gain: i32, target: i32, position: i32) -> i64 {
    (i64::from(gain) * i64::from(target.saturating_sub(position)) + (1 << 15)) >> 16
}

/// To the nearest integer; saturates, and not-a-number is zero.
fn round(x: f32) -> i32 {
    (x + if x < 0.0 { -0.5 } else { 0.5 }) as i32
}

#[cfg(test)]
#[path = "player_tests.rs"]
mod tests;
