//! The handshake: who speaks, in which version, with which scales.
//!
//! The host opens with [`Greeting`] and is answered with [`Hello`]. Both begin with bytes that never change, whatever
//! else does, so that a mismatch can be told with both sides printed:
//!
//! ```text
//!   Greeting:  0x00 │ protocol version varint │ schema key 8 bytes
//!   Hello:     0x00 │ protocol version varint │ schema key 8 bytes │ firmware version │ robot │ … the rest may change
//!                                                                    (length varint + UTF-8 each)
//! ```

use core::fmt;
use heapless::Vec;
use postcard_schema::{Schema, key::Key};
use serde::{Deserialize, Serialize};

use crate::{
    Descriptions, MAX_ENCODERS, MAX_GYROS, PROTOCOL_VERSION, Report, Sample, ToDevice, sample::Layout, units::Text,
};

/// A hash over the structure of every message.
#[derive(Clone, Copy, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct SchemaKey(pub [u8; 8]);

impl SchemaKey {
    /// The key of this build.
    pub const OURS: Self = Self(
        // One type that holds every message.
        Key::for_path::<(Report, Sample, ToDevice)>("flexible-joint-robot").to_bytes(),
    );
}

impl fmt::Display for SchemaKey {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:016x}", u64::from_be_bytes(self.0))
    }
}

impl fmt::Debug for SchemaKey {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "SchemaKey({self})")
    }
}

/// How a host introduces itself. Its bytes are frozen.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct Greeting {
    /// The host's [`PROTOCOL_VERSION`].
    pub protocol_version: u16,
    /// The host's [`SchemaKey`].
    pub schema_key: SchemaKey,
}

impl Greeting {
    /// The greeting of this build.
    pub const OURS: Self = Self { protocol_version: PROTOCOL_VERSION, schema_key: SchemaKey::OURS };
}

/// Who answers. Its bytes are frozen.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct Identity {
    /// The device's [`PROTOCOL_VERSION`].
    pub protocol_version: u16,
    /// The device's [`SchemaKey`].
    pub schema_key: SchemaKey,
    /// Version of the firmware, as in `0.1.0`.
    pub firmware_version: Text<24>,
    /// Name of the robot that the firmware runs, as in its description file.
    pub robot: Text<24>,
}

impl Identity {
    /// An identity that speaks as this build does.
    pub fn ours(firmware_version: &str, robot: &str) -> Self {
        Self {
            protocol_version: PROTOCOL_VERSION,
            schema_key: SchemaKey::OURS,
            firmware_version: crate::units::text(firmware_version),
            robot: crate::units::text(robot),
        }
    }

    /// Whether its messages mean what ours do.
    pub fn agrees(&self, greeting: &Greeting) -> bool {
        self.protocol_version == greeting.protocol_version && self.schema_key == greeting.schema_key
    }
}

/// Which side of the gear an encoder turns with.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub enum Side {
    /// The motor's shaft.
    Motor,
    /// The link, behind the elastic transmission.
    Link,
}

/// What an encoder's counts mean: joint position = 2π (counts − zero) / (`counts_per_turn` · `gear`).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct EncoderInfo {
    /// Index of the joint, from 0.
    pub joint: u8,
    /// Where it is mounted.
    pub side: Side,
    /// Counts in one turn of the shaft that it is mounted on, all edges counted; negative if it counts backwards.
    pub counts_per_turn: i32,
    /// Radians of that shaft per unit of the joint (rad, or m): the gear ratio on the motor's side, 1 on a rotary link.
    pub gear: f64,
    /// When it is read, µs after the tick's time.
    pub offset_us: u16,
}

/// What a gyro's words mean: angular rate = word · `rad_s_per_lsb`, in the sensor's own axes.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct GyroInfo {
    /// Index of the body that carries it: that of the joint that moves the body.
    pub body: u8,
    /// Size of one step, rad/s.
    pub rad_s_per_lsb: f64,
    /// A word at or beyond this size is saturated.
    pub saturated_at: u16,
    /// When it is read, µs after the tick's time.
    pub offset_us: u16,
    /// By how much its filter delays what changes slowly, µs, as far as the device knows; none if it does not.
    pub filter_delay_us: Option<u16>,
    /// Nominal conversions per second by the gyro's own clock; none if it converts when it is read.
    pub output_rate_hz: Option<u16>,
}

