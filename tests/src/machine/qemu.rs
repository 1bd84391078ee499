//! The emulator's process, its FIFOs and its monitor.

use std::fs::{File, OpenOptions};
use std::io::{self, Read, Write};
use std::os::fd::AsFd;
use std::os::unix::fs::OpenOptionsExt;
use std::os::unix::net::UnixStream;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use firmware::lockstep::{FROM_WORLD, MAX_MESSAGE, Request, TO_WORLD};
use nix::fcntl::OFlag;
use nix::poll::{PollFd, PollFlags, PollTimeout, poll};
use nix::sys::stat::Mode;
use tempfile::TempDir;

const EMULATOR: &str = "qemu-system-arm";
/// How it is installed.
const INSTALL: &str = "apt-get update && apt-get install -y --no-install-recommends qemu-system-arm";
/// What the USART sends.
const USART: &str = "usart";
const MONITOR: &str = "monitor";
const PROMPT: &[u8] = b"(qemu) ";
/// How long an emulator that should run may say nothing. It takes a millisecond; a busy PC may take seconds.
const PATIENCE: Duration = Duration::from_secs(60);
const LOOK_MS: u16 = 200;

/// A running emulator. Dropped, it is ended. If this process dies, the image finds the FIFOs closed and ends it.
#[derive(Debug)]
pub struct Qemu {
    child: Child,
    folder: TempDir,
    to_world: File,
    from_world: File,
    usart: File,
    /// Messages read and not taken yet.
    read: Vec<u8>,
}

/// The emulated machine with an image.
fn emulator(image: &Path) -> Command {
    let mut command = Command::new(EMULATOR);
    command
        .args(["-M", "netduinoplus2", "-display", "none", "-kernel"])
        .arg(image)
        .args(["-semihosting-config", "enable=on,target=native"])
        // 8 ns an instruction, and no waiting for the clock on the wall: the same run every time.
        .args(["-icount", "shift=3,sleep=off"]);
    command
}

/// What an image says that has no world around it, until its end.
///
/// # Panics
/// If it does not end well, or there is no emulator.
pub fn said(image: &Path) -> String {
    let output = emulator(image).args(["-serial", "null"]).output();
    let output = output.unwrap_or_else(|error| panic!("{EMULATOR}: {error}. Install it with:\n    {INSTALL}"));
    let said = String::from_utf8_lossy(&output.stdout).into_owned() + &String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{said}");
    said
}

impl Qemu {
    /// Starts an image.
    ///
    /// # Panics
    /// If there is no emulator; the message has the command that installs it.
    pub fn start(image: &Path) -> io::Result<Self> {
        let folder = tempfile::tempdir()?;
        for name in [TO_WORLD, FROM_WORLD, USART] {
            nix::unistd::mkfifo(&folder.path().join(name), Mode::S_IRUSR | Mode::S_IWUSR)?;
        }
        // Opened both ways, so that neither side waits for the other, and a reset of the machine is no end of file.
        let open = |name: &str, flags: OFlag| {
            OpenOptions::new().read(true).write(true).custom_flags(flags.bits()).open(folder.path().join(name))
        };
        let (to_world, from_world) = (open(TO_WORLD, OFlag::empty())?, open(FROM_WORLD, OFlag::empty())?);
        let usart = open(USART, OFlag::O_NONBLOCK)?;
        let child = emulator(image)
            .args(["-serial", &format!("file:{USART}")])
            .args(["-monitor", &format!("unix:{MONITOR},server=on,wait=off")])
            .current_dir(folder.path())
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(File::create(folder.path().join("stderr"))?)
            .spawn();
        let child = match child {
            Err(error) if error.kind() == io::ErrorKind::NotFound => {
                panic!("{EMULATOR} is missing. Install it with:\n    {INSTALL}")
            }
            child => child?,
        };
        Ok(Self { child, folder, to_world, from_world, usart, read: Vec::new() })
    }

