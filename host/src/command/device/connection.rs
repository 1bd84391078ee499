//! The line to a device: its options, a simulated robot in the place of a port, and failures of the line.

use std::ops::RangeInclusive;
use std::path::Path;

use protocol::Hello;
use protocol::budget::BAUD;

use crate::command::{Failure, NewFile, Ui, interrupt, json};
use crate::failure::simulate_failure;
use crate::link::{self, Device, LinkError, Options};
use crate::simulate::{self, SimulationReport, Simulator};

/// Bits per second that a serial line may be asked for; 0 is none.
pub(super) const BAUDS: RangeInclusive<i64> = 1200..=20_000_000;

/// To be flattened into the `Args` of a verb that speaks to one device.
#[derive(Debug, clap::Args)]
pub(super) struct Connection {
    /// The robot's serial device, or sim: with the options of simulate, as sim:seed=3,effect=base_bearing
    #[arg(long, value_name = "PORT")]
    pub(super) port: String,
    /// Bits per second on the line
    #[arg(long, value_name = "BAUD", default_value_t = BAUD, value_parser = clap::value_parser!(u32).range(BAUDS))]
    pub(super) baud: u32,
}

/// A simulated robot, how it was asked for, and where its truth is to be written.
pub(super) type Simulated = (Simulator, simulate::Options, Option<NewFile>);

impl Connection {
    /// A simulated robot for the port's name, if it is one (`sim:…`).
    pub(super) fn simulated(&self, force: bool) -> Result<Option<Simulated>, Failure> {
        let Some(options) = self.port.strip_prefix("sim:") else { return Ok(None) };
        let options = simulate::Options::parse(options).map_err(simulate_failure)?;
        let truth = options.truth.as_deref().map(|path: &Path| NewFile::claim(path, force)).transpose()?;
        let simulator = Simulator::start(&options).map_err(simulate_failure)?;
        Ok(Some((simulator, options, truth)))
    }

    /// The device at the port, or the simulated one.
    pub(super) fn open(&self, simulated: Option<&Simulated>) -> Result<Device, Failure> {
        Device::open(&self.path(simulated), &self.options()).map_err(link_failure)
    }

    /// The same without its line: who is there after a line was lost.
    pub(super) fn probe(&self, simulated: Option<&Simulated>) -> Result<Hello, LinkError> {
        link::probe(&self.path(simulated), &self.options())
    }

    fn path(&self, simulated: Option<&Simulated>) -> String {
        simulated.map_or(self.port.clone(), |(simulator, ..)| simulator.path().display().to_string())
    }

    fn options(&self) -> Options {
        Options { baud: self.baud, ..Options::default() }
    }

    /// The same, for a verb that Ctrl-C ends by stopping what is under way.
    pub(super) fn open_for_requests(&self, simulated: Option<&Simulated>, ui: &Ui) -> Result<Device, Failure> {
        let connecting = ui.busy("connecting");
        let device = self.open(simulated)?;
        let stopper = device.stopper();
        // What is under way fails for it.
        interrupt::instead(move || stopper.stop());
        drop(connecting);
        Ok(device)
    }
}

/// A device that cannot be used.
pub(super) fn link_failure(error: LinkError) -> Failure {
    let advice = error.advice();
    Failure::device(error).advice(advice)
}

/// Writes what a simulation knows to the file that was claimed for it.
pub(super) fn write_truth(file: Option<NewFile>, report: &SimulationReport) -> Result<(), Failure> {
    let Some(file) = file else { return Ok(()) };
    file.finish_with(json(report)?.as_bytes())
}
