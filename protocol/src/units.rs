//! Raw quantities that cross the wire, each with its unit in its type.

use core::fmt;
use postcard_schema::{
    Schema,
    schema::{DataModelType, NamedType},
};
use serde::{Deserialize, Deserializer, Serialize, Serializer, de, ser::SerializeSeq};

use crate::MAX_JOINTS;

/// A text of at most `N` bytes.
pub type Text<const N: usize> = heapless::String<N>;

/// Cuts a text to its first `N` bytes, at a character boundary.
pub fn text<const N: usize>(s: &str) -> Text<N> {
    let mut end = s.len().min(N);
    while !s.is_char_boundary(end) {
        end -= 1;
    }
    let mut out = Text::new();
    // `end` ≤ N, so the text fits; were it not so, the result would be empty.
    let _ = out.push_str(&s[..end]);
    out
}

/// A PWM duty in steps of 10⁻⁴: −10,000 is full backward, 10,000 full forward.
///
/// In a file for people it is the fraction, −1.0 … 1.0.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct Duty(pub i16);

impl Duty {
    /// No voltage on the motor.
    pub const ZERO: Self = Self(0);
    /// Steps of a full duty.
    pub const FULL: i16 = 10_000;

    /// The nearest duty to a fraction, limited to −1 … 1; not-a-number is zero.
    pub fn from_fraction(fraction: f32) -> Self {
        let steps = fraction.clamp(-1.0, 1.0) * f32::from(Self::FULL);
        // Adding half a step away from zero and cutting rounds to the nearest; the cast of a NaN is 0.
        Self((steps + if steps < 0.0 { -0.5 } else { 0.5 }) as i16)
    }

    /// The duty as a fraction, −1.0 … 1.0.
    pub fn fraction(self) -> f32 {
        f32::from(self.0) / f32::from(Self::FULL)
    }

    /// The duty kept within `ceiling` on both sides.
    pub fn limited_to(self, ceiling: Self) -> Self {
        let ceiling = ceiling.0.saturating_abs();
        Self(self.0.clamp(-ceiling, ceiling))
    }
}

impl Serialize for Duty {
    fn serialize<S: Serializer>(&self, s: S) -> Result<S::Ok, S::Error> {
        if s.is_human_readable() { s.serialize_f32(self.fraction()) } else { s.serialize_i16(self.0) }
    }
}

impl<'de> Deserialize<'de> for Duty {
    fn deserialize<D: Deserializer<'de>>(d: D) -> Result<Self, D::Error> {
        if d.is_human_readable() {
            let fraction = f32::deserialize(d)?;
            if (-1.0..=1.0).contains(&fraction) {
                Ok(Self::from_fraction(fraction))
            } else {
                Err(de::Error::custom(format_args!("a duty of {fraction} is outside −1 … 1")))
            }
        } else {
            i16::deserialize(d).map(Self)
        }
    }
}

impl Schema for Duty {
    const SCHEMA: &'static NamedType = &NamedType { name: "Duty", ty: &DataModelType::NewtypeStruct(i16::SCHEMA) };
}

/// A set of joints. In a file for people it is a list of numbers from 1, as in `[1, 3]`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct JointSet(u8);

impl JointSet {
    /// No joint.
    pub const EMPTY: Self = Self(0);

    /// The joint of this index, from 0; beyond the last possible joint the set stays empty.
    pub const fn only(joint: usize) -> Self {
        Self::EMPTY.with(joint)
    }

    /// The first `n` joints.
    pub const fn first(n: usize) -> Self {
        let mut set = Self::EMPTY;
        let mut joint = 0;
        while joint < n {
            set = set.with(joint);
            joint += 1;
        }
        set
    }

    /// This set and the joint of this index, from 0; beyond the last possible joint the set is unchanged.
    pub const fn with(self, joint: usize) -> Self {
        if joint < MAX_JOINTS { Self(self.0 | 1 << joint) } else { self }
    }

    /// Whether the joint of this index is in the set.
    pub const fn contains(self, joint: usize) -> bool {
        joint < MAX_JOINTS && self.0 & 1 << joint != 0
    }

    /// How many joints are in the set.
    pub const fn len(self) -> usize {
        self.0.count_ones() as usize
    }

