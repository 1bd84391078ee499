//! A simulated robot behind a pseudo-terminal, in a thread of its own.
//!
//! Time: at `Pace::Real` a tick takes a millisecond of the host's clock. At `Pace::Fast` a tick of a motion comes as soon
//! as the host has kept up, and one at rest after a millisecond. `Pace::Patient` is the same in a motion; at rest a few
//! ticks pass for every piece that the host sends, and none otherwise. There, time waits for the host's heartbeats and for
//! what it has worked off, so that a slow machine never trips the device's timeout, and nothing runs ahead without
//! bound. A host that closed the port or says nothing for [`PATIENCE`] is gone: time goes on, and the device stops as
//! it should.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use serde::Serialize;

use super::board::Board;
use super::noise::{Purpose, stream};
use super::options::EffectChoice;
use super::serial::pty::Pty;
use super::serial::session::{FaultCounts, Session};
use super::world::gyro_clock::{self, GyroChips};
use super::{Microcontroller, Options, Pace, Plant, ProcessNoise, SimulateError, Truth, World};
use crate::effect::{Hidden, TrueValue};

/// How long the fast pace waits for a host that says nothing.
const PATIENCE: Duration = Duration::from_secs(5);
/// A tick of real time.
const TICK: Duration = Duration::from_millis(1);
/// A machine that stood still for longer is not caught up with: the robot stood still as well. Well below the device's
/// timeout, since the host's heartbeats stood still too.
const MOST_BEHIND: Duration = Duration::from_millis(20);
/// Ticks between looks at the port while time runs fast.
const BATCH: usize = 8;

/// A running simulation. Dropped, it ends.
#[derive(Debug)]
pub struct Simulator {
    path: PathBuf,
    truth: Vec<TrueValue>,
    effects: Vec<EffectTruth>,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<Result<Ran, SimulateError>>>,
}

/// What the thread of a simulation has to tell.
#[derive(Debug)]
struct Ran {
    faults: FaultCounts,
    ticks: u64,
    farthest: Vec<f64>,
}

/// The truth about an effect.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct EffectTruth {
    /// Its id in the catalogue.
    pub id: &'static str,
    /// Its parameters.
    pub parameters: Vec<TrueValue>,
}

/// A robot as a seed draws it, with what is true of it.
#[derive(Debug)]
pub struct Drawn {
    /// The robot and the chips on it.
    pub world: World,
    /// The true parameters of the base model.
    pub truth: Vec<TrueValue>,
    /// The effects in it.
    pub effects: Vec<EffectTruth>,
}

/// What a simulation that ended has to tell.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SimulationReport {
    /// The true parameters of the base model.
    pub truth: Vec<TrueValue>,
    /// The effects.
    pub effects: Vec<EffectTruth>,
    /// The faults injected.
    pub faults: FaultCounts,
    /// Ticks simulated.
    pub ticks: u64,
    /// How far each joint was from its marked pose, motor or link, at most; rad or m.
    pub farthest: Vec<f64>,
}

impl Drawn {
    /// The robot of these options.
    ///
    /// # Errors
    /// [`SimulateError`] if the robot or its effects cannot be simulated.
    pub fn new(options: &Options) -> Result<Self, SimulateError> {
        let robot = &options.robot;
        let truth = Truth::drawn(robot, &mut stream(options.seed, Purpose::Truth));
        let mut hidden = hide(options)?;
        let effects = hidden.iter().map(|h| EffectTruth { id: h.id, parameters: h.values.clone() }).collect();
        if options.gyros != GyroChips::Ideal && robot.gyros().next().is_some() {
            hidden.push(gyro_clock::filter(robot, options.seed));
        }
        let mut plant = Plant::new(robot, &truth, hidden)?;
        if options.process_noise > 0.0 {
            plant = plant.with_process_noise(ProcessNoise::scaled(options.process_noise), options.seed);
        }
        let mut world = World::new(robot, plant, options.seed)?.with_mistakes(robot, &options.mistakes)?;
        if options.gyros != GyroChips::Ideal {
            world = world.with_real_gyros(robot, options.seed, options.gyros == GyroChips::Real);
        }
        Ok(Self { world, truth: truth.values(robot), effects })
    }
}

impl Simulator {
    /// Starts a simulation; a host may open [`Self::path`] at once.
    ///
    /// # Errors
    /// [`SimulateError`] if the robot or its effects cannot be simulated, or there is no pseudo-terminal.
    pub fn start(options: &Options) -> Result<Self, SimulateError> {
        let Drawn { world, truth, effects } = Drawn::new(options)?;
        let mut board = Board::new(&options.robot, world)?;
        if let Some(path) = &options.flash {
            board = board.with_flash(path)?;
        }
        let mut simulator = Self::of(Box::new(board), options)?;
        (simulator.truth, simulator.effects) = (truth, effects);
        Ok(simulator)
    }

