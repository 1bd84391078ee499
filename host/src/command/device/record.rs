//! `host record`: plays a motion on a robot and records it.

use std::io::IsTerminal;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::{Arc, Mutex};

use protocol::budget::{self};
use protocol::{Hello, Motion};

use super::connection::{Connection, link_failure, write_truth};
use super::simulate::say_faults;
use crate::command::{Exit, Failure, LiveFile, Progress, Ui, interrupt, robot_failure};
use crate::failure::{Kind, simulate_failure};
use crate::link::{
    self, CaptureError, Captured, Device, Dictionary, ElfError, LinkError, News, Ready, Restart, ScaleError, Stopper,
    Zero, reset_name,
};
use crate::robot::Robot;

/// Play a motion on a robot and record it
///
/// The robot must know its zero positions: hold it in its marked pose and give --set-zero, once after it was switched
/// on. Ctrl-C stops the robot and closes the recording. A recording that was cut off by force is readable up to its
/// last half second.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(flatten)]
    connection: Connection,
    /// calibration, validation, or a motion file
    #[arg(long, value_name = "MOTION", default_value = "calibration")]
    motion: String,
    /// The robot: a built-in name or a description file [default: the one that the device names]
    #[arg(long, value_name = "ROBOT")]
    robot: Option<String>,
    /// Take the present pose as zero: the robot is held in its marked pose
    #[arg(long)]
    set_zero: bool,
    /// Clear the fault of an emergency stop: it is released, and nobody is in reach of the robot
    #[arg(long)]
    clear_stop: bool,
    /// Show and keep the firmware's log: the ELF file that was flashed
    #[arg(long, value_name = "FIRMWARE")]
    elf: Option<PathBuf>,
    /// The motion starts in this tick of the device, which counts from 0 when it starts [default: the next one]
    #[arg(long, value_name = "N")]
    start_tick: Option<u32>,
    /// The recording to make
    #[arg(short, long, value_name = "RUN.mcap")]
    output: PathBuf,
    /// Replace the recording if it exists
    #[arg(long)]
    force: bool,
}

