//! Files that a verb makes: claimed before the long work starts, never overwritten unasked, whole or absent.

use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};

use serde::Serialize;
use tempfile::NamedTempFile;

use crate::command::terminal::interrupt::Registered;
use crate::command::{Failure, Ui};
use crate::report;

/// A file that appears under its name only when it is complete.
///
/// [`NewFile::claim`] refuses an existing file (before the work that fills it) and opens a temporary one in the same
/// folder, so that a full disk or a missing folder is known early too; [`NewFile::finish`] syncs and renames it. Dropped
/// or interrupted before that, nothing is left behind.
#[derive(Debug)]
pub struct NewFile {
    path: PathBuf,
    force: bool,
    part: BufWriter<NamedTempFile>,
    registered: Registered,
}

impl NewFile {
    /// Opens the temporary file beside `path`; with `force`, `path` may exist and is replaced at the end.
    pub fn claim(path: &Path, force: bool) -> Result<Self, Failure> {
        refuse_existing(path, force)?;
        let mut part = tempfile::Builder::new();
        part.prefix(".host-").suffix(".part");
        part.permissions(std::fs::Permissions::from_mode(0o666)); // less the user's umask, as any new file
        let (part, registered) =
            Registered::make(|| part.tempfile_in(folder(path)), |part: &NamedTempFile| part.path().to_owned())
                .map_err(|error| cannot_write(path, error))?;
        Ok(Self { path: path.to_owned(), force, part: BufWriter::new(part), registered })
    }

    /// Syncs the file to disk and gives it its name.
    pub fn finish(self) -> Result<(), Failure> {
        let Self { path, force, part, registered } = self;
        let part = part.into_inner().map_err(|error| cannot_write(&path, error.into_error()))?;
        part.as_file().sync_all().map_err(|error| cannot_write(&path, error))?;
        let named = if force { part.persist(&path) } else { part.persist_noclobber(&path) };
        drop(registered);
        match named {
            Ok(_) => Ok(()),
            Err(error) if error.error.kind() == io::ErrorKind::AlreadyExists => Err(exists(&path)),
            Err(error) => Err(cannot_write(&path, error.error)),
        }
    }

    /// Writes all of `bytes` and finishes.
    pub fn finish_with(mut self, bytes: &[u8]) -> Result<(), Failure> {
        self.part.write_all(bytes).map_err(|error| cannot_write(&self.path, error))?;
        self.finish()
    }

    /// The name that the file will have.
    pub fn path(&self) -> &Path {
        &self.path
    }
}

impl Write for NewFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.part.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.part.flush()
    }
}

impl io::Seek for NewFile {
    fn seek(&mut self, position: io::SeekFrom) -> io::Result<u64> {
        self.part.seek(position)
    }
}

/// A file that is there, under its name, from the first byte: for data that must survive the death of the program.
#[derive(Debug)]
pub struct LiveFile {
    path: PathBuf,
    force: bool,
}

impl LiveFile {
    /// Refuses an existing file; creates nothing yet, so that a device that does not answer leaves no empty file.
    pub fn claim(path: &Path, force: bool) -> Result<Self, Failure> {
        refuse_existing(path, force)?;
        let folder = folder(path);
        if !folder.is_dir() {
            return Err(cannot_write(path, io::Error::new(io::ErrorKind::NotFound, "there is no such folder")));
        }
        Ok(Self { path: path.to_owned(), force })
    }

    /// Creates the file. A file that appeared since [`LiveFile::claim`] is refused too.
    pub fn create(&self) -> Result<File, Failure> {
        let opened = if self.force { File::create(&self.path) } else { File::create_new(&self.path) };
        opened.map_err(|error| match error.kind() {
            io::ErrorKind::AlreadyExists => exists(&self.path),
            _ => cannot_write(&self.path, error),
        })
    }

    /// Removes the file that [`LiveFile::create`] made.
    pub fn discard(&self) -> Result<(), Failure> {
        std::fs::remove_file(&self.path).map_err(|error| cannot_write(&self.path, error))
    }

    /// The file's name.
    pub fn path(&self) -> &Path {
        &self.path
    }
}

