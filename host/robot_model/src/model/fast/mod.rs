//! The base model four samples at once: one step of the dynamics with its derivatives, and the gyros' rates.
//!
//! The same equations as the generic walk over dual numbers (which stays the reference: a test holds one against the other), with two
//! differences that make them fast. The derivative of the link torque is taken in closed form (`bodies`), and four neighbouring samples
//! fill the lanes of a vector, so that nothing is lost to short loops.
//!
//! What it covers: [`JOINTS`] revolute elastic joints, with a pair of passive ones before or behind them or both, no Coriolis terms, no constant
//! torque and no unknown inertia; of effects' laws those that change a drive, with at most [`MOST_OWN`] states of their own, and gyros that lag.
//! Everything else takes the generic walk.
//! A step is made in one part: where friction is so steep that it does [not leave it whole](super::Integrator::leaves_whole), the caller has to take the generic walk too.
//! Kernels are compiled by the number L of links; joint i of the robot moves link `first` + i. A state is
//!
//! ```text
//! | q: L links | q̇: L | θ: JOINTS motors | θ̇: JOINTS | own states of laws |
//! ```
//!
//! ```text
//! samples k … k+3 ─▶ State (one quad a component) ─▶ bodies, drives ─▶ f, ∂f ─▶ Euler or Runge–Kutta ─▶ StepQuads
//! ```

mod bodies;
mod drive;
mod elementary;
mod gyro;
mod lags;
mod laws;
mod own;
mod step;
#[cfg(test)]
mod tests;
mod vector;

pub use gyro::{GyroQuads, RateSource};
pub use step::{SlopesBy, StepQuads};

use super::{Dynamics, Model};
use crate::robot::{JointKind, Transmission};
use bodies::{Bodies, Links};
use solve::simd::{Quad, Simd, Wide};

/// Robots of this many joints are covered, …
pub const JOINTS: usize = 3;
/// … and chains of as many links, with a bearing or a structure that gives way, …
pub const WITH_PAIR: usize = JOINTS + 2;
/// … or with both.
pub const WITH_PAIRS: usize = JOINTS + 4;
/// Most own states of laws of the drives.
pub const MOST_OWN: usize = 9;

/// The constants of a model that the fast kernel covers.
#[derive(Debug, Clone)]
pub struct Fast {
    links: Links,
    /// Passive joints before the robot's first.
    first: usize,
    /// Drives have laws of effects.
    has_laws: bool,
    /// A law of the supply couples all motors.
    is_coupled: bool,
    /// Components of the state that laws of the drives bring.
    own: Vec<usize>,
}

impl Fast {
    /// `None` where the kernel does not cover the model.
    pub fn of(model: &Model) -> Option<Self> {
        let chain = model.chain();
        let elastic = model.transmissions.iter().all(|&t| t == Transmission::Elastic);
        let revolute = chain.frames().all(|link| link.kind == JointKind::Revolute);
        let layout = model.layout();
        let sized = layout.joints() == JOINTS && matches!(chain.joints(), JOINTS | WITH_PAIR | WITH_PAIRS);
        let own: Vec<usize> = (0..layout.joints()).flat_map(|joint| model.laws.own_states(joint)).copied().collect();
        let inputs = layout.inputs().is_empty() && model.input_delay().is_none();
        let few = own.len() <= MOST_OWN;
        let covered = elastic && revolute && sized && inputs && few && !chain.has_coriolis() && model.is_plain();
        let (has_laws, is_coupled) = (model.laws.at_drives(), model.laws.supply.is_some());
        covered.then(|| Fast { links: Links::of(chain), first: layout.q(0), has_laws, is_coupled, own })
    }

    /// Number of links: [`JOINTS`], [`WITH_PAIR`] or [`WITH_PAIRS`].
    pub fn links(&self) -> usize {
        self.links.count()
    }

    /// The link that the robot's first joint moves, known to the compiler where no joint is passive.
    #[inline(always)]
    fn first<const L: usize>(&self) -> usize {
        if L == JOINTS { 0 } else { self.first }
    }
}

/// Four states, one quad a component in the order of [`Layout`](super::Layout), with the chain at their positions.
#[derive(Clone, Copy)]
pub struct Samples<S: Simd, const L: usize> {
    simd: S,
    q: [Wide<S>; L],
    qd: [Wide<S>; L],
    theta: [Wide<S>; JOINTS],
    thetad: [Wide<S>; JOINTS],
    bodies: Bodies<S, L>,
}

/// Quads from memory, beginning with the first.
#[inline(always)]
fn load_all<S: Simd, const N: usize>(simd: S, quads: &[Quad]) -> [Wide<S>; N] {
    let mut out = [Wide::splat(simd, 0.0); N];
    for (out, quad) in out.iter_mut().zip(&quads[..N]) {
        *out = Wide::load(simd, &quad.0);
    }
    out
}

impl<S: Simd, const L: usize> Samples<S, L> {
    /// From the components of the state.
    #[inline(always)]
    pub fn new(simd: S, fast: &Fast, x: &[Quad]) -> Self {
        let (q, qd) = (load_all(simd, x), load_all(simd, &x[L..]));
        let (theta, thetad) = (load_all(simd, &x[2 * L..]), load_all(simd, &x[2 * L + JOINTS..]));
        Samples { simd, q, qd, theta, thetad, bodies: Bodies::at(simd, &fast.links, &q) }
    }
}
