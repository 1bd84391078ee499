//! The riddle of the paper: belts that read far too soft, on a robot whose base may give way.
//!
//! ```text
//! robot on a bearing of k N m/rad ─▶ short motion ─▶ calibrated as if the base were rigid, by both presets ─▶ how far its belts read off
//! ```
//!
//! The paper guessed that its bearing's give went into the belts. The map says what the equations make of that guess.

use firmware::motion::preset;
use host::calibrate::{Preset, calibrate};
use host::diagnose::{self, Diagnosis, diagnose};
use host::effect::{Effect, Size};
use host::recording::Recording;
use host::robot::Robot;
use host::simulate::{Direct, EffectChoice, Options, SHORT_MOTION};
use protocol::motion::Limits;
use solve::levenberg::Settings;

/// The robot: its true parameters are drawn from this seed.
const SEED: u64 = 1;
/// Stiffness of the bearing about x and y, N m/rad; at 92 the robot's own weight would topple it.
pub const STIFFNESS: [f64; 8] = [1_000.0, 2_000.0, 4_000.0, 7_000.0, 12_000.0, 20_000.0, 50_000.0, 200_000.0];

/// A robot on a bearing of this stiffness.
pub struct OnBearing {
    options: Options,
    recorded: Direct,
}

/// How far the belts read off, as shares of the truth.
pub type Belts = [f64; 3];

impl OnBearing {
    /// Plays the short motion on it.
    ///
    /// # Panics
    /// If the built-in robot cannot be simulated: then there is nothing to tell.
    pub fn new(stiffness: f64) -> Self {
        let robot = Robot::builtin("doggy").expect("the built-in robot is valid");
        let effect = Effect::by_id("base_bearing").expect("the catalogue has it");
        // About x and y alike.
        let effects = vec![EffectChoice { effect, size: Size::Exact(stiffness) }];
        let options = Options { seed: SEED, effects, ..Options::new(robot) };
        let recorded = Direct::record(&options, SHORT_MOTION).expect("the robot plays the built-in motion");
        Self { options, recorded }
    }

    /// A true parameter of the robot or its bearing.
    ///
    /// # Panics
    /// If there is none of this name.
    pub fn truth(&self, name: &str) -> f64 {
        let effects = self.recorded.effects.iter().flat_map(|effect| &effect.parameters);
        let found = self.recorded.truth.iter().chain(effects).find(|value| value.name == name);
        found.unwrap_or_else(|| panic!("the robot has no {name}")).value
    }

    /// What the belts read as if the base were rigid.
    ///
    /// # Panics
    /// If the recording cannot be calibrated.
    pub fn belts_of_a_rigid_base(&self, preset: Preset) -> Belts {
        let recording = &self.recorded.recording;
        let found = calibrate(&self.options.robot, &[recording], preset, &Settings::default(), |_, _| {});
        let found = found.unwrap_or_else(|error| panic!("{preset:?}: {error}"));
        self.belts(|name| found.parameters.iter().find(|p| p.name == name).map(|p| p.estimate))
    }

    /// How far the belts among these estimates are off.
    pub fn belts(&self, estimate: impl Fn(&str) -> Option<f64>) -> Belts {
        [1, 2, 3].map(|joint| {
            let name = format!("k_s[{joint}]");
            estimate(&name).map_or(f64::NAN, |estimate| estimate / self.truth(&name) - 1.0)
        })
    }

    /// Another motion of the same robot: medium steps, slow sines, fast steps.
    ///
    /// # Panics
    /// If the robot cannot play it.
    pub fn another_motion(&self) -> Recording {
        let limits = |joint: &host::robot::Joint| Limits { min: joint.limits[0] as f32, max: joint.limits[1] as f32 };
        let limits: Vec<Limits> = self.options.robot.joints.iter().map(limits).collect();
        let motion = toml::to_string(&preset::validation(&limits)).expect("motions are TOML");
        Direct::record(&self.options, &motion).expect("the robot plays the validation motion").recording
    }

    /// What the diagnosis says, its gain measured on `another` motion.
    ///
    /// # Panics
    /// If the recording cannot be diagnosed.
    pub fn diagnosed(&self, another: &Recording) -> Diagnosis {
        let options = diagnose::Options::default();
        diagnose(&self.options.robot, &[&self.recorded.recording], Some(another), &options, &|_| {})
            .unwrap_or_else(|error| panic!("{error}"))
    }
}