/// Connects, makes ready, plays and records.
pub fn run(args: Args, ui: &Ui) -> Result<Exit, Failure> {
    let file = LiveFile::claim(&args.output, args.force)?;
    let mut robot = args.robot.as_deref().map(Robot::load).transpose().map_err(robot_failure)?;
    let wanted = Wanted::of(&args.motion)?;
    let dictionary = args.elf.as_deref().map(Dictionary::load).transpose().map_err(elf_failure)?;
    let simulated = args.connection.simulated(args.force)?;
    let interrupt = Interrupt::listen();

    let connecting = ui.busy("connecting");
    robot = robot.or_else(|| simulated.as_ref().map(|(_, simulation, _)| simulation.robot.clone()));
    let mut device = args.connection.open(simulated.as_ref())?;
    interrupt.guards(device.stopper());
    drop(connecting);
    let identity = &device.hello().identity;
    let started = reset_name(device.hello().reset);
    ui.say(format_args!(
        "{}: {}, firmware {}, started: {started}",
        args.connection.port,
        link::printable(&identity.robot),
        link::printable(&identity.firmware_version)
    ));
    say_restart(ui, device.hello());
    if let Some(other) = link::runs(device.hello()).other {
        ui.warn(other, "switch the device off and on; if it still does not run, this firmware cannot run it: `host robot push` tells why");
    }
    let dictionary = dictionary.filter(|dictionary| match dictionary.fits(device.hello()) {
        Ok(()) => true,
        Err(error) => {
            ui.warn(format_args!("the firmware's log is not read: {error}"), error.advice());
            false
        }
    });
    let ticks_per_s = 1_000_000 / u32::from(device.hello().tick_us);
    if !budget::carries(&device.hello().layout, ticks_per_s, args.connection.baud) {
        return Err(Failure::usage(format!(
            "{} baud cannot carry {ticks_per_s} samples a second",
            args.connection.baud
        ))
        .advice("give a higher --baud, and set the firmware to the same"));
    }
    let robot = match robot {
        Some(robot) => robot,
        None => Robot::builtin(&link::printable(&identity.robot))
            .map_err(|error| robot_failure(error).advice("name the robot's description file with --robot"))?,
    };
    let (motion, text) = wanted.fitted(&robot)?;
    // A simulated robot starts in its marked pose.
    let zero = if simulated.is_some() { Zero::Set } else { ask_for_zero(&args, &device, ui)? };

    let preparing = ui.busy("uploading");
    if args.clear_stop {
        device.clear_stop().map_err(link_failure)?;
    }
    let mut ready = Ready::prepare(&mut device, &robot, &motion, text, zero).map_err(capture_failure)?;
    if let Some(tick) = args.start_tick {
        ready = ready.starting_at(tick);
    }
    if let Some(dictionary) = dictionary {
        ready = ready.reading_log(dictionary);
    }
    drop(preparing);
    interrupt.recording.store(true, Relaxed);
    let bar = ui.progress("starting", 1000);
    let mut in_file = None;
    let captured = ready.run(file.create()?, &interrupt.wished, |news| match news {
        News::Closed(captured) => in_file = Some(*captured),
        News::Progress(now) => show(&bar, &now),
        News::Log(line) => ui.firmware(line),
        News::LogUnread if args.elf.is_some() => {}
        News::LogUnread => ui.say("the firmware logs; --elf FIRMWARE, the file that was flashed, shows it"),
    });
    drop(bar);
    drop(device);
    interrupt.releases();
    if let Err(CaptureError::Link(LinkError::Restarted { .. })) = &captured
        && let Ok(hello) = args.connection.probe(simulated.as_ref())
    {
        say_restart(ui, &hello);
    }
    if let Some((simulator, _, truth)) = simulated {
        let report = simulator.finish().map_err(simulate_failure)?;
        say_faults(ui, &report);
        write_truth(truth, &report)?;
    }
    match captured {
        Ok(captured) => {
            say_captured(ui, &args, &captured);
            Ok(Exit::Ok)
        }
        // Nothing was recorded that is worth a file.
        Err(error @ CaptureError::Link(LinkError::Refused { .. })) => {
            file.discard()?;
            Err(capture_failure(error))
        }
        Err(error) => {
            if let Some(captured) = &in_file {
                say_captured(ui, &args, captured);
            }
            Err(capture_failure(error))
        }
    }
}

fn say_captured(ui: &Ui, args: &Args, captured: &Captured) {
    let Captured { samples, duration_s, balance, refused, log } = captured;
    ui.say(format_args!("{}: {samples} samples in {duration_s:.1} s, {}", args.output.display(), losses(balance)));
    if *refused > 0 {
        let what = format_args!("{refused} samples could not follow the ones before them and were left out");
        ui.warn(what, "reset the device before the next recording");
    }
    if log.lost_bytes + log.unread_frames > 0 {
        ui.say(format_args!(
            "the firmware's log: {} lines, {} not readable, {} bytes lost on the line",
            log.lines, log.unread_frames, log.lost_bytes
        ));
    }
}

pub(super) fn losses(balance: &crate::recording::LossBalance) -> String {
    format!(
        "{} lost (device {}, host {}, line {}; {} damaged frames{})",
        balance.missing,
        balance.device_dropped,
        balance.host_dropped,
        balance.line_lost,
        balance.damaged_frames,
        if balance.closed { "" } else { "; not confirmed by the device" }
    )
}

/// A warning if the device's last start was not an ordinary one.
fn say_restart(ui: &Ui, hello: &Hello) {
    if let Some(Restart { by, advice }) = link::restart(hello) {
        ui.warn(format_args!("the device was restarted by {by}"), advice);
    }
}

/// How far it is, on the terminal.
fn show(bar: &Progress, now: &link::Progress<'_>) {
    bar.stage(now.stage.unwrap_or("starting"));
    bar.at(now.per_mille());
    let (rate_hz, lost) = (now.rate_hz, now.balance.missing);
    bar.note(match now.starts_in_ticks {
        Some(ticks) => format!("{rate_hz:.0} Hz, {lost} lost, starts in {ticks} ticks"),
        None => format!("{rate_hz:.0} Hz, {lost} lost"),
    });
}

/// What the user wants played.
enum Wanted {
    Preset(String),
    File(Box<Motion>, String),
}

