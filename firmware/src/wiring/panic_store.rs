//! The place of a panic, kept in RAM that a reset leaves alone.
//!
//! ```text
//!   0       4      8        12                        52
//!   magic │ line │ length │ end of the file's path  │ CRC-32 of the bytes before      all little endian
//! ```
//!
//! After power-on the bytes are whatever they are; magic, CRC and a path of UTF-8 must fit before they are believed.

use protocol::Text;
use protocol::frame::crc32;
use protocol::hello::PanicPlace;

/// Bytes of a path that are kept.
const PATH: usize = 40;
/// Where the path and the checksum begin.
const PATH_AT: usize = 12;
const CRC_AT: usize = PATH_AT + PATH;
/// Bytes of the record.
pub const BYTES: usize = CRC_AT + 4;
const MAGIC: [u8; 4] = *b"panc";

/// The record of a panic at `line` of `file`; of a long path the end is kept.
pub fn encode(file: &str, line: u32) -> [u8; BYTES] {
    let mut start = file.len().saturating_sub(PATH);
    while !file.is_char_boundary(start) {
        start += 1;
    }
    let path = &file.as_bytes()[start..];
    let mut record = [0; BYTES];
    record[..4].copy_from_slice(&MAGIC);
    record[4..8].copy_from_slice(&line.to_le_bytes());
    record[8..PATH_AT].copy_from_slice(&(path.len() as u32).to_le_bytes());
    // At most PATH bytes were kept.
    record[PATH_AT..PATH_AT + path.len()].copy_from_slice(path);
    let check = crc32(&record[..CRC_AT]);
    record[CRC_AT..].copy_from_slice(&check.to_le_bytes());
    record
}

/// The place, if the bytes are a record.
pub fn decode(record: &[u8; BYTES]) -> Option<PanicPlace> {
    let (body, check) = record.split_last_chunk::<4>()?;
    if body[..4] != MAGIC || u32::from_le_bytes(*check) != crc32(body) {
        return None;
    }
    let [_, _, _, _, l0, l1, l2, l3, n0, n1, n2, n3, path @ ..] = body else { return None };
    let len = usize::try_from(u32::from_le_bytes([*n0, *n1, *n2, *n3])).ok()?;
    let mut file = Text::new();
    file.push_str(core::str::from_utf8(path.get(..len)?).ok()?).ok()?;
    Some(PanicPlace { file, line: u32::from_le_bytes([*l0, *l1, *l2, *l3]) })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_place_comes_back_with_the_end_of_its_path(file in "\\PC{0,80}", line: u32) {
            let place = decode(&encode(&file, line)).unwrap();
            prop_assert_eq!(place.line, line);
            prop_assert!(file.ends_with(place.file.as_str()));
            prop_assert!(place.file.len() > PATH - 4 || place.file.as_str() == file);
        }

        #[test]
        fn any_bytes_are_survived(bytes in prop::collection::vec(any::<u8>(), BYTES), bit in 0usize..8 * BYTES) {
            prop_assert_eq!(decode(&bytes.try_into().unwrap()), None);
            let mut damaged = encode("firmware/src/main.rs", 120);
            damaged[bit / 8] ^= 1 << (bit % 8);
            prop_assert_eq!(decode(&damaged), None, "bit {}", bit);
        }
    }

    #[test]
    fn erased_memory_is_no_place() {
        for byte in [0, u8::MAX] {
            assert_eq!(decode(&[byte; BYTES]), None);
        }
    }
}