/// Where the result of a verb goes. To be flattened into the verb's `Args`.
#[derive(Debug, clap::Args)]
pub struct ResultArgs {
    /// Print the result as JSON to stdout
    #[arg(long)]
    pub json: bool,
    /// Write the result as JSON to this file
    #[arg(short, long, value_name = "FILE.json")]
    pub output: Option<PathBuf>,
    /// Write one self-contained page
    #[arg(long, value_name = "OUT.html")]
    pub report: Option<PathBuf>,
    /// Replace files that exist
    #[arg(long)]
    pub force: bool,
}

impl ResultArgs {
    /// Claims the files. To be called before the long work.
    pub fn claim(&self) -> Result<Outputs, Failure> {
        let claim = |path: &Option<PathBuf>| path.as_deref().map(|path| NewFile::claim(path, self.force)).transpose();
        Ok(Outputs { json: self.json, output: claim(&self.output)?, report: claim(&self.report)? })
    }
}

/// The claimed places of a result.
#[derive(Debug)]
pub struct Outputs {
    json: bool,
    output: Option<NewFile>,
    report: Option<NewFile>,
}

impl Outputs {
    /// Writes the result object to where it was asked for; `page` makes the report and is called only if one is wanted.
    pub fn finish<T: Serialize>(self, ui: &Ui, result: &T, page: impl FnOnce() -> String) -> Result<(), Failure> {
        let text = json(result)?;
        if let Some(file) = self.output {
            ui.say(format_args!("result: {}", file.path().display()));
            file.finish_with(text.as_bytes())?;
        }
        if let Some(file) = self.report {
            ui.say(format_args!("report: {}", file.path().display()));
            file.finish_with(page().as_bytes())?;
        }
        if self.json {
            ui.print(&text)?;
        }
        Ok(())
    }
}

/// A result as JSON for people and programs, a line feed at the end.
pub fn json<T: Serialize + ?Sized>(result: &T) -> Result<String, Failure> {
    report::json(result).map_err(Failure::fault)
}

fn folder(path: &Path) -> &Path {
    match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    }
}

fn refuse_existing(path: &Path, force: bool) -> Result<(), Failure> {
    // symlink_metadata: a dangling link is in the way as well.
    match path.symlink_metadata() {
        Ok(found) if found.is_dir() => {
            Err(Failure::usage(format!("{} is a folder", path.display())).advice("give the name of a file"))
        }
        Ok(_) if !force => Err(exists(path)),
        _ => Ok(()),
    }
}

fn exists(path: &Path) -> Failure {
    Failure::usage(format!("{} exists already, and nothing was overwritten", path.display()))
        .advice("choose another name, or add --force to replace it")
}

fn cannot_write(path: &Path, error: io::Error) -> Failure {
    Failure::device(CannotWrite { path: path.to_owned(), source: error })
        .advice("check that the folder exists, that you may write there, and that the disk has room")
}

#[derive(Debug, thiserror::Error)]
#[error("cannot write {}", path.display())]
struct CannotWrite {
    path: PathBuf,
    source: io::Error,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::command::Exit;

    #[test]
    fn an_existing_file_stays_as_it_was() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("cal.json");
        std::fs::write(&path, "precious").unwrap();
        assert_eq!(NewFile::claim(&path, false).unwrap_err().exit(), Exit::Usage);
        assert_eq!(LiveFile::claim(&path, false).unwrap_err().exit(), Exit::Usage);
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "precious");
    }

    #[test]
    fn a_file_that_appears_during_the_work_is_not_overwritten() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("cal.json");
        let file = NewFile::claim(&path, false).unwrap();
        let live = LiveFile::claim(&path, false).unwrap();
        std::fs::write(&path, "precious").unwrap();
        assert_eq!(file.finish_with(b"new").unwrap_err().exit(), Exit::Usage);
        assert_eq!(live.create().unwrap_err().exit(), Exit::Usage);
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "precious");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "a temporary file was left behind");
    }

    #[test]
    fn force_replaces_only_at_the_end() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("cal.json");
        std::fs::write(&path, "old").unwrap();
        let mut file = NewFile::claim(&path, true).unwrap();
        file.write_all(b"half").unwrap();
        drop(file);
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "old");
        NewFile::claim(&path, true).unwrap().finish_with(b"new").unwrap();
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "new");
    }

    #[test]
    fn a_missing_folder_is_known_before_the_work() {
        let path = Path::new("no/such/folder/cal.json");
        assert_eq!(NewFile::claim(path, false).unwrap_err().exit(), Exit::Device);
        assert_eq!(LiveFile::claim(path, false).unwrap_err().exit(), Exit::Device);
    }
}
