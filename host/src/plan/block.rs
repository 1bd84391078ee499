//! The blocks that motions are made of. Each begins and ends with all joints at rest in the middle of their ranges, so that blocks
//! can follow one another in any order and what they tell adds up.
//!
//! ```text
//!   steps   move to targets, one after the other, with or without pauses     ╮
//!   chirp   duty of rising frequency                                          ├─▶ home: back to the middle, belts come to rest
//!   sine    positions about the middle                                        ╯
//! ```
//!
//! Positions are parts of the half range of each joint about its middle, as in the preset motions.

use firmware::constants::MAX_DUTY;
use protocol::motion::{Header, Limits, MAX_SEGMENTS};
use protocol::units::text;
use protocol::{Action, Duty, JointSet, MAX_JOINTS, Motion, Segment};
use rand::{Rng, RngExt};
use rand_distr::{Distribution, StandardNormal};
use serde::{Deserialize, Serialize};

/// As in the preset motions: gain of the position controller times the half range.
const GAIN_TIMES_HALF_RANGE: f32 = 1.8;
/// As there: how near a move must come, part of the half range.
const TOLERANCE: f32 = 0.05;
/// Rest at the beginning of a motion, ms, as there.
pub const REST_MS: u32 = 3400;
/// Rest before a block that is tried alone, ms.
const REST_OF_BLOCK_MS: u32 = 450;
/// Hold at the end of a block, ms: most of a swing is out. Doggy's swings die out in 0.6 s.
const HOME_HOLD_MS: u32 = 500;
/// Duty up to which a block is slow.
pub const SLOW_DUTY: f32 = 0.2;
/// Highest duty on the way home.
const HOME_DUTY: f32 = 0.5;
/// Longest move of a slow block and of a fast one, ms.
const TIMEOUT_MS: [u32; 2] = [9000, 2500];
/// Targets lie within this part of the half range.
const FARTHEST: f32 = 0.8;
/// Duties of blocks: friction still lets joints move, and less than what safety lets pass.
const DUTY: [f32; 2] = [0.08, 0.9];
/// Frequencies of chirps and sines, Hz.
const CHIRP_HZ: [f32; 2] = [0.5, 16.0];
const SINE_HZ: [f32; 2] = [0.15, 3.0];
/// Amplitude of sines, part of the smallest half range.
const SINE_PART: [f32; 2] = [0.05, 0.6];
/// Lengths of chirps and sines, ms.
const WAVE_MS: [u32; 2] = [1500, 5000];
/// Longest pause between steps, ms.
const PAUSE_MS: u32 = 800;
/// Steps of a block.
const STEPS: [usize; 2] = [1, 6];

/// A block.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Block {
    /// Moves to targets.
    Steps {
        /// Joints that move, from 1.
        joints: JointSet,
        /// For each step the target of each joint of the robot, part of its half range about its middle.
        targets: Vec<Vec<f32>>,
        /// Highest duty, as a fraction.
        ceiling: f32,
        /// Hold after each step, ms; 0 for none.
        pause_ms: u32,
    },
    /// A duty of rising frequency.
    Chirp {
        /// Joints that move, from 1.
        joints: JointSet,
        /// Highest duty, as a fraction.
        amplitude: f32,
        /// First and last frequency, Hz.
        band_hz: [f32; 2],
        /// Relative step of the frequency from joint to joint.
        spread: f32,
        /// How long, ms.
        duration_ms: u32,
    },
    /// Positions that follow a sine.
    Sine {
        /// Joints that move, from 1.
        joints: JointSet,
        /// Part of the smallest half range.
        amplitude: f32,
        /// Frequency of the first joint, Hz.
        frequency_hz: f32,
        /// Relative step of the frequency from joint to joint.
        spread: f32,
        /// Highest duty, as a fraction.
        ceiling: f32,
        /// How long, ms.
        duration_ms: u32,
    },
}

