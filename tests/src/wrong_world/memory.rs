//! Rate-independent operators: presliding friction and elasto-plastic elements.
//!
//! An operator maps the memory at the start of a step and the displacement since then to the memory now. It is exact for a monotonic displacement,
//! so the integration step need not resolve the presliding distance.

use serde::{Deserialize, Serialize};

/// Presliding law: friction as a share of the sliding friction, −1 to 1.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum Onset {
    /// tanh(κ v / 2): no memory, s/rad or s/m.
    Smooth {
        /// κ.
        slope: f64,
    },
    /// Bristles that bend (Dahl 1968; the bristle state of LuGre).
    Bristles {
        /// Displacement over which they bend, rad or m.
        bending: f64,
    },
    /// Four elements in parallel, each a spring that slips (Iwan 1966).
    Slip {
        /// Displacement at which the last one slips, rad or m.
        reach: f64,
    },
}

/// Elements of [`Onset::Slip`] and of a [`SlipStack`].
pub const ELEMENTS: usize = 4;
/// Where the elements of [`Onset::Slip`] slip, shares of its reach, and what share of the friction each carries.
const REACHES: [f64; ELEMENTS] = [0.1, 0.25, 0.5, 1.0];
const SHARES: [f64; ELEMENTS] = [0.35, 0.3, 0.2, 0.15];

/// Memory of one contact.
pub type Memory = [f64; ELEMENTS];

impl Onset {
    /// The memory after a displacement.
    pub fn moved(&self, memory: &Memory, displacement: f64) -> Memory {
        match *self {
            Onset::Smooth { .. } => *memory,
            Onset::Bristles { bending } => {
                let towards = displacement.signum();
                let left = (-displacement.abs() / bending).exp();
                [towards + (memory[0] - towards) * left, 0.0, 0.0, 0.0]
            }
            Onset::Slip { reach } => {
                std::array::from_fn(|i| (memory[i] + displacement / (reach * REACHES[i])).clamp(-1.0, 1.0))
            }
        }
    }

    /// The share of the sliding friction that is built up.
    pub fn share(&self, memory: &Memory, speed: f64) -> f64 {
        match *self {
            Onset::Smooth { slope } => (0.5 * slope * speed).tanh(),
            Onset::Bristles { .. } => memory[0],
            Onset::Slip { .. } => memory.iter().zip(SHARES).map(|(element, share)| element * share).sum(),
        }
    }

    /// Stiffness before it slides, per unit of sliding friction, 1/rad or 1/m; zero without memory.
    pub fn stiffness(&self) -> f64 {
        match *self {
            Onset::Smooth { .. } => 0.0,
            Onset::Bristles { bending } => 1.0 / bending,
            Onset::Slip { reach } => REACHES.iter().zip(SHARES).map(|(at, share)| share / (at * reach)).sum(),
        }
    }
}

/// Springs in parallel that slip, each at a torque of its own: elasto-plastic hysteresis without a time constant.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct SlipStack {
    /// Of all elements together before one slips, N m/rad.
    pub stiffness: f64,
    /// Windup at which each slips, rad.
    pub yields: [f64; ELEMENTS],
}

impl SlipStack {
    /// Torques of the elements after the windup grew by `displacement`.
    pub fn moved(&self, torques: &Memory, displacement: f64) -> Memory {
        let stiffness = self.stiffness / ELEMENTS as f64;
        std::array::from_fn(|i| {
            let most = stiffness * self.yields[i];
            (torques[i] + stiffness * displacement).clamp(-most, most)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn friction_with_memory_takes_energy_out_of_every_cycle() {
        let onsets = [Onset::Bristles { bending: 1e-4 }, Onset::Slip { reach: 3e-4 }];
        for onset in onsets {
            let (mut memory, mut work) = ([0.0; ELEMENTS], 0.0);
            for k in 0..40_000 {
                let at = |k: i32| 4e-4 * (f64::from(k) * 1e-3).sin();
                let moved = at(k + 1) - at(k);
                memory = onset.moved(&memory, moved);
                work += onset.share(&memory, 0.0) * moved;
                assert!(onset.share(&memory, 0.0).abs() <= 1.0 + 1e-12);
            }
            assert!(work > 0.0, "{onset:?}: {work}");
        }
    }

    #[test]
    fn one_long_step_ends_where_many_short_ones_do() {
        let onsets = [Onset::Bristles { bending: 1e-4 }, Onset::Slip { reach: 3e-4 }];
        for onset in onsets {
            let start = onset.moved(&[0.0; ELEMENTS], -5e-5);
            let long = onset.moved(&start, 2e-4);
            let short = (0..200).fold(start, |memory, _| onset.moved(&memory, 1e-6));
            for (a, b) in long.iter().zip(short) {
                // atol: rounding of 200 steps
                assert!((a - b).abs() < 1e-12, "{onset:?}");
            }
        }
    }
}
