//! A motion as data: bounded segments that the host uploads and the firmware plays.
//!
//! ```text
//!   phase      0        1            2            3              …
//!          ┌───────┬───────────┬────────────┬─────────────┬───────────┐
//!          │ zero  │ move to   │ move to    │ chirp       │ …         │   duty = 0 afterwards
//!          └───────┴───────────┴────────────┴─────────────┴───────────┘
//!   stage   "rest"   "slow"      "slow"       "fast"
//! ```
//!
//! The same types are the motion file of the host (TOML); there a duty is a fraction and joints count from 1:
//!
//! ```toml
//! name = "nod"
//! stages = ["rest", "slow"]
//! gain = [2.0, 2.0, 2.0]
//!
//! [[segments]]
//! stage = 0
//! action.zero = { duration_ms = 3000 }
//!
//! [[segments]]
//! stage = 1
//! action.move_to = { joints = [2], targets = [0.4], ceiling = 0.15, tolerance = 0.01, timeout_ms = 4000 }
//! ```
//!
//! Joint positions are absolute, on the link's side of the gear, in the unit of the joint: rad, or m.

use heapless::Vec;
use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

use crate::{
    MAX_JOINTS,
    frame::crc32,
    units::{Duty, JointSet, Text},
};

/// Most segments of a motion.
pub const MAX_SEGMENTS: usize = 96;
/// Most stages of a motion.
pub const MAX_STAGES: usize = 8;
/// Longest segment, ms.
pub const MAX_SEGMENT_MS: u32 = 120_000;
/// Longest motion if every move takes all of its time, ms.
pub const MAX_MOTION_MS: u32 = 1_200_000;
/// Highest frequency of a chirp or sine, Hz.
pub const MAX_FREQUENCY_HZ: f32 = 100.0;

/// All of a motion but its segments.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct Header {
    /// Name of the motion.
    pub name: Text<24>,
    /// Names of the stages that segments belong to.
    pub stages: Vec<Text<16>, MAX_STAGES>,
    /// Gain of the position controller of each joint of the robot, duty (1 = full) per rad or m.
    pub gain: Vec<f32, MAX_JOINTS>,
}

/// A motion.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Schema)]
#[serde(deny_unknown_fields)]
pub struct Motion {
    /// Name of the motion.
    pub name: Text<24>,
    /// Names of the stages that segments belong to.
    pub stages: Vec<Text<16>, MAX_STAGES>,
    /// Gain of the position controller of each joint of the robot, duty (1 = full) per rad or m.
    pub gain: Vec<f32, MAX_JOINTS>,
    /// What is done, one after the other.
    pub segments: Vec<Segment, MAX_SEGMENTS>,
}

/// A part of a motion; its index is the phase in [`crate::Sample`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Schema)]
#[serde(deny_unknown_fields)]
pub struct Segment {
    /// Index into the motion's stages.
    pub stage: u8,
    /// What is done.
    pub action: Action,
}

/// What a segment does.
///
/// In [`Action::Hold`], [`Action::MoveTo`] and [`Action::Sine`] a position controller works on every joint, also on
/// those that are not named: duty = gain · (target − measured), limited to the ceiling. A joint that was never moved
/// has the position at the end of the last `zero` as its target, so it stays where it is.
/// A chirp's joints get their target anew at its end: where they are.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Schema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Action {
    /// No duty on any joint.
    Zero {
        /// How long, ms.
        duration_ms: u32,
    },
    /// Every joint is kept at its target.
    Hold {
        /// Highest duty.
        ceiling: Duty,
        /// How long, ms.
        duration_ms: u32,
    },
    /// The named joints get new targets. Done when they are all within the tolerance, or when the time is over.
    MoveTo {
        /// Which joints.
        joints: JointSet,
        /// Their targets in ascending order of the joints, rad or m.
        targets: Vec<f32, MAX_JOINTS>,
        /// Highest duty.
        ceiling: Duty,
        /// How near counts as arrived, rad or m.
        tolerance: f32,
        /// When the segment ends at the latest, ms.
        timeout_ms: u32,
    },
    /// A duty whose frequency rises linearly in time on the named joints, the others are kept at their targets
    /// with the amplitude as ceiling:
    ///
    /// duty = amplitude · cos φ + centring · (start − measured), limited to the amplitude,
    /// dφ/dt = 2π (1 + i · spread) (from + (to − from) t / duration), φ(0) = 0, i the rank of the joint in the set.
    ///
    /// Speed follows the duty, so a cosine swings to both sides of the start.
    Chirp {
        /// Which joints.
        joints: JointSet,
        /// Highest duty.
        amplitude: Duty,
        /// First frequency, Hz.
        from_hz: f32,
        /// Last frequency, Hz.
        to_hz: f32,
        /// Relative step of the frequency from one joint of the set to the next, 0 for all the same.
        spread: f32,
        /// Pull back to the position at the start, duty (1 = full) per rad or m; 0 for none.
        centring: f32,
        /// How long, ms.
        duration_ms: u32,
    },
    /// A sine of the *position* of the named joints about their targets:
    /// target + amplitude · sin(2π (1 + i · spread) f t), i the rank of the joint in the set.
    Sine {
        /// Which joints.
        joints: JointSet,
        /// Amplitude, rad or m.
        amplitude: f32,
        /// Frequency, Hz.
        frequency_hz: f32,
        /// Relative step of the frequency from one joint of the set to the next, 0 for all the same.
        spread: f32,
        /// Highest duty.
        ceiling: Duty,
        /// How long, ms.
        duration_ms: u32,
    },
}

