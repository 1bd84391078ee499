//! What a board provides: the contract of a port. The application (`main.rs`) is the same on every board.
//!
//! ```text
//!   t_k                     + ≤ 600 µs                                        t_{k+1}
//!   │ begin()               │ collect() ─▶ ControlLoop::tick ─▶ apply()       │ begin()
//!   │ preloaded duty acts   │ transfers are over, or aborted    │ preload, or │
//!   │ encoders latched      │ as errors of their sensors        │ zero now    │
//!   │ transfers start ······│                                   │             │
//! ```
//!
//! A board has one folder under `src/board/` with `start` and `motors_off` beside these traits; see
//! `firmware/PORTING.md`.

pub mod absence;
pub mod budget;
pub mod check_in;
pub mod data_ready;
pub mod i2c;
pub mod log_ring;
pub mod panic_store;
pub mod pwm;
pub mod reset;

use crate::{Inputs, Outputs};

/// Sensors and motors, in the hands of the two tasks of highest priority.
pub trait Pins {
    /// The period begins: what was applied last becomes active, encoders are latched and bus transfers start. Without
    /// an [`apply`](Self::apply) since the last period the duty is zero: a missed deadline moves nothing. Makes the
    /// tick's task run [`BUS_BOUND_US`] later, or as soon as the transfers are over. Returns at once with the device
    /// time t_k, µs.
    fn begin(&mut self) -> u32;

    /// What the sensors said since [`begin`](Self::begin). Waits for nothing: a transfer that is not over is aborted
    /// and is a bus error of its gyro; its bus is brought back without blocking.
    fn collect(&mut self) -> Inputs;

    /// Keeps the duties for the next period; a stop is zero duty at the pins before this returns.
    fn apply(&mut self, outputs: &Outputs);

    /// The I²C interrupts, on boards that have one transfer driven by interrupts.
    fn bus_event(&mut self) {}

    /// The end of a burst that DMA has moved, on boards that have one.
    fn burst_over(&mut self) {}
}

/// Latest end of a bus transfer after the start of the period, µs: 60 % of it.
pub const BUS_BOUND_US: u32 = 600;

/// The transmitter, with its buffer.
pub trait LineOut {
    /// The buffer for the next bytes, or `None` while the last ones are on their way.
    fn room(&mut self) -> Option<&mut [u8]>;

    /// Sends the first `len` bytes of the buffer; returns at once.
    fn send(&mut self, len: usize);
}

/// The receiver.
pub trait LineIn {
    /// Takes what has arrived since the last call, at most what `out` holds; returns how much.
    fn read(&mut self, out: &mut [u8]) -> usize;
}

/// Resets the processor unless fed in time.
pub trait Watchdog {
    /// Once a tick, while every task that must live does.
    fn feed(&mut self);

    /// The flash is about to be erased, which may hold the core up: the next [`feed`](Self::feed) is due only after a second
    /// or more, and with it the time of a tick is in force again. Only while the drivers are off.
    fn lengthen(&mut self);
}