impl Wanted {
    /// Reads the motion file, if it is one. To be called before anything is connected.
    fn of(name_or_path: &str) -> Result<Self, Failure> {
        if matches!(name_or_path, "calibration" | "validation") {
            return Ok(Self::Preset(name_or_path.to_owned()));
        }
        let text = std::fs::read_to_string(name_or_path).map_err(|error| {
            Failure::device(format!("cannot read the motion {name_or_path}: {error}"))
                .advice("give calibration, validation, or the path of a motion file")
        })?;
        let motion = toml::from_str(&text).map_err(|error| {
            Failure::data(format!("{name_or_path} is not a motion: {error}"))
                .advice("correct the file at that place; every recording holds its motion as an example (motion.toml)")
        })?;
        Ok(Self::File(Box::new(motion), text))
    }

    /// The motion for a robot, and its text for the recording.
    fn fitted(self, robot: &Robot) -> Result<(Motion, String), Failure> {
        match self {
            Self::File(motion, text) => Ok((*motion, text)),
            Self::Preset(name) => {
                let (motion, text) = link::preset_motion(&name, robot).ok_or_else(|| Failure::fault(name))?;
                Ok((motion, text.map_err(Failure::fault)?))
            }
        }
    }
}

/// Whether the pose is to be taken as zero; on a terminal the user is asked to hold the robot.
fn ask_for_zero(args: &Args, device: &Device, ui: &Ui) -> Result<Zero, Failure> {
    if args.set_zero {
        return Ok(Zero::Set);
    }
    if device.hello().zero.is_some() {
        return Ok(Zero::Keep);
    }
    if !(std::io::stdin().is_terminal() && std::io::stderr().is_terminal()) {
        return Err(capture_failure(CaptureError::Scale(ScaleError::NotZeroed)));
    }
    ui.say("The robot does not know its zero positions yet.");
    ui.say("Hold it in its marked pose and press Enter (Ctrl-C to leave): ");
    let mut line = String::new();
    match std::io::stdin().read_line(&mut line) {
        Ok(1..) => Ok(Zero::Set),
        _ => Err(capture_failure(CaptureError::Scale(ScaleError::NotZeroed))),
    }
}

/// Ctrl-C, or a polite end by the system: the stop goes out from the signal's own thread, whatever else waits.
#[derive(Clone, Default)]
struct Interrupt {
    wished: Arc<AtomicBool>,
    /// A recording is under way and wants to be closed.
    recording: Arc<AtomicBool>,
    guarded: Arc<Mutex<Option<Stopper>>>,
}

impl Interrupt {
    fn listen() -> Self {
        let interrupt = Self::default();
        let heard = interrupt.clone();
        interrupt::instead(move || {
            heard.wished.store(true, Relaxed);
            if let Some(stopper) = &*heard.guarded.lock().unwrap_or_else(|e| e.into_inner()) {
                stopper.stop();
            }
            if !heard.recording.load(Relaxed) {
                interrupt::leave(Exit::Device as u8);
            }
        });
        interrupt
    }

    /// The device is closed; its stopper would hold the port.
    fn releases(&self) {
        *self.guarded.lock().unwrap_or_else(|e| e.into_inner()) = None;
    }

    fn guards(&self, stopper: Stopper) {
        *self.guarded.lock().unwrap_or_else(|e| e.into_inner()) = Some(stopper);
    }
}

/// A file that does not help to read the firmware's log.
fn elf_failure(error: ElfError) -> Failure {
    let advice = error.advice();
    let kind = if matches!(error, ElfError::Open { .. }) { Kind::Device } else { Kind::Data };
    Failure::new(kind, error).advice(advice)
}

/// A recording that was not made, or not to its end.
fn capture_failure(error: CaptureError) -> Failure {
    let (kind, advice) = (kind_of(&error), error.advice());
    Failure::new(kind, error).advice(advice)
}

fn kind_of(error: &CaptureError) -> Kind {
    match error {
        CaptureError::Scale(ScaleError::NotZeroed) => Kind::Device,
        CaptureError::Scale(_) | CaptureError::Motion { .. } => Kind::Data,
        _ => Kind::Device,
    }
}