/// Why the device started last.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum ResetReason {
    /// Power came on.
    PowerOn,
    /// The reset pin.
    Pin,
    /// The supply fell too low.
    BrownOut,
    /// The watchdog: a task that must live did not check in.
    Watchdog,
    /// The software asked for it.
    Software,
    /// A panic; the handshake has its place.
    Panic,
    /// The hardware does not say.
    Unknown,
}

/// Where the firmware panicked last.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct PanicPlace {
    /// The end of the path of the source file.
    pub file: Text<40>,
    /// Line in it.
    pub line: u32,
}

/// The device's answer to a greeting.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct Hello {
    /// Who answers; frozen.
    pub identity: Identity,
    /// Numbers of joints, encoders and gyros in a sample.
    pub layout: Layout,
    /// Period of the tick, µs.
    pub tick_us: u16,
    /// Each encoder, in the sample's order.
    pub encoders: Vec<EncoderInfo, MAX_ENCODERS>,
    /// Each gyro, in the sample's order.
    pub gyros: Vec<GyroInfo, MAX_GYROS>,
    /// Counts of each encoder where its joint is at zero; none before "set zero".
    pub zero: Option<Vec<i32, MAX_ENCODERS>>,
    /// Why the device started last.
    pub reset: ResetReason,
    /// Where it panicked last, if it did and the place survived.
    pub panic: Option<PanicPlace>,
    /// Which description of a robot it runs, and which one it has stored.
    pub description: Descriptions,
    /// CRC-32 ([`crate::frame::crc32`]) over the program's code in flash (the section `.text`), by which a host tells
    /// whether a file is the program that runs; none where there is no such program.
    pub code_crc: Option<u32>,
}

/// A handshake that contradicts itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum HelloError {
    /// Lists of other lengths than the layout says.
    #[error("the device announces {announced} {what} but describes {described}")]
    Count {
        /// Encoders, gyros or zero positions.
        what: &'static str,
        /// By the layout.
        announced: usize,
        /// In the list.
        described: usize,
    },
    /// A scale that nothing can be computed with.
    #[error("encoder {index} (from 0) has a scale of zero or not a number")]
    EncoderScale {
        /// Which encoder.
        index: usize,
    },
    /// A scale that nothing can be computed with.
    #[error("gyro {index} (from 0) has a scale that is not positive")]
    GyroScale {
        /// Which gyro.
        index: usize,
    },
    /// A period of zero.
    #[error("the device announces a tick of 0 µs")]
    Tick,
    /// A sensor on a joint that is not there.
    #[error("a sensor sits on joint {joint} (from 0) of {joints}")]
    Joint {
        /// Where it claims to sit.
        joint: u8,
        /// How many there are.
        joints: usize,
    },
}

impl Hello {
    /// Looks whether the lists fit the layout and the scales can be computed with.
    ///
    /// # Errors
    /// [`HelloError`] with what does not fit.
    pub fn validate(&self) -> Result<(), HelloError> {
        let zero = self.zero.as_ref().map_or(self.layout.encoders(), |zero| zero.len());
        for (what, announced, described) in [
            ("encoders", self.layout.encoders(), self.encoders.len()),
            ("gyros", self.layout.gyros(), self.gyros.len()),
            ("zero positions", self.layout.encoders(), zero),
        ] {
            if announced != described {
                return Err(HelloError::Count { what, announced, described });
            }
        }
        if self.tick_us == 0 {
            return Err(HelloError::Tick);
        }
        let joints = self.layout.joints();
        for (index, encoder) in self.encoders.iter().enumerate() {
            if encoder.counts_per_turn == 0 || !encoder.gear.is_normal() {
                return Err(HelloError::EncoderScale { index });
            }
        }
        for (index, gyro) in self.gyros.iter().enumerate() {
            if !(gyro.rad_s_per_lsb.is_normal() && gyro.rad_s_per_lsb > 0.0) {
                return Err(HelloError::GyroScale { index });
            }
        }
        let on = self.encoders.iter().map(|e| e.joint);
        match on.chain(self.gyros.iter().map(|g| g.body)).find(|joint| usize::from(*joint) >= joints) {
            Some(joint) => Err(HelloError::Joint { joint, joints }),
            None => Ok(()),
        }
    }
}
