//! What to simulate, from the command line or from a port's name.
//!
//! `sim:seed=3,effect=base_bearing,effect=backlash=small,fault=drop=0.01` is `host simulate` with the same options.

use std::path::PathBuf;
use std::str::FromStr;

use super::{GyroChips, Mistake, SimulateError};
use crate::effect::{CATALOGUE, Effect, EffectError, Hidden, Size};
use crate::robot::Robot;

/// What to simulate.
#[derive(Debug, Clone)]
pub struct Options {
    /// The robot.
    pub robot: Robot,
    /// Decides everything that is drawn: true parameters, sizes of effects, noise, faults.
    pub seed: u64,
    /// Effects in the plant.
    pub effects: Vec<EffectChoice>,
    /// One more effect, drawn by this seed of its own.
    pub hide: Option<u64>,
    /// Process noise in the plant, in [`ProcessNoise::UNIT`](super::ProcessNoise::UNIT); 0 for none.
    pub process_noise: f64,
    /// How simulated time follows the host's.
    pub pace: Pace,
    /// Faults of the line and the board.
    pub faults: Vec<Fault>,
    /// What the gyros are.
    pub gyros: GyroChips,
    /// Mistakes of wiring and assembly.
    pub mistakes: Vec<Mistake>,
    /// A symbolic link to the port.
    pub link: Option<PathBuf>,
    /// Where the caller writes the truth at the end.
    pub truth: Option<PathBuf>,
    /// A file that keeps the board's flash, and with it a stored description, from one simulation to the next.
    pub flash: Option<PathBuf>,
}

/// An effect and its size, as `backlash`, `backlash=large` or `backlash=0.008`.
#[derive(Debug, Clone)]
pub struct EffectChoice {
    /// Which.
    pub effect: &'static Effect,
    /// How strong.
    pub size: Size,
}

/// How simulated time follows the host's.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Pace {
    /// As a real robot.
    Real,
    /// In a motion as fast as the host keeps up; otherwise as a real robot.
    Fast,
    /// As fast, and at rest time passes for what the host sends only: so a motion can start at a tick of its own,
    /// whatever time the host needs before.
    Patient,
}

/// A fault to inject. Times count from the first tick of the first motion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Fault {
    /// Frames from the device that vanish, as a share: `drop=0.01`.
    Drop(f64),
    /// Frames from the device of which bytes change, as a share: `corrupt=0.001`.
    Corrupt(f64),
    /// The line takes nothing from the device for so long: `stall-out=0.3@20`, seconds.
    StallOut {
        /// How long.
        duration_s: f64,
        /// When.
        at_s: f64,
    },
    /// The line holds back what the host sends for so long: `stall-in=0.3@20`, seconds.
    StallIn {
        /// How long.
        duration_s: f64,
        /// When.
        at_s: f64,
    },
    /// The watchdog resets the board: `reset@20`, seconds.
    Reset {
        /// When.
        at_s: f64,
    },
}

impl Options {
    /// A robot with nothing wrong, as fast as the host keeps up.
    pub fn new(robot: Robot) -> Self {
        Self {
            robot,
            seed: 0,
            effects: Vec::new(),
            hide: None,
            process_noise: 0.0,
            pace: Pace::Fast,
            faults: Vec::new(),
            gyros: GyroChips::Ideal,
            mistakes: Vec::new(),
            link: None,
            truth: None,
            flash: None,
        }
    }

    /// From the part of a port's name behind `sim:`.
    ///
    /// # Errors
    /// [`SimulateError`] that names the option.
    pub fn parse(text: &str) -> Result<Self, SimulateError> {
        let pairs: Vec<(&str, &str)> = text
            .split(',')
            .filter(|option| !option.is_empty())
            .map(|option| option.split_once('=').unwrap_or((option, "")))
            .collect();
        let robot = pairs.iter().rev().find(|(key, _)| *key == "robot").map_or("doggy", |(_, value)| value);
        let mut options = Self::new(Robot::load(robot)?);
        for (key, value) in pairs {
            let wrong = |wanted| SimulateError::option(key, value, wanted);
            match key {
                "robot" => {}
                "seed" => options.seed = value.parse().map_err(|_| wrong("a whole number"))?,
                "hide" => options.hide = Some(value.parse().map_err(|_| wrong("a whole number"))?),
                "process_noise" => {
                    options.process_noise = parse_scale(value).ok_or_else(|| wrong("a number, 0 or above"))?;
                }
                "effect" => options.effects.push(value.parse()?),
                "fault" => options.faults.push(value.parse()?),
                "mistake" => options.mistakes.push(value.parse()?),
                "gyros" => {
                    options.gyros = match value {
                        "ideal" => GyroChips::Ideal,
                        "real" => GyroChips::Real,
                        "unstamped" => GyroChips::Unstamped,
                        _ => return Err(wrong("ideal, real or unstamped")),
                    };
                }
                "flash" => options.flash = Some(PathBuf::from(value)),
                "truth" => options.truth = Some(PathBuf::from(value)),
                "pace" => {
                    options.pace = match value {
                        "real" => Pace::Real,
                        "fast" => Pace::Fast,
                        _ => return Err(wrong("real or fast")),
                    };
                }
                _ => return Err(SimulateError::UnknownOption { key: key.to_owned() }),
            }
        }
        Ok(options)
    }
}

