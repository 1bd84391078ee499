//! `host observe`: the robot's observer on a recording.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

use super::verify::read_calibration;
use super::{Exit, Failure, FitnessArgs, NewFile, ResultArgs, Ui, read_failure};
use crate::calibrate;
use crate::export::Exported;
use crate::failure::observe_failure;
use crate::observe::{self, Consistency, Estimates, Observation, Status, Truth};
use crate::recording;
use crate::report;

/// Run the robot's observer on a recording
///
/// The filter that runs on the device, in the same single precision: an extended Kalman filter over the calibrated model, with the noise that the
/// calibration found. Prints whether its innovations are as large as it says (NIS), the same of its true errors where a simulated robot's
/// truth is given (NEES), and when the robot stopped behaving like its model. Ends with 4 where the filter is not consistent, or
/// where the calibration does not fit its own recording (`--unchecked` ends with 0).
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The calibration
    #[arg(value_name = "CAL.json")]
    calibration: PathBuf,
    /// The recording to observe
    #[arg(value_name = "RUN")]
    recording: PathBuf,
    /// What is read
    #[arg(long, value_enum, default_value = "both")]
    sensors: Sensors,
    /// True states of a simulated robot, a table with `t_us` and any of the states' names as columns
    #[arg(long, value_name = "STATES.csv")]
    truth: Option<PathBuf>,
    /// Write the estimates and their standard deviations as a table, a row a tick
    #[arg(long, value_name = "OUT.csv")]
    estimates: Option<PathBuf>,
    #[command(flatten)]
    fitness: FitnessArgs,
    #[command(flatten)]
    result: ResultArgs,
}

/// What is read.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum Sensors {
    /// Gyros alone; positions start from the encoders
    Gyros,
    /// All but gyros
    Encoders,
    /// All
    Both,
}

impl From<Sensors> for observer::Sensors {
    fn from(sensors: Sensors) -> Self {
        match sensors {
            Sensors::Gyros => Self::Gyros,
            Sensors::Encoders => Self::Encoders,
            Sensors::Both => Self::Both,
        }
    }
}

/// Reads, observes, writes the result, prints its table.
pub fn run(args: Args, ui: &Ui) -> Result<Exit, Failure> {
    let outputs = args.result.claim()?;
    let table = args.estimates.as_deref().map(|path| NewFile::claim(path, args.result.force)).transpose()?;
    let calibration = read_calibration(&args.calibration)?;
    let truth = args.truth.as_deref().map(read_truth).transpose()?;
    let recording = recording::read(&args.recording).map_err(read_failure)?;
    args.fitness.look(&recording, recording.source.path.display(), ui)?;
    let progress = ui.busy("reading");
    let sensors = args.sensors.into();
    let (observation, estimates) =
        observe::observe(&calibration, &recording, sensors, truth.as_ref(), |step| progress.stage(step))
            .map_err(observe_failure)?;
    drop(progress);
    let warning = Exported::of(&calibration).ok().and_then(|exported| exported.warning());
    let but = if warning.is_some() { "; but its calibration is not to be trusted, see below" } else { "" };
    ui.say(format_args!("{}{but}", verdict(&observation)));
    if let Some(warning) = warning {
        ui.say(format_args!("WARNING: {warning}"));
    }
    say(ui, &observation);
    if let Some(file) = table {
        ui.say(format_args!("estimates: {}", file.path().display()));
        write_estimates(file, &recording.t_us, &observation, &estimates)?;
    }
    outputs.finish(ui, &observation, || report::observation::page(&observation, &estimates).to_html())?;
    Ok(match calibration.status {
        _ if args.fitness.unchecked => Exit::Ok,
        _ if observation.status != Status::Consistent => Exit::Data,
        calibrate::Status::DoesNotFit => Exit::Data,
        status if status.is_usable() => Exit::Ok,
        _ => Exit::NoConvergence,
    })
}

