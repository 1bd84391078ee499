//! Whole streams, cut ones, damaged ones, and files of other programs.

use std::path::Path;

use proptest::prelude::*;

use super::{Dictionary, ElfError, Entry, LogCounts, LogReader};
use crate::link::tests::firmware::{TEXTS, elf, elf_with, frame, late, started};
use crate::link::tests::peer::doggy;
use crate::recording::LogLevel;

fn dictionary() -> Dictionary {
    Dictionary::parse(&elf(b"code"), Path::new("firmware")).unwrap()
}

fn entry(t_us: u32, level: LogLevel, message: impl Into<String>) -> Entry {
    Entry { t_us: Some(t_us), level, message: message.into(), place: None }
}

/// A hundred lines: the stream, and what it says.
fn stream() -> (Vec<u8>, Vec<Entry>) {
    let mut bytes = vec![0];
    let mut entries = Vec::new();
    for k in 0..100u32 {
        if k % 3 == 0 {
            let name = "x".repeat(k as usize);
            bytes.extend(started(k * 1000, &name, k as u16));
            entries.push(entry(k * 1000, LogLevel::Info, format!("started: {name}, {k} parts")));
        } else {
            bytes.extend(late(k * 1000, k as u8));
            entries.push(entry(k * 1000, LogLevel::Warn, format!("gyro {k} answers late")));
        }
    }
    (bytes, entries)
}

/// The stream in pieces of these lengths, over and over, each with the count of the bytes before it.
fn pieces<'a>(bytes: &'a [u8], lengths: &[usize]) -> Vec<(u32, &'a [u8])> {
    let (mut at, mut pieces) = (0, Vec::new());
    for length in lengths.iter().cycle() {
        if at == bytes.len() {
            break;
        }
        let end = (at + length).min(bytes.len());
        pieces.push((at as u32, &bytes[at..end]));
        at = end;
    }
    pieces
}

#[test]
fn a_frame_becomes_a_line() {
    let mut reader = LogReader::new(dictionary());
    let said = reader
        .feed(0, &[&[0][..], &started(1_500_000, "doggy", 5), &frame(3, 7, &[9, 0, 0, 0, 64, 66, 15, 0])].concat());
    let expected = [
        entry(1_500_000, LogLevel::Info, "started: doggy, 5 parts"),
        entry(7, LogLevel::Error, "tick 9 took 1.000000 s"),
    ];
    assert_eq!(said, expected);
    assert_eq!(reader.counts(), LogCounts { lines: 2, ..LogCounts::default() });
}

proptest! {
    #[test]
    fn pieces_of_any_length_give_the_same_lines(lengths in prop::collection::vec(1usize..=64, 1..20)) {
        let (bytes, expected) = stream();
        let mut reader = LogReader::new(dictionary());
        let said: Vec<_> = pieces(&bytes, &lengths).into_iter().flat_map(|(at, piece)| reader.feed(at, piece)).collect();
        prop_assert_eq!(said, expected);
        prop_assert_eq!(reader.counts(), LogCounts { lines: 100, ..LogCounts::default() });
    }

    #[test]
    fn lost_pieces_cost_the_lines_that_they_touch(
        lengths in prop::collection::vec(1usize..=64, 1..20),
        lost in prop::collection::vec(any::<prop::sample::Index>(), 1..8),
    ) {
        let (bytes, expected) = stream();
        let pieces = pieces(&bytes, &lengths);
        let lost: Vec<usize> = lost.iter().map(|lost| lost.index(pieces.len())).collect();
        let kept = || (0..pieces.len()).filter(|k| !lost.contains(k));
        // A line is whole if all of its bytes came, and its beginning was seen: the delimiter before it.
        let mut came = vec![false; bytes.len()];
        for (at, piece) in kept().map(|k| pieces[k]) {
            came[at as usize..at as usize + piece.len()].fill(true);
        }
        let ends: Vec<usize> = (0..bytes.len()).filter(|&i| bytes[i] == 0).collect();
        let whole = ends.windows(2).map(|w| came[w[0]..=w[1]].iter().all(|came| *came));
        let expected: Vec<_> = expected.into_iter().zip(whole).filter(|(_, whole)| *whole).map(|(line, _)| line).collect();
        let mut reader = LogReader::new(dictionary());
        let said: Vec<_> = kept().flat_map(|k| reader.feed(pieces[k].0, pieces[k].1)).collect();
        prop_assert_eq!(said, expected);
        // What is missing at either end of the stream nobody can know.
        let first = came.iter().position(|came| *came).unwrap_or(0);
        let last = came.iter().rposition(|came| *came).unwrap_or(0);
        let missing = came[first..=last].iter().filter(|came| !**came).count();
        prop_assert_eq!(reader.counts().lost_bytes, missing as u64);
    }

    #[test]
    fn any_bytes_are_survived_and_the_next_line_is_read(noise: Vec<u8>, at: u32) {
        let mut reader = LogReader::new(dictionary());
        let noise = [&[0][..], &noise, &[0]].concat();
        let garbage = reader.feed(at, &noise).len() as u64;
        let said = reader.feed(at.wrapping_add(noise.len() as u32), &late(5, 1));
        prop_assert_eq!(said, vec![entry(5, LogLevel::Warn, "gyro 1 answers late")]);
        prop_assert_eq!(reader.counts().lines, garbage + 1);
    }

    #[test]
    fn any_file_is_survived(bytes: Vec<u8>, cut in any::<prop::sample::Index>(), flip in 1u8..) {
        let path = Path::new("firmware");
        prop_assert!(Dictionary::parse(&bytes, path).is_err());
        let mut file = elf(b"code");
        let at = cut.index(file.len());
        let _ = Dictionary::parse(&file[..at], path);
        file[at] ^= flip;
        let _ = Dictionary::parse(&file, path);
    }
}

