//! The texts of the firmware's log, from the ELF file that was flashed.

use std::fmt;
use std::io;
use std::path::{Path, PathBuf};

use defmt_decoder::{Encoding, Locations, Table};
use object::{Object, ObjectSection};
use protocol::Hello;

use super::Entry;
use crate::recording::{LogLevel, Place};

/// Why a file does not help to read the log.
#[derive(Debug, thiserror::Error)]
pub enum ElfError {
    /// It cannot be read.
    #[error("cannot read {}", path.display())]
    Open {
        /// As the user named it.
        path: PathBuf,
        /// By the operating system.
        source: io::Error,
    },
    /// It is no ELF file, or a damaged one.
    #[error("{} is no program as a linker writes it: {reason}", path.display())]
    NotElf {
        /// As the user named it.
        path: PathBuf,
        /// What is wrong.
        reason: String,
    },
    /// A program that does not log.
    #[error("{} has no texts of a log", path.display())]
    NoLog {
        /// As the user named it.
        path: PathBuf,
    },
    /// Its log is not of a kind that survives losses.
    #[error("the log of {} is encoded in another way than rzcobs", path.display())]
    Encoding {
        /// As the user named it.
        path: PathBuf,
    },
    /// Another program than the one that runs.
    #[error("{} is not the program that runs on the device (checksum of its code {file:#010x}, on the device {device:#010x})", path.display())]
    OtherProgram {
        /// As the user named it.
        path: PathBuf,
        /// Of the code in the file.
        file: u32,
        /// Of the code on the device.
        device: u32,
    },
    /// The device does not say which program runs.
    #[error("the device does not say which program runs on it")]
    NoProgram,
}

impl ElfError {
    /// What the user can do about it.
    pub fn advice(&self) -> &'static str {
        match self {
            Self::Open { .. } => {
                "check the path: cargo leaves the firmware in target/thumbv7em-none-eabihf/release/firmware"
            }
            Self::NotElf { .. } | Self::NoLog { .. } => {
                "give the file that was flashed: cargo leaves it in target/thumbv7em-none-eabihf/release/firmware"
            }
            Self::Encoding { .. } => "build the firmware with defmt's encoding rzcobs, which is its default",
            Self::OtherProgram { .. } => "give the file that was flashed, or flash this one",
            Self::NoProgram => "a simulated robot has no program of a microcontroller: leave --elf out",
        }
    }
}

/// The texts, and how to know the program that they belong to.
pub struct Dictionary {
    path: PathBuf,
    table: Table,
    /// Empty if the file tells nothing about its source.
    places: Locations,
    /// The folder that all places have in common, which nobody needs to read.
    sources: PathBuf,
    code_crc: u32,
}

impl fmt::Debug for Dictionary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Dictionary").field("path", &self.path).field("code_crc", &self.code_crc).finish_non_exhaustive()
    }
}

impl Dictionary {
    /// Reads the ELF file at `path`.
    ///
    /// # Errors
    /// [`ElfError`].
    pub fn load(path: &Path) -> Result<Self, ElfError> {
        let elf = std::fs::read(path).map_err(|source| ElfError::Open { path: path.to_owned(), source })?;
        Self::parse(&elf, path)
    }

    /// Reads an ELF file's bytes; `path` is for messages only.
    ///
    /// # Errors
    /// [`ElfError`].
    pub fn parse(elf: &[u8], path: &Path) -> Result<Self, ElfError> {
        let path = path.to_owned();
        let not_elf = |reason: String| ElfError::NotElf { path: path.clone(), reason };
        let object = object::File::parse(elf).map_err(|error| not_elf(error.to_string()))?;
        let code = object.section_by_name(".text").ok_or_else(|| not_elf("it has no code".to_owned()))?;
        let code = code.data().map_err(|error| not_elf(error.to_string()))?;
        let code_crc = crc32fast::hash(code);
        let table = Table::parse(elf).map_err(|error| not_elf(error.to_string()))?;
        let Some(table) = table.filter(|table| !table.is_empty()) else { return Err(ElfError::NoLog { path }) };
        if table.encoding() != Encoding::Rzcobs {
            return Err(ElfError::Encoding { path });
        }
        // A file without them still has its texts.
        let places = table.get_locations(elf).unwrap_or_default();
        let sources = common_folder(places.values().map(|place| place.file.as_path()));
        Ok(Self { path, table, places, sources, code_crc })
    }