    /// The next request of the image.
    pub fn request(&mut self) -> Result<Request, String> {
        let since = Instant::now();
        loop {
            if let Some(len) = self.read.first().map(|len| usize::from(*len) + 1)
                && self.read.len() >= len
            {
                let message: Vec<u8> = self.read.drain(..len).collect();
                return Request::read(&message[1..])
                    .map_err(|_| format!("a message that is none of this version: {message:x?}"));
            }
            let mut ends = [PollFd::new(self.to_world.as_fd(), PollFlags::POLLIN)];
            if poll(&mut ends, PollTimeout::from(LOOK_MS)).map_err(|error| error.to_string())? > 0 {
                let mut chunk = [0; 4 * MAX_MESSAGE];
                let n = self.to_world.read(&mut chunk).map_err(|error| error.to_string())?;
                self.read.extend_from_slice(&chunk[..n]);
            } else if let Ok(Some(status)) = self.child.try_wait() {
                return Err(format!("the emulator ended with {status}: {}", self.last_words()));
            } else if since.elapsed() > PATIENCE {
                return Err(format!("the image hangs: no request for {PATIENCE:?}; {}", self.last_words()));
            }
        }
    }

    /// Answers it, in one piece.
    pub fn reply(&mut self, message: &[u8]) -> Result<(), String> {
        self.from_world.write_all(message).map_err(|error| error.to_string())
    }

    /// Takes what the USART sent.
    pub fn sent(&mut self, into: &mut Vec<u8>) -> Result<(), String> {
        let mut chunk = [0; 4096];
        loop {
            match self.usart.read(&mut chunk) {
                Ok(n) => into.extend_from_slice(&chunk[..n]),
                Err(error) if error.kind() == io::ErrorKind::WouldBlock => return Ok(()),
                Err(error) => return Err(error.to_string()),
            }
        }
    }

    /// Pulls the reset of the machine; it has been when this returns. The image has read the last reply before: what it
    /// leaves in the FIFO would answer its next request.
    pub fn reset(&mut self) -> Result<(), String> {
        let since = Instant::now();
        while self.is_unread().map_err(|error| error.to_string())? {
            if since.elapsed() > PATIENCE {
                return Err(format!("the image does not read; {}", self.last_words()));
            }
            std::thread::sleep(Duration::from_millis(1));
        }
        self.command("system_reset").map_err(|error| format!("the emulator's monitor: {error}"))
    }

    /// Whether the last reply still lies in the FIFO.
    fn is_unread(&self) -> io::Result<bool> {
        let mut ends = [PollFd::new(self.from_world.as_fd(), PollFlags::POLLIN)];
        Ok(poll(&mut ends, PollTimeout::ZERO)? > 0)
    }

    /// A command of the monitor: it is done when the next prompt comes. Who hangs up earlier is not heard.
    fn command(&self, command: &str) -> io::Result<()> {
        let mut monitor = UnixStream::connect(self.folder.path().join(MONITOR))?;
        monitor.set_read_timeout(Some(PATIENCE))?;
        let (mut printed, mut chunk) = (Vec::new(), [0; 1024]);
        let mut until_prompt = |monitor: &mut UnixStream, prompts: usize| {
            while printed.windows(PROMPT.len()).filter(|text| *text == PROMPT).count() < prompts {
                match monitor.read(&mut chunk)? {
                    0 => return Err(io::ErrorKind::UnexpectedEof.into()),
                    n => printed.extend_from_slice(&chunk[..n]),
                }
            }
            Ok(())
        };
        until_prompt(&mut monitor, 1)?;
        monitor.write_all(format!("{command}\n").as_bytes())?;
        until_prompt(&mut monitor, 2)
    }

    fn last_words(&self) -> String {
        std::fs::read_to_string(self.folder.path().join("stderr")).unwrap_or_default()
    }
}

impl Drop for Qemu {
    fn drop(&mut self) {
        // Ended already is as good.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