impl Action {
    /// How long the segment lasts, at the longest, ms.
    pub fn longest_ms(&self) -> u32 {
        match *self {
            Self::Zero { duration_ms }
            | Self::Hold { duration_ms, .. }
            | Self::Chirp { duration_ms, .. }
            | Self::Sine { duration_ms, .. } => duration_ms,
            Self::MoveTo { timeout_ms, .. } => timeout_ms,
        }
    }
}

/// A rule that a motion breaks. Segments and joints count from 0.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema, thiserror::Error)]
pub enum MotionError {
    /// Nothing to do.
    #[error("it has no segments")]
    Empty,
    /// Longer than [`MAX_MOTION_MS`].
    #[error("it may last {ms} ms, the longest allowed is {MAX_MOTION_MS} ms")]
    TooLong {
        /// Sum over the segments.
        ms: u32,
    },
    /// Gains for another number of joints than the robot has.
    #[error("it has {got} gains for {joints} joints")]
    Gains {
        /// Gains in the motion.
        got: u8,
        /// Joints of the robot.
        joints: u8,
    },
    /// A gain that is negative, infinite or not a number.
    #[error("the gain of joint {}, {gain}, is not a finite number from 0", joint + 1)]
    Gain {
        /// Which joint.
        joint: u8,
        /// Its gain.
        gain: f32,
    },
    /// A stage that is not in the list.
    #[error("segment {segment} belongs to stage {stage} of {stages}")]
    Stage {
        /// Which segment.
        segment: u8,
        /// Its stage.
        stage: u8,
        /// Length of the list.
        stages: u8,
    },
    /// A time of zero or beyond [`MAX_SEGMENT_MS`].
    #[error("segment {segment} lasts {ms} ms; allowed are 1 to {MAX_SEGMENT_MS} ms")]
    Duration {
        /// Which segment.
        segment: u8,
        /// Its time.
        ms: u32,
    },
    /// No joint named, or one that the robot does not have.
    #[error("segment {segment} names no joint, or one beyond joint {joints}")]
    Joints {
        /// Which segment.
        segment: u8,
        /// Joints of the robot.
        joints: u8,
    },
    /// Another number of targets than of joints.
    #[error("segment {segment} has {got} targets for {expected} joints")]
    Targets {
        /// Which segment.
        segment: u8,
        /// Joints named.
        expected: u8,
        /// Targets given.
        got: u8,
    },
    /// A position, or the end of a swing, outside of the joint's limits.
    #[error("segment {segment} moves joint {} to {position}, outside of its limits", joint + 1)]
    OutsideLimits {
        /// Which segment.
        segment: u8,
        /// Which joint.
        joint: u8,
        /// Where to.
        position: f32,
    },
    /// A duty ceiling that is not positive, or above full.
    #[error("segment {segment} has a duty ceiling of {}; allowed are 0.0001 to 1", ceiling.fraction())]
    Ceiling {
        /// Which segment.
        segment: u8,
        /// Its ceiling.
        ceiling: Duty,
    },
    /// A number that is infinite, not a number, or of the wrong sign.
    #[error("segment {segment} has a value of {value} that must be a finite number from 0")]
    Value {
        /// Which segment.
        segment: u8,
        /// The value.
        value: f32,
    },
    /// A frequency of zero, or beyond [`MAX_FREQUENCY_HZ`].
    #[error("segment {segment} has a frequency of {hz} Hz; allowed is up to {MAX_FREQUENCY_HZ} Hz")]
    Frequency {
        /// Which segment.
        segment: u8,
        /// The frequency, of the fastest joint.
        hz: f32,
    },
}

