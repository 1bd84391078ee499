//! Readings of a tick: raw codes for the sample, positions and speeds for player and limits, and whether to believe
//! them.

use protocol::sample::Flags;
use protocol::{Duty, Fault, GyroAge, MAX_ENCODERS, MAX_GYROS, MAX_JOINTS};

use super::Inputs;
use crate::config::{Config, Joint};
use crate::motion::Positions;
use crate::safety::{DriveWatch, EncoderWatch, GyroInput, GyroWatch, RotationWatch, Turn, Verdict};
use crate::speed::Speed;

/// How near the watches are to their bounds in this tick, each as a part of its bound: for whoever measures margins.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Nearness {
    /// Push on an encoder that has not moved.
    pub stuck: f32,
    /// Push on a joint against its speed.
    pub wrong_way: f32,
    /// Difference between a gyro and the encoders.
    pub rotation: f32,
}

/// The sensors of a robot.
#[derive(Clone, Debug)]
pub(super) struct Sensors {
    encoders: heapless::Vec<EncoderWatch, MAX_ENCODERS>,
    gyros: heapless::Vec<GyroWatch, MAX_GYROS>,
    drives: heapless::Vec<DriveWatch, MAX_JOINTS>,
    rotations: heapless::Vec<RotationWatch, MAX_GYROS>,
    /// The gyro that is judged in this tick.
    judged: usize,
    turns: heapless::Vec<Turn, MAX_JOINTS>,
    encoder_joint: [usize; MAX_ENCODERS],
    encoder_verdicts: [Verdict; MAX_ENCODERS],
    gyro_verdicts: [Verdict; MAX_GYROS],
    /// First joint that goes the wrong way, and first gyro that tells of another rotation than the encoders.
    wrong_way: Option<u8>,
    differs: Option<u8>,
    speed: [Speed; MAX_JOINTS],
    /// Speeds of the joints lately, counts/s.
    fastest: [u32; MAX_JOINTS],
    /// Last counts of every encoder.
    pub counts: [i32; MAX_ENCODERS],
    /// Last words of every gyro.
    pub words: [[i16; 3]; MAX_GYROS],
    /// Ages of the words of this tick.
    pub ages: [GyroAge; MAX_GYROS],
    /// Counts of every encoder at the zero positions.
    pub zero: Option<[i32; MAX_ENCODERS]>,
    /// Joint positions, counts from zero, positive with the joint.
    pub positions: Positions,
    /// Joint speeds, counts/s.
    pub speeds: [i32; MAX_JOINTS],
}

impl Sensors {
    pub fn new(config: &Config) -> Self {
        let mut encoder_joint = [0; MAX_ENCODERS];
        for (joint, encoder) in encoder_joint.iter_mut().zip(&config.hello.encoders) {
            *joint = usize::from(encoder.joint);
        }
        Sensors {
            encoders: config.encoder_bounds[..config.hello.encoders.len()]
                .iter()
                .map(|bounds| EncoderWatch::new(*bounds))
                .collect(),
            gyros: config.hello.gyros.iter().map(|_| GyroWatch::new(config.gyro_bounds)).collect(),
            drives: config.joints.iter().map(|joint| DriveWatch::new(joint.drive)).collect(),
            rotations: config.rotations.clone(),
            judged: 0,
            turns: config.joints.iter().map(|joint| joint.turn).collect(),
            encoder_joint,
            encoder_verdicts: [Verdict::Good; MAX_ENCODERS],
            gyro_verdicts: [Verdict::Good; MAX_GYROS],
            wrong_way: None,
            differs: None,
            speed: [Speed::default(); MAX_JOINTS],
            fastest: [0; MAX_JOINTS],
            counts: [0; MAX_ENCODERS],
            words: [[0; 3]; MAX_GYROS],
            ages: [GyroAge::UNKNOWN; MAX_GYROS],
            zero: None,
            positions: [0; MAX_JOINTS],
            speeds: [0; MAX_JOINTS],
        }
    }

    /// Takes the readings of a tick; `in_force` is the duty that drives the joints, and `moving` whether a motion is
    /// under way.
    pub fn read(&mut self, inputs: &Inputs, joints: &[Joint], in_force: &[Duty; MAX_JOINTS], moving: bool) -> Flags {
        let mut flags = Flags::empty();
        for (index, watch) in self.encoders.iter_mut().enumerate() {
            let duty = in_force.get(self.encoder_joint[index]).map_or(0, |duty| duty.0);
            let verdict = watch.check(inputs.encoders[index], duty);
            self.encoder_verdicts[index] = verdict;
            self.counts[index] = inputs.encoders[index].unwrap_or(self.counts[index]);
            flags.set(Flags::ENCODER_STALE, flags.contains(Flags::ENCODER_STALE) || silent(verdict));
        }
        for (index, watch) in self.gyros.iter_mut().enumerate() {
            let verdict = watch.check(inputs.gyros[index]);
            self.gyro_verdicts[index] = verdict;
            self.ages[index] = GyroAge::UNKNOWN;
            if let GyroInput::Words(words) = inputs.gyros[index] {
                (self.words[index], self.ages[index]) = (words, inputs.gyro_ages[index]);
            }
            flags.set(Flags::gyro_stale(index), silent(verdict));
            flags.set(Flags::gyro_saturated(index), matches!(verdict, Verdict::Saturated | Verdict::OutOfRange));
        }
        let zero = self.zero.unwrap_or_default();
        let mut steps = [0; MAX_JOINTS];
        self.wrong_way = None;
        for (index, joint) in joints.iter().enumerate() {
            let moved = self.counts[joint.encoder].wrapping_sub(zero[joint.encoder]);
            let position = if joint.reversed { moved.wrapping_neg() } else { moved };
            steps[index] = position.wrapping_sub(self.positions[index]);
            self.positions[index] = position;
            self.speeds[index] = self.speed[index].update(position);
            let (speed, duty) = (self.speeds[index], in_force[index].0);
            let is_wrong_way = self.drives[index].is_wrong_way(speed, duty, index, &mut self.fastest);
            if is_wrong_way && self.wrong_way.is_none() {
                self.wrong_way = Some(index as u8);
            }
        }
        let strongest = in_force.iter().copied().max_by_key(|duty| duty.0.unsigned_abs()).unwrap_or_default();
        self.compare(joints, &steps, strongest, moving);
        flags
    }

