//! A description on its way from the host into the flash.
//!
//! ```text
//!   Begin ─▶ Piece 0 ─▶ … ─▶ End ─▶ Outputs::store ─▶ ControlLoop::store: checks, erases, writes ─▶ the answer to End
//!                             tick  │ the caller, drivers off, no motion                         │ next tick
//! ```
//!
//! The tick itself writes nothing: an erase may hold the core up for half a second, and whoever calls the tick knows what
//! that means for its watchdog. What is stored runs from the next start on.

use embedded_storage::nor_flash::NorFlash;
use protocol::description::{DESCRIPTION_PIECE, MAX_DESCRIPTION_PIECES};
use protocol::frame::crc32;
use protocol::{Command, Description, Refusal};

use super::request::{Upload, acknowledge};
use super::{ControlLoop, Inputs};
use crate::description::Hardware;
use crate::queues::TickEnds;
use crate::store::{self, Bytes};

/// A description that is uploaded and is to be stored.
#[derive(Clone, Copy, Debug)]
pub(super) struct Storing {
    /// Of the request that is answered afterwards.
    pub id: u8,
    /// CRC-32 over the encoded description, by the host.
    pub checksum: u32,
}

impl ControlLoop {
    /// Checks the description that [`Outputs::store`](super::Outputs::store) asks to be stored, stores it, and answers the
    /// host. To be called after the tick and before the next one. An erase of flash may hold the core up meanwhile: no motion
    /// runs and the drivers are off, and the next tick finds an overrun that stops nothing.
    pub fn store<F: NorFlash>(&mut self, hardware: &Hardware<'_>, flash: &mut F, ends: &mut TickEnds<'_>) {
        let Some(Storing { id, checksum }) = self.storing.take() else { return };
        let answer = checked(checksum, hardware, ends.description)
            .and_then(|()| store::save(flash, ends.description).map_err(|_| Refusal::StoreFailed));
        let answer = answer.map(|stamp| self.descriptions.stored = Some(stamp));
        self.memory.keep(id, &Command::DescriptionEnd { checksum }, answer);
        acknowledge(id, answer, ends);
    }

    pub(super) fn begin_description(&mut self, pieces: u8, inputs: &Inputs, there: &mut Bytes) -> Result<(), Refusal> {
        self.may_store(inputs)?;
        if !(1..=MAX_DESCRIPTION_PIECES).contains(&usize::from(pieces)) {
            return Err(Refusal::Unreadable);
        }
        there.clear();
        self.upload = Upload::Description { pieces, taken: 0 };
        Ok(())
    }

    pub(super) fn take_piece(&mut self, index: u8, bytes: &[u8], there: &mut Bytes) -> Result<(), Refusal> {
        let Upload::Description { taken, .. } = &mut self.upload else {
            return Err(Refusal::NoUpload);
        };
        let repeated = index.checked_add(1) == Some(*taken) && there.ends_with(bytes);
        if repeated {
            return Ok(());
        }
        if index != *taken {
            return Err(Refusal::UploadOrder { expected: *taken, got: index });
        }
        // Every piece but the last is full, so the longest description fits.
        if there.len() != usize::from(index) * DESCRIPTION_PIECE || there.extend_from_slice(bytes).is_err() {
            return Err(Refusal::Unreadable);
        }
        *taken += 1;
        Ok(())
    }

    /// Whether what is uploaded may be stored now; it is stored after the tick.
    pub(super) fn end_description(&mut self, inputs: &Inputs) -> Result<(), Refusal> {
        self.may_store(inputs)?;
        let Upload::Description { pieces, taken } = self.upload else {
            return Err(Refusal::NoUpload);
        };
        if pieces != taken {
            return Err(Refusal::UploadOrder { expected: taken, got: pieces });
        }
        self.upload = Upload::None;
        Ok(())
    }

    /// Whether a description may be stored now: at rest, drivers off, no fault, and somewhere to store it.
    fn may_store(&self, inputs: &Inputs) -> Result<(), Refusal> {
        if !self.descriptions.can_store {
            return Err(Refusal::NoStore);
        }
        self.not_busy()?;
        if let Some(fault) = self.fault.or_else(|| self.standing_fault(inputs)) {
            return Err(Refusal::Fault(fault));
        }
        if self.armed_ticks > 0 { Err(Refusal::Armed) } else { Ok(()) }
    }
}

/// Whether these bytes are what the host sent, and a robot that runs on this board.
#[inline(never)] // the description is on the stack only while it runs
fn checked(checksum: u32, hardware: &Hardware<'_>, bytes: &[u8]) -> Result<(), Refusal> {
    let got = crc32(bytes);
    if got != checksum {
        return Err(Refusal::Checksum { expected: checksum, got });
    }
    let mut description = Description::default();
    description.read(bytes).map_err(|_| Refusal::Unreadable)?;
    hardware.check(&description).map_err(Refusal::Description)
}
