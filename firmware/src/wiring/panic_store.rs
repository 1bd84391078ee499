//! The place of a panic, kept in RAM that a reset leaves alone.
//!
//! ```text
//!   word 0  1     2        3 … 12                     13
//!   magic   line  length   end of the file's path     CRC-32 of the words before
//! ```
//!
//! After power-on the words are whatever they are; magic, CRC and a path of UTF-8 must fit before they are believed.

use protocol::Text;
use protocol::frame::crc32;
use protocol::hello::PanicPlace;

/// Words of the record.
pub const WORDS: usize = 14;
/// Bytes of a path that are kept.
const PATH: usize = 40;
const MAGIC: u32 = 0x7061_6e63;

/// The record of a panic at `line` of `file`; of a long path the end is kept.
pub fn encode(file: &str, line: u32) -> [u32; WORDS] {
    let mut start = file.len().saturating_sub(PATH);
    while !file.is_char_boundary(start) {
        start += 1;
    }
    let kept = &file.as_bytes()[start..];
    let mut words = [0; WORDS];
    (words[0], words[1], words[2]) = (MAGIC, line, kept.len() as u32);
    for (word, bytes) in words[3..].iter_mut().zip(kept.chunks(4)) {
        let mut four = [0; 4];
        four[..bytes.len()].copy_from_slice(bytes);
        *word = u32::from_le_bytes(four);
    }
    words[WORDS - 1] = check(&words);
    words
}

/// The place, if the words are a record.
pub fn decode(words: &[u32; WORDS]) -> Option<PanicPlace> {
    if words[0] != MAGIC || words[WORDS - 1] != check(words) {
        return None;
    }
    let bytes = bytes_of(words);
    let len = usize::try_from(words[2]).ok()?;
    let path = bytes[12..12 + PATH].get(..len)?;
    let mut file = Text::new();
    file.push_str(core::str::from_utf8(path).ok()?).ok()?;
    Some(PanicPlace { file, line: words[1] })
}

fn check(words: &[u32; WORDS]) -> u32 {
    crc32(&bytes_of(words)[..4 * (WORDS - 1)])
}

fn bytes_of(words: &[u32; WORDS]) -> [u8; 4 * WORDS] {
    let mut bytes = [0; 4 * WORDS];
    for (four, word) in bytes.chunks_exact_mut(4).zip(words) {
        four.copy_from_slice(&word.to_le_bytes());
    }
    bytes
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
        fn any_words_are_survived(words: [u32; WORDS], bit in 0usize..32 * WORDS) {
            prop_assert_eq!(decode(&words), None);
            let mut damaged = encode("firmware/src/main.rs", 120);
            damaged[bit / 32] ^= 1 << (bit % 32);
            prop_assert_eq!(decode(&damaged), None, "bit {}", bit);
        }
    }

    #[test]
    fn erased_memory_is_no_place() {
        for word in [0, u32::MAX] {
            assert_eq!(decode(&[word; WORDS]), None);
        }
    }
}
