//! The description of a robot as the firmware runs it: a value that the host sends and the device keeps in its flash.
//!
//! ```text
//!   host   Description ── encode ──▶ bytes ── DescriptionBegin · Piece … · End ──▶ device ── checks ──▶ flash, two copies
//!   device Hello::description: which one runs, and which one the next start runs, by sequence number and CRC-32
//! ```
//!
//! Host and firmware agree on the bytes by [`FORMAT`]: a copy that another version wrote is not read.

use heapless::Vec;
use postcard_schema::{Schema, key::Key};
use serde::{Deserialize, Serialize};

use crate::{
    MAX_ENCODERS, MAX_GYROS, MAX_JOINTS,
    frame::{crc32, crc32_of},
    hello::Side,
    motion::Limits,
    sample::LayoutError,
    units::{Duty, Text},
};

/// Longest encoded description, bytes: seven joints, fourteen encoders and two gyros take 784.
pub const MAX_DESCRIPTION_BYTES: usize = 800;
/// Most bytes of a description in one message.
pub const DESCRIPTION_PIECE: usize = 128;
/// Most pieces of a description.
pub const MAX_DESCRIPTION_PIECES: usize = MAX_DESCRIPTION_BYTES.div_ceil(DESCRIPTION_PIECE);

/// Names the structure of the encoded bytes: another [`Description`] has another format.
pub const FORMAT: u32 = {
    let key = Key::for_path::<Description>("robot-description").to_bytes();
    u32::from_le_bytes([key[0], key[1], key[2], key[3]])
};

/// What the firmware must know of a robot.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, Schema)]
pub struct Description {
    /// Name of the robot, as in its description file.
    pub robot: Text<24>,
    /// Its joints.
    pub joints: Vec<JointDescription, MAX_JOINTS>,
    /// Its encoders, in the sample's order.
    pub encoders: Vec<EncoderDescription, MAX_ENCODERS>,
    /// Its gyros, in the sample's order.
    pub gyros: Vec<GyroDescription, MAX_GYROS>,
}

/// How a joint moves the bodies that it carries.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub enum Axis {
    /// It turns them about this unit vector, in axes of the base, with all joints at zero; positive by the right hand.
    Turns([f32; 3]),
    /// It slides them, which no gyro sees.
    Slides,
}

/// A joint.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct JointDescription {
    /// Range, rad or m from the zero position.
    pub limits: Limits,
    /// How it moves the bodies that it carries.
    pub axis: Axis,
    /// Largest duty at which it may stand: friction holds it, and what gravity loads it with.
    pub standing_duty: Duty,
    /// Largest duty that safety lets pass.
    pub max_duty: Duty,
    /// Time constant of the speed at zero duty, s.
    pub coast_s: f32,
    /// Time for which its belt may hold the motor at a standstill against full duty, s.
    pub held_s: f32,
    /// By joint: torque that an acceleration of the joint's link puts on this joint, over this joint's torque at full
    /// duty, s². As many as there are joints.
    pub carried_s2: Vec<f32, MAX_JOINTS>,
}

/// An encoder. When it is read is the board's to know.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct EncoderDescription {
    /// Index of the joint, from 0.
    pub joint: u8,
    /// Where it is mounted.
    pub side: Side,
    /// Counts in one turn of the shaft that it is mounted on, all edges counted; negative if it counts backwards.
    pub counts_per_turn: i32,
    /// Radians of that shaft per unit of the joint (rad, or m).
    pub gear: f64,
}

/// A gyro. What its words mean follows from part and range, and is the board's to know.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct GyroDescription {
    /// The part that is read.
    pub part: GyroPart,
    /// Its full scale, °/s.
    pub range_dps: u16,
    /// Index of the body that carries it: that of the joint that moves the body.
    pub body: u8,
    /// Rotation that takes vectors in axes of the base, all joints at zero, to the gyro's own axes.
    pub mount: [[f32; 3]; 3],
    /// Angle by which the belts before it give way together while full duty accelerates the robot, rad.
    pub give_rad: f32,
    /// The same under gravity, from one pose to another, rad.
    pub sag_rad: f32,
}

