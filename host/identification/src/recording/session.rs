//! What surrounds the samples of a recording: where it comes from, what was played, what happened, what was lost.

use std::path::PathBuf;

use serde::{Deserialize, Serialize};

use crate::robot::Robot;

/// What is known before the first sample. It stands first in a file, so that nothing can cut it off.
#[derive(Debug, Clone, PartialEq)]
pub struct Session {
    /// The robot, with the text of its description.
    pub robot: Robot,
    /// The motion that is played.
    pub motion: Option<MotionFile>,
    /// Angle of each encoder (motor encoders, then link encoders, in channel order) where it was switched on, that was
    /// taken off to give absolute angles, rad or m; empty if the angles came as absolute ones.
    pub zero_rad: Vec<f64>,
    /// The handshake of the device.
    pub firmware: Option<Firmware>,
    /// What the device tells of each gyro's own clock and filter; empty if it tells nothing, as tables and older recordings do.
    pub gyro_times: Vec<GyroTime>,
    /// Mean time between rows of an imported table, s; of others the robot's period counts.
    pub period_s: Option<f64>,
    /// The table or bag that was imported.
    pub imported_from: Option<Source>,
}

impl Session {
    /// A session of which nothing but the robot is known.
    pub fn of(robot: Robot) -> Self {
        Self {
            robot,
            motion: None,
            zero_rad: Vec::new(),
            firmware: None,
            gyro_times: Vec::new(),
            period_s: None,
            imported_from: None,
        }
    }
}

/// When a gyro reads what it tells, as far as the device knows.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct GyroTime {
    /// By how much its filter delays what changes slowly, µs; nothing is known if left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub filter_delay_us: Option<f64>,
    /// Nominal conversions per second by its own clock; it converts when it is read if left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub output_rate_hz: Option<f64>,
}

impl GyroTime {
    /// Of every gyro of a device; empty if it tells nothing of any.
    pub fn of(gyros: &[protocol::GyroInfo]) -> Vec<Self> {
        let tells = |gyro: &protocol::GyroInfo| gyro.filter_delay_us.is_some() || gyro.output_rate_hz.is_some();
        if !gyros.iter().any(tells) {
            return Vec::new();
        }
        let of = |gyro: &protocol::GyroInfo| GyroTime {
            filter_delay_us: gyro.filter_delay_us.map(f64::from),
            output_rate_hz: gyro.output_rate_hz.map(f64::from),
        };
        gyros.iter().map(of).collect()
    }
}

/// The robot of a device that tells this of its gyros: real ones have a lag that no data sheet tells all of.
pub(super) fn suited(robot: Robot, gyro_times: &[GyroTime]) -> Robot {
    if gyro_times.is_empty() { robot } else { robot.with_free_lags() }
}

/// A file that data came from.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Source {
    /// As the user named it.
    pub path: PathBuf,
    /// SHA-256 of its bytes, lower-case hexadecimal.
    pub sha256: String,
}

/// A motion as it was uploaded.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct MotionFile {
    /// Name of the preset or file.
    pub name: String,
    /// Text of the motion file; [`Recording::phase`](super::Recording::phase) counts its segments.
    pub toml: String,
}

/// Versions of the device, from its handshake.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Firmware {
    /// Version of the firmware.
    pub version: String,
    /// Version of the protocol.
    pub protocol_version: u16,
    /// Hash over the structure of every message.
    pub schema_key: String,
    /// Name of the robot that the firmware was built for.
    pub robot: String,
    /// What ended the device's life before this one, if it was not an ordinary start: a watchdog, a panic and its
    /// place, a supply that fell too low.
    #[serde(default)]
    pub restarted_by: Option<String>,
    /// Whatever else the handshake said and a reader may want (scales, offsets, reason of the last reset), as text.
    #[serde(default)]
    pub details: String,
}

/// How much something matters.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Severity {
    /// Worth knowing.
    Note,
    /// The result will be worse than it could be.
    Warning,
    /// Unusable.
    Error,
}

impl Severity {
    /// As results and files spell it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Note => "note",
            Self::Warning => "warning",
            Self::Error => "error",
        }
    }

    pub(super) fn of_name(name: &str) -> Option<Self> {
        [Self::Note, Self::Warning, Self::Error].into_iter().find(|severity| severity.name() == name)
    }
}

/// Something that happened during the recording, said by the device or by the host.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Event {
    /// Device time (unwrapped), µs.
    pub t_us: u64,
    /// Number of the tick (unwrapped).
    pub seq: u64,
    /// How much it matters.
    pub severity: Severity,
    /// What happened, for people.
    pub text: String,
}

/// Where the missing samples went. Exact when the device's own count was received at the end.
///
/// `missing = device_dropped + host_dropped + line_lost`
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LossBalance {
    /// Ticks of the stream, sent or not.
    pub ticks: u64,
    /// Samples that arrived.
    pub received: u64,
    /// Sequence numbers that never arrived.
    pub missing: u64,
    /// Of these, dropped by the device (its own count).
    pub device_dropped: u64,
    /// Of these, dropped by the host's queue.
    pub host_dropped: u64,
    /// The rest: lost on the line.
    pub line_lost: u64,
    /// Frames, samples or not, that arrived damaged since the port was opened, and were thrown away.
    pub damaged_frames: u64,
    /// Whether the device's closing count was received; if not, `device_dropped` is what it had told until then.
    pub closed: bool,
}
