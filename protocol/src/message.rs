//! The table of messages, and how each becomes a frame and back.
//!
//! The order of the variants is their tag on the wire; the crate's first page shows the table.

use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

use crate::{
    event::{Event, Loss},
    frame::{self, CRC_BYTES, MAX_PAYLOAD},
    hello::{Greeting, Hello, Identity},
    request::{Command, Heartbeat, Refusal, Status},
    sample::{self, Layout, MAX_SAMPLE_PAYLOAD, Sample, SampleError},
    units::Text,
};

/// Longest frame to the host.
pub const MAX_TO_HOST_FRAME: usize = frame::wire_len(MAX_PAYLOAD);
/// Most bytes of the log in one message.
pub const LOG_PIECE: usize = 64;
/// Longest frame of a sample, of the widest layout.
pub const MAX_SAMPLE_FRAME: usize = frame::wire_len(MAX_SAMPLE_PAYLOAD);
/// Longest payload to the device: its decoder needs [`CRC_BYTES`] more.
pub const MAX_TO_DEVICE_PAYLOAD: usize = 220;
/// Longest frame to the device.
pub const MAX_TO_DEVICE_FRAME: usize = frame::wire_len(MAX_TO_DEVICE_PAYLOAD);

/// Device → host.
#[derive(Clone, Debug, PartialEq)]
#[allow(clippy::large_enum_variant, reason = "no allocator to put the large one behind")]
pub enum ToHost {
    /// Of every tick, in its own fixed format.
    Sample(Sample),
    /// Everything else.
    Report(Report),
}

/// Device → host, all but the sample. A device writes a `Report<&Hello>`, so that the handshake, ten times as long as
/// anything else, is not copied.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Schema)]
#[allow(clippy::large_enum_variant, reason = "no allocator to put the large one behind")]
pub enum Report<H = Hello> {
    /// The answer to a greeting. Tag and first bytes are frozen.
    Hello(H),
    /// The request of this id was carried out.
    Accepted {
        /// Of the request.
        id: u8,
    },
    /// The request of this id was not carried out.
    Refused {
        /// Of the request.
        id: u8,
        /// Why.
        refusal: Refusal,
    },
    /// A heartbeat arrived.
    HeartbeatSeen {
        /// Of the heartbeat.
        count: u16,
        /// Device time at which it arrived, µs; wraps.
        t_us: u32,
    },
    /// Where the device stands.
    Status(Status),
    /// Samples that the device dropped.
    Loss(Loss),
    /// Something happened.
    Event(Event),
    /// A line of text for people.
    Log {
        /// How grave.
        level: Level,
        /// The line.
        text: Text<80>,
    },
    /// The next bytes of the firmware's log, a defmt stream.
    Defmt {
        /// How many bytes of it came before these; wraps. A jump tells what was lost on the line.
        at: u32,
        /// The bytes.
        bytes: heapless::Vec<u8, LOG_PIECE>,
    },
}

/// How grave a line of the log is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub enum Level {
    /// Something is broken.
    Error,
    /// Something is doubtful.
    Warn,
    /// Worth knowing.
    Info,
    /// For whoever looks for a fault.
    Debug,
}

/// Host → device.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Schema)]
#[allow(clippy::large_enum_variant, reason = "no allocator to put the large one behind")]
pub enum ToDevice {
    /// Who are you? Frozen.
    Hello(Greeting),
    /// The host lives.
    Heartbeat(Heartbeat),
    /// Do this, and answer with the id.
    Request {
        /// The same in every attempt of this request, another in the next.
        id: u8,
        /// What to do.
        command: Command,
    },
}

/// A message did not fit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the message does not fit a buffer of {room} bytes")]
pub struct WriteError {
    /// Length of the buffer given.
    pub room: usize,
}

/// Why an undamaged payload is no message.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ReadError {
    /// It follows no entry of the table: the other side speaks another version.
    #[error(
        "a message with tag {tag:#04x} and {len} bytes does not follow the table: do both sides have the same version?"
    )]
    Unknown {
        /// First byte.
        tag: u8,
        /// Length of the payload.
        len: usize,
    },
    /// A sample came before the handshake that announces its layout.
    #[error("a sample before the handshake")]
    SampleBeforeHello,
    /// Not the sample that the layout announces.
    #[error(transparent)]
    Sample(#[from] SampleError),
}