/// A gyro that there is a driver for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema, thiserror::Error)]
pub enum GyroPart {
    /// TDK ICM-42688-P, on SPI.
    #[error("ICM-42688-P")]
    Icm42688p,
    /// Bosch BMI323, on I²C.
    #[error("BMI323")]
    Bmi323,
}

impl Description {
    /// Encodes it; returns the length. [`MAX_DESCRIPTION_BYTES`] are always enough.
    ///
    /// # Errors
    /// [`Unreadable`] if `out` is too small.
    pub fn encode(&self, out: &mut [u8]) -> Result<usize, Unreadable> {
        postcard::to_slice(self, out).map(|bytes| bytes.len()).map_err(|_| Unreadable)
    }

    /// Reads one; bytes left over are an error. What it describes is not looked at.
    ///
    /// # Errors
    /// [`Unreadable`] if it follows another format or is cut off.
    pub fn decode(bytes: &[u8]) -> Result<Self, Unreadable> {
        let mut description = Self::default();
        description.read(bytes)?;
        Ok(description)
    }

    /// Takes the place of this one, as [`Self::decode`] and item by item: nothing larger than an item is on the stack beside
    /// it.
    ///
    /// # Errors
    /// [`Unreadable`]; what this one holds then is of no use.
    pub fn read(&mut self, bytes: &[u8]) -> Result<(), Unreadable> {
        // Postcard writes the fields one after the other, and the number of items before a list.
        let (robot, rest) = postcard::take_from_bytes(bytes).map_err(|_| Unreadable)?;
        self.robot = robot;
        let rest = read_list(rest, &mut self.joints)?;
        let rest = read_list(rest, &mut self.encoders)?;
        let rest = read_list(rest, &mut self.gyros)?;
        if rest.is_empty() { Ok(()) } else { Err(Unreadable) }
    }

    /// CRC-32 over its encoded bytes.
    pub fn crc(&self) -> u32 {
        crc32_of(&[], self)
    }
}

/// Reads a list item by item; gives the bytes behind it.
fn read_list<'a, T: Deserialize<'a>, const N: usize>(
    bytes: &'a [u8],
    list: &mut Vec<T, N>,
) -> Result<&'a [u8], Unreadable> {
    list.clear();
    let (items, mut rest) = postcard::take_from_bytes::<u32>(bytes).map_err(|_| Unreadable)?;
    for _ in 0..items {
        let (item, behind) = postcard::take_from_bytes(rest).map_err(|_| Unreadable)?;
        // More items than there is room for end it.
        list.push(item).map_err(|_| Unreadable)?;
        rest = behind;
    }
    Ok(rest)
}

/// Bytes that are no description of this format.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("not a description of a robot in the format {FORMAT:08x}")]
pub struct Unreadable;

/// Which description it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct Stamp {
    /// One more with every description that the device stores; wraps.
    pub sequence: u32,
    /// CRC-32 over the encoded description.
    pub crc: [u8; 4],
}

impl Stamp {
    /// That of these encoded bytes.
    pub fn new(sequence: u32, bytes: &[u8]) -> Self {
        Self { sequence, crc: crc32(bytes).to_le_bytes() }
    }

    /// CRC-32 over the encoded description.
    pub fn crc(&self) -> u32 {
        u32::from_le_bytes(self.crc)
    }
}

/// Which descriptions a device has, told in the handshake.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct Descriptions {
    /// The stored one that runs; none if it is the one that is built in.
    pub running: Option<Stamp>,
    /// The stored one, which the next start runs if the firmware can; none if nothing is stored.
    pub stored: Option<Stamp>,
    /// Whether the board has a place to store one.
    pub can_store: bool,
}

