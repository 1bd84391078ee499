//! Effects of the catalogue in this plant: size tables of this study, truths under the catalogue's names and units.
//!
//! Sizes are relative to the joint's statistics in the same motion without effects ([`Usage`]), or to its own friction and stiffness. The plant's law
//! differs from the catalogue's law. A truth is comparable where the parameter has the same meaning in both.

mod belt;
mod friction;
mod sensing;
mod structure;
mod supply;

use host::robot::Robot;
use rand::RngExt;
use rand::seq::IndexedRandom;
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

use super::machine::Machine;
use super::outsider::Usage;

/// How strong an effect is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Size {
    /// The upper end of the realistic range.
    Large,
    /// The middle of the range.
    Medium,
    /// The lower end of the range.
    Weak,
    /// A third of weak.
    Trace,
}

impl Size {
    /// Sizes of main effects.
    pub const OF_MAINS: [Self; 3] = [Self::Large, Self::Medium, Self::Weak];

    /// The entry of a table of weak, medium and large.
    pub fn of(self, [weak, medium, large]: [f64; 3]) -> f64 {
        match self {
            Self::Large => large,
            Self::Medium => medium,
            Self::Weak => weak,
            Self::Trace => weak / 3.0,
        }
    }

    /// As on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Large => "large",
            Self::Medium => "medium",
            Self::Weak => "weak",
            Self::Trace => "trace",
        }
    }

    /// The size of a main effect by its name.
    pub fn parse(name: &str) -> Option<Self> {
        Self::OF_MAINS.into_iter().find(|size| size.name() == name)
    }
}

/// The true value of a parameter of the catalogue.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Truth {
    /// As the diagnosis names it: `backlash.h[1]`.
    pub name: String,
    /// In the catalogue's unit.
    pub value: f64,
    /// Whether the plant's law means the same number.
    pub is_comparable: bool,
}

/// A machine into which effects are put.
#[derive(Debug)]
pub struct Hiding<'a> {
    /// The machine.
    pub machine: &'a mut Machine,
    /// Its description.
    pub robot: &'a Robot,
    /// What its joints do without effects.
    pub usage: &'a [Usage],
    /// Largest rate that each gyro sees, rad/s.
    pub gyro_peaks: &'a [f64],
    /// Half gaps of worn transmissions of this family: weak, medium, large; rad.
    pub gaps: [f64; 3],
    /// Draws sizes within their level, joints, signs and phases.
    pub rng: &'a mut ChaCha8Rng,
}

/// Drawn values lie within this factor of the table's.
const WITHIN: f64 = 1.25;
/// How likely an effect acts on a joint.
const JOINT_SHARE: f64 = 0.67;
/// A dead time and a lag are longer on machines that sample more slowly, at most by this factor.
const MOST_SLOWER: f64 = 2.0;

impl Hiding<'_> {
    /// Puts an effect of the catalogue into the machine and tells its truths. `None` for one that this study cannot hide.
    pub fn hide(&mut self, id: &str, size: Size) -> Option<Vec<Truth>> {
        friction::hide(self, id, size)
            .or_else(|| belt::hide(self, id, size))
            .or_else(|| supply::hide(self, id, size))
            .or_else(|| structure::hide(self, id, size))
            .or_else(|| sensing::hide(self, id, size))
    }

    /// A value of a level.
    fn draw(&mut self, size: Size, table: [f64; 3]) -> f64 {
        size.of(table) * WITHIN.powf(self.rng.random_range(-1.0..1.0))
    }

    /// The same with either sign.
    fn draw_signed(&mut self, size: Size, table: [f64; 3]) -> f64 {
        let value = self.draw(size, table);
        if self.rng.random() { value } else { -value }
    }

    /// The joints among `suited` that an effect acts on, at least one where there is one.
    fn some_of(&mut self, suited: impl IntoIterator<Item = usize>) -> Vec<usize> {
        let suited: Vec<usize> = suited.into_iter().collect();
        let mut chosen = suited.clone();
        chosen.retain(|_| self.rng.random_bool(JOINT_SHARE));
        if chosen.is_empty() {
            chosen.extend(suited.choose(self.rng));
        }
        chosen
    }

    fn all(&self) -> std::ops::Range<usize> {
        0..self.robot.joints.len()
    }

    fn elastic(&self) -> Vec<usize> {
        self.all().filter(|joint| self.machine.joints[*joint].belt.is_some()).collect()
    }

    /// By how much longer lags are than at 1 kHz.
    fn slower(&self) -> f64 {
        (self.robot.sample_period_s / 1e-3).clamp(1.0, MOST_SLOWER)
    }

    /// What the speed costs a drive: back-EMF or viscous friction, N m s/rad.
    fn speed_loss(&self, joint: usize) -> f64 {
        let drive = &self.machine.joints[joint];
        drive.back_emf + drive.friction.viscous
    }
}

/// A truth that joints have each for themselves; 0-based.
fn of_joint(id: &str, symbol: &str, joint: usize, value: f64) -> Truth {
    Truth { name: format!("{id}.{symbol}[{}]", joint + 1), value, is_comparable: true }
}

/// A truth that there is once.
fn single(id: &str, symbol: &str, value: f64) -> Truth {
    Truth { name: format!("{id}.{symbol}"), value, is_comparable: true }
}

impl Truth {
    /// Marks a parameter that has another meaning in the catalogue's law.
    fn not_comparable(self) -> Self {
        Self { is_comparable: false, ..self }
    }
}