    /// Holds the gyros against the encoders while a motion is under way, one a tick in turn, and takes their zero while the
    /// joints rest.
    fn compare(&mut self, joints: &[Joint], steps: &[i32; MAX_JOINTS], strongest: Duty, moving: bool) {
        let at_rest = self.at_rest(joints);
        self.differs = None;
        if !moving {
            self.wait(at_rest);
            return;
        }
        let is_held = joints.iter().all(|joint| strongest.0.unsigned_abs() <= joint.drive.standing_duty.unsigned_abs());
        self.judged = if self.judged + 1 < self.rotations.len() { self.judged + 1 } else { 0 };
        for (index, watch) in self.rotations.iter_mut().enumerate() {
            let words = (self.gyro_verdicts[index] == Verdict::Good).then_some(self.words[index]);
            if at_rest && is_held {
                watch.pauses(words);
            }
            watch.moves(words, steps);
            if index == self.judged && watch.differs(&self.turns, &self.positions, strongest) {
                self.differs = Some(index as u8);
            }
        }
    }

    /// A tick without a motion.
    #[inline(never)]
    fn wait(&mut self, at_rest: bool) {
        for (index, watch) in self.rotations.iter_mut().enumerate() {
            let words = (self.gyro_verdicts[index] == Verdict::Good).then_some(self.words[index]);
            if at_rest { watch.at_rest(words) } else { watch.begin_anew() }
        }
    }

    /// An encoder jumped in this tick: its count is no longer a position.
    pub fn jumped(&self) -> Option<Fault> {
        let jumped = |verdict: &Verdict| *verdict == Verdict::OutOfRange;
        self.encoder_verdicts.iter().position(jumped).map(|index| Fault::EncoderJump { encoder: index as u8 })
    }

    /// A sensor that cannot be believed.
    pub fn fault(&self) -> Option<Fault> {
        for (index, verdict) in (0u8..).zip(self.encoder_verdicts) {
            match verdict {
                Verdict::OutOfRange => return Some(Fault::EncoderJump { encoder: index }),
                Verdict::Stuck => return Some(Fault::EncoderStuck { encoder: index }),
                Verdict::Stale | Verdict::BusHang => return Some(Fault::EncoderStale { encoder: index }),
                Verdict::Good | Verdict::Missing | Verdict::Saturated => {}
            }
        }
        if let Some(joint) = self.wrong_way {
            return Some(Fault::WrongWay { joint });
        }
        for (gyro, verdict) in (0u8..).zip(self.gyro_verdicts) {
            match verdict {
                Verdict::Stale => return Some(Fault::GyroStale { gyro }),
                Verdict::BusHang => return Some(Fault::BusHang { gyro }),
                Verdict::Stuck => return Some(Fault::GyroStuck { gyro }),
                Verdict::OutOfRange => return Some(Fault::GyroRange { gyro }),
                Verdict::Good | Verdict::Missing | Verdict::Saturated => {}
            }
        }
        self.differs.map(|gyro| Fault::RotationMismatch { gyro })
    }

    /// How near the watches are to a fault that a healthy robot must not have.
    pub fn nearness(&self) -> Nearness {
        let largest = |parts: &mut dyn Iterator<Item = f32>| parts.fold(0.0, f32::max);
        Nearness {
            stuck: largest(&mut self.encoders.iter().map(EncoderWatch::nearness)),
            wrong_way: largest(&mut self.drives.iter().map(DriveWatch::nearness)),
            rotation: largest(&mut self.rotations.iter().map(RotationWatch::nearness)),
        }
    }

    /// Whether every sensor answers, and every joint and every body with a gyro is at rest.
    pub fn quiet(&self, joints: &[Joint]) -> bool {
        let heard = self.encoder_verdicts.iter().all(|verdict| *verdict == Verdict::Good);
        let still = self.rotations.iter().all(RotationWatch::is_quiet);
        heard && still && self.fault().is_none() && self.at_rest(joints)
    }

    fn at_rest(&self, joints: &[Joint]) -> bool {
        let at_rest = |(joint, speed): (&Joint, &i32)| speed.unsigned_abs() <= joint.quiet_counts_per_s.unsigned_abs();
        joints.iter().zip(&self.speeds).all(at_rest)
    }

    /// Takes the present counts as zero.
    pub fn set_zero(&mut self) {
        self.zero = Some(self.counts);
        self.speed = [Speed::default(); MAX_JOINTS];
    }

    /// The counts mean no position any more.
    pub fn forget_zero(&mut self) {
        self.zero = None;
        self.speed = [Speed::default(); MAX_JOINTS];
    }
}

/// No new reading in this tick.
fn silent(verdict: Verdict) -> bool {
    matches!(verdict, Verdict::Missing | Verdict::Stale | Verdict::BusHang)
}
