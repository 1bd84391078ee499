//! The rules of a motion. Host and firmware check the same ones: the host before an upload, the device after it.

use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

use super::{Action, MAX_FREQUENCY_HZ, MAX_MOTION_MS, MAX_SEGMENT_MS, Motion, Segment};
use crate::{
    MAX_JOINTS,
    units::{Duty, JointSet},
};

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
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct Limits {
    /// Lower end.
    pub min: f32,
    /// Upper end.
    pub max: f32,
}

impl Motion {
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
            segment.validate(index, self.stages.len(), joints)?;
        }
        self.validate_length()
    }

    /// Checks that it does not last too long.
    ///
    /// # Errors
    /// [`MotionError::TooLong`].
    pub fn validate_length(&self) -> Result<(), MotionError> {
        match self.longest_ms() {
            ms if ms > MAX_MOTION_MS => Err(MotionError::TooLong { ms }),
            _ => Ok(()),
        }
    }
}

impl Segment {
    /// Checks the rules of one segment, with its index, in a motion of so many stages.
    ///
    /// # Errors
    /// [`MotionError`] with what is wrong.
    pub fn validate(&self, index: u8, stages: usize, joints: &[Limits]) -> Result<(), MotionError> {
        if usize::from(self.stage) >= stages {
            return Err(MotionError::Stage { segment: index, stage: self.stage, stages: stages as u8 });
        }
        self.action.validate(index, joints)
    }
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
    use super::super::samples::{LIMITS, chirp, motion, move_to, sine};
    use super::*;

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
}
