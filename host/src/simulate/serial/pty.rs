//! A pseudo-terminal: the simulated serial port.
//!
//! The simulation holds the master end. It keeps the other end open itself only while no host has it: so a host that
//! closes the port, or dies, is noticed, and nothing of its settings stays.

use std::fs::{File, OpenOptions};
use std::io::{self, Read, Write};
use std::os::fd::{AsFd, OwnedFd};
use std::path::{Path, PathBuf};
use std::time::Duration;

use nix::fcntl::{FcntlArg, OFlag, fcntl};
use nix::poll::{PollFd, PollFlags, PollTimeout, poll};
use nix::pty::openpty;
use nix::sys::termios::{SetArg, cfmakeraw, tcgetattr, tcsetattr};
use nix::unistd::ttyname;

/// The simulated end of a serial port.
#[derive(Debug)]
pub struct Pty {
    master: File,
    path: PathBuf,
    /// Our own hold on the host's end, while no host has it.
    held: Option<OwnedFd>,
    link: Option<PathBuf>,
}

impl Pty {
    /// Opens one; with `link`, a symbolic link by that name leads to it until it is dropped.
    ///
    /// # Errors
    /// The operating system's. A `link` that exists is replaced only if it is a link to nowhere.
    pub fn open(link: Option<&Path>) -> io::Result<Self> {
        let ends = openpty(None, None)?;
        let path = ttyname(&ends.slave)?;
        make_raw(&ends.slave)?;
        fcntl(&ends.master, FcntlArg::F_SETFL(OFlag::O_NONBLOCK))?;
        if let Some(link) = link {
            let dangling = link.symlink_metadata().is_ok_and(|meta| meta.is_symlink()) && !link.exists();
            if dangling {
                std::fs::remove_file(link)?;
            }
            std::os::unix::fs::symlink(&path, link)?;
        }
        Ok(Self { master: File::from(ends.master), path, held: Some(ends.slave), link: link.map(Path::to_owned) })
    }

    /// The host's end, as `--port` takes it.
    pub fn path(&self) -> &Path {
        self.link.as_deref().unwrap_or(&self.path)
    }

    /// Takes what the host sent, if anything; never waits.
    ///
    /// # Errors
    /// The operating system's, except that a host that went away is no error.
    pub fn read(&mut self, into: &mut Vec<u8>) -> io::Result<()> {
        let mut chunk = [0; 4096];
        loop {
            match self.master.read(&mut chunk) {
                Ok(0) => return Ok(()),
                Ok(n) => {
                    into.extend_from_slice(&chunk[..n]);
                    // There is a host, and it holds its end now.
                    self.held = None;
                }
                Err(error) if error.kind() == io::ErrorKind::WouldBlock => return Ok(()),
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                Err(error) if is_hang_up(&error) => return self.hold(),
                Err(error) => return Err(error),
            }
        }
    }

    /// Hands as much to the host as there is room for; never waits. What was taken is removed from `bytes`.
    ///
    /// # Errors
    /// The operating system's. What is sent to a host that went away is gone, as on a cable.
    pub fn write(&mut self, bytes: &mut Vec<u8>) -> io::Result<()> {
        while !bytes.is_empty() {
            match self.master.write(bytes) {
                Ok(n) => drop(bytes.drain(..n)),
                Err(error) if error.kind() == io::ErrorKind::WouldBlock => break,
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                Err(error) if is_hang_up(&error) => {
                    bytes.clear();
                    return self.hold();
                }
                Err(error) => return Err(error),
            }
        }
        Ok(())
    }

    /// Waits until the host has sent something or the time is over.
    ///
    /// # Errors
    /// The operating system's.
    pub fn wait(&self, patience: Duration) -> io::Result<()> {
        let mut ends = [PollFd::new(self.master.as_fd(), PollFlags::POLLIN)];
        let timeout = PollTimeout::try_from(patience).unwrap_or(PollTimeout::MAX);
        match poll(&mut ends, timeout) {
            Ok(_) | Err(nix::errno::Errno::EINTR) => Ok(()),
            Err(error) => Err(error.into()),
        }
    }

    /// Whether a host has been heard and has not gone since.
    pub fn has_host(&self) -> bool {
        self.held.is_none()
    }

    /// Takes the host's end while no host has it.
    fn hold(&mut self) -> io::Result<()> {
        let end = OwnedFd::from(OpenOptions::new().read(true).write(true).open(&self.path)?);
        make_raw(&end)?;
        self.held = Some(end);
        Ok(())
    }
}

impl Drop for Pty {
    fn drop(&mut self) {
        if let Some(link) = &self.link {
            // Gone already is as good.
            let _ = std::fs::remove_file(link);
        }
    }
}

/// Linux tells a master end that nobody holds the other by EIO.
fn is_hang_up(error: &io::Error) -> bool {
    error.raw_os_error() == Some(nix::errno::Errno::EIO as i32)
}

/// Bytes as they are: no echo, no line editing, no signals.
fn make_raw(end: &OwnedFd) -> io::Result<()> {
    let mut settings = tcgetattr(end)?;
    cfmakeraw(&mut settings);
    tcsetattr(end, SetArg::TCSANOW, &settings)?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_pass_both_ways_and_a_second_host_may_follow_the_first() {
        let folder = tempfile::tempdir().unwrap();
        let link = folder.path().join("robot");
        let mut pty = Pty::open(Some(&link)).unwrap();
        for round in 0..3u8 {
            let mut host = OpenOptions::new().read(true).write(true).open(pty.path()).unwrap();
            host.write_all(&[0, 3, 13, 10, 17, 255, round]).unwrap();
            let mut heard = Vec::new();
            pty.wait(Duration::from_secs(5)).unwrap();
            pty.read(&mut heard).unwrap();
            assert_eq!(heard, [0, 3, 13, 10, 17, 255, round], "raw: no byte means anything");
            assert!(pty.has_host());
            pty.write(&mut vec![4, 13, 10, 0, round]).unwrap();
            let mut told = [0; 5];
            host.read_exact(&mut told).unwrap();
            assert_eq!(told, [4, 13, 10, 0, round]);
            drop(host);
            pty.read(&mut heard).unwrap();
            assert!(!pty.has_host(), "the host's leaving was noticed");
        }
        drop(pty);
        assert!(link.symlink_metadata().is_err(), "the link went with the port");
    }

    #[test]
    fn a_file_in_the_way_stays() {
        let folder = tempfile::tempdir().unwrap();
        let link = folder.path().join("precious");
        std::fs::write(&link, "precious").unwrap();
        assert!(Pty::open(Some(&link)).is_err());
        assert_eq!(std::fs::read_to_string(&link).unwrap(), "precious");
        let dangling = folder.path().join("dangling");
        std::os::unix::fs::symlink("/nowhere/at/all", &dangling).unwrap();
        assert!(Pty::open(Some(&dangling)).is_ok());
    }
}