/// Whether the filter is consistent, and what to do if not.
fn verdict(observation: &Observation) -> String {
    let innovations = observation.nis.map_or_else(String::new, |nis| {
        format!(
            ": innovations are {:.3} of what it says, {:.1} % of ticks in motion lie within the central 95 %",
            nis.mean_per_dof,
            100.0 * nis.within_95
        )
    });
    let event = observation.events.first();
    let event =
        event.map_or_else(String::new, |event| format!("; from {:.3} s on the robot is not its model", event.t_s));
    let lost = match observation.starts.saturating_sub(1 + observation.recording.gaps) {
        0 => String::new(),
        times => format!("; it lost the robot and started anew {times} times"),
    };
    match observation.status {
        Status::Consistent => format!("the filter is consistent{innovations}"),
        Status::TooSure => format!(
            "the filter is NOT consistent, do not use its estimates{innovations}{event}{lost}; `host diagnose` tells what the model lacks, a new `host calibrate` what has changed"
        ),
        Status::TooCareful => format!(
            "the filter is NOT consistent, its errors are smaller than it says{innovations}; the calibration's noise is not that of this recording: calibrate on this one"
        ),
        Status::NoMotion => {
            "whether the filter is consistent is not known: no position moves further than its sensor's step; observe a motion".to_owned()
        }
    }
}

fn read_truth(path: &Path) -> Result<Truth, Failure> {
    let file = File::open(path)
        .map_err(|error| Failure::device(format!("cannot read the true states {}: {error}", path.display())))?;
    Truth::read(file).map_err(Failure::data)
}

/// A header, then the time, every state and every standard deviation of a tick in a row.
fn write_estimates(file: NewFile, t_us: &[u64], observation: &Observation, found: &Estimates) -> Result<(), Failure> {
    let mut writer = BufWriter::new(file);
    let names: Vec<&str> = observation.states.iter().map(|state| state.name.as_str()).collect();
    let sigmas: Vec<String> = names.iter().map(|name| format!("sigma_{name}")).collect();
    let mut write = || -> std::io::Result<()> {
        writeln!(writer, "t_us,{},{},nis_per_reading", names.join(","), sigmas.join(","))?;
        for (k, t_us) in t_us.iter().enumerate() {
            write!(writer, "{t_us}")?;
            for column in found.states.iter().chain(&found.sigmas) {
                write!(writer, ",{}", column[k])?;
            }
            writeln!(writer, ",{}", found.nis_per_reading[k])?;
        }
        Ok(())
    };
    write().map_err(Failure::device)?;
    writer.into_inner().map_err(|error| Failure::device(error.into_error()))?.finish()
}

fn say(ui: &Ui, observation: &Observation) {
    // Estimates that are not to be used are in the result, for who looks for the cause.
    let is_usable = observation.status != Status::TooSure;
    if is_usable {
        ui.say(format_args!("{:<16}{:>14}{:>14}  unit", "state at the end", "estimate", "± sigma"));
    }
    for state in observation.states.iter().filter(|_| is_usable) {
        let (Some(last), Some(sigma)) = (state.last, state.last_sigma) else { continue };
        ui.say(format_args!("{:<16}{last:>14.6}{sigma:>14.2e}  {}", state.name, state.unit));
    }
    for error in &observation.errors {
        ui.say(format_args!(
            "{}: true error {:.2e} {}, the filter says {:.2e}",
            error.name, error.rms, error.unit, error.rms_sigma
        ));
    }
    let of = |name: &str, found: &Option<Consistency>| {
        if let Some(found) = found {
            ui.say(format_args!(
                "{name}: {:.3} of what it should be, {:.1} % of {} ticks within the central 95 %",
                found.mean_per_dof,
                100.0 * found.within_95,
                found.ticks
            ));
        }
    };
    of("innovations (NIS) in motion", &observation.nis);
    of("true errors (NEES)", &observation.nees);
    if observation.left_out > 0 {
        ui.say(format_args!(
            "{} readings lay beyond 6 standard deviations and were left out, at most three in a row of a sensor",
            observation.left_out
        ));
    }
    for event in &observation.events {
        ui.say(format_args!("at {:.3} s the robot stopped behaving like its model", event.t_s));
    }
}
