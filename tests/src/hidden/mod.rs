//! Does the diagnosis find what is hidden? Simulated robots, each with parameters of its own and with nothing, one effect or two in it; what the
//! diagnosis says is compared with what was hidden only after it has spoken.
//!
//! ```text
//! case ─▶ robot (±15 %) with an effect ─▶ short motion ─▶ recording ─▶ diagnose ─▶ one line of JSON ─┐
//!                                                   the truth, sealed until then ─▶ compared ────────┴▶ Scoreboard
//! ```

mod disturbance;
pub mod information;
mod scoreboard;

use std::path::Path;
use std::time::Instant;

use host::diagnose::{self, Diagnosis, Verdict, diagnose};
use host::effect::{CATALOGUE, Effect, Size};
use host::robot::Robot;
use host::simulate::{Direct, EffectChoice, Options, SHORT_MOTION};
use serde::{Deserialize, Serialize};
use solve::levenberg::Settings;

pub use disturbance::Disturbance;
use information::{Sized, asked, sized};
pub use scoreboard::{Scoreboard, wilson};

/// What is hidden, and in which robot.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Case {
    /// Ids of the catalogue.
    pub effects: Vec<String>,
    /// `small`, `medium` or `large`.
    pub size: String,
    /// Whether the diagnosis does not know these effects.
    pub is_outsider: bool,
    /// Decides the robot, the effect's parameters and the sensors' noise.
    pub seed: u64,
    /// What spoils the recording besides.
    #[serde(default)]
    pub disturbance: Disturbance,
    /// What a size's name means.
    #[serde(default)]
    pub sizes: Sizes,
}

/// What `small`, `medium` and `large` mean.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Sizes {
    /// What the catalogue calls so: as on machines.
    #[default]
    Catalogue,
    /// A margin of 30, 300 and 3000 over the nearest rival; see [`information`].
    Information,
}

/// What kind of riddle a case is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// One effect of the catalogue.
    Single,
    /// Two.
    Pairs,
    /// One that the diagnosis does not know.
    Outsiders,
    /// No effect.
    Nothing,
}

impl Kind {
    /// From its name on the command line.
    pub fn parse(name: &str) -> Option<Self> {
        match name {
            "single" => Some(Self::Single),
            "pairs" => Some(Self::Pairs),
            "outsiders" => Some(Self::Outsiders),
            "nothing" => Some(Self::Nothing),
            _ => None,
        }
    }
}

impl Case {
    /// What kind it is of.
    pub fn kind(&self) -> Kind {
        match self.effects.len() {
            0 => Kind::Nothing,
            _ if self.is_outsider => Kind::Outsiders,
            1 => Kind::Single,
            _ => Kind::Pairs,
        }
    }
}

/// What became of a case.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Outcome {
    /// Which.
    pub case: Case,
    /// In one word.
    pub verdict: Verdict,
    /// What was named, in that order.
    pub named: Vec<String>,
    /// What the motion cannot tell from what was named.
    pub aliases: Vec<String>,
    /// Equation and joint of the largest defect that has no name.
    pub place: Option<(String, Option<usize>)>,
    /// What that defect is a function of.
    #[serde(default)]
    pub argument: Option<String>,
    /// Whether what is hidden acts there.
    pub is_right_place: bool,
    /// Parameters of hidden effects that were named: how far the estimates lie from the truth, relative to it.
    pub errors: Vec<(String, f64)>,
    /// How long the diagnosis took, s.
    pub seconds: f64,
    /// Of sizes by information, level and margin of each effect alone.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub sized: Vec<Sized>,
}

/// What the whole study covers: nothing hidden, every effect at three sizes, pairs, and effects that the diagnosis does not know.
pub fn cases(first: u64, seeds: u64, sizes: Sizes) -> Vec<Case> {
    let case = |effects: &[&str], size: &str, is_outsider: bool, seed: u64| Case {
        effects: effects.iter().map(|id| id.to_string()).collect(),
        size: size.to_string(),
        is_outsider,
        seed,
        disturbance: Disturbance::Nothing,
        sizes,
    };
    let mut cases = Vec::new();
    for seed in first..first + seeds {
        cases.push(case(&[], "medium", false, seed));
        for size in ["large", "medium", "small"] {
            cases.extend(CATALOGUE.iter().map(|effect| case(&[effect.id], size, false, seed)));
        }
        cases.extend(PAIRS.iter().map(|pair| case(pair, "medium", false, seed)));
        cases.extend(OUTSIDERS.iter().map(|id| case(&[id], "large", true, seed)));
    }
    cases
}

/// Robots with nothing hidden, every third with jittered stamps and every third with coloured noise of its gyros.
pub fn nothing(first: u64, seeds: u64) -> Vec<Case> {
    let case = |seed: u64| Case {
        effects: Vec::new(),
        size: "medium".to_string(),
        is_outsider: false,
        seed,
        disturbance: match seed % 3 {
            0 => Disturbance::JitteredStamps,
            1 => Disturbance::ColouredNoise,
            _ => Disturbance::Nothing,
        },
        sizes: Sizes::Catalogue,
    };
    (first..first + seeds).map(case).collect()
}