/// A finite scale, not negative.
pub(crate) fn parse_scale(text: &str) -> Option<f64> {
    text.parse().ok().filter(|scale: &f64| scale.is_finite() && *scale >= 0.0)
}

impl FromStr for EffectChoice {
    type Err = SimulateError;

    fn from_str(text: &str) -> Result<Self, SimulateError> {
        let (id, size) = text.split_once('=').unwrap_or((text, "medium"));
        let effect = Effect::by_id(id)?;
        Ok(Self { effect, size: Size::parse(effect.id, size)? })
    }
}

impl EffectChoice {
    /// One effect of the catalogue in one of the named sizes, drawn among those that the robot can have. A late command
    /// suits every robot, so that one is found.
    pub(super) fn hide_one(robot: &Robot, rng: &mut impl rand::RngExt) -> Result<Hidden, EffectError> {
        loop {
            let effect = CATALOGUE[rng.random_range(0..CATALOGUE.len())];
            let size = [Size::Small, Size::Medium, Size::Large][rng.random_range(0..3)];
            match effect.hide_in(robot, size, rng) {
                Err(EffectError::Unsuited { .. }) => {}
                decided => return decided,
            }
        }
    }
}

impl FromStr for Fault {
    type Err = SimulateError;

    fn from_str(text: &str) -> Result<Self, SimulateError> {
        let forms = "drop=RATE, corrupt=RATE, stall-out=SECONDS@TIME, stall-in=SECONDS@TIME or reset@TIME";
        let wrong = || SimulateError::option("fault", text, forms);
        let number = |text: &str| text.parse::<f64>().ok().filter(|x| x.is_finite() && *x >= 0.0).ok_or_else(wrong);
        let rate = |text: &str| number(text).and_then(|x| if x <= 1.0 { Ok(x) } else { Err(wrong()) });
        let span = |text: &str| -> Result<(f64, f64), SimulateError> {
            let (duration, at) = text.split_once('@').ok_or_else(wrong)?;
            Ok((number(duration)?, number(at)?))
        };
        if let Some(at) = text.strip_prefix("reset@") {
            return Ok(Self::Reset { at_s: number(at)? });
        }
        match text.split_once('=').ok_or_else(wrong)? {
            ("drop", value) => Ok(Self::Drop(rate(value)?)),
            ("corrupt", value) => Ok(Self::Corrupt(rate(value)?)),
            ("stall-out", value) => span(value).map(|(duration_s, at_s)| Self::StallOut { duration_s, at_s }),
            ("stall-in", value) => span(value).map(|(duration_s, at_s)| Self::StallIn { duration_s, at_s }),
            _ => Err(wrong()),
        }
    }
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;

    use super::*;
    use crate::robot::Transmission;

    #[test]
    fn a_ports_name_says_all() {
        let text = "seed=3,effect=base_bearing,effect=backlash=0.004,robot=one_joint,fault=drop=0.01,fault=reset@7,mistake=gear=1*0.5,truth=t.json,flash=f.bin,process_noise=2";
        let options = Options::parse(text).unwrap();
        assert_eq!((options.robot.name.as_str(), options.seed, options.pace), ("one_joint", 3, Pace::Fast));
        let effects: Vec<_> = options.effects.iter().map(|choice| (choice.effect.id, choice.size)).collect();
        assert_eq!(effects, [("base_bearing", Size::Medium), ("backlash", Size::Exact(0.004))]);
        assert_eq!(options.faults, [Fault::Drop(0.01), Fault::Reset { at_s: 7.0 }]);
        assert_eq!(options.mistakes, [Mistake::Gear(0, 0.5)]);
        assert_eq!(options.process_noise, 2.0);
        assert_eq!(options.truth, Some(PathBuf::from("t.json")));
        assert_eq!(options.flash, Some(PathBuf::from("f.bin")));
        assert_eq!(Options::parse("").unwrap().robot.name, "doggy");
    }

    /// Any robot gets something hidden in it, drawn among what suits it.
    #[test]
    fn something_can_be_hidden_in_every_robot() {
        for robot in Robot::builtin_names().map(|name| Robot::builtin(name).unwrap()) {
            let mut drawn = std::collections::BTreeSet::new();
            for seed in 0..200 {
                let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
                drawn.insert(EffectChoice::hide_one(&robot, &mut rng).unwrap().id);
            }
            // A slide without belts, gyros and duty has little to hide: 7 effects.
            let is_elastic = robot.joints.iter().any(|joint| joint.transmission == Transmission::Elastic);
            assert!(drawn.len() > if is_elastic { 20 } else { 5 }, "{}: {drawn:?}", robot.name);
        }
    }

    #[test]
    fn what_is_not_understood_is_named() {
        for (text, told) in [
            ("sede=3", "sede"),
            ("seed=three", "`three`"),
            ("effect=bakclash", "did you mean `backlash`"),
            ("effect=backlash=huge", "huge"),
            ("fault=drop=2", "`drop=2`"),
            ("fault=stall-out=1", "stall-out=SECONDS@TIME"),
            ("pace=quick", "real or fast"),
            ("gyros=perfect", "ideal, real or unstamped"),
            ("process_noise=-1", "0 or above"),
            ("robot=dogy", "did you mean `doggy`"),
            ("effect=base_baering=large", "did you mean `base_bearing`"),
        ] {
            let error = Options::parse(text).unwrap_err().to_string();
            assert!(error.contains(told), "{text}: {error}");
        }
    }
}