impl Block {
    /// The parts of the preset calibration motion, for so many joints.
    pub fn of_preset(joints: usize) -> Vec<Self> {
        let all = JointSet::first(joints);
        let alternate = |joint: usize| if joint.is_multiple_of(2) { 1.0 } else { -1.0 };
        let each = |part: f32| vec![part; joints];
        let steps =
            |joints, targets: Vec<Vec<f32>>, ceiling, pause_ms| Block::Steps { joints, targets, ceiling, pause_ms };
        let chirp =
            |joints, spread| Block::Chirp { joints, amplitude: 0.9, band_hz: [1.4, 10.0], spread, duration_ms: 3000 };
        let mut blocks = Vec::new();
        for joint in 0..joints {
            let set = JointSet::only(joint);
            blocks.push(steps(set, vec![each(0.8), each(-0.8)], 0.15, 800));
            blocks.push(steps(set, vec![each(0.65), each(-0.75), each(0.65), each(-0.75), each(0.65)], 0.9, 700));
            blocks.push(steps(set, vec![each(0.65), each(-0.75), each(0.65)], 0.9, 0));
            blocks.push(chirp(set, 0.0));
        }
        if joints > 1 {
            let against = |part: f32| (0..joints).map(|joint| alternate(joint) * part).collect::<Vec<_>>();
            blocks.push(steps(all, vec![against(0.8), against(-0.7), against(0.5)], 0.15, 800));
            blocks.push(steps(all, vec![each(0.5), against(-0.6), each(0.6), against(-0.5), each(0.4)], 0.9, 700));
            blocks.push(chirp(all, 0.07));
        }
        blocks
    }

    /// A block drawn without preference, for so many joints.
    pub fn draw(joints: usize, rng: &mut impl Rng) -> Self {
        let set = draw_joints(joints, rng);
        let duty = log_uniform(DUTY, rng);
        let spread = rng.random_range(0.03..0.25);
        let duration_ms = rng.random_range(WAVE_MS[0]..WAVE_MS[1]);
        match rng.random_range(0..5) {
            0 | 1 => {
                let steps = rng.random_range(2..=STEPS[1]);
                let mut targets: Vec<Vec<f32>> = (0..steps).map(|_| draw_targets(joints, rng)).collect();
                // From side to side.
                for (step, target) in targets.iter_mut().enumerate() {
                    target[set.iter().next().unwrap_or(0)] *= if step.is_multiple_of(2) { 1.0 } else { -1.0 };
                }
                let pause_ms = if rng.random_bool(0.5) { 0 } else { rng.random_range(50..PAUSE_MS) };
                Block::Steps { joints: set, targets, ceiling: duty, pause_ms }
            }
            2 | 3 => {
                let from_hz = log_uniform([CHIRP_HZ[0], 0.5 * CHIRP_HZ[1]], rng);
                let to_hz = log_uniform([1.2 * from_hz, CHIRP_HZ[1]], rng);
                Block::Chirp { joints: set, amplitude: duty, band_hz: [from_hz, to_hz], spread, duration_ms }
            }
            _ => Block::Sine {
                joints: set,
                amplitude: log_uniform(SINE_PART, rng),
                frequency_hz: log_uniform(SINE_HZ, rng),
                spread,
                ceiling: duty.max(0.3),
                duration_ms,
            },
        }
    }

