//! Sectors 1 and 2 of the flash, 16 KiB each, which keep the description of a robot in two copies.
//!
//! `memory.x` places the vectors before them and the code behind them. An erase of a sector takes 0.4 s and at most 0.8 s, a
//! byte 16 µs and at most 100 µs (data sheet DS8626, programming by bytes, which every supply voltage allows). The flash has
//! one bank: while it is busy the core stands still at its next access to it, interrupts too. So this is done only while the
//! drivers are off, with the watchdog set to the time of a start.

use embedded_storage::nor_flash::{ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash};
use stm32f4xx_hal::flash::{self, FlashExt};
use stm32f4xx_hal::pac::FLASH;

const SECTOR_BYTES: usize = 16 * 1024;
const FIRST_SECTOR: u8 = 1;
const SECTORS: usize = 2;
/// From the beginning of the flash to that of sector 1.
const BEGIN: usize = 16 * 1024;

/// The two sectors, as one flash that begins at 0.
pub struct Store(FLASH);

/// Why the flash did not do it.
#[derive(Debug)]
pub enum Failure {
    /// A place beyond the two sectors, or not a whole sector.
    Place,
    /// Said by the flash.
    Flash,
}

impl From<flash::Error> for Failure {
    fn from(_: flash::Error) -> Self {
        Failure::Flash
    }
}

impl NorFlashError for Failure {
    fn kind(&self) -> NorFlashErrorKind {
        match self {
            Failure::Place => NorFlashErrorKind::OutOfBounds,
            Failure::Flash => NorFlashErrorKind::Other,
        }
    }
}

impl Store {
    /// With the registers of the flash, once the clocks are set.
    pub fn new(registers: FLASH) -> Self {
        // Whoever ran before may have left it open; to open it twice is an error.
        if registers.cr().read().lock().bit_is_clear() {
            registers.cr().modify(|_, w| w.lock().set_bit());
        }
        Store(registers)
    }

    /// Clears errors of the past, which the next operation would be taken to have made.
    fn clear_errors(&mut self) {
        // SAFETY: ones clear PGSERR, PGPERR, PGAERR, WRPERR and OPERR, zeros do nothing.
        self.0.sr().write(|w| unsafe { w.bits(0b1111_0010) });
    }

    /// Forgets what the data cache holds of the flash: it does not see what is erased and written. It may be reset only
    /// while it is off.
    fn reset_cache(&mut self) {
        let acr = self.0.acr();
        let on = acr.read().dcen().bit();
        acr.modify(|_, w| w.dcen().clear_bit());
        acr.modify(|_, w| w.dcrst().set_bit());
        acr.modify(|_, w| w.dcrst().clear_bit());
        acr.modify(|_, w| w.dcen().bit(on));
    }
}

/// The place in the flash, if all of it lies in the two sectors.
fn place(offset: u32, len: usize) -> Result<usize, Failure> {
    let offset = offset as usize;
    let end = offset.checked_add(len).filter(|end| *end <= SECTORS * SECTOR_BYTES);
    end.map(|_| BEGIN + offset).ok_or(Failure::Place)
}

impl ErrorType for Store {
    type Error = Failure;
}

impl ReadNorFlash for Store {
    const READ_SIZE: usize = 1;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), Failure> {
        let from = place(offset, bytes.len())?;
        let there = self.0.read().get(from..from + bytes.len()).ok_or(Failure::Place)?;
        bytes.copy_from_slice(there);
        Ok(())
    }

    fn capacity(&self) -> usize {
        SECTORS * SECTOR_BYTES
    }
}

impl NorFlash for Store {
    const WRITE_SIZE: usize = 1;
    const ERASE_SIZE: usize = SECTOR_BYTES;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), Failure> {
        let (from, to) = (from as usize, to as usize);
        if !from.is_multiple_of(SECTOR_BYTES) || !to.is_multiple_of(SECTOR_BYTES) || to > SECTORS * SECTOR_BYTES {
            return Err(Failure::Place);
        }
        self.clear_errors();
        let outcome = (from / SECTOR_BYTES..to / SECTOR_BYTES)
            .try_for_each(|sector| self.0.unlocked().erase(FIRST_SECTOR + sector as u8));
        self.reset_cache();
        outcome.map_err(Failure::from)
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), Failure> {
        let to = place(offset, bytes.len())?;
        self.clear_errors();
        let outcome = self.0.unlocked().program(to, bytes.iter());
        self.reset_cache();
        outcome.map_err(Failure::from)
    }
}
