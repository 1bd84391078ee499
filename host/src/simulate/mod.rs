//! The simulated robot: plant, microcontroller running the firmware's control core, serial line with faults.
//!
//! ```text
//!                       ┌──────────── Board, a tick a millisecond ────────────┐
//! host ◀─ Pty ◀─ Line ◀─┤ ControlCore (firmware) ◀─ drivers ◀─ chips ◀─ Plant │
//!   └────▶ Pty ────────▶│        └────────── duty of the next tick ──────▲    │
//!                       └─────────────────────────────────────────────────────┘
//! ```
//!
//! The bytes on the port are those of the firmware, because the firmware makes them. Everything random comes from one
//! seed; from the start of a motion on, a recording depends on nothing else.

mod board;
mod chip;
mod describe;
mod direct;
mod encoder;
mod error;
mod flash;
mod gyro_clock;
mod line;
mod loads;
mod microcontroller;
mod mistake;
mod noise;
mod options;
mod plant;
mod pty;
mod rehearsal;
mod session;
mod simulator;
mod truth;
mod wires;
mod world;

#[cfg(test)]
mod tests;

pub use board::Board;
pub use chip::{Bmi323Chip, BoardClock, Icm42688pChip, Shared};
pub use describe::description;
pub use direct::{Direct, SHORT_MOTION};
pub use error::SimulateError;
pub use gyro_clock::GyroChips;
pub use line::LineCounts;
pub use microcontroller::Microcontroller;
pub use mistake::Mistake;
pub(crate) use options::parse_scale;
pub use options::{EffectChoice, Fault, Options, Pace};
pub use plant::{Plant, ProcessNoise, STEP_S};
pub use rehearsal::{JointPeaks, Rehearsal};
pub use session::FaultCounts;
pub use simulator::{Drawn, EffectTruth, SimulationReport, Simulator};
pub use truth::Truth;
pub use world::{GyroChip, World};

/// A tick.
const TICK_NS: u64 = 1_000_000;
/// The same, s.
const TICK_S: f64 = 1e-3;