/// Where a joint may be, rad or m.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// Lower end.
    pub min: f32,
    /// Upper end.
    pub max: f32,
}

impl Motion {
    /// A motion without segments yet.
    pub fn new(header: Header) -> Self {
        let Header { name, stages, gain } = header;
        Self { name, stages, gain, segments: Vec::new() }
    }

    /// All but the segments.
    pub fn header(&self) -> Header {
        Header { name: self.name.clone(), stages: self.stages.clone(), gain: self.gain.clone() }
    }

    /// Checks every rule against a robot with these joints.
    ///
    /// # Errors
    /// The first [`MotionError`], in order of the segments.
    pub fn validate(&self, joints: &[Limits]) -> Result<(), MotionError> {
        // At most MAX_JOINTS, MAX_STAGES and MAX_SEGMENTS entries: all counts fit a byte.
        let n = joints.len().min(MAX_JOINTS) as u8;
        if self.gain.len() != joints.len() {
            return Err(MotionError::Gains { got: self.gain.len() as u8, joints: n });
        }
        for (joint, gain) in (0u8..).zip(&self.gain) {
            if !(gain.is_finite() && *gain >= 0.0) {
                return Err(MotionError::Gain { joint, gain: *gain });
            }
        }
        if self.segments.is_empty() {
            return Err(MotionError::Empty);
        }
        for (index, segment) in (0u8..).zip(&self.segments) {
            if usize::from(segment.stage) >= self.stages.len() {
                return Err(MotionError::Stage {
                    segment: index,
                    stage: segment.stage,
                    stages: self.stages.len() as u8,
                });
            }
            segment.action.validate(index, joints)?;
        }
        match self.longest_ms() {
            ms if ms > MAX_MOTION_MS => Err(MotionError::TooLong { ms }),
            _ => Ok(()),
        }
    }

    /// How long the motion lasts if every move takes all of its time, ms.
    pub fn longest_ms(&self) -> u32 {
        self.segments.iter().fold(0, |ms, s| ms.saturating_add(s.action.longest_ms()))
    }

    /// The checksum of an upload: over the checksums of the header and of each segment as they are encoded.
    pub fn checksum(&self) -> u32 {
        let mut sum = checksum_of(&self.header(), 0);
        for segment in &self.segments {
            sum = checksum_of(segment, sum);
        }
        sum
    }
}

/// CRC-32 over the sum so far and the encoding of one part.
fn checksum_of<T: Serialize>(part: &T, so_far: u32) -> u32 {
    // A header takes at most 194 bytes, a segment 57: see the test that holds the bounds of messages.
    let mut bytes = [0; 4 + 256];
    let (head, rest) = bytes.split_at_mut(4);
    head.copy_from_slice(&so_far.to_le_bytes());
    let used = postcard::to_slice(part, rest).map_or(0, |part| part.len());
    crc32(&bytes[..4 + used])
}