    /// Starts a simulation of a microcontroller, at whatever pins it stands; the robot, its seed and its effects are
    /// not taken from the options then, and neither is the truth known.
    ///
    /// # Errors
    /// [`SimulateError`] if there is no pseudo-terminal.
    pub fn of(controller: Box<dyn Microcontroller>, options: &Options) -> Result<Self, SimulateError> {
        let pty = Pty::open(options.link.as_deref())?;
        let path = pty.path().to_owned();
        let session = Session::new(controller, options.faults.clone(), options.seed);
        let stop = Arc::new(AtomicBool::new(false));
        let (pace, theirs) = (options.pace, Arc::clone(&stop));
        let thread = std::thread::Builder::new()
            .name("simulated robot".to_owned())
            .spawn(move || run(session, pty, pace, &theirs))?;
        Ok(Self { path, truth: Vec::new(), effects: Vec::new(), stop, thread: Some(thread) })
    }

    /// The serial port of the robot.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// What is true of the robot.
    pub fn truth(&self) -> &[TrueValue] {
        &self.truth
    }

    /// The effects in it.
    pub fn effects(&self) -> &[EffectTruth] {
        &self.effects
    }

    /// Whether the simulation still runs; if not, [`Self::finish`] tells why.
    pub fn is_running(&self) -> bool {
        self.thread.as_ref().is_some_and(|thread| !thread.is_finished())
    }

    /// Ends the simulation.
    ///
    /// # Errors
    /// Why it ended before.
    pub fn finish(mut self) -> Result<SimulationReport, SimulateError> {
        self.stop.store(true, Relaxed);
        let thread = self.thread.take().ok_or(SimulateError::Died)?;
        let Ran { faults, ticks, farthest } = thread.join().map_err(|_| SimulateError::Died)??;
        let (truth, effects) = (std::mem::take(&mut self.truth), std::mem::take(&mut self.effects));
        Ok(SimulationReport { truth, effects, faults, ticks, farthest })
    }
}

impl Drop for Simulator {
    fn drop(&mut self) {
        self.stop.store(true, Relaxed);
        if let Some(thread) = self.thread.take() {
            // Nobody is left to be told.
            let _ = thread.join();
        }
    }
}

/// The effects asked for, and the hidden one.
fn hide(options: &Options) -> Result<Vec<Hidden>, SimulateError> {
    let robot = &options.robot;
    let mut rng = stream(options.seed, Purpose::Effects);
    let mut hidden = Vec::new();
    for choice in &options.effects {
        hidden.push(choice.effect.hide_in(robot, choice.size, &mut rng)?);
    }
    if let Some(seed) = options.hide {
        let mut rng = stream(seed, Purpose::Hide);
        hidden.push(EffectChoice::hide_one(robot, &mut rng)?);
    }
    Ok(hidden)
}

fn run(mut session: Session, mut pty: Pty, pace: Pace, stop: &AtomicBool) -> Result<Ran, SimulateError> {
    let mut heard = Vec::new();
    let mut due = Instant::now();
    let mut waiting_since: Option<Instant> = None;
    while !stop.load(Relaxed) {
        pty.read(&mut heard)?;
        session.receive(&mut heard);
        pty.write(&mut session.to_host)?;

        let now = Instant::now();
        if !pty.has_host() {
            session.forget_host();
        }
        if pace == Pace::Patient && !session.in_motion() {
            (due, waiting_since) = (now, None);
            if session.is_due() {
                session.tick()?;
            } else {
                pty.wait(TICK)?;
            }
            continue;
        }
        let follows = pace != Pace::Real && session.was_heard() && !session.is_deaf();
        if !follows || session.host_keeps_up() {
            waiting_since = None;
        }
        if follows && session.host_keeps_up() && session.in_motion() {
            due = now;
            for _ in 0..BATCH {
                session.tick()?;
            }
            continue;
        }
        if follows && !session.host_keeps_up() && now - *waiting_since.get_or_insert(now) < PATIENCE {
            due = now;
            // What did not fit into the port is offered again soon: the host may be waiting for it.
            pty.wait(TICK)?;
            pty.read(&mut heard)?;
            if !heard.is_empty() {
                // A heartbeat becomes known by the tick that takes it.
                session.receive(&mut heard);
                session.tick()?;
            }
            continue;
        }
        if now < due {
            std::thread::sleep(due - now);
            continue;
        }
        session.tick()?;
        due += TICK;
        if now > due + MOST_BEHIND {
            due = now;
        }
    }
    Ok(Ran { faults: session.counts(), ticks: session.ticks(), farthest: session.farthest() })
}