/// Frames a sample; returns the length, delimiter included. [`MAX_SAMPLE_FRAME`] bytes are always enough.
///
/// # Errors
/// [`WriteError`] if `out` is too small.
pub fn write_sample(sample: &Sample, layout: &Layout, out: &mut [u8]) -> Result<usize, WriteError> {
    let mut scratch = [0; MAX_SAMPLE_PAYLOAD + CRC_BYTES];
    let room = out.len();
    sample
        .write(layout, &mut scratch)
        .and_then(|len| frame::encode(&mut scratch, len, out).ok())
        .ok_or(WriteError { room })
}

/// Frames a report; returns the length, delimiter included. [`MAX_TO_HOST_FRAME`] bytes are always enough.
///
/// # Errors
/// [`WriteError`] if `out` is too small.
pub fn write_report(report: &Report, out: &mut [u8]) -> Result<usize, WriteError> {
    write(report, out, MAX_TO_HOST_FRAME)
}

/// Frames a report as a device has it; like [`write_report`].
///
/// # Errors
/// [`WriteError`] if `out` is too small.
pub fn write_own_report(report: &Report<&Hello>, out: &mut [u8]) -> Result<usize, WriteError> {
    write(report, out, MAX_TO_HOST_FRAME)
}

/// Frames a message to the device; returns the length, delimiter included. [`MAX_TO_DEVICE_FRAME`] bytes are always
/// enough.
///
/// # Errors
/// [`WriteError`] if `out` is too small.
pub fn write_to_device(message: &ToDevice, out: &mut [u8]) -> Result<usize, WriteError> {
    write(message, out, MAX_TO_DEVICE_FRAME)
}

/// No frame is longer than `most`, the reader's bound.
fn write(message: &impl Serialize, out: &mut [u8], most: usize) -> Result<usize, WriteError> {
    let room = out.len().min(most);
    frame::encode_value(message, &mut out[..room]).map_err(|_| WriteError { room })
}

/// Reads a payload from the device; `layout` is that of the handshake, if there was one.
///
/// # Errors
/// [`ReadError`]; the payload was not damaged, so sender and reader differ.
pub fn read_to_host(payload: &[u8], layout: Option<&Layout>) -> Result<ToHost, ReadError> {
    if payload.first() == Some(&sample::TAG) {
        let layout = layout.ok_or(ReadError::SampleBeforeHello)?;
        return Ok(ToHost::Sample(Sample::read(layout, payload)?));
    }
    read(payload).map(ToHost::Report)
}

/// Reads a payload from the host.
///
/// # Errors
/// [`ReadError`]; the payload was not damaged, so sender and reader differ.
#[inline(never)] // its copies of the message stay on the stack no longer than it runs
pub fn read_to_device(payload: &[u8]) -> Result<ToDevice, ReadError> {
    read(payload)
}

/// The frozen part of a [`Hello`], from a device of whatever version; `None` if the payload is not a hello.
pub fn peek_identity(payload: &[u8]) -> Option<Identity> {
    let (tag, rest) = payload.split_first()?;
    if *tag != 0 {
        return None;
    }
    postcard::take_from_bytes(rest).ok().map(|(identity, _)| identity)
}

/// The frozen [`Greeting`], from a host of whatever version; `None` if the payload is not a greeting.
pub fn peek_greeting(payload: &[u8]) -> Option<Greeting> {
    let (tag, rest) = payload.split_first()?;
    if *tag != 0 {
        return None;
    }
    postcard::take_from_bytes(rest).ok().map(|(greeting, _)| greeting)
}

/// Reads a whole payload; bytes left over are an error.
fn read<'a, T: Deserialize<'a>>(payload: &'a [u8]) -> Result<T, ReadError> {
    match postcard::take_from_bytes(payload) {
        Ok((message, [])) => Ok(message),
        _ => Err(ReadError::Unknown { tag: payload.first().copied().unwrap_or_default(), len: payload.len() }),
    }
}