    /// A block that differs a little.
    #[must_use]
    pub fn mutate(&self, joints: usize, rng: &mut impl Rng) -> Self {
        let mut block = self.clone();
        match &mut block {
            Block::Steps { targets, ceiling, pause_ms, .. } => {
                *ceiling = scaled(*ceiling, DUTY, rng);
                for target in targets.iter_mut().flatten() {
                    *target = (*target + 0.15 * normal(rng)).clamp(-FARTHEST, FARTHEST);
                }
                *pause_ms = (*pause_ms as f32 + 150.0 * normal(rng)).clamp(0.0, PAUSE_MS as f32) as u32;
                if *pause_ms < 50 {
                    *pause_ms = 0;
                }
                match rng.random_range(0..4) {
                    0 if targets.len() > STEPS[0] => {
                        let at = rng.random_range(0..targets.len());
                        targets.remove(at);
                    }
                    1 if targets.len() < STEPS[1] => targets.push(draw_targets(joints, rng)),
                    _ => {}
                }
            }
            Block::Chirp { amplitude, band_hz, spread, duration_ms, .. } => {
                *amplitude = scaled(*amplitude, DUTY, rng);
                band_hz[0] = scaled(band_hz[0], [CHIRP_HZ[0], 0.5 * CHIRP_HZ[1]], rng);
                band_hz[1] = scaled(band_hz[1], [1.1 * band_hz[0], CHIRP_HZ[1]], rng);
                *spread = (*spread + 0.05 * normal(rng)).clamp(0.0, 0.3);
                *duration_ms = scaled(*duration_ms as f32, WAVE_MS.map(|ms| ms as f32), rng) as u32;
            }
            Block::Sine { amplitude, frequency_hz, spread, ceiling, duration_ms, .. } => {
                *amplitude = scaled(*amplitude, SINE_PART, rng);
                *frequency_hz = scaled(*frequency_hz, SINE_HZ, rng);
                *spread = (*spread + 0.05 * normal(rng)).clamp(0.0, 0.3);
                *ceiling = scaled(*ceiling, [0.2, DUTY[1]], rng);
                *duration_ms = scaled(*duration_ms as f32, WAVE_MS.map(|ms| ms as f32), rng) as u32;
            }
        }
        if rng.random_bool(0.15) {
            *block.joints_mut() = draw_joints(joints, rng);
        }
        block
    }

    fn joints_mut(&mut self) -> &mut JointSet {
        match self {
            Block::Steps { joints, .. } | Block::Chirp { joints, .. } | Block::Sine { joints, .. } => joints,
        }
    }

    fn joints(&self) -> JointSet {
        match self {
            Block::Steps { joints, .. } | Block::Chirp { joints, .. } | Block::Sine { joints, .. } => *joints,
        }
    }

    /// Highest duty, as a fraction.
    pub fn duty(&self) -> f32 {
        match self {
            Block::Steps { ceiling, .. } | Block::Sine { ceiling, .. } => *ceiling,
            Block::Chirp { amplitude, .. } => *amplitude,
        }
    }

    /// Its segments on a robot with these limits, the way home included.
    pub fn actions(&self, limits: &[Limits]) -> Vec<Action> {
        let duty = ceiling(self.duty());
        let is_slow = self.duty() <= SLOW_DUTY;
        let timeout_ms = TIMEOUT_MS[usize::from(!is_slow)];
        let mut actions = Vec::new();
        match self {
            Block::Steps { joints, targets, pause_ms, .. } => {
                for target in targets {
                    actions.push(move_to(*joints, target, duty, timeout_ms, limits));
                    if *pause_ms > 0 {
                        actions.push(Action::Hold { ceiling: duty, duration_ms: *pause_ms });
                    }
                }
            }
            Block::Chirp { joints, band_hz, spread, duration_ms, .. } => actions.push(Action::Chirp {
                joints: *joints,
                amplitude: duty,
                from_hz: band_hz[0],
                to_hz: band_hz[1],
                spread: *spread,
                centring: 0.5 * GAIN_TIMES_HALF_RANGE / smallest_half_range(limits),
                duration_ms: *duration_ms,
            }),
            Block::Sine { joints, amplitude, frequency_hz, spread, duration_ms, .. } => actions.push(Action::Sine {
                joints: *joints,
                amplitude: amplitude * smallest_half_range(limits),
                frequency_hz: *frequency_hz,
                spread: *spread,
                ceiling: duty,
                duration_ms: *duration_ms,
            }),
        }
        actions.extend(home(self.joints(), ceiling(self.duty().min(HOME_DUTY)), timeout_ms, limits));
        actions
    }
}

