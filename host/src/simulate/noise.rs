//! Seeded randomness: one seed, and for each purpose a stream of its own, so that none disturbs another.

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

/// What a stream of randomness is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u64)]
pub enum Purpose {
    /// The true parameters.
    Truth = 0,
    /// Sizes of effects asked for.
    Effects = 1,
    /// Which effect is hidden.
    Hide = 2,
    /// Noise of the sensors before the first motion; that of motion k is `Noise + k`.
    Noise = 16,
    /// Process noise before the first motion; that of motion k is `Process + k`.
    Process = 1 << 32,
    /// Faults of the line.
    Line = 3,
    /// Clocks of real gyros.
    GyroClock = 4,
    /// Filters of real gyros.
    GyroFilter = 5,
}

/// The stream of a seed for a purpose.
pub fn stream(seed: u64, purpose: Purpose) -> ChaCha8Rng {
    numbered(seed, purpose as u64)
}

fn numbered(seed: u64, number: u64) -> ChaCha8Rng {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    rng.set_stream(number);
    rng
}

/// Gaussian noise, of the sensors or of the process.
///
/// Every motion begins a stream of its own: how long the robot waited before it, which is the host's doing, does not
/// change what the motion's recording holds.
#[derive(Debug)]
pub struct Noise {
    seed: u64,
    purpose: Purpose,
    motions: u64,
    rng: ChaCha8Rng,
}

impl Noise {
    /// The sensors' noise from a seed, before the first motion.
    pub fn new(seed: u64) -> Self {
        Self::of(seed, Purpose::Noise)
    }

    /// The noise of a purpose from a seed, before the first motion.
    pub fn of(seed: u64, purpose: Purpose) -> Self {
        Self { seed, purpose, motions: 0, rng: stream(seed, purpose) }
    }

    /// A motion begins.
    pub fn begin_motion(&mut self) {
        self.motions += 1;
        self.rng = numbered(self.seed, self.purpose as u64 + self.motions);
    }

    /// One value of standard deviation `sigma` from the first motion on. Before it the robot is held in its marked pose
    /// and nothing shakes it, so that the zero positions do not depend on the moment at which the host takes them.
    pub fn draw_once_moved(&mut self, sigma: f64) -> f64 {
        if self.motions == 0 { 0.0 } else { self.draw(sigma) }
    }

    /// One value of standard deviation `sigma`.
    pub fn draw(&mut self, sigma: f64) -> f64 {
        let unit: f64 = StandardNormal.sample(&mut self.rng);
        sigma * unit
    }
}