    /// Whether no joint is in the set.
    pub const fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// One more than the highest index in the set.
    pub const fn end(self) -> usize {
        (u8::BITS - self.0.leading_zeros()) as usize
    }

    /// The indices in the set, ascending, from 0.
    pub fn iter(self) -> impl Iterator<Item = usize> {
        (0..MAX_JOINTS).filter(move |joint| self.contains(*joint))
    }

    /// The place of a joint among those of the set, ascending.
    pub fn rank(self, joint: usize) -> Option<usize> {
        let below = (1u16 << joint.min(MAX_JOINTS)) - 1;
        self.contains(joint).then(|| (u16::from(self.0) & below).count_ones() as usize)
    }
}

impl Serialize for JointSet {
    fn serialize<S: Serializer>(&self, s: S) -> Result<S::Ok, S::Error> {
        if !s.is_human_readable() {
            return s.serialize_u8(self.0);
        }
        let mut list = s.serialize_seq(Some(self.len()))?;
        for joint in self.iter() {
            list.serialize_element(&(joint + 1))?;
        }
        list.end()
    }
}

impl<'de> Deserialize<'de> for JointSet {
    fn deserialize<D: Deserializer<'de>>(d: D) -> Result<Self, D::Error> {
        struct List;
        impl<'de> de::Visitor<'de> for List {
            type Value = JointSet;
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                write!(f, "a list of joint numbers from 1 to {MAX_JOINTS}")
            }
            fn visit_seq<A: de::SeqAccess<'de>>(self, mut list: A) -> Result<JointSet, A::Error> {
                let mut set = JointSet::EMPTY;
                while let Some(number) = list.next_element::<usize>()? {
                    let index = number.wrapping_sub(1);
                    if index >= MAX_JOINTS || set.contains(index) {
                        return Err(de::Error::custom(format_args!(
                            "joint {number} is not a number from 1 to {MAX_JOINTS}, or is named twice"
                        )));
                    }
                    set = set.with(index);
                }
                Ok(set)
            }
        }
        if d.is_human_readable() {
            return d.deserialize_seq(List);
        }
        let bits = u8::deserialize(d)?;
        if bits >> MAX_JOINTS == 0 {
            Ok(Self(bits))
        } else {
            Err(de::Error::custom("a set of joints with a bit beyond the last joint"))
        }
    }
}

impl Schema for JointSet {
    const SCHEMA: &'static NamedType = &NamedType { name: "JointSet", ty: &DataModelType::NewtypeStruct(u8::SCHEMA) };
}

/// The host's number for an uploaded motion; 0 stands for "no motion".
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct MotionId(pub u8);

impl MotionId {
    /// No motion.
    pub const NONE: Self = Self(0);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn duty_rounds_to_the_nearest_step_and_saturates() {
        for (fraction, steps) in [
            (0.0, 0),
            (0.15, 1500),
            (-0.9, -9000),
            (0.00005, 1),
            (-0.00004, 0),
            (3.0, 10_000),
            (f32::NEG_INFINITY, -10_000),
            (f32::NAN, 0),
        ] {
            assert_eq!(Duty::from_fraction(fraction), Duty(steps), "{fraction}");
        }
        assert_eq!(Duty(i16::MIN).limited_to(Duty(1500)), Duty(-1500));
        assert_eq!(Duty(900).limited_to(Duty(-1500)), Duty(900));
    }

    #[test]
    fn joint_sets_know_members_order_and_end() {
        let set = JointSet::only(4).with(1);
        assert_eq!(set.iter().collect::<Vec<_>>(), [1, 4]);
        assert_eq!((set.len(), set.end()), (2, 5));
        assert_eq!((set.rank(1), set.rank(4), set.rank(2)), (Some(0), Some(1), None));
        assert_eq!(set.rank(usize::MAX), None);
        assert_eq!(JointSet::first(3), JointSet::only(0).with(1).with(2));
        assert_eq!(JointSet::only(MAX_JOINTS), JointSet::EMPTY);
    }

    #[test]
    fn text_is_cut_between_characters() {
        assert_eq!(text::<8>("Doggy").as_str(), "Doggy");
        assert_eq!(text::<3>("aäö").as_str(), "aä");
        assert_eq!(text::<2>("aä").as_str(), "a");
    }
}