/// Effects of different equations, and of the same.
const PAIRS: [[&str; 2]; 6] = [
    ["base_bearing", "voltage_sag"],
    ["backlash", "viscous_friction"],
    ["gravity_residual", "cogging"],
    ["asymmetric_friction", "input_delay"],
    ["belt_hardening", "gyro_lag"],
    ["stribeck", "quadratic_drag"],
];

/// Effects that curves can show and no other entry of the catalogue is.
const OUTSIDERS: [&str; 6] =
    ["cogging", "quadratic_drag", "belt_hardening", "gravity_residual", "viscous_friction", "asymmetric_friction"];

/// Outsiders, and an effect that holds each as a special case: it is taken out of the catalogue with it.
const HELD_BY: [(&str, &str); 1] = [("viscous_friction", "motor_mismatch")];

/// What the diagnosis of a case does not know.
fn unknown(case: &Case) -> Vec<String> {
    if !case.is_outsider {
        return Vec::new();
    }
    let holders = HELD_BY.iter().filter(|(held, _)| case.effects.iter().any(|id| id == held));
    case.effects.iter().cloned().chain(holders.map(|(_, holder)| holder.to_string())).collect()
}

/// Hides, records and diagnoses.
///
/// # Panics
/// If a built-in robot cannot be simulated or diagnosed: then there is nothing to measure.
pub fn outcome(case: &Case) -> Outcome {
    let robot = Robot::builtin("doggy").expect("the built-in robot is valid");
    let mut options = Options { seed: case.seed, ..Options::new(robot.clone()) };
    let mut levels = Vec::new();
    for id in &case.effects {
        let effect = Effect::by_id(id).expect("cases are made of the catalogue");
        let size = match case.sizes {
            Sizes::Catalogue => Size::parse(effect.id, &case.size).expect("sizes have names"),
            Sizes::Information => {
                let sized = sized(effect, case.seed, asked(&case.size));
                levels.push(sized);
                Size::Level(sized.level)
            }
        };
        options.effects.push(EffectChoice { effect, size });
    }
    let mut simulated = Direct::record(&options, SHORT_MOTION).expect("the built-in robot plays the built-in motion");
    case.disturbance.act(&mut simulated.recording, case.seed);
    let how = diagnose::Options { without: unknown(case), settings: Settings { threads: 1, ..Settings::default() } };
    let clock = Instant::now();
    let found = diagnose(&robot, &[&simulated.recording], None, &how, &|_| {})
        .unwrap_or_else(|error| panic!("{case:?}: {error}"));
    let seconds = clock.elapsed().as_secs_f64();
    let truth = simulated.effects.iter().flat_map(|effect| &effect.parameters);
    let truth = truth.map(|value| (value.name.clone(), value.value)).collect();
    Outcome { sized: levels, ..compare(case, &found, &as_it_shows(truth), seconds) }
}

/// Viscous friction that is common to all joints is back-EMF; what shows is the rest of it.
fn as_it_shows(mut truth: Vec<(String, f64)>) -> Vec<(String, f64)> {
    let is_viscous = |name: &str| name.starts_with("viscous_friction.v[");
    let viscous: Vec<f64> = truth.iter().filter(|(name, _)| is_viscous(name)).map(|(_, value)| *value).collect();
    let common = viscous.iter().sum::<f64>() / viscous.len().max(1) as f64;
    truth.iter_mut().filter(|(name, _)| is_viscous(name)).for_each(|(_, value)| *value -= common);
    truth
}

fn compare(case: &Case, found: &Diagnosis, truth: &[(String, f64)], seconds: f64) -> Outcome {
    let estimates = || found.findings.iter().flat_map(|finding| &finding.parameters);
    let error = |(name, truth): &(String, f64)| {
        // What nothing shows, as a stop that was never met, is no estimate.
        let estimate = estimates().find(|parameter| parameter.name == *name && parameter.std_error.is_some())?.estimate;
        (*truth != 0.0).then(|| (name.clone(), estimate / truth - 1.0))
    };
    let place = found.unexplained.places.first();
    // Parameters of joints end in `[joint]`.
    let acts_on = |axis: usize| truth.iter().any(|(name, value)| *value != 0.0 && name.ends_with(&format!("[{axis}]")));
    let is_hidden_row = |row| case.effects.iter().any(|id| Effect::by_id(id).is_ok_and(|effect| effect.row == row));
    let is_right_place = place.is_some_and(|place| is_hidden_row(place.row) && place.axis.is_none_or(acts_on));
    Outcome {
        case: case.clone(),
        verdict: found.verdict,
        named: found.findings.iter().map(|finding| finding.effect.clone()).collect(),
        aliases: found.findings.iter().flat_map(|finding| finding.aliases.clone()).collect(),
        argument: place.map(|place| place.argument.clone()),
        place: place.map(|place| (format!("{:?}", place.row).to_lowercase(), place.axis)),
        is_right_place,
        errors: truth.iter().filter_map(error).collect(),
        seconds,
        sized: Vec::new(),
    }
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
