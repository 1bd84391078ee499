//! What stands between a robot's pins and the line to the host.

use protocol::{Layout, State};

use crate::simulate::SimulateError;

/// A microcontroller that runs the firmware, one tick after the other.
pub trait Microcontroller: Send {
    /// One tick of the firmware and the millisecond that follows it.
    ///
    /// # Errors
    /// [`SimulateError::Machine`] if it runs no further.
    fn tick(&mut self) -> Result<(), SimulateError>;

    /// The watchdog bites: motors off, the firmware starts anew, counters at zero. What the robot did meanwhile it did.
    ///
    /// # Errors
    /// [`SimulateError`] if it does not start again.
    fn reset(&mut self) -> Result<(), SimulateError>;

    /// Bytes from the host.
    fn receive(&mut self, bytes: &[u8]);

    /// Bytes for the host; as many as are ready and fit.
    fn transmit(&mut self, out: &mut [u8]) -> usize;

    /// What the control loop is doing, as far as it shows.
    fn state(&self) -> State;

    /// What a sample holds.
    fn layout(&self) -> Layout;

    /// How far each joint was from its marked pose at most, rad or m; empty where nobody measures it.
    fn farthest(&self) -> Vec<f64> {
        Vec::new()
    }

    /// Simulated time since power-on, s.
    fn time_s(&self) -> f64;
}
