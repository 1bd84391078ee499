//! The way to the device: whole frames, one at a time, from whichever thread has something to say.

use std::io::{self, Write};
use std::sync::{Mutex, MutexGuard};

use protocol::frame::DELIMITER;
use protocol::message::{MAX_TO_DEVICE_FRAME, write_to_device};
use protocol::{Command, ToDevice};
use serialport::SerialPort;

/// What threads share to write.
pub(super) struct Outgoing {
    line: Mutex<Line>,
}

struct Line {
    port: Box<dyn SerialPort>,
    /// The last frame was not written whole: a delimiter first, so that it spoils no other.
    torn: bool,
    /// A stop was sent by [`Outgoing::stop`]: what could set the robot in motion is not sent any more.
    stopping: bool,
    next_id: u8,
}

/// Why a message was not written.
#[derive(Debug)]
pub(super) enum Unsent {
    /// The line does not take it.
    Io(io::Error),
    /// The device was told to stop.
    Stopping,
}

impl Outgoing {
    pub(super) fn new(port: Box<dyn SerialPort>) -> Self {
        // The first frame follows whatever was on the line before.
        Self { line: Mutex::new(Line { port, torn: true, stopping: false, next_id: 0 }) }
    }

    /// An id that the last request did not have.
    pub(super) fn fresh_id(&self) -> u8 {
        let mut line = self.lock();
        line.next_id = line.next_id.wrapping_add(1);
        line.next_id
    }

    /// Writes a message, unless a stop forbids it.
    pub(super) fn send(&self, message: &ToDevice) -> Result<(), Unsent> {
        let mut line = self.lock();
        if line.stopping && sets_in_motion(message) {
            return Err(Unsent::Stopping);
        }
        line.write(message).map_err(Unsent::Io)
    }

    /// Writes a stop at once and lets nothing follow that could set the robot in motion, not even the repetition of a
    /// start that waits for its answer.
    pub(super) fn stop(&self) -> io::Result<()> {
        let mut line = self.lock();
        line.stopping = true;
        line.next_id = line.next_id.wrapping_add(1);
        let id = line.next_id;
        line.write(&ToDevice::Request { id, command: Command::Stop })
    }

    fn lock(&self) -> MutexGuard<'_, Line> {
        self.line.lock().unwrap_or_else(|e| e.into_inner())
    }
}

impl Line {
    fn write(&mut self, message: &ToDevice) -> io::Result<()> {
        let mut frame = [DELIMITER; MAX_TO_DEVICE_FRAME + 1];
        let n = write_to_device(message, &mut frame[1..]).map_err(io::Error::other)?;
        let from = usize::from(!self.torn);
        self.torn = true;
        self.port.write_all(&frame[from..=n])?;
        self.torn = false;
        Ok(())
    }
}

fn sets_in_motion(message: &ToDevice) -> bool {
    let ToDevice::Request { command, .. } = message else { return false };
    matches!(command, Command::Start { .. } | Command::Jog { .. } | Command::ClearFault)
}
