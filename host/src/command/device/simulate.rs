//! `host simulate`: plays robot and microcontroller behind a pseudo-terminal.

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::time::Duration;

use super::connection::write_truth;
use crate::command::{Exit, Failure, NewFile, Ui, interrupt, robot_failure};
use crate::failure::simulate_failure;
use crate::robot::Robot;
use crate::simulate::{
    EffectChoice, Fault, GyroChips, Mistake, Options, Pace, SimulationReport, Simulator, parse_scale,
};

/// Play robot and microcontroller behind a pseudo-terminal
///
/// Prints the path of the port, which `host record --port` opens like any other, and runs until Ctrl-C. The bytes are
/// those of the firmware, whose control core runs inside.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The robot: a built-in name or a description file
    #[arg(long, value_name = "ROBOT", default_value = "doggy")]
    robot: String,
    /// A symbolic link to the port, for a path that does not change
    #[arg(long, value_name = "PATH")]
    link: Option<PathBuf>,
    /// An effect in the plant, as base_bearing, backlash=large, backlash=@-1.5 (a level: -1 is small, 0 medium, 1 large) or backlash=0.008; may be repeated
    #[arg(long = "effect", value_name = "ID[=SIZE]")]
    effects: Vec<EffectChoice>,
    /// Hide an effect drawn by this seed
    #[arg(long, value_name = "SEED")]
    hide: Option<u64>,
    /// Process noise: white torque on motors and links, 1 for a hundredth of the paper's (36)
    #[arg(long, value_name = "SCALE", default_value_t = 0.0, value_parser = scale)]
    process_noise: f64,
    /// Decides true parameters, sizes, noise and faults
    #[arg(long, value_name = "N", default_value_t = 0)]
    seed: u64,
    /// Whether time runs as on a real robot, or in motions as fast as the host keeps up
    #[arg(long, value_enum, default_value_t = Pace::Real)]
    pace: Pace,
    /// drop=RATE, corrupt=RATE, stall-out=SECONDS@TIME, stall-in=SECONDS@TIME or reset@TIME; may be repeated. Times
    /// count from the start of the first motion
    #[arg(long = "fault", value_name = "FAULT")]
    faults: Vec<Fault>,
    /// A mistake of wiring or assembly: encoders-swapped=1+2, motors-swapped=1+2, encoder-reversed=1, leads-reversed=1,
    /// encoder-phase=1 (one is open), counts=1*0.5, gear=1*0.7, gyro-turned=2z or gyro-mirrored=2z; may be repeated
    #[arg(long = "mistake", value_name = "MISTAKE")]
    mistakes: Vec<Mistake>,
    /// What the gyros are
    #[arg(long, value_enum, default_value_t = GyroChips::Ideal)]
    gyros: GyroChips,
    /// Write the true parameters, the effects and the faults injected to this file at the end
    #[arg(long, value_name = "FILE.json")]
    truth: Option<PathBuf>,
    /// Keep the flash of the simulated board in this file, and with it what `host robot push` stored [default: none; gone with the simulation]
    #[arg(long, value_name = "FILE")]
    flash: Option<PathBuf>,
    /// Replace the file of --truth if it exists
    #[arg(long)]
    force: bool,
}

fn scale(text: &str) -> Result<f64, &'static str> {
    parse_scale(text).ok_or("a number, 0 or above")
}

/// Runs until Ctrl-C.
pub fn run(args: Args, ui: &Ui) -> Result<Exit, Failure> {
    let truth = args.truth.as_deref().map(|path| NewFile::claim(path, args.force)).transpose()?;
    let options = Options {
        robot: Robot::load(&args.robot).map_err(robot_failure)?,
        seed: args.seed,
        effects: args.effects,
        hide: args.hide,
        process_noise: args.process_noise,
        pace: args.pace,
        faults: args.faults,
        gyros: args.gyros,
        mistakes: args.mistakes,
        link: args.link,
        truth: args.truth,
        flash: args.flash,
    };
    let over = Arc::new(AtomicBool::new(false));
    let heard = Arc::clone(&over);
    interrupt::instead(move || heard.store(true, Relaxed));

    let simulator = Simulator::start(&options).map_err(simulate_failure)?;
    ui.print(&format!("{}\n", simulator.path().display()))?;
    ui.say(format_args!("{} simulated, seed {}; Ctrl-C ends it", options.robot.name, options.seed));
    while !over.load(Relaxed) && simulator.is_running() {
        std::thread::sleep(Duration::from_millis(20));
    }
    let report = simulator.finish().map_err(simulate_failure)?;
    say_faults(ui, &report);
    write_truth(truth, &report)?;
    Ok(Exit::Ok)
}

/// One line about faults, if any were injected.
pub(super) fn say_faults(ui: &Ui, report: &SimulationReport) {
    let faults = &report.faults;
    let line = &faults.line;
    let injected = line.dropped_frames + line.corrupted_frames > 0 || faults.stalls_out + faults.stalls_in > 0;
    if injected || faults.resets > 0 {
        ui.say(format_args!(
            "injected: {} samples lost on the line ({} frames dropped, {} corrupted), {} stalls, {} resets",
            line.lost_samples(),
            line.dropped_frames,
            line.corrupted_frames,
            faults.stalls_out + faults.stalls_in,
            faults.resets
        ));
    }
}
