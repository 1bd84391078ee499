//! What a device tells, in words for the recording and the terminal.

use protocol::message::Level;
use protocol::{EventKind, Hello, Loss, LossCause, MotionEnd, ResetReason};

use super::reset_name;
use crate::recording::{Firmware, Severity};

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
    }
}

/// A loss that the device reports.
pub(super) fn loss(loss: &Loss) -> (Severity, String) {
    let cause = match loss.cause {
        LossCause::QueueFull => "its telemetry queue was full",
        LossCause::Transmitter => "its transmitter failed",
    };
    (Severity::Warning, format!("device dropped {} samples from tick {}: {cause}", loss.count, loss.first_seq))
}

/// How grave a line of the device's log is.
pub(super) fn level(level: Level) -> Severity {
    match level {
        Level::Error => Severity::Error,
        Level::Warn => Severity::Warning,
        Level::Info | Level::Debug => Severity::Note,
    }
}

/// The handshake as a recording keeps it.
pub(super) fn firmware(hello: &Hello) -> Firmware {
    let identity = &hello.identity;
    Firmware {
        version: identity.firmware_version.as_str().to_owned(),
        protocol_version: identity.protocol_version,
        schema_key: identity.schema_key.to_string(),
        robot: identity.robot.as_str().to_owned(),
        // A handshake has no map with keys that JSON could refuse.
        details: serde_json::to_string(hello).unwrap_or_default(),
    }
}
