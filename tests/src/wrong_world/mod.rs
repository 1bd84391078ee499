//! The wrong-world study: is a cause found in robots that are not "the base model and one law"?
//!
//! ```text
//! case ─▶ machine (±15 %; the file's fixed numbers ±20 % wrong; friction of another shape)
//!          + main effect + three to eight traces + torque of no law + noise ─▶ recording ─▶ diagnose ─▶ one line of JSON ─▶ Scoreboard
//! ```
//!
//! The plant stands in this folder and shares no physics with the estimator: a chain by recursive Newton–Euler, friction by bristles or slipping
//! elements, hysteresis by slipping springs, contacts with damped play, steps of 0.2 ms. A pair of tests holds both sides to the same meaning of a
//! description file: a machine that is true to its file is calibrated to its own numbers.

mod chain;
mod dynamics;
pub mod effect;
pub mod family;
mod machine;
mod memory;
mod motion;
mod noise;
pub mod outcome;
pub mod outsider;
pub mod said;
mod scoreboard;
mod sensors;
mod session;
#[cfg(test)]
mod tests;
mod unmodelled;

use std::path::Path;

use host::recording::Recording;
use host::robot::Robot;
use rand::RngExt;
use rand::seq::SliceRandom;
use serde::{Deserialize, Serialize};

use effect::{Hiding, Size, Truth};
use family::Family;
use machine::{Fidelity, Machine};
use noise::{Purpose, stream};
use outsider::OutsiderKind;
use session::{Diverged, Played, STEP_S, play};
use unmodelled::Unmodelled;

pub use outcome::{Outcome, outcome};
pub use scoreboard::Scoreboard;

/// Effects in the background of every machine.
const TRACES: std::ops::RangeInclusive<usize> = 3..=8;

/// What is hidden, and in which robot.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Case {
    /// Which family of robots.
    pub family: Family,
    /// Decides everything that is drawn.
    pub seed: u64,
    /// What is hidden over the background.
    pub main: Main,
    /// Its size.
    pub size: Size,
}

/// A main effect.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Main {
    /// None.
    None,
    /// An effect of the catalogue.
    Effect(String),
    /// A law that no catalogue holds.
    Outsider(OutsiderKind),
}

/// What kind of riddle a case is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// A main effect of the catalogue.
    Main,
    /// None.
    Null,
    /// A law that no catalogue holds.
    Outsider,
}

impl Kind {
    /// From its name on the command line.
    pub fn parse(name: &str) -> Option<Self> {
        [("main", Self::Main), ("null", Self::Null), ("outsider", Self::Outsider)]
            .into_iter()
            .find_map(|(known, kind)| (known == name).then_some(kind))
    }
}

impl Case {
    /// What kind it is of.
    pub fn kind(&self) -> Kind {
        match self.main {
            Main::None => Kind::Null,
            Main::Effect(_) => Kind::Main,
            Main::Outsider(_) => Kind::Outsider,
        }
    }

    /// The id of the main effect, where the catalogue has it.
    pub fn effect(&self) -> Option<&str> {
        match &self.main {
            Main::Effect(id) => Some(id),
            Main::None | Main::Outsider(_) => None,
        }
    }
}

/// The whole study: for every seed and family a robot without a main effect, every effect at three sizes, and every outsider at two.
pub fn cases(first: u64, seeds: u64) -> Vec<Case> {
    let mut cases = Vec::new();
    for seed in first..first + seeds {
        for family in Family::ALL {
            let case = |main: Main, size: Size| Case { family, seed, main, size };
            cases.push(case(Main::None, Size::Medium));
            for size in Size::OF_MAINS {
                let effects = family.effects(seed).into_iter();
                cases.extend(effects.map(|id| case(Main::Effect(id.to_owned()), size)));
            }
            for size in [Size::Large, Size::Medium] {
                let outsiders = family.outsiders(seed).into_iter();
                cases.extend(outsiders.map(|kind| case(Main::Outsider(kind), size)));
            }
        }
    }
    cases
}

/// A case as it is played, with the truth.
#[derive(Debug)]
pub struct Drawn {
    /// The description that the diagnosis is given.
    pub robot: Robot,
    /// What was recorded.
    pub recording: Recording,
    /// Parameters of the main effect.
    pub truths: Vec<Truth>,
    /// Ids of the effects in the background.
    pub traces: Vec<String>,
}

/// Draws and plays a case.
///
/// # Errors
/// [`Diverged`], in words, if the machine leaves the range of numbers.
pub fn draw(case: &Case) -> Result<Drawn, String> {
    let Case { family, seed, size, .. } = *case;
    let stream = |purpose| stream(family.stream(), seed, purpose);
    let robot = family.robot(seed);
    let motion = || family.motion(&robot, &mut stream(Purpose::Motion));
    let (sound, _) = Machine::draw(&robot, Fidelity::WrongWorld, &mut stream(Purpose::Machine));
    let mut machine = sound.clone();
    machine.gyros = machine.gyros.into_iter().map(sensors::GyroTruth::filtered).collect();
    let diverged = |Diverged { time_s }| format!("the plant diverged at {time_s:.3} s");
    // What sizes are shares of.
    let sensing = || stream(Purpose::Sensors);
    let rehearsal = play((&robot, &sound), motion(), Unmodelled::none(), Fidelity::WrongWorld, &mut sensing());
    let Played { usage, gyro_peaks, .. } = rehearsal.map_err(diverged)?;

    let traces = traces(case);
    let mut hide = |id: &str, size: Size, purpose| {
        let (usage, gyro_peaks, gaps) = (&usage[..], &gyro_peaks[..], family.gaps());
        let rng = &mut stream(purpose);
        Hiding { machine: &mut machine, robot: &robot, usage, gyro_peaks, gaps, rng }
            .hide(id, size)
            .ok_or_else(|| format!("`{id}` cannot be hidden in {}", family.name()))
    };
    for id in &traces {
        hide(id, Size::Trace, Purpose::Traces)?;
    }
    let truths = case.effect().map_or(Ok(Vec::new()), |id| hide(id, size, Purpose::Main))?;
    if let Main::Outsider(kind) = &case.main {
        machine.outsider = Some(kind.make(size, &usage));
    }
    let unmodelled = Unmodelled::draw(family, &robot, &usage, STEP_S, &mut stream(Purpose::Torque));
    let played =
        play((&robot, &machine), motion(), unmodelled, Fidelity::WrongWorld, &mut sensing()).map_err(diverged)?;
    Ok(Drawn { robot, recording: played.recording, truths, traces })
}

/// The effects in a case's background: the same for all cases of a family's seed, less what is the main effect or means the same.
fn traces(case: &Case) -> Vec<String> {
    let mut rng = stream(case.family.stream(), case.seed, Purpose::Traces);
    let mut ids = case.family.effects(case.seed);
    ids.retain(|id| Family::may_be_trace(id));
    ids.shuffle(&mut rng);
    ids.truncate(rng.random_range(TRACES));
    let is_main = |id: &str| case.effect().is_some_and(|main| said::same(case.family, main, id));
    ids.retain(|id| !is_main(id));
    ids.into_iter().map(str::to_owned).collect()
}

/// Makes what `file` does not hold yet of `cases`, as many at once as there are workers; `progress` is told how many are done.
///
/// # Errors
/// If the file cannot be read or written.
pub fn study(
    file: &Path,
    cases: &[Case],
    workers: usize,
    progress: impl Fn(u64) + Sync,
) -> std::io::Result<Vec<Outcome>> {
    crate::study::resume(file, cases, |case, outcome: &Outcome| outcome.case == *case, workers, outcome, progress)
}
