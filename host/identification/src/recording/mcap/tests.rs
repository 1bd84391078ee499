//! Whole files, cut files, damaged files, files of others.

use std::cell::RefCell;
use std::io::{self, Write};
use std::path::Path;
use std::rc::Rc;

use proptest::prelude::*;

use super::records::{Record, Records, unpack_chunk};
use super::{Damage, ReadError, WriteError, Writer, parse, write};
use crate::recording::fixture::{any_recording, assert_same, plain, row};
use crate::recording::{Event, LossBalance, Recording, RowError, Session, Severity};
use crate::robot::Robot;

fn file(recording: &Recording) -> Vec<u8> {
    write(Vec::new(), recording).unwrap()
}

fn read(bytes: &[u8]) -> Result<Recording, ReadError> {
    parse(bytes, Path::new("run.mcap"))
}

/// A file that can be looked at while it is written.
#[derive(Clone, Default)]
struct Glass(Rc<RefCell<Vec<u8>>>);

impl Write for Glass {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.borrow_mut().write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// A prefix of `whole`, or an error that says why there is nothing.
fn assert_usable(result: &Result<Recording, ReadError>, whole: &Recording) {
    match result {
        Ok(read) => {
            assert!(!read.is_empty());
            assert_eq!(read.robot, whole.robot);
            for (channel, expected) in read.channels.iter().zip(&whole.channels) {
                for (k, value) in channel.values.iter().enumerate() {
                    // A lost chunk is missing ticks: the number says which sample this is.
                    let original = read.seq[k] as usize;
                    assert_eq!(*value, expected.values[original]);
                }
            }
        }
        Err(error) => {
            assert!(!error.advice().is_empty());
            assert!(!error.is_io());
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn a_recording_comes_back(recording in any_recording()) {
        let read = read(&file(&recording)).unwrap();
        assert_same(&read, &recording);
        prop_assert!(read.damage.is_empty());
    }

    #[test]
    fn any_bytes_are_survived(bytes: Vec<u8>) {
        prop_assert!(read(&bytes).is_err());
        let _ = read(&[mcap::MAGIC, &bytes].concat());
    }

    #[test]
    fn any_damage_is_told(position in 0.0..1.0f64, mask in 1..=255u8) {
        let whole = plain(900);
        let mut bytes = file(&whole);
        let at = (position * bytes.len() as f64) as usize;
        bytes[at] ^= mask;
        let result = read(&bytes);
        assert_usable(&result, &whole);
        if let Ok(read) = result {
            // In the summary nothing is read, so nothing is harmed; elsewhere a sample less must come with a word.
            prop_assert!(read.len() == whole.len() || !read.damage.is_empty(), "byte {} of {}", at, bytes.len());
        }
    }
}

#[test]
fn a_file_cut_anywhere_is_read_up_to_its_last_quarter_of_a_second() {
    // Written as a recorder does, one sample after the other; the prefix that reached the disk is what a kill leaves.
    let whole = plain(2_000);
    let glass = Glass::default();
    let mut writer = Writer::new(glass.clone(), &whole.session()).unwrap();
    let mut reached = Vec::new(); // length of the file after each sample
    let mut values = Vec::new();
    for k in 0..whole.len() {
        values.clear();
        values.extend(whole.channels.iter().map(|channel| channel.values[k]));
        writer.push(&row(whole.t_us[k], whole.seq[k], &[0.1], &values)).unwrap();
        reached.push(glass.0.borrow().len());
    }
    writer.finish().unwrap();
    let bytes = glass.0.take();
    for (k, &length) in reached.iter().enumerate() {
        let kept = match read(&bytes[..length]) {
            Ok(read) => read.len(),
            Err(ReadError::NothingUsable { .. }) => 0,
            Err(error) => panic!("{error}"),
        };
        assert!(kept <= k + 1 && k + 1 - kept <= 250, "{kept} of {} samples", k + 1);
    }
    // And every region of the file, the middle of a record included.
    let mut cuts: Vec<usize> = (0..bytes.len()).step_by(97).collect();
    cuts.extend(0..2_000.min(bytes.len()));
    cuts.extend(bytes.len() - 1_500..bytes.len());
    let mut before = 0;
    cuts.sort_unstable();
    for cut in cuts {
        let result = read(&bytes[..cut]);
        assert_usable(&result, &whole);
        let kept = result.as_ref().map_or(0, Recording::len);
        assert!(kept >= before, "{cut} bytes hold {kept} samples, fewer bytes held {before}");
        before = kept;
        if let Ok(read) = result {
            assert!(matches!(read.damage[..], [Damage::CutOff { .. }]), "{:?}", read.damage);
            assert_eq!(read.missing_ticks(), 0);
        }
    }
    assert_eq!(before, whole.len());
}

#[test]
fn a_damaged_chunk_is_missing_ticks() {
    let whole = plain(1_000);
    let mut bytes = file(&whole);
    let chunks: Vec<usize> = Records::from(&bytes, mcap::MAGIC.len())
        .filter(|record| record.opcode == mcap::records::op::CHUNK)
        .map(|record| record.at + record.body.len() / 2)
        .collect();
    bytes[chunks[chunks.len() / 2]] ^= 0x10;
    let read = read(&bytes).unwrap();
    assert!(matches!(&read.damage[..], [Damage::Record { what: "chunk", .. }]), "{:?}", read.damage);
    assert_eq!(read.len() as u64 + read.missing_ticks(), 1_000);
    assert_eq!(read.gaps(), 1);
    assert!(read.missing_ticks() <= 251, "{} ticks missing", read.missing_ticks());
}

#[test]
fn other_files_are_named() {
    let says = |bytes: &[u8], expected: &str| {
        let error = read(bytes).unwrap_err();
        assert!(error.to_string().contains(expected), "{error}");
        assert!(!error.advice().is_empty());
    };
    says(b"", "empty");
    says(b"t_us,u1\n0,0\n", "a table of text");
    says(&[0x1f, 0x8b, 8, 0], "gzip");
    says(&[0; 5000], "zeros");
    says(b"\x7fELF\xff\xfe", "another kind");
    says(&mcap::MAGIC[..5], "header");
    says(mcap::MAGIC, "header");
    let mut other = mcap::Writer::new(io::Cursor::new(Vec::new())).unwrap();
    other.finish().unwrap();
    says(other.into_inner().get_ref(), "MCAP file of another program");
}

#[test]
fn a_recording_without_a_sample_is_none() {
    let session = Session::of(Robot::builtin("doggy").unwrap());
    let bytes = Writer::new(Vec::new(), &session).unwrap().finish().unwrap();
    let error = read(&bytes).unwrap_err();
    assert!(error.to_string().contains("before the first sample"), "{error}");
}

#[test]
fn a_refused_sample_leaves_the_writer_working() {
    let whole = plain(2);
    let mut writer = Writer::new(Vec::new(), &whole.session()).unwrap();
    let values = vec![0.0; whole.channels.len()];
    writer.push(&row(1000, 1, &[0.0], &values)).unwrap();
    let refused = writer.push(&row(1000, 2, &[0.0], &values));
    assert!(matches!(refused, Err(WriteError::Row(RowError::Time { t_us: 1000, before_us: 1000 }))));
    let refused = writer.push(&row(2000, 2, &[0.0, 0.0], &values));
    assert!(matches!(refused, Err(WriteError::Row(RowError::Width { expected: 1, got: 2, .. }))));
    writer.push(&row(2000, 2, &[0.0], &values)).unwrap();
    assert_eq!(read(&writer.finish().unwrap()).unwrap().seq, [1, 2]);
}

#[test]
fn what_happened_last_is_in_the_file_at_once() {
    let whole = plain(3);
    let glass = Glass::default();
    let mut writer = Writer::new(glass.clone(), &whole.session()).unwrap();
    let values = vec![0.0; whole.channels.len()];
    writer.push(&row(1000, 1, &[0.0], &values)).unwrap();
    writer.balance(&LossBalance { ticks: 1, received: 1, ..Default::default() }).unwrap();
    let event = Event { t_us: 1500, seq: 1, severity: Severity::Error, text: "heartbeat lost".into() };
    writer.event(&event).unwrap();
    let read = read(&glass.0.borrow()).unwrap();
    assert_eq!(read.events, [event]);
    assert_eq!(read.balance.map(|balance| balance.ticks), Some(1));
}

/// The same file with its chunks packed as lz4, as other tools do; what comes behind the samples is left out.
fn with_lz4(bytes: &[u8]) -> Vec<u8> {
    let mut packed = mcap::MAGIC.to_vec();
    let mut record = |opcode: u8, body: &[u8]| {
        packed.push(opcode);
        packed.extend((body.len() as u64).to_le_bytes());
        packed.extend(body);
    };
    for Record { opcode, body, .. } in Records::from(bytes, mcap::MAGIC.len()) {
        match opcode {
            mcap::records::op::CHUNK => {
                let unpacked = unpack_chunk(body).unwrap();
                let mut encoder = lz4::EncoderBuilder::new().build(Vec::new()).unwrap();
                encoder.write_all(&unpacked).unwrap();
                let (content, result) = encoder.finish();
                result.unwrap();
                // Times, size and checksum stay.
                let chunk = [&body[..28], &3u32.to_le_bytes(), b"lz4", &(content.len() as u64).to_le_bytes(), &content];
                record(opcode, &chunk.concat());
            }
            mcap::records::op::DATA_END => {
                record(opcode, &[0; 4]);
                break;
            }
            _ => record(opcode, body),
        }
    }
    [&packed[..], mcap::MAGIC].concat()
}

#[test]
fn chunks_in_lz4_are_read() {
    let whole = plain(1_000);
    let packed = with_lz4(&file(&whole));
    let again = read(&packed).unwrap();
    assert_same(&again, &whole);
    assert_eq!(again.damage, []);
    // A chunk whose size is not what it says, and a compression that nobody knows, are told as such.
    let chunk = Records::from(&packed, mcap::MAGIC.len()).find(|r| r.opcode == mcap::records::op::CHUNK).unwrap();
    let says = |body: &[u8], expected: &str| {
        let reason = unpack_chunk(body).unwrap_err();
        assert!(reason.contains(expected), "{reason}");
    };
    let mut body = chunk.body.to_vec();
    body[16] ^= 1;
    says(&body, "checksum");
    let mut body = chunk.body.to_vec();
    body[32..35].copy_from_slice(b"xzz");
    says(&body, "compression `xzz` is not known (zstd, lz4 and none are): mcap compress");
    let mut body = chunk.body.to_vec();
    let middle = body.len() / 2;
    body.truncate(middle);
    says(&body, "shorter");
}

#[test]
fn files_one_behind_the_other_are_refused_with_the_place() {
    let first = file(&plain(100));
    let both = [&first[..], &file(&plain(50))].concat();
    let error = read(&both).unwrap_err();
    assert!(error.to_string().contains(&format!("a second file begins at byte {}", first.len())), "{error}");
    assert!(error.advice().contains(&format!("head -c {}", first.len())), "{}", error.advice());
    assert_eq!(read(&first).unwrap().len(), 100);
}
