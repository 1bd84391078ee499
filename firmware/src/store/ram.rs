//! A NOR flash in RAM, for boards and robots that are only played: an erase sets bits, a write only clears them.

use embedded_storage::nor_flash::{ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash};

/// Bytes of an area, which is erased as a whole.
pub const AREA_BYTES: usize = 1024;

/// Two areas of [`AREA_BYTES`] in these bytes; more are left alone.
#[derive(Debug)]
pub struct RamFlash<B>(pub B);

/// A place that the flash does not have.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct OutOfBounds;

impl NorFlashError for OutOfBounds {
    fn kind(&self) -> NorFlashErrorKind {
        NorFlashErrorKind::OutOfBounds
    }
}

impl<B> ErrorType for RamFlash<B> {
    type Error = OutOfBounds;
}

impl<B: AsRef<[u8]>> ReadNorFlash for RamFlash<B> {
    const READ_SIZE: usize = 1;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), OutOfBounds> {
        let from = offset as usize;
        let there = self.0.as_ref().get(from..from + bytes.len()).ok_or(OutOfBounds)?;
        bytes.copy_from_slice(there);
        Ok(())
    }

    fn capacity(&self) -> usize {
        self.0.as_ref().len().min(2 * AREA_BYTES)
    }
}

impl<B: AsRef<[u8]> + AsMut<[u8]>> NorFlash for RamFlash<B> {
    const WRITE_SIZE: usize = 1;
    const ERASE_SIZE: usize = AREA_BYTES;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), OutOfBounds> {
        self.0.as_mut().get_mut(from as usize..to as usize).ok_or(OutOfBounds)?.fill(0xFF);
        Ok(())
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), OutOfBounds> {
        let from = offset as usize;
        let there = self.0.as_mut().get_mut(from..from + bytes.len()).ok_or(OutOfBounds)?;
        there.iter_mut().zip(bytes).for_each(|(there, byte)| *there &= byte);
        Ok(())
    }
}
