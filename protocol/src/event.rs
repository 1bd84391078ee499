//! What the device reports unasked: losses, events, faults.

use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

use crate::{hello::ResetReason, units::MotionId};

/// Why the device dropped samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub enum LossCause {
    /// The telemetry queue was full: the line was too slow, or the transmitter took no more.
    QueueFull,
}

/// Samples that the device dropped, reported when there is room again.
///
/// A report can be lost on the line like any frame; `total` makes up for it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct Loss {
    /// Why.
    pub cause: LossCause,
    /// Samples dropped in this run of losses.
    pub count: u32,
    /// Number of the first tick dropped.
    pub first_seq: u32,
    /// All samples dropped, for whatever cause, since the stream was switched on.
    pub total: u32,
}

/// Something that happened, with the tick in which it did.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct Event {
    /// Number of the tick.
    pub seq: u32,
    /// Device time, µs; wraps.
    pub t_us: u32,
    /// What happened.
    pub kind: EventKind,
}

/// What can happen.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub enum EventKind {
    /// The device started. Told once after a reset, stream or no stream.
    Started(ResetReason),
    /// The zero positions were set; a new handshake tells them.
    ZeroSet,
    /// The first tick of a motion.
    MotionStarted(MotionId),
    /// A move did not arrive in its time; the motion went on.
    MoveTimedOut {
        /// Index of the segment.
        segment: u8,
    },
    /// A motion ended; the duty is zero.
    MotionEnded {
        /// Which motion.
        motion: MotionId,
        /// Why it ended.
        end: MotionEnd,
    },
    /// A fault was latched; the duty is zero until it is cleared.
    FaultRaised(Fault),
    /// The fault was cleared.
    FaultCleared,
    /// A jog ended; the duty is zero.
    JogEnded {
        /// Index of the joint, from 0.
        joint: u8,
        /// Why it ended.
        end: MotionEnd,
    },
}

/// Why a motion ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub enum MotionEnd {
    /// Its last segment was done.
    Finished,
    /// The host asked for a stop.
    Stopped,
    /// A fault stopped it.
    Fault(Fault),
}

/// What stops every motion and stays until cleared. Indices are from 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema, thiserror::Error)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Fault {
    /// No heartbeat for 100 ms of device time.
    #[error("the host's heartbeats stayed away")]
    HeartbeatLost,
    /// The emergency stop was pressed.
    #[error("emergency stop")]
    EmergencyStop,
    /// A joint is beyond its end.
    #[error("joint {} is beyond its limit", joint + 1)]
    JointLimit {
        /// Which joint.
        joint: u8,
    },
    /// An encoder moved further in one tick than the robot can.
    #[error("encoder {} jumped", encoder + 1)]
    EncoderJump {
        /// Which encoder.
        encoder: u8,
    },
    /// An encoder gives no readings.
    #[error("encoder {} does not answer", encoder + 1)]
    EncoderStale {
        /// Which encoder.
        encoder: u8,
    },
    /// A gyro gives no new readings.
    #[error("gyro {} does not answer", gyro + 1)]
    GyroStale {
        /// Which gyro.
        gyro: u8,
    },
    /// A gyro gives the same words again and again.
    #[error("gyro {} is stuck at one reading", gyro + 1)]
    GyroStuck {
        /// Which gyro.
        gyro: u8,
    },
    /// A gyro's reading is beyond what the robot can do.
    #[error("gyro {} is out of range", gyro + 1)]
    GyroRange {
        /// Which gyro.
        gyro: u8,
    },
    /// A sensor's bus hangs.
    #[error("the bus of gyro {} hangs", gyro + 1)]
    BusHang {
        /// The gyro on that bus.
        gyro: u8,
    },
    /// The tick took longer than its period.
    #[error("the control loop overran its period")]
    Overrun,
    /// The supply is too low.
    #[error("the supply is too low")]
    BrownOut,
    /// An encoder's count stands still while its motor is driven.
    #[error("encoder {} is stuck while its motor is driven", encoder + 1)]
    EncoderStuck {
        /// Which encoder.
        encoder: u8,
    },
    /// The processor's crystal is broken or not the one that the firmware was built for.
    #[error(
        "the crystal of the board is broken or another one than the firmware was built for: see the firmware's log (--elf)"
    )]
    Clock,
    /// A joint goes the other way than its motor drives it.
    #[error("joint {} goes against its duty: encoder or motor wires are swapped", joint + 1)]
    WrongWay {
        /// Which joint.
        joint: u8,
    },
    /// A gyro measures another rotation than the encoders of the joints that carry it.
    #[error("gyro {} measures another rotation than the encoders: counts are lost, or a gear, a count per turn or an axis is wrong", gyro + 1)]
    RotationMismatch {
        /// Which gyro.
        gyro: u8,
    },
}
