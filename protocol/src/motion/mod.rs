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

mod rules;
#[cfg(test)]
mod samples;

pub use rules::{Limits, MotionError};

use heapless::Vec;
use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

use crate::{
    MAX_JOINTS,
    frame::crc32_of,
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
    /// The named joints get new targets. Done when they have all stayed within the tolerance for 20 ms, or when the
    /// time is over.
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

impl Motion {
    /// No name, no segments.
    pub const EMPTY: Self = Self { name: Text::new(), stages: Vec::new(), gain: Vec::new(), segments: Vec::new() };

    /// A motion without segments yet.
    pub fn new(header: Header) -> Self {
        let Header { name, stages, gain } = header;
        Self { name, stages, gain, segments: Vec::new() }
    }

    /// All but the segments.
    pub fn header(&self) -> Header {
        Header { name: self.name.clone(), stages: self.stages.clone(), gain: self.gain.clone() }
    }

    /// How long the motion lasts if every move takes all of its time, ms.
    pub fn longest_ms(&self) -> u32 {
        self.segments.iter().fold(0, |ms, s| ms.saturating_add(s.action.longest_ms()))
    }

    /// The checksum of an upload: over the checksums of the header and of each segment as they are encoded.
    pub fn checksum(&self) -> u32 {
        let mut sum = self.header().checksum();
        for segment in &self.segments {
            sum = segment.checksum(sum);
        }
        sum
    }
}

impl Header {
    /// The checksum of a motion that has no segments yet.
    pub fn checksum(&self) -> u32 {
        checksum_of(self, 0)
    }
}

impl Segment {
    /// The checksum of a motion that had `so_far` before this segment.
    pub fn checksum(&self, so_far: u32) -> u32 {
        checksum_of(self, so_far)
    }
}

/// CRC-32 over the sum so far and the encoding of one part.
fn checksum_of<T: Serialize>(part: &T, so_far: u32) -> u32 {
    crc32_of(&so_far.to_le_bytes(), part)
}

#[cfg(test)]
mod tests {
    use super::samples::{LIMITS, chirp, motion, move_to, sine};
    use super::*;
    use crate::units::text;

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
        let docs: String = include_str!("mod.rs")
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
