//! The whole core in one value, for a caller with one thread: the simulator, and tests.
//!
//! A board with interrupts takes the parts instead ([`ControlLoop`], [`Telemetry`], [`Receiver`] and the ends of
//! [`Queues`]) and gives each to its task; it is the same code.

use embedded_storage::nor_flash::NorFlash;

use crate::config::Config;
use crate::control::{ControlLoop, Inputs, Outputs};
use crate::description::Hardware;
use crate::queues::Queues;
use crate::receive::{ReceiveCounts, Receiver};
use crate::telemetry::Telemetry;

/// RAM of the core on a 32-bit machine, bytes. Of a budget of 24 KiB the rest is left to stacks and DMA buffers.
pub const RAM_BUDGET: usize = 13 * 1024;
// Measured 13,008: motion 4.7 KiB, queues 3.1 KiB, the loop 3.3 KiB, a description on its way 0.8 KiB.
#[cfg(target_pointer_width = "32")]
const _: () = assert!(size_of::<ControlCore>() <= RAM_BUDGET);

/// Control loop, telemetry, receiver and the queues between them.
#[derive(Debug)]
pub struct ControlCore {
    control: ControlLoop,
    telemetry: Telemetry,
    receiver: Receiver,
    queues: Queues,
}

impl ControlCore {
    /// At rest, for a robot.
    pub fn new(config: &Config) -> Self {
        ControlCore {
            control: ControlLoop::new(config),
            telemetry: Telemetry::new(config),
            receiver: Receiver::new(),
            queues: Queues::new(),
        }
    }

    /// One tick; see [`ControlLoop::tick`].
    pub fn tick(&mut self, now_us: u32, inputs: &Inputs) -> Outputs {
        let (mut ends, _, _) = self.queues.split();
        self.control.tick(now_us, inputs, &mut ends)
    }

    /// Stores the description that a tick has asked to be stored ([`Outputs::store`]); see [`ControlLoop::store`].
    pub fn store<F: NorFlash>(&mut self, hardware: &Hardware<'_>, flash: &mut F) {
        let (mut ends, _, _) = self.queues.split();
        self.control.store(hardware, flash, &mut ends);
    }

    /// Bytes from the host; see [`Receiver::receive`].
    pub fn receive(&mut self, bytes: &[u8]) {
        let (_, _, mut commands) = self.queues.split();
        self.receiver.receive(bytes, &mut commands);
    }

    /// Bytes for the host, whole frames; see [`Telemetry::transmit`].
    pub fn transmit(&mut self, out: &mut [u8]) -> usize {
        let (_, mut ends, _) = self.queues.split();
        self.telemetry.transmit(out, &mut ends)
    }

    /// The control loop, to look at.
    pub fn control(&self) -> &ControlLoop {
        &self.control
    }

    /// What became of the frames received.
    pub fn received(&self) -> ReceiveCounts {
        self.receiver.counts()
    }
}
