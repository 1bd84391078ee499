//! The wrong-world study: how the diagnosis performs on robots that the model class does not contain.
//!
//! ```text
//! case ─▶ machine (free parameters ±15 %, fixed parameters ±20 % wrong, another friction law)
//!          + main effect + three to eight trace effects + unmodelled torque + noise ─▶ recording ─▶ diagnose ─▶ JSON line ─▶ Scoreboard
//! ```
//!
//! The plant in this folder shares no physics with the estimator. Its chain uses recursive Newton–Euler. Its friction laws are presliding bristles,
//! Iwan elements or a smooth sign. Its hysteresis is elasto-plastic. Backlash has a damped contact. The integration step is 0.2 ms. Unit tests check
//! that both sides read a description file in the same way: both chains agree, and a machine without model errors is calibrated to its true
//! parameters.

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
use noise::{Purpose, nth_stream, stream};
use outsider::OutsiderKind;
use session::{Diverged, Played, STEP_S, play};
use unmodelled::Unmodelled;

pub use outcome::{Outcome, outcome};
pub use scoreboard::Scoreboard;

/// Number of trace effects in every machine.
const TRACES: std::ops::RangeInclusive<usize> = 3..=8;
/// At most this share of the effects of a family are traces, beyond the least number: otherwise every name would be true.
const MOST_TRACES: f64 = 1.0 / 3.0;

/// A robot and its main effect.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Case {
    /// Which family of robots.
    pub family: Family,
    /// Decides everything that is drawn.
    pub seed: u64,
    /// The main effect.
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
    /// A law that the catalogue does not contain.
    Outsider(OutsiderKind),
}

/// The kinds of cases.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// A main effect of the catalogue.
    Main,
    /// None.
    Null,
    /// A law that the catalogue does not contain.
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

/// The whole study. For each seed and family: one null, every effect at three sizes, every outsider at two sizes.
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

/// A simulated case and its truth.
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

/// Draws and simulates a case.
///
/// # Errors
/// A message if the simulation diverges or an effect cannot be hidden.
pub fn draw(case: &Case) -> Result<Drawn, String> {
    let Case { family, seed, size, .. } = *case;
    let stream = |purpose| stream(family.stream(), seed, purpose);
    let robot = family.robot(seed);
    let motion = || family.motion(&robot, &mut stream(Purpose::Motion));
    let (sound, _) = Machine::draw(&robot, Fidelity::WrongWorld, &mut stream(Purpose::Machine));
    let mut machine = sound.clone();
    machine.gyros = machine.gyros.into_iter().map(sensors::GyroTruth::filtered).collect();
    let diverged = |Diverged { time_s }| format!("the plant diverged at {time_s:.3} s");
    // A first simulation without effects: sizes are relative to its torques, speeds and ranges.
    let sensing = || stream(Purpose::Sensors);
    let rehearsal = play((&robot, &sound), motion(), Unmodelled::none(), Fidelity::WrongWorld, &mut sensing());
    let Played { usage, gyro_peaks, .. } = rehearsal.map_err(diverged)?;

    let traces = traces(case);
    let mut hide = |id: &str, size: Size, purpose| {
        let (usage, gyro_peaks, gaps) = (&usage[..], &gyro_peaks[..], family.gaps());
        // A stream for each effect: the others do not change where one is left out.
        let nth = family.effects(seed).iter().position(|known| *known == id).map_or(0, |place| place as u64 + 1);
        let rng = &mut nth_stream(family.stream(), seed, purpose, nth);
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

/// The trace effects of a case. They are the same for all cases of a family's seed, except that the main effect and its equivalents are left out.
fn traces(case: &Case) -> Vec<String> {
    let mut rng = stream(case.family.stream(), case.seed, Purpose::Traces);
    let mut ids = case.family.effects(case.seed);
    ids.retain(|id| Family::may_be_trace(id));
    ids.shuffle(&mut rng);
    let most = (MOST_TRACES * ids.len() as f64) as usize;
    ids.truncate(rng.random_range(*TRACES.start()..=most.clamp(*TRACES.start(), *TRACES.end())));
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
