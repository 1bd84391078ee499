//! Readings of a tick: raw codes for the sample, positions and speeds for player and limits, and whether to believe
//! them.

use protocol::sample::Flags;
use protocol::{Duty, Fault, MAX_ENCODERS, MAX_GYROS, MAX_JOINTS};

use super::Inputs;
use crate::config::{Config, Joint};
use crate::motion::Positions;
use crate::safety::{EncoderWatch, GyroInput, GyroWatch, Verdict};
use crate::speed::Speed;

/// The sensors of a robot.
#[derive(Clone, Debug)]
pub(super) struct Sensors {
    encoders: heapless::Vec<EncoderWatch, MAX_ENCODERS>,
    gyros: heapless::Vec<GyroWatch, MAX_GYROS>,
    encoder_joint: [usize; MAX_ENCODERS],
    encoder_verdicts: [Verdict; MAX_ENCODERS],
    gyro_verdicts: [Verdict; MAX_GYROS],
    speed: [Speed; MAX_JOINTS],
    /// Last counts of every encoder.
    pub counts: [i32; MAX_ENCODERS],
    /// Last words of every gyro.
    pub words: [[i16; 3]; MAX_GYROS],
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
            encoder_joint,
            encoder_verdicts: [Verdict::Good; MAX_ENCODERS],
            gyro_verdicts: [Verdict::Good; MAX_GYROS],
            speed: [Speed::default(); MAX_JOINTS],
            counts: [0; MAX_ENCODERS],
            words: [[0; 3]; MAX_GYROS],
            zero: None,
            positions: [0; MAX_JOINTS],
            speeds: [0; MAX_JOINTS],
        }
    }

    /// Takes the readings of a tick; `in_force` is the duty that drives the joints.
    pub fn read(&mut self, inputs: &Inputs, joints: &[Joint], in_force: &[Duty; MAX_JOINTS]) -> Flags {
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
            if let GyroInput::Words(words) = inputs.gyros[index] {
                self.words[index] = words;
            }
            flags.set(Flags::gyro_stale(index), silent(verdict));
            flags.set(Flags::gyro_saturated(index), matches!(verdict, Verdict::Saturated | Verdict::OutOfRange));
        }
        let zero = self.zero.unwrap_or_default();
        for (index, joint) in joints.iter().enumerate() {
            let moved = self.counts[joint.encoder].wrapping_sub(zero[joint.encoder]);
            let position = if joint.reversed { moved.wrapping_neg() } else { moved };
            self.positions[index] = position;
            self.speeds[index] = self.speed[index].update(position);
        }
        flags
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
        for (gyro, verdict) in (0u8..).zip(self.gyro_verdicts) {
            match verdict {
                Verdict::Stale => return Some(Fault::GyroStale { gyro }),
                Verdict::BusHang => return Some(Fault::BusHang { gyro }),
                Verdict::Stuck => return Some(Fault::GyroStuck { gyro }),
                Verdict::OutOfRange => return Some(Fault::GyroRange { gyro }),
                Verdict::Good | Verdict::Missing | Verdict::Saturated => {}
            }
        }
        None
    }

    /// Whether every sensor answers and every joint is at rest.
    pub fn quiet(&self, joints: &[Joint]) -> bool {
        let at_rest = |(joint, speed): (&Joint, &i32)| speed.unsigned_abs() <= joint.quiet_counts_per_s.unsigned_abs();
        let heard = self.encoder_verdicts.iter().all(|verdict| *verdict == Verdict::Good);
        heard && self.fault().is_none() && joints.iter().zip(&self.speeds).all(at_rest)
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
