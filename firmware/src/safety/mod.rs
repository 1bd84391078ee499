//! Safety: watches that stop a motion, and limits that lower a duty. Last before the pin; nothing here can raise one.
//!
//! ```text
//!   encoders ─▶ EncoderWatch ┐
//!   speeds ───▶ DriveWatch ──┤
//!   gyros ────▶ GyroWatch ───┤
//!   both ─────▶ RotationWatch┤
//!   clock ────▶ Deadline ────┼─▶ Fault ─▶ zero duty at once, latched until cleared
//!   host ─────▶ Heartbeat ───┤
//!   stop pin ────────────────┘
//!
//!   player ─▶ duty asked ─▶ JointLimits ─▶ duty allowed ─▶ pin
//! ```

mod deadline;
mod drive;
mod envelope;
mod heartbeat;
mod plausible;
mod rotation;

pub use deadline::{Deadline, OnTime};
pub use drive::{DriveBounds, DriveWatch};
pub use envelope::{JointLimits, Lowered};
pub use heartbeat::Heartbeat;
pub use plausible::{EncoderBounds, EncoderWatch, GyroBounds, GyroInput, GyroWatch, STILL_COUNTS, Verdict};
pub use rotation::{Axis, RotationWatch, Turn};