    /// Whether this is the program that runs on a device.
    ///
    /// # Errors
    /// [`ElfError::OtherProgram`], [`ElfError::NoProgram`].
    pub fn fits(&self, hello: &Hello) -> Result<(), ElfError> {
        match hello.code_crc {
            Some(device) if device == self.code_crc => Ok(()),
            Some(device) => Err(ElfError::OtherProgram { path: self.path.clone(), file: self.code_crc, device }),
            None => Err(ElfError::NoProgram),
        }
    }

    /// The line of a frame, which comes without its delimiter; `None` if it makes no sense.
    pub(super) fn read(&self, frame: &[u8]) -> Option<Entry> {
        // The program is the right one and the frame is whole. Should the library stumble all the same, it costs a line
        // and not the recording.
        let read = || {
            let mut decoder = self.table.new_stream_decoder();
            decoder.received(frame);
            decoder.received(&[0]);
            let frame = decoder.decode().ok()?;
            // A text without level was printed unconditionally.
            let level = frame.level().and_then(|level| LogLevel::of_name(level.as_str())).unwrap_or(LogLevel::Info);
            let place = self.places.get(&frame.index());
            Some(Entry {
                t_us: frame.display_timestamp().and_then(|time| microseconds(&time.to_string())),
                level,
                message: frame.display_message().to_string(),
                place: place.map(|place| Place {
                    file: place.file.strip_prefix(&self.sources).unwrap_or(&place.file).display().to_string(),
                    line: place.line,
                }),
            })
        };
        std::panic::catch_unwind(std::panic::AssertUnwindSafe(read)).ok().flatten()
    }
}

/// The folder that is common to all files; empty if there is no file.
fn common_folder<'a>(mut files: impl Iterator<Item = &'a Path>) -> PathBuf {
    let first = files.next().and_then(Path::parent).unwrap_or(Path::new("")).to_owned();
    files.fold(first, |common, file| {
        let same = common.components().zip(file.components()).take_while(|(a, b)| a == b);
        same.map(|(component, _)| component).collect()
    })
}

/// The µs of a time in seconds with six decimals, as defmt's hint `us` prints a count of µs.
fn microseconds(seconds: &str) -> Option<u32> {
    let (whole, fraction) = seconds.split_once('.')?;
    if fraction.len() != 6 {
        return None;
    }
    let (whole, fraction): (u64, u64) = (whole.parse().ok()?, fraction.parse().ok()?);
    u32::try_from(whole.checked_mul(1_000_000)?.checked_add(fraction)?).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_are_told_from_their_common_folder_on() {
        let common = |files: &[&str]| common_folder(files.iter().map(Path::new));
        assert_eq!(common(&["/w/firmware/src/main.rs", "/w/firmware/src/board/gyro.rs"]), Path::new("/w/firmware/src"));
        assert_eq!(common(&["/w/firmware/src/main.rs"]), Path::new("/w/firmware/src"));
        assert_eq!(common(&["/w/a.rs", "x/b.rs"]), Path::new(""));
        assert_eq!(common(&[]), Path::new(""));
    }

    #[test]
    fn only_microseconds_are_a_time() {
        assert_eq!(microseconds("1.000002"), Some(1_000_002));
        assert_eq!(microseconds("4294.967295"), Some(u32::MAX));
        for other in ["4294.967296", "1.002", "12", "-1.000000", "", "."] {
            assert_eq!(microseconds(other), None, "{other}");
        }
    }
}
