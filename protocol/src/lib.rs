//! What firmware and host agree on: messages, framing, schema key, link budget.
//!
//! One frame on the line:
//!
//! ```text
//!   ┌────── COBS: no 0x00 inside ───────┐
//!   │ tag │ body              │ CRC-32  │ 0x00
//!   └─────┴───────────────────┴─────────┘
//!   1 byte  ≤ 519 bytes         4 bytes   delimiter
//!           ╰── the payload is tag + body; the CRC covers every byte of it, low byte first
//! ```
//!
//! Device → host ([`ToHost`]):
//!
//! | tag | message | when |
//! |---|---|---|
//! | `0x53` | [`Sample`] | every tick while the stream is on; fixed width, see [`sample`] |
//! | 0 | [`Hello`] | answers [`ToDevice::Hello`] |
//! | 1 | [`Report::Accepted`] | a request was carried out |
//! | 2 | [`Report::Refused`] | a request was not, with the [`Refusal`] |
//! | 3 | [`Report::HeartbeatSeen`] | answers [`ToDevice::Heartbeat`] |
//! | 4 | [`Status`] | answers [`Command::Status`], before its acknowledgement |
//! | 5 | [`Loss`] | samples that the device itself dropped |
//! | 6 | [`Event`] | a reset, a motion's start and end, a fault |
//! | 7 | [`Report::Log`] | a line of text |
//! | 8 | [`Report::Defmt`] | bytes of the log, a defmt stream; only between samples |
//!
//! Host → device ([`ToDevice`]):
//!
//! | tag | message | answered by |
//! |---|---|---|
//! | 0 | [`ToDevice::Hello`] | [`Hello`], whatever versions the host has |
//! | 1 | [`ToDevice::Heartbeat`] | [`Report::HeartbeatSeen`] |
//! | 2 | [`ToDevice::Request`] with a [`Command`] | [`Report::Accepted`] or [`Report::Refused`] with the same id |
//!
//! Every message but the sample is encoded by postcard. The sample has a fixed width, so its time on the line is
//! the same whatever the robot does, and its length is one more check.
//!
//! Principles:
//! * Raw codes on the wire (counts, words, duty steps), SI on the host; the handshake carries the scales.
//! * A message is either whole and right or counted as damaged; nothing in between reaches a reader.
//! * Every size is bounded at compile time; no allocation, no `unsafe`, no panic on any input.
//! * The line may lose anything at any time. A request is repeated under the same id until it is answered, and a
//!   device acts on it once ([`request::Memory`]), unless it may be done twice, as a stop or a part of an upload.
//! * Every tick has a number, sent or not, so that loss is counted and never guessed ([`sample::Sample::seq`]).
//!
//! ```
//! use protocol::{Command, ToDevice, frame::Decoder, message};
//!
//! let mut bytes = [0; message::MAX_TO_DEVICE_FRAME];
//! let n = message::write_to_device(&ToDevice::Request { id: 7, command: Command::Stop }, &mut bytes)?;
//! let mut decoder = Decoder::<{ message::MAX_TO_DEVICE_PAYLOAD + 4 }>::new();
//! for byte in &bytes[..n] {
//!     if let Some(payload) = decoder.feed(*byte) {
//!         let message = message::read_to_device(payload.unwrap()).unwrap();
//!         assert_eq!(message, ToDevice::Request { id: 7, command: Command::Stop });
//!     }
//! }
//! # Ok::<(), message::WriteError>(())
//! ```
#![cfg_attr(not(test), no_std)]
#![forbid(unsafe_code)]

pub mod budget;
pub mod clock;
pub mod description;
pub mod event;
pub mod frame;
pub mod hello;
pub mod message;
pub mod motion;
pub mod request;
pub mod sample;
pub mod units;

pub use description::{Description, DescriptionError, Descriptions};
pub use event::{Event, EventKind, Fault, Loss, LossCause, MotionEnd};
pub use hello::{EncoderInfo, GyroInfo, Hello, Identity, ResetReason, Side};
pub use message::{Report, ToDevice, ToHost};
pub use motion::{Action, Motion, MotionError, Segment};
pub use request::{Command, Refusal, State, Status};
pub use sample::{Flags, GyroAge, Layout, Sample};
pub use units::{Duty, JointSet, MotionId, Text};

/// The version of this protocol: raised when the meaning of bytes changes in a way that the schema key cannot see.
pub const PROTOCOL_VERSION: u16 = 1;

/// Most joints of a robot.
pub const MAX_JOINTS: usize = 7;
/// Most encoders: one on the motor's and one on the link's side of every joint.
pub const MAX_ENCODERS: usize = 2 * MAX_JOINTS;
/// Most gyroscopes, three axes each.
pub const MAX_GYROS: usize = 2;
