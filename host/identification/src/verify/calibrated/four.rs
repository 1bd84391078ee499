//! Steps of four states of a calibrated robot by the model's fast kernel.

use super::super::system::Four;
use crate::model::fast::{Fast, JOINTS, Samples, SlopesBy, StepQuads, WITH_PAIR, WITH_PAIRS};
use crate::model::{Dynamics, Integrator};
use solve::simd::{Simd, Work, vectorised};

/// One step of four states, in the scratch space of `step`; with derivatives by the state where `WITH_SLOPES`.
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
        let Four { x, u, time_s, dt_s } = four;
        let samples = Samples::<S, L>::new(simd, fast, x);
        step.step::<S, L, WITH_SLOPES>(
            (integrator, SlopesBy::State),
            (fast, dynamics),
            (&samples, &x[..]),
            (u, time_s),
            dt_s,
        );
    }
}

#[cfg(test)]
mod tests {
    use super::super::CalibratedModel;
    use crate::model::Integrator;
    use crate::robot::Robot;
    use crate::verify::system::{Four, System};
    use solve::simd::{LANES, Quad};

    #[test]
    fn four_states_at_once_go_where_each_of_them_goes_alone() {
        let robot = Robot::builtin("doggy").unwrap();
        let starts: Vec<(String, f64)> =
            robot.parameters().iter().map(|spec| (spec.name.clone(), spec.value.start)).collect();
        let start = |name: &str| starts.iter().find(|(own, _)| own == name).map(|(_, value)| *value);
        // Eight milliseconds are divided where friction is, which the kernel does not.
        for (integrator, period_s) in
            [(Integrator::Euler, 1e-3), (Integrator::RungeKutta4, 1e-3), (Integrator::RungeKutta4, 8e-3)]
        {
            let model = CalibratedModel::from_values(robot.clone(), integrator, start).unwrap();
            assert!(model.fast.is_some(), "the kernel covers Doggy");
            let mut system = model.system();
            let n = system.states();
            let mut four = Four::new(n, 3);
            for lane in 0..LANES {
                let at = |i: usize, scale: f64| scale * ((7 * lane + 3 * i) as f64).sin();
                // Links stand near their motors, as belts let them.
                (0..3).for_each(|i| four.x[i].0[lane] = at(i, 0.5));
                (3..6).for_each(|i| four.x[i].0[lane] = at(i, 2.0));
                (6..9).for_each(|i| four.x[i].0[lane] = at(i - 6, 0.5) + at(i, 0.01));
                (9..n).for_each(|i| four.x[i].0[lane] = at(i - 6, 2.0) + at(i, 0.5));
                (0..3).for_each(|i| four.u[i].0[lane] = at(i, 0.9));
                four.dt_s.0[lane] = period_s * (1.0 + 0.1 * lane as f64);
            }
            let (mut next, mut jacobian) = (vec![Quad::default(); n], vec![Quad::default(); n * n]);
            let (mut each, mut each_jacobian) = (next.clone(), jacobian.clone());
            // rtol and atol 1e-11: rounding on forces of a thousand newton metres
            let close = |found: &[Quad], expected: &[Quad]| {
                for (found, expected) in found.iter().flat_map(|quad| quad.0).zip(expected.iter().flat_map(|q| q.0)) {
                    assert!((found - expected).abs() <= 1e-11 * (1.0 + expected.abs()), "{found} {expected}");
                }
            };
            system.step_four(&four, &mut next);
            four.step_each(&mut system, &mut each);
            close(&next, &each);
            system.step_jacobian_four(&four, &mut next, &mut jacobian);
            four.step_jacobian_each(&mut system, &mut each, &mut each_jacobian);
            close(&next, &each);
            close(&jacobian, &each_jacobian);
        }
    }
}
