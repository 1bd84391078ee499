//! The flash of the simulated board: in memory, and in a file where one is given, so that the next simulation finds it.

use std::io;
use std::path::{Path, PathBuf};

use firmware::store::{AREA_BYTES, RamFlash};

/// Bytes of it: two areas.
const BYTES: usize = 2 * AREA_BYTES;

/// The flash, as the firmware reads and writes it, and its file.
#[derive(Debug)]
pub(super) struct Flash {
    pub(super) memory: RamFlash<Vec<u8>>,
    file: Option<PathBuf>,
}

impl Flash {
    /// An erased flash that is gone with the simulation.
    pub(super) fn erased() -> Self {
        Self { memory: RamFlash(vec![0xFF; BYTES]), file: None }
    }

    /// What the file holds, or an erased flash if there is no such file.
    pub(super) fn open(path: &Path) -> io::Result<Self> {
        let memory = match std::fs::read(path) {
            Ok(bytes) if bytes.len() == BYTES => bytes,
            Ok(bytes) => {
                let said = format!("{} has {} bytes and is no flash of {BYTES} bytes", path.display(), bytes.len());
                return Err(io::Error::new(io::ErrorKind::InvalidData, said));
            }
            Err(error) if error.kind() == io::ErrorKind::NotFound => vec![0xFF; BYTES],
            Err(error) => return Err(io::Error::new(error.kind(), format!("{}: {error}", path.display()))),
        };
        Ok(Self { memory: RamFlash(memory), file: Some(path.to_owned()) })
    }

    /// Writes the file, the old one or the new one at any time.
    pub(super) fn keep(&self) -> io::Result<()> {
        let Some(path) = &self.file else { return Ok(()) };
        let mut beside = path.clone().into_os_string();
        beside.push(".new");
        std::fs::write(&beside, &self.memory.0)?;
        std::fs::rename(&beside, path)
    }
}