impl Action {
    /// Checks the rules of one segment.
    fn validate(&self, segment: u8, limits: &[Limits]) -> Result<(), MotionError> {
        let n = limits.len().min(MAX_JOINTS) as u8;
        let ms = self.longest_ms();
        if ms == 0 || ms > MAX_SEGMENT_MS {
            return Err(MotionError::Duration { segment, ms });
        }
        let named = |set: &JointSet| {
            if set.is_empty() || set.end() > limits.len() {
                return Err(MotionError::Joints { segment, joints: n });
            }
            Ok(())
        };
        let ceiling = |ceiling: Duty| {
            if ceiling.0 <= 0 || ceiling.0 > Duty::FULL {
                return Err(MotionError::Ceiling { segment, ceiling });
            }
            Ok(())
        };
        let positive = |value: f32| {
            if !(value.is_finite() && value >= 0.0) {
                return Err(MotionError::Value { segment, value });
            }
            Ok(())
        };
        let frequency = |hz: f32, spread: f32, set: &JointSet| {
            positive(spread)?;
            let fastest = hz * (1.0 + spread * set.len().saturating_sub(1) as f32);
            if !(hz > 0.0 && fastest <= MAX_FREQUENCY_HZ) {
                return Err(MotionError::Frequency { segment, hz: fastest });
            }
            Ok(())
        };
        match self {
            Self::Zero { .. } => Ok(()),
            Self::Hold { ceiling: duty, .. } => ceiling(*duty),
            Self::MoveTo { joints, targets, ceiling: duty, tolerance, .. } => {
                named(joints)?;
                ceiling(*duty)?;
                positive(*tolerance)?;
                if targets.len() != joints.len() {
                    return Err(MotionError::Targets {
                        segment,
                        expected: joints.len() as u8,
                        got: targets.len() as u8,
                    });
                }
                for (joint, position) in joints.iter().zip(targets) {
                    // Written so that a position that is not a number is outside.
                    let inside = limits.get(joint).is_some_and(|l| (l.min..=l.max).contains(position));
                    if !inside {
                        return Err(MotionError::OutsideLimits { segment, joint: joint as u8, position: *position });
                    }
                }
                Ok(())
            }
            Self::Chirp { joints, amplitude, from_hz, to_hz, spread, centring, .. } => {
                named(joints)?;
                ceiling(*amplitude)?;
                positive(*centring)?;
                frequency(*from_hz, *spread, joints)?;
                frequency(*to_hz, *spread, joints)
            }
            Self::Sine { joints, amplitude, frequency_hz, spread, ceiling: duty, .. } => {
                named(joints)?;
                ceiling(*duty)?;
                positive(*amplitude)?;
                frequency(*frequency_hz, *spread, joints)?;
                for joint in joints.iter() {
                    // The swing must fit between the ends; where its middle is, the player knows.
                    if let Some(l) = limits.get(joint)
                        && 2.0 * amplitude > l.max - l.min
                    {
                        return Err(MotionError::OutsideLimits { segment, joint: joint as u8, position: *amplitude });
                    }
                }
                Ok(())
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::units::text;

    const LIMITS: [Limits; 3] = [Limits { min: -0.6, max: 0.6 }; 3];

    fn motion(action: Action) -> Motion {
        let mut motion = Motion::new(Header {
            name: text("trial"),
            stages: [text("rest"), text("slow")].into_iter().collect(),
            gain: [2.0; 3].into_iter().collect(),
        });
        motion.segments.push(Segment { stage: 1, action }).unwrap();
        motion
    }

    fn move_to(joints: JointSet, targets: &[f32]) -> Action {
        Action::MoveTo {
            joints,
            targets: targets.iter().copied().collect(),
            ceiling: Duty(1500),
            tolerance: 0.01,
            timeout_ms: 4000,
        }
    }

    fn chirp(from_hz: f32, to_hz: f32, spread: f32) -> Action {
        Action::Chirp {
            joints: JointSet::first(3),
            amplitude: Duty(9000),
            from_hz,
            to_hz,
            spread,
            centring: 0.5,
            duration_ms: 3000,
        }
    }

    fn sine(amplitude: f32) -> Action {
        Action::Sine {
            joints: JointSet::only(1),
            amplitude,
            frequency_hz: 0.3,
            spread: 0.0,
            ceiling: Duty(2000),
            duration_ms: 6000,
        }
    }

    #[test]
    fn every_kind_of_segment_can_be_valid() {
        for action in [
            Action::Zero { duration_ms: 3000 },
            Action::Hold { ceiling: Duty(1), duration_ms: MAX_SEGMENT_MS },
            move_to(JointSet::only(0).with(2), &[0.6, -0.6]),
            chirp(1.4, 10.0, 0.1),
            sine(0.6),
        ] {
            assert_eq!(motion(action.clone()).validate(&LIMITS), Ok(()), "{action:?}");
        }
    }

    #[test]
    fn every_rule_has_its_error() {
        let joint4 = JointSet::only(3);
        for (action, error) in [
            (Action::Zero { duration_ms: 0 }, MotionError::Duration { segment: 0, ms: 0 }),
            (
                Action::Zero { duration_ms: MAX_SEGMENT_MS + 1 },
                MotionError::Duration { segment: 0, ms: MAX_SEGMENT_MS + 1 },
            ),
            (
                Action::Hold { ceiling: Duty(10_001), duration_ms: 1 },
                MotionError::Ceiling { segment: 0, ceiling: Duty(10_001) },
            ),
            (move_to(joint4, &[0.1]), MotionError::Joints { segment: 0, joints: 3 }),
            (move_to(JointSet::EMPTY, &[]), MotionError::Joints { segment: 0, joints: 3 }),
            (move_to(JointSet::first(2), &[0.1]), MotionError::Targets { segment: 0, expected: 2, got: 1 }),
            (move_to(JointSet::only(1), &[0.61]), MotionError::OutsideLimits { segment: 0, joint: 1, position: 0.61 }),
            (sine(0.7), MotionError::OutsideLimits { segment: 0, joint: 1, position: 0.7 }),
            (sine(-0.1), MotionError::Value { segment: 0, value: -0.1 }),
            (chirp(0.0, 10.0, 0.0), MotionError::Frequency { segment: 0, hz: 0.0 }),
            (chirp(1.0, 80.0, 0.5), MotionError::Frequency { segment: 0, hz: 160.0 }),
        ] {
            assert_eq!(motion(action).validate(&LIMITS), Err(error));
        }
        for action in [move_to(JointSet::only(0), &[f32::NAN]), chirp(f32::NAN, 1.0, 0.0), sine(f32::INFINITY)] {
            assert!(motion(action.clone()).validate(&LIMITS).is_err(), "{action:?}");
        }
    }

    #[test]
    fn rules_of_the_whole_motion() {
        let good = motion(Action::Zero { duration_ms: MAX_SEGMENT_MS });
        let error = |change: fn(&mut Motion)| {
            let mut motion = good.clone();
            change(&mut motion);
            motion.validate(&LIMITS).unwrap_err()
        };
        assert_eq!(error(|m| m.segments.clear()), MotionError::Empty);
        assert_eq!(error(|m| m.segments[0].stage = 2), MotionError::Stage { segment: 0, stage: 2, stages: 2 });
        assert_eq!(error(|m| m.gain.truncate(2)), MotionError::Gains { got: 2, joints: 3 });
        assert_eq!(error(|m| m.gain[1] = -1.0), MotionError::Gain { joint: 1, gain: -1.0 });
        assert_eq!(
            error(|m| {
                let one = m.segments[0].clone();
                m.segments.extend(std::iter::repeat_n(one, 10));
            }),
            MotionError::TooLong { ms: 11 * MAX_SEGMENT_MS }
        );
    }

    #[test]
    fn the_checksum_sees_order_header_and_every_segment() {
        let mut one = motion(sine(0.1));
        one.segments.push(Segment { stage: 0, action: chirp(1.4, 10.0, 0.0) }).unwrap();
        let mut other = one.clone();
        other.segments.swap(0, 1);
        let mut renamed = one.clone();
        renamed.name = text("other");
        let sums = [one.checksum(), other.checksum(), renamed.checksum()];
        assert!(sums[0] != sums[1] && sums[0] != sums[2] && sums[1] != sums[2], "{sums:?}");
        assert_eq!(one.checksum(), one.clone().checksum());
    }

    #[test]
    fn a_motion_is_a_readable_file() {
        let mut motion = motion(Action::Zero { duration_ms: 3000 });
        for action in [move_to(JointSet::only(0).with(2), &[0.4, -0.4]), chirp(1.4, 10.0, 0.1), sine(0.2)] {
            motion.segments.push(Segment { stage: 1, action }).unwrap();
        }
        let file = toml::to_string(&motion).unwrap();
        assert!(file.contains("joints = [1, 3]") && file.contains("ceiling = 0.15"), "{file}");
        assert_eq!(toml::from_str::<Motion>(&file).unwrap(), motion);
        for (from, to) in [("[1, 3]", "[0, 3]"), ("0.15", "1.5"), ("from_hz", "form_hz")] {
            assert!(toml::from_str::<Motion>(&file.replace(from, to)).is_err(), "{to}");
        }
    }

    #[test]
    fn the_example_of_the_docs_is_a_motion() {
        let docs: String = include_str!("motion.rs")
            .lines()
            .skip_while(|l| *l != "//! ```toml")
            .skip(1)
            .take_while(|l| *l != "//! ```")
            .map(|l| l.trim_start_matches("//!").trim_start().to_owned() + "\n")
            .collect();
        let motion: Motion = toml::from_str(&docs).unwrap();
        assert_eq!(motion.validate(&LIMITS), Ok(()));
        assert_eq!(motion.segments.len(), 2);
    }
}
