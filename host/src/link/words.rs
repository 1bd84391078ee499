//! What a device tells, in words for the recording and the terminal.

use protocol::message::Level;
use protocol::{EventKind, Hello, Loss, LossCause, MotionEnd, ResetReason};

use super::reset_name;
use crate::recording::{Firmware, LogLevel, Severity};

/// Text of a device as it is printed: control characters, which a terminal would obey, are escaped.
pub fn printable(text: &str) -> String {
    text.chars().flat_map(|c| if c.is_control() { c.escape_default().collect() } else { vec![c] }).collect()
}

/// An event.
pub(super) fn event(kind: &EventKind) -> (Severity, String) {
    match kind {
        EventKind::Started(reason) => {
            let severity = match reason {
                ResetReason::PowerOn | ResetReason::Pin | ResetReason::Software => Severity::Note,
                ResetReason::BrownOut | ResetReason::Watchdog | ResetReason::Panic | ResetReason::Unknown => {
                    Severity::Warning
                }
            };
            (severity, format!("device started: {}", reset_name(*reason)))
        }
        EventKind::ZeroSet => (Severity::Note, "zero positions set".to_owned()),
        EventKind::MotionStarted(_) => (Severity::Note, "motion started".to_owned()),
        EventKind::MoveTimedOut { segment } => {
            (Severity::Warning, format!("segment {segment}: the move did not arrive in its time"))
        }
        EventKind::MotionEnded { end, .. } => match end {
            MotionEnd::Finished => (Severity::Note, "motion finished".to_owned()),
            MotionEnd::Stopped => (Severity::Warning, "motion stopped by the host".to_owned()),
            MotionEnd::Fault(fault) => (Severity::Error, format!("motion stopped: {fault}")),
        },
        EventKind::FaultRaised(fault) => (Severity::Error, format!("fault: {fault}")),
        EventKind::FaultCleared => (Severity::Note, "fault cleared".to_owned()),
        EventKind::JogEnded { joint, end } => {
            let joint = joint + 1;
            match end {
                MotionEnd::Finished => (Severity::Note, format!("jog of joint {joint} over")),
                MotionEnd::Stopped => (Severity::Note, format!("jog of joint {joint} stopped by the host")),
                MotionEnd::Fault(fault) => (Severity::Error, format!("jog of joint {joint} stopped: {fault}")),
            }
        }
    }
}

/// A loss that the device reports.
pub(super) fn loss(loss: &Loss) -> (Severity, String) {
    let cause = match loss.cause {
        LossCause::QueueFull => "its telemetry queue was full",
    };
    (Severity::Warning, format!("device dropped {} samples from tick {}: {cause}", loss.count, loss.first_seq))
}

/// How grave a line of the device's log is.
pub(super) fn level(level: Level) -> LogLevel {
    match level {
        Level::Error => LogLevel::Error,
        Level::Warn => LogLevel::Warn,
        Level::Info => LogLevel::Info,
        Level::Debug => LogLevel::Debug,
    }
}

/// An end of the device's last life that was not ordinary.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Restart {
    /// By what it was restarted, with the place of a panic.
    pub by: String,
    /// What the user can do about it.
    pub advice: &'static str,
}

/// Why the device started last, if it was not switched on, reset by its pin or by a request.
pub fn restart(hello: &Hello) -> Option<Restart> {
    let (by, advice) = match hello.reset {
        ResetReason::PowerOn | ResetReason::Pin | ResetReason::Software | ResetReason::Unknown => return None,
        ResetReason::BrownOut => (
            "a supply that fell too low".to_owned(),
            "check battery, cable and plug: under load the voltage breaks down",
        ),
        ResetReason::Watchdog => (
            "its watchdog: a task of the firmware hung".to_owned(),
            "motors were off meanwhile; --elf shows what the firmware logged, and its next version must not hang",
        ),
        ResetReason::Panic => {
            let place = hello.panic.as_ref().map(|place| format!(" at {}:{}", printable(&place.file), place.line));
            let by =
                format!("a panic of the firmware{}", place.unwrap_or_else(|| ", its place is not known".to_owned()));
            (by, "motors were off meanwhile; that place in the firmware's source has a fault")
        }
    };
    Some(Restart { by, advice })
}

/// The handshake as a recording keeps it.
pub(super) fn firmware(hello: &Hello) -> Firmware {
    let identity = &hello.identity;
    Firmware {
        version: printable(&identity.firmware_version),
        protocol_version: identity.protocol_version,
        schema_key: identity.schema_key.to_string(),
        robot: printable(&identity.robot),
        restarted_by: restart(hello).map(|restart| restart.by),
        // A handshake has no map with keys that JSON could refuse.
        details: serde_json::to_string(hello).unwrap_or_default(),
    }
}