/// A robot that the firmware cannot run, or not on this board. Everything counts from 0 here, from 1 in the texts.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema, thiserror::Error)]
pub enum DescriptionError {
    /// More or fewer joints, encoders or gyros than a sample can carry.
    #[error(transparent)]
    Layout(LayoutError),
    /// A joint has no encoder on its motor: nothing to control it by.
    #[error("joint {} has no encoder on its motor", joint + 1)]
    NoMotorEncoder {
        /// Which joint.
        joint: u8,
    },
    /// An encoder on a joint that is not there.
    #[error("encoder {} sits on a joint that is not there", encoder + 1)]
    NoSuchJoint {
        /// Which encoder.
        encoder: u8,
    },
    /// Fewer than 1 or more than 10⁸ counts for a rad or m, or not a number.
    #[error("encoder {} gives less than 1 or more than 1e8 counts for a rad or m", encoder + 1)]
    Scale {
        /// Which encoder.
        encoder: u8,
    },
    /// A step of a gyro's words that is not positive, not a number, or beyond 1 rad/s.
    #[error("a step of gyro {} is no rate from 0 to 1 rad/s", gyro + 1)]
    GyroScale {
        /// Which gyro.
        gyro: u8,
    },
    /// A gyro on a body that is not there.
    #[error("gyro {} sits on a body that is not there", gyro + 1)]
    NoSuchBody {
        /// Which gyro.
        gyro: u8,
    },
    /// A mount whose rows are no unit vectors.
    #[error("the mount of gyro {} is no rotation", gyro + 1)]
    Mount {
        /// Which gyro.
        gyro: u8,
    },
    /// An axis that is no unit vector.
    #[error("the axis of joint {} is no unit vector", joint + 1)]
    Axis {
        /// Which joint.
        joint: u8,
    },
    /// An angle by which belts give way that is negative, not a number, or beyond a turn.
    #[error("the angle by which the belts before gyro {} give way is not from 0 to 2 pi", gyro + 1)]
    Belts {
        /// Which gyro.
        gyro: u8,
    },
    /// What a joint carries, or the time for which its belt holds it, is negative or not a number, or there are more or
    /// fewer figures than joints.
    #[error("what joint {} carries, or how long its belt holds it, is no number from 0", joint + 1)]
    Carried {
        /// Which joint.
        joint: u8,
    },
    /// A range that is empty, not a number, or wider than 2²⁹ counts of its encoder on either side.
    #[error("the limits of joint {} are empty, or beyond what its encoder can count", joint + 1)]
    Limits {
        /// Which joint.
        joint: u8,
    },
    /// A duty limit that is not from 0 to 1.
    #[error("a duty limit of joint {} is not from 0 to 1", joint + 1)]
    Duty {
        /// Which joint.
        joint: u8,
    },
    /// A coasting time that is negative, not a number, or beyond ten seconds.
    #[error("the coasting time of joint {} is not from 0 to 10 s", joint + 1)]
    Coast {
        /// Which joint.
        joint: u8,
    },
    /// The board drives another number of motors.
    #[error("it has {described} joints, and the board drives {board} motors")]
    Motors {
        /// Joints described.
        described: u8,
        /// Motors of the board.
        board: u8,
    },
    /// The board reads another number of encoders.
    #[error("it has {described} encoders, and the board reads {board}")]
    Encoders {
        /// Encoders described.
        described: u8,
        /// Those of the board.
        board: u8,
    },
    /// The board reads an encoder of another joint, or on the other side of it, in this place.
    #[error("the board reads encoder {} on another joint or side", encoder + 1)]
    EncoderPlace {
        /// Which encoder.
        encoder: u8,
    },
    /// The board reads fewer gyros.
    #[error("it has {described} gyros, and the board reads {board}")]
    Gyros {
        /// Gyros described.
        described: u8,
        /// Those of the board.
        board: u8,
    },
    /// The board reads another part in this place.
    #[error("gyro {} is a {described}, and the board reads one of type {board} there", gyro + 1)]
    GyroPart {
        /// Which gyro.
        gyro: u8,
        /// The part described.
        described: GyroPart,
        /// The board's.
        board: GyroPart,
    },
    /// The firmware sets this gyro to another range.
    #[error("gyro {} has a range of {described} deg/s, and the firmware sets it to {board}", gyro + 1)]
    GyroRange {
        /// Which gyro.
        gyro: u8,
        /// The range described, °/s.
        described: u16,
        /// The firmware's, °/s.
        board: u16,
    },
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::units::text;
    use proptest::prelude::*;