/// A motion of these blocks, slow ones first, and for each of its segments the place of its block; `alone` is a block that is tried.
pub fn motion(name: &str, blocks: &[&Block], limits: &[Limits], alone: bool) -> (Motion, Vec<Option<usize>>) {
    let gain = limits.iter().take(MAX_JOINTS).map(|l| GAIN_TIMES_HALF_RANGE / half_range(l)).collect();
    let stages = ["rest", "slow", "fast"].into_iter().map(text).collect();
    let mut motion = Motion::new(Header { name: text(name), stages, gain });
    let mut owners = Vec::new();
    let mut push = |stage: u8, action: Action, owner| {
        // Whoever chooses blocks counts their segments.
        debug_assert!(motion.segments.len() < MAX_SEGMENTS);
        let _ = motion.segments.push(Segment { stage, action });
        owners.push(owner);
    };
    push(0, Action::Zero { duration_ms: if alone { REST_OF_BLOCK_MS } else { REST_MS } }, None);
    if !starts_in_the_middle(limits) {
        for action in home(JointSet::first(limits.len()), ceiling(0.15), TIMEOUT_MS[0], limits) {
            push(1, action, None);
        }
    }
    for stage in [1, 2] {
        for (place, block) in blocks.iter().enumerate().filter(|(_, block)| (block.duty() <= SLOW_DUTY) == (stage == 1))
        {
            block.actions(limits).into_iter().for_each(|action| push(stage, action, Some(place)));
        }
    }
    (motion, owners)
}

/// Rest before a block that is tried alone, s.
pub const REST_OF_BLOCK_S: f64 = REST_OF_BLOCK_MS as f64 * 1e-3;

/// Segments of a motion before its first block.
pub fn segments_before(limits: &[Limits]) -> usize {
    if starts_in_the_middle(limits) { 1 } else { 3 }
}

/// Whether the marked pose is the middle of every range.
fn starts_in_the_middle(limits: &[Limits]) -> bool {
    limits.iter().all(|l| (0.5 * (l.min + l.max)).abs() <= TOLERANCE * half_range(l))
}

fn home(joints: JointSet, ceiling: Duty, timeout_ms: u32, limits: &[Limits]) -> [Action; 2] {
    let middle = vec![0.0; limits.len()];
    [move_to(joints, &middle, ceiling, timeout_ms, limits), Action::Hold { ceiling, duration_ms: HOME_HOLD_MS }]
}

fn move_to(joints: JointSet, parts: &[f32], ceiling: Duty, timeout_ms: u32, limits: &[Limits]) -> Action {
    let moved = || joints.iter().filter_map(|joint| Some((limits.get(joint)?, parts.get(joint)?)));
    let tolerance = moved().map(|(limits, _)| TOLERANCE * half_range(limits)).fold(f32::INFINITY, f32::min);
    // One target a joint of the set, which has at most MAX_JOINTS.
    let targets = moved().map(|(limits, part)| limits.min + half_range(limits) * (1.0 + part)).collect();
    Action::MoveTo { joints, targets, ceiling, tolerance, timeout_ms }
}

fn half_range(limits: &Limits) -> f32 {
    (limits.max - limits.min) / 2.0
}

fn smallest_half_range(limits: &[Limits]) -> f32 {
    limits.iter().map(half_range).fold(f32::INFINITY, f32::min)
}

fn ceiling(fraction: f32) -> Duty {
    Duty::from_fraction(fraction).limited_to(Duty(MAX_DUTY))
}

fn log_uniform(ends: [f32; 2], rng: &mut impl Rng) -> f32 {
    (ends[0].ln() + rng.random_range(0.0..1.0) * (ends[1] / ends[0]).ln()).exp()
}

fn draw_targets(joints: usize, rng: &mut impl Rng) -> Vec<f32> {
    let mut target = || rng.random_range(0.15..FARTHEST) * if rng.random_bool(0.5) { 1.0 } else { -1.0 };
    (0..joints).map(|_| target()).collect()
}

fn normal(rng: &mut impl Rng) -> f32 {
    StandardNormal.sample(rng)
}

/// A value that differs by some 30 %, within these ends.
fn scaled(value: f32, ends: [f32; 2], rng: &mut impl Rng) -> f32 {
    (value * (0.3 * normal(rng)).exp()).clamp(ends[0], ends[1])
}

/// One joint, or all of them, or some.
fn draw_joints(joints: usize, rng: &mut impl Rng) -> JointSet {
    if joints > 1 && rng.random_bool(0.35) {
        return JointSet::first(joints);
    }
    let mut set = JointSet::only(rng.random_range(0..joints));
    if joints > 2 && rng.random_bool(0.2) {
        set = set.with(rng.random_range(0..joints));
    }
    set
}
