//! The emulated machine: the firmware's machine code in QEMU, at the pins of a simulated robot, behind a serial port.
//!
//! ```text
//!                 ┌────────────── QEMU, netduinoplus2 ──────────────┐
//!   World ◀─FIFO─▶│ board/emulated ◀─▶ tasks ◀─▶ control core       │
//!   plant, chips  │                     └──▶ USART1 ────────────────┼─▶ line at 921,600 baud ─▶ pty ─▶ host
//!   motors, pins  │   received bytes ◀── exchange ◀─────────────────┼── line ◀───────────────── pty ◀─ host
//!                 └─────────────────────────────────────────────────┘
//! ```
//!
//! The way of time. The emulator's clock stands still while it waits for an answer of the world, and a tick is answered
//! when the host has kept up (`host::simulate`). So the order of things is:
//!
//! ```text
//!   host      heartbeat, request … ─────────┐                ┌─▶ samples
//!   machine   ─ tick k asked ─ wait for it ─┴─ answer ─ run ─┴─ tick k+1 asked ─ …
//!   device              stands still              1 ms           stands still
//! ```
//!
//! A slow or busy PC makes the machine slower and changes nothing else; no test looks at a clock on the wall.

mod controller;
mod fault;
pub mod image;
mod line_monitor;
mod log;
mod qemu;
pub mod replay;

use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};

use ::host::effect::TrueValue;
use ::host::robot::Robot;
use ::host::simulate::{self, Drawn, Fault, GyroChips, Pace, SimulationReport, Simulator};

use tempfile::TempDir;

use crate::host;
use controller::Machine;
pub use fault::{FaultKind, TimedFault};
pub use image::{image, observer_image};
pub use log::{Log, Period};
pub use qemu::said;

/// A motion of two seconds with a duty on some motor in nearly every tick: what stops it can be measured at once.
pub const SWING: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/src/machine/swing.toml");

/// A slow move of the pitch, 0.45 rad far, which takes a second and a half.
pub const REACH: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/src/machine/reach.toml");

/// What to emulate.
#[derive(Debug, Clone, Default)]
pub struct Options {
    /// Decides everything that is drawn.
    pub seed: u64,
    /// The tick in which the motion starts, if it is known beforehand; from it on a recording depends on the seed only.
    pub start_tick: Option<u32>,
    /// What goes wrong at the pins and in the processor.
    pub machine_faults: Vec<TimedFault>,
    /// What goes wrong on the line.
    pub faults: Vec<Fault>,
    /// Gyros convert when they are read and do not filter, though the image tells of real ones.
    pub ideal_gyros: bool,
    /// The first gyro answers from so many ticks after power-on on; before, its lines are low.
    pub gyro1_from_tick: u32,
    /// The leads of this motor, from 0, are swapped.
    pub swapped_leads: Option<usize>,
}

/// What `host record` made of a machine.
pub struct Recorded {
    /// Its exit code.
    pub code: Option<i32>,
    /// What it printed.
    pub said: String,
    /// The recording, until this is dropped.
    pub file: PathBuf,
    _scratch: TempDir,
}

/// A running machine. Dropped, it ends, and the emulator with it.
pub struct Emulated {
    simulator: Simulator,
    log: Arc<Mutex<Log>>,
    truth: Vec<TrueValue>,
}

impl Emulated {
    /// Builds the image if need be, starts the emulator and opens the port.
    ///
    /// # Panics
    /// If anything of that fails; the message says what is missing.
    pub fn start(options: &Options) -> Self {
        let robot = Robot::builtin("doggy").expect("the built-in robot is valid");
        let mut wanted = simulate::Options::new(robot);
        (wanted.seed, wanted.pace, wanted.faults) = (options.seed, Pace::Patient, options.faults.clone());
        wanted.gyros = if options.ideal_gyros { GyroChips::Ideal } else { GyroChips::Real };
        let Drawn { world, truth, .. } = Drawn::new(&wanted).expect("the built-in robot can be simulated");
        let log = Arc::new(Mutex::new(Log::default()));
        let machine = Machine::start(world, options, Arc::clone(&log));
        let simulator = Simulator::of(Box::new(machine), &wanted).expect("there is a pseudo-terminal");
        Self { simulator, log, truth }
    }

    /// The serial port, as `--port` takes it.
    pub fn port(&self) -> PathBuf {
        Path::to_owned(self.simulator.path())
    }

    /// Records this machine with `host record`, in its marked pose, with these options more.
    pub fn record(&self, more: &[&str]) -> Recorded {
        let scratch = tempfile::tempdir().expect("there is room for scratch files");
        let file = scratch.path().join("run.mcap");
        let port = self.port();
        let mut record = host();
        record.args(["record", "--set-zero", "--port"]).arg(port).arg("-o").arg(&file).args(more);
        let output = record.output().expect("the host binary can be started");
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        Recorded { code: output.status.code(), said, file, _scratch: scratch }
    }

    /// The true parameters of the robot.
    pub fn truth(&self) -> &[TrueValue] {
        &self.truth
    }

    /// Whether it still runs; if not, [`Self::finish`] tells why.
    pub fn is_running(&self) -> bool {
        self.simulator.is_running()
    }

    /// What the pins have shown so far.
    pub fn so_far<T>(&self, look: impl FnOnce(&Log) -> T) -> T {
        look(&self.log.lock().unwrap_or_else(|poisoned| poisoned.into_inner()))
    }

    /// Ends the machine; what the pins showed, and what the line did.
    ///
    /// # Panics
    /// If the machine had ended by itself.
    pub fn finish(self) -> (Log, SimulationReport) {
        let report = self.simulator.finish().unwrap_or_else(|error| panic!("{error}"));
        let log = std::mem::take(&mut *self.log.lock().unwrap_or_else(|poisoned| poisoned.into_inner()));
        (log, report)
    }
}
