//! The base model four samples at once: one step of the dynamics with its derivatives, and the gyros' rates.
//!
//! The same equations as the generic walk over dual numbers (which stays the reference: a test holds one against the other), with two
//! differences that make them fast. The derivative of the link torque is taken in closed form (`bodies`), and four neighbouring samples
//! fill the lanes of a vector, so that nothing is lost to short loops.
//!
//! What it covers: chains of [`JOINTS`] revolute elastic joints without Coriolis terms and without gravity on a joint, no constant torque and no
//! unknown inertia; of effects' laws those that change a drive and have no state of their own. Everything else takes the generic walk.
//!
//! ```text
//! samples k … k+3 ─▶ State (one quad a component) ─▶ bodies, drives ─▶ f, ∂f ─▶ Euler or Runge–Kutta ─▶ StepQuads
//! ```

mod bodies;
mod drive;
mod elementary;
mod gyro;
mod laws;
mod step;
#[cfg(test)]
mod tests;
mod vector;

pub use gyro::{GyroQuads, RateSource};
pub use step::StepQuads;

use super::{Dynamics, Model};
use crate::robot::{JointKind, Transmission};
use bodies::{Bodies, Links};
use solve::simd::{Quad, Simd, Wide};

/// Chains of this many joints are compiled.
pub const JOINTS: usize = 3;

/// The constants of a model that the fast kernel covers.
#[derive(Debug, Clone)]
pub struct Fast {
    links: Links,
    /// Drives have laws of effects.
    has_laws: bool,
    /// A law of the supply couples all motors.
    is_coupled: bool,
}

impl Fast {
    /// `None` where the kernel does not cover the model.
    pub fn of(model: &Model) -> Option<Self> {
        let chain = model.chain();
        let elastic = model.transmissions.iter().all(|&t| t == Transmission::Elastic);
        let revolute = chain.frames().all(|link| link.kind == JointKind::Revolute);
        let quiet = !chain.has_coriolis() && !chain.has_gravity();
        let own = model.layout().own().is_empty() && model.input_delay().is_none();
        let covered = elastic && revolute && quiet && own && chain.joints() == JOINTS && model.is_plain();
        let (has_laws, is_coupled) = (!model.laws().is_empty(), model.laws.supply.is_some());
        covered.then(|| Fast { links: Links::of(chain), has_laws, is_coupled })
    }
}

/// Four states, one quad a component in the order of [`Layout`](super::Layout), with the chain at their positions.
#[derive(Clone, Copy)]
pub struct Samples<S: Simd, const N: usize> {
    simd: S,
    q: [Wide<S>; N],
    qd: [Wide<S>; N],
    theta: [Wide<S>; N],
    thetad: [Wide<S>; N],
    bodies: Bodies<S, N>,
}

impl<S: Simd, const N: usize> Samples<S, N> {
    /// From the components of the state, 4N quads.
    #[inline(always)]
    pub fn new(simd: S, fast: &Fast, x: &[Quad]) -> Self {
        let mut parts = [[Wide::splat(simd, 0.0); N]; 4];
        for (part, x) in parts.iter_mut().zip(x.chunks_exact(N)) {
            for i in 0..N {
                part[i] = Wide::load(simd, &x[i].0);
            }
        }
        let [q, qd, theta, thetad] = parts;
        Samples { simd, q, qd, theta, thetad, bodies: Bodies::at(simd, &fast.links, &q) }
    }
}
