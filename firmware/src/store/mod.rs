//! One description of a robot in a NOR flash, in two copies, of which one is whole at any time.
//!
//! ```text
//!   area 0                                     area 1
//!   │ header │ encoded description │ 0xFF … │  │ header │ encoded description │ 0xFF … │
//!
//!   header, 24 bytes, little-endian:
//!   0        4        8          12       16          20
//!   │"JOIN"  │ format │ sequence │ length │ CRC-32 of │ CRC-32 of the header │
//!   │        │        │          │        │ the bytes │ so far               │
//! ```
//!
//! A copy counts if its header and its bytes agree with their checksums; of two the one with the later sequence number.
//! [`save`] erases the other area, writes the bytes, then the header, and reads everything back. Until the last byte of the
//! header is there the old copy is the only one that counts, from then on the new one: a loss of power at any byte, or in
//! the erase, leaves the old or the new description. What a torn erase leaves is an older copy, which loses against the
//! present one by its number, or none.

mod ram;
#[cfg(test)]
mod tests;

pub use ram::{AREA_BYTES, OutOfBounds, RamFlash};

use embedded_storage::nor_flash::{NorFlash, ReadNorFlash};
use heapless::Vec;
use protocol::description::{FORMAT, MAX_DESCRIPTION_BYTES, Stamp};
use protocol::frame::{RunningCrc, crc32};

/// An encoded description.
pub type Bytes = Vec<u8, MAX_DESCRIPTION_BYTES>;

/// Fewest bytes of an area: the header and the longest description, rounded up to whole writes.
pub const MIN_AREA_BYTES: usize = HEADER + MAX_DESCRIPTION_BYTES;

const MAGIC: u32 = u32::from_le_bytes(*b"JOIN");
const HEADER: usize = 24;
/// What is read or written at a time. A flash must read and write pieces of a length that divides [`WORD`].
const CHUNK: usize = 32;
/// Header and description begin at multiples of it.
const WORD: usize = 8;

/// The description was not stored. The one before is there still.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StoreError {
    /// The flash has no room for two copies, or reads and writes pieces that are too long.
    Unsuited,
    /// The flash reports a failure.
    Flash,
    /// What was read back is not what was written.
    ReadBack,
}

/// A copy that counts.
#[derive(Clone, Copy)]
struct Copied {
    area: usize,
    stamp: Stamp,
    len: usize,
}

/// The description that counts, read into `bytes`; none if there is none, and `bytes` is empty then.
pub fn load<F: ReadNorFlash>(flash: &mut F, bytes: &mut Bytes) -> Option<Stamp> {
    bytes.clear();
    let copy = newest(flash).ok()??;
    // At most MAX_DESCRIPTION_BYTES, and they were read a moment ago.
    let kept = |chunk: &[u8]| {
        let _ = bytes.extend_from_slice(chunk);
    };
    read(flash, start(flash, copy.area) + HEADER, copy.len, kept).ok()?;
    (crc32(bytes) == copy.stamp.crc()).then_some(copy.stamp)
}

/// Which description counts, without reading it out.
pub fn stamp<F: ReadNorFlash>(flash: &mut F) -> Option<Stamp> {
    newest(flash).ok()?.map(|copy| copy.stamp)
}