#[test]
fn a_listener_who_comes_late_begins_with_the_next_line() {
    let (bytes, expected) = stream();
    let mut reader = LogReader::new(dictionary());
    // In the middle of the line of 48 letters.
    let from = bytes.windows(5).position(|w| w == b"x".repeat(5)).unwrap() + 1;
    let said = reader.feed(from as u32, &bytes[from..]);
    let first = expected.iter().position(|line| *line == said[0]).unwrap();
    assert!(first > 0 && said == expected[first..], "{first}");
    assert_eq!(reader.counts().lost_bytes, 0);
}

#[test]
fn a_device_that_starts_anew_is_followed() {
    let mut reader = LogReader::new(dictionary());
    let life = [&[0][..], &late(900, 1)].concat();
    assert_eq!(reader.feed(70_000, &life).len(), 1);
    assert_eq!(reader.feed(70_000 + life.len() as u32, &late(950, 2)[..3]), []);
    assert_eq!(reader.feed(0, &life).len(), 1);
    assert_eq!(reader.counts(), LogCounts { lines: 2, lost_bytes: 0, unread_frames: 1 });
}

#[test]
fn a_frame_without_end_is_given_up() {
    let mut reader = LogReader::new(dictionary());
    assert_eq!(reader.feed(0, &[0]), []);
    assert_eq!(reader.feed(1, &[7; 10_000]), []);
    assert_eq!(reader.feed(10_001, &[&[0][..], &late(5, 1)].concat()).len(), 1);
    assert_eq!(reader.counts(), LogCounts { lines: 1, lost_bytes: 0, unread_frames: 1 });
}

#[test]
fn only_the_program_that_runs_is_read() {
    let mut hello = doggy();
    assert!(matches!(dictionary().fits(&hello), Err(ElfError::NoProgram)));
    hello.code_crc = Some(protocol::frame::crc32(b"code"));
    dictionary().fits(&hello).unwrap();
    let other = Dictionary::parse(&elf(b"other"), Path::new("firmware")).unwrap();
    let error = other.fits(&hello).unwrap_err();
    assert!(error.to_string().contains(&format!("{:#010x}", protocol::frame::crc32(b"other"))), "{error}");
    assert!(error.advice().contains("flashed"));
}

#[test]
fn files_that_do_not_help_are_named() {
    let parse = |bytes: &[u8]| Dictionary::parse(bytes, Path::new("x.elf")).unwrap_err();
    assert!(matches!(Dictionary::load(Path::new("no/such/file")), Err(ElfError::Open { .. })));
    assert!(matches!(parse(b"t_us,u1"), ElfError::NotElf { .. }));
    assert!(matches!(parse(&elf_with(b"code", &[], "rzcobs")), ElfError::NotElf { .. }), "texts are announced");
    assert!(matches!(parse(&elf_with(b"code", &TEXTS[..1], "rzcobs")), ElfError::NoLog { .. }));
    assert!(matches!(parse(&elf_with(b"code", &TEXTS, "raw")), ElfError::Encoding { .. }));
    assert!(matches!(parse(&elf_with(b"code", &[("defmt_info", "a"), ("x", "")], "morse")), ElfError::NotElf { .. }));
}
