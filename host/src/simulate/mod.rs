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
mod direct;
mod error;
mod loads;
mod mistake;
mod noise;
mod options;
mod plant;
mod rehearsal;
mod serial;
mod simulator;
mod truth;
mod world;

#[cfg(test)]
mod tests;

pub use board::{Board, Microcontroller};
pub use direct::{Direct, SHORT_MOTION};
pub use error::SimulateError;
pub use mistake::Mistake;
pub(crate) use options::parse_scale;
pub use options::{EffectChoice, Fault, Options, Pace};
pub use plant::{Plant, ProcessNoise, STEP_S};
pub use rehearsal::{JointPeaks, Rehearsal};
pub use serial::line::LineCounts;
pub use serial::session::FaultCounts;
pub use simulator::{Drawn, EffectTruth, SimulationReport, Simulator};
pub use truth::Truth;
pub use world::chip::{Bmi323Chip, BoardClock, Icm42688pChip, Shared};
pub use world::describe::description;
pub use world::{GyroChip, GyroChips, World};

/// A tick.
const TICK_NS: u64 = 1_000_000;
/// The same, s.
const TICK_S: f64 = 1e-3;