/// Stores an encoded description beside the present one, and returns its stamp. One that is there already is not written
/// again.
///
/// # Errors
/// [`StoreError`]; the description before counts.
pub fn save<F: NorFlash>(flash: &mut F, bytes: &[u8]) -> Result<Stamp, StoreError> {
    let area_bytes = flash.capacity() / 2;
    let whole = area_bytes.is_multiple_of(F::ERASE_SIZE) && area_bytes >= MIN_AREA_BYTES;
    let fine = WORD.is_multiple_of(F::WRITE_SIZE) && WORD.is_multiple_of(F::READ_SIZE);
    if !whole || !fine || bytes.len() > MAX_DESCRIPTION_BYTES {
        return Err(StoreError::Unsuited);
    }
    // What cannot be read is not taken for empty: it might be erased.
    let present = newest(flash).map_err(|_| StoreError::Flash)?;
    let stamp = Stamp::new(present.map_or(1, |copy| copy.stamp.sequence.wrapping_add(1)), bytes);
    if let Some(copy) = present.filter(|copy| copy.stamp.crc == stamp.crc && copy.len == bytes.len()) {
        return Ok(copy.stamp);
    }
    let area = present.map_or(0, |copy| 1 - copy.area);
    let begin = area * area_bytes;
    flash.erase(begin as u32, (begin + area_bytes) as u32).map_err(|_| StoreError::Flash)?;
    write(flash, begin + HEADER, bytes)?;
    write(flash, begin, &header(stamp, bytes.len()))?;
    match newest(flash) {
        Ok(Some(copy)) if copy.area == area && copy.stamp == stamp => Ok(stamp),
        _ => Err(StoreError::ReadBack),
    }
}

fn header(stamp: Stamp, len: usize) -> [u8; HEADER] {
    let mut header = [0; HEADER];
    let words = [MAGIC, FORMAT, stamp.sequence, len as u32, stamp.crc()];
    for (place, word) in header.chunks_exact_mut(4).zip(words) {
        place.copy_from_slice(&word.to_le_bytes());
    }
    let (said, check) = header.split_at_mut(HEADER - 4);
    check.copy_from_slice(&crc32(said).to_le_bytes());
    header
}

/// Writes from a multiple of [`WORD`] on; the last word is filled up with what an erased flash shows.
fn write<F: NorFlash>(flash: &mut F, begin: usize, bytes: &[u8]) -> Result<(), StoreError> {
    for (index, piece) in bytes.chunks(CHUNK).enumerate() {
        let mut chunk = [0xFF; CHUNK];
        chunk[..piece.len()].copy_from_slice(piece);
        let padded = piece.len().next_multiple_of(WORD);
        flash.write((begin + index * CHUNK) as u32, &chunk[..padded]).map_err(|_| StoreError::Flash)?;
    }
    Ok(())
}

/// Gives `len` bytes to `take`, a chunk at a time.
fn read<F: ReadNorFlash>(flash: &mut F, begin: usize, len: usize, mut take: impl FnMut(&[u8])) -> Result<(), F::Error> {
    let mut at = 0;
    while at < len {
        let n = (len - at).min(CHUNK);
        let mut chunk = [0; CHUNK];
        flash.read((begin + at) as u32, &mut chunk[..n.next_multiple_of(WORD)])?;
        take(&chunk[..n]);
        at += n;
    }
    Ok(())
}

fn start<F: ReadNorFlash>(flash: &F, area: usize) -> usize {
    area * (flash.capacity() / 2)
}

/// The copy that counts.
fn newest<F: ReadNorFlash>(flash: &mut F) -> Result<Option<Copied>, F::Error> {
    Ok(match (look(flash, 0)?, look(flash, 1)?) {
        (Some(first), Some(second)) => {
            let later = second.stamp.sequence.wrapping_sub(first.stamp.sequence) as i32 > 0;
            Some(if later { second } else { first })
        }
        (first, second) => first.or(second),
    })
}

/// The copy in an area, if it is whole.
fn look<F: ReadNorFlash>(flash: &mut F, area: usize) -> Result<Option<Copied>, F::Error> {
    let begin = start(flash, area);
    let mut header = [0; HEADER];
    flash.read(begin as u32, &mut header)?;
    let word = |index: usize| u32::from_le_bytes(core::array::from_fn(|i| header[4 * index + i]));
    let len = word(3) as usize;
    let right = crc32(&header[..HEADER - 4]) == word(5) && (word(0), word(1)) == (MAGIC, FORMAT);
    if !right || len > MAX_DESCRIPTION_BYTES {
        return Ok(None);
    }
    let mut crc = RunningCrc::new();
    read(flash, begin + HEADER, len, |chunk| crc.update(chunk))?;
    let stamp = Stamp { sequence: word(2), crc: word(4).to_le_bytes() };
    Ok((crc.finish() == stamp.crc()).then_some(Copied { area, stamp, len }))
}
