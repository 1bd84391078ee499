//! Steps of four states of a calibrated robot by the model's fast kernel.

use super::super::system::Four;
use crate::model::fast::{Fast, JOINTS, Samples, StepQuads, WITH_PAIR, WITH_PAIRS};
use crate::model::{Dynamics, Integrator};
use solve::simd::{Quad, Simd, Work, vectorised};

/// One step of four states, in the scratch space of `step`; with derivatives where `WITH_SLOPES`.
pub(super) fn step<const WITH_SLOPES: bool>(
    (fast, dynamics, integrator): (&Fast, &Dynamics<'_>, Integrator),
    four: &Four,
    step: &mut StepQuads,
) {
    match fast.links() {
        JOINTS => vectorised(Stepping::<JOINTS, WITH_SLOPES> { fast, dynamics, integrator, four, step }),
        WITH_PAIR => vectorised(Stepping::<WITH_PAIR, WITH_SLOPES> { fast, dynamics, integrator, four, step }),
        _ => vectorised(Stepping::<WITH_PAIRS, WITH_SLOPES> { fast, dynamics, integrator, four, step }),
    }
}

/// Under a model of L links.
struct Stepping<'a, 'm, const L: usize, const WITH_SLOPES: bool> {
    fast: &'a Fast,
    dynamics: &'a Dynamics<'m>,
    integrator: Integrator,
    four: &'a Four,
    step: &'a mut StepQuads,
}

impl<const L: usize, const WITH_SLOPES: bool> Work for Stepping<'_, '_, L, WITH_SLOPES> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        let Stepping { fast, dynamics, integrator, four, step } = self;
        let Four { x, u, time_s, dt_s }: &Four = four;
        let samples = Samples::<S, L>::new(simd, fast, x);
        let quads: &[Quad] = x;
        step.step::<S, L, WITH_SLOPES>(integrator, (fast, dynamics), (&samples, quads), (u, time_s), dt_s);
    }
}
