//! The simulated robot: plant, microcontroller running the firmware's control core, serial line with faults.

mod plant;
mod truth;

#[cfg(test)]
mod tests;

pub use plant::{Plant, STEP_S};
pub use truth::Truth;