    /// The largest that there can be.
    fn largest() -> Description {
        let joint = JointDescription {
            limits: Limits { min: f32::MIN, max: f32::MAX },
            axis: Axis::Turns([f32::MAX; 3]),
            standing_duty: Duty(i16::MIN),
            max_duty: Duty(i16::MIN),
            coast_s: f32::MAX,
            held_s: f32::MAX,
            carried_s2: [f32::MAX; MAX_JOINTS].into_iter().collect(),
        };
        let encoder = EncoderDescription { joint: 255, side: Side::Link, counts_per_turn: i32::MIN, gear: f64::MAX };
        let mount = [[f32::MAX; 3]; 3];
        let gyro = GyroDescription {
            part: GyroPart::Bmi323,
            range_dps: u16::MAX,
            body: 255,
            mount,
            give_rad: f32::MAX,
            sag_rad: f32::MAX,
        };
        Description {
            robot: text(&"r".repeat(24)),
            joints: (0..MAX_JOINTS).map(|_| joint.clone()).collect(),
            encoders: [encoder; MAX_ENCODERS].into_iter().collect(),
            gyros: [gyro; MAX_GYROS].into_iter().collect(),
        }
    }

    #[test]
    fn the_largest_fits_and_comes_back() {
        let mut out = [0; MAX_DESCRIPTION_BYTES];
        let n = largest().encode(&mut out).unwrap();
        assert_eq!(n, 784);
        assert_eq!(Description::decode(&out[..n]), Ok(largest()));
        assert_eq!(largest().crc(), crc32(&out[..n]));
        assert_eq!(Stamp::new(3, &out[..n]).crc(), largest().crc());
        assert_eq!(largest().encode(&mut out[..n - 1]), Err(Unreadable));
        for cut in 0..n {
            assert_eq!(Description::decode(&out[..cut]), Err(Unreadable), "{cut}");
        }
    }

    /// The format on the wire and in the flash: if this changes, older copies are not read, and the change must be meant.
    #[test]
    fn the_format_is_the_golden_one() {
        assert_eq!(format!("{FORMAT:08x}"), "bb1c5ef9");
    }

    proptest! {
        #[test]
        fn any_bytes_are_survived(bytes in prop::collection::vec(any::<u8>(), 0..=MAX_DESCRIPTION_BYTES)) {
            let as_a_whole = match postcard::take_from_bytes::<Description>(&bytes) {
                Ok((description, [])) => Ok(description),
                _ => Err(Unreadable),
            };
            prop_assert_eq!(format!("{:?}", Description::decode(&bytes)), format!("{as_a_whole:?}"));
        }

        /// Item by item reads what the derived code reads, also where bytes are changed.
        #[test]
        fn changed_bytes_are_read_alike(place in 0..784_usize, byte: u8) {
            let mut bytes = [0; MAX_DESCRIPTION_BYTES];
            let n = largest().encode(&mut bytes).unwrap();
            bytes[place] = byte;
            let as_a_whole = match postcard::take_from_bytes::<Description>(&bytes[..n]) {
                Ok((description, [])) => Ok(description),
                _ => Err(Unreadable),
            };
            // As text: not-a-number equals nothing.
            prop_assert_eq!(format!("{:?}", Description::decode(&bytes[..n])), format!("{as_a_whole:?}"));
        }
    }
}
