//! The fast kernel against the generic walk over dual numbers.

use rand::{RngExt, SeedableRng, rngs::StdRng};

use super::{Fast, GyroQuads, JOINTS, RateSource, Samples, SlopesBy, StepQuads, WITH_PAIR, WITH_PAIRS};
use crate::effect::Effect;
use crate::model::{Dynamics, Integrator, Model, SensorFrame, StepSlopes, Stepper};
use crate::robot::Robot;
use solve::simd::{LANES, Plain, Quad, Simd, Work, vectorised};

/// Doggy; the same with joints that do not meet and friction on the link side; both without counter-springs.
fn robots() -> [Robot; 4] {
    let doggy = include_str!("../../robot/builtin/doggy.toml");
    let apart = doggy
        .replace(
            "name = \"pitch\"\nkind = \"revolute\"",
            "name = \"pitch\"\nkind = \"revolute\"\norigin_m = [0.2, -0.1, 0.3]",
        )
        .replace(
            "name = \"roll\"\nkind = \"revolute\"",
            "name = \"roll\"\nkind = \"revolute\"\norigin_m = [0.1, 0.4, -0.2]",
        )
        .replace("speed = \"motor\"", "speed = \"link\"");
    assert!(apart.matches("origin_m").count() == 3, "the description has changed");
    let loaded = [doggy, &apart].map(|text| text.replace("gravity = \"compensated\"", "gravity = \"acts\""));
    [doggy, &apart, &loaded[0], &loaded[1]].map(|text| Robot::parse(text).unwrap())
}

/// Robots alone, and on passive joints: before them, behind them, both; beside laws of the drives and of the supply, with states of their own and without, and with
/// gyros that lag.
fn models() -> Vec<(String, Model)> {
    let effects = [
        vec![],
        vec!["base_bearing"],
        vec!["structure_mode"],
        vec!["base_bearing", "structure_mode"],
        vec!["base_bearing", "asymmetric_friction"],
        vec!["voltage_sag", "structure_mode"],
        vec!["belt_hysteresis"],
        vec!["belt_hysteresis", "voltage_sag", "base_bearing"],
        vec!["belt_hysteresis", "electrical_lag", "gyro_lag"],
        vec!["gyro_lag", "structure_mode"],
    ];
    let mut models = Vec::new();
    for (i, robot) in robots().iter().enumerate() {
        for ids in &effects {
            let laws = ids.iter().map(|id| Effect::by_id(id).unwrap().laws(robot).unwrap().swap_remove(0)).collect();
            models.push((format!("robot {i} with {ids:?}"), Model::extended(robot, laws).unwrap()));
        }
    }
    models
}

/// No law here asks for the time.
const TIMES_S: Quad = Quad([0.0; LANES]);

/// Step and gyro rates by the fast kernel, on any instruction set.
struct Run<'a> {
    fast: &'a Fast,
    dynamics: &'a Dynamics<'a>,
    integrator: Integrator,
    x: &'a [Quad],
    u: &'a [Quad],
    to_sensor: crate::robot::Matrix3,
}

struct Found {
    step: StepQuads,
    rates: Vec<Quad>,
    slopes: Vec<(Quad, Quad)>,
}

impl Run<'_> {
    #[inline(always)]
    fn links<S: Simd, const L: usize>(self, simd: S) -> Found {
        let samples = Samples::<S, L>::new(simd, self.fast, self.x);
        let mut step = StepQuads::default();
        let model = (self.fast, self.dynamics);
        step.step::<S, L, true>(
            (self.integrator, SlopesBy::All),
            model,
            (&samples, self.x),
            (self.u, &TIMES_S),
            &Quad([1e-3, 1e-3, 2e-3, 5e-4]),
        );
        let (mut rates, mut slopes) = (Vec::new(), Vec::new());
        for body in 0..L {
            let gyro = GyroQuads::of(&samples, self.fast, body, &self.to_sensor, RateSource::Base);
            for axis in 0..3 {
                rates.push(Quad(gyro.rate(axis).to_array()));
                let (by_q, by_qd) = gyro.slopes(axis);
                for (by_q, by_qd) in by_q.into_iter().zip(by_qd) {
                    slopes.push((Quad(by_q.to_array()), Quad(by_qd.to_array())));
                }
            }
        }
        Found { step, rates, slopes }
    }
}

impl Work for Run<'_> {
    type Output = Found;
    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> Found {
        match self.fast.links() {
            JOINTS => self.links::<S, JOINTS>(simd),
            WITH_PAIR => self.links::<S, WITH_PAIR>(simd),
            _ => self.links::<S, WITH_PAIRS>(simd),
        }
    }
}

#[test]
fn what_the_kernel_does_not_cover_is_left_to_the_generic_walk() {
    assert!(Fast::of(&Model::new(&Robot::builtin("one_joint").unwrap())).is_none());
    let text = include_str!("../../robot/builtin/doggy.toml").replace("coriolis = false", "coriolis = true");
    assert!(Fast::of(&Model::new(&Robot::parse(&text).unwrap())).is_none());
}

#[test]
fn the_fast_kernel_equals_the_equations_on_dual_numbers() {
    let mut rng = StdRng::seed_from_u64(7);
    for (name, model) in models() {
        let Some(fast) = Fast::of(&model) else { panic!("{name} is not covered") };
        let z = model.coordinates().start();
        let dynamics = model.at(&z);
        let (n, size, columns) = (fast.links(), dynamics.size(), dynamics.columns());
        let mut quads = |count: usize, range: f64| -> Vec<Quad> {
            (0..count).map(|_| Quad(std::array::from_fn(|_| rng.random_range(-range..range)))).collect()
        };
        let mut x = quads(size, 1.5);
        // Some motors slow enough that the friction's sigmoid is not saturated.
        for (i, x) in x.iter_mut().enumerate().filter(|(i, _)| i % 2 == 1) {
            x.0[i % LANES] *= 1e-3;
        }
        let u = quads(JOINTS, 0.9);
        let to_sensor = [[0.6, 0.8, 0.0], [-0.8, 0.6, 0.0], [0.0, 0.0, 1.0]];
        for integrator in [Integrator::Euler, Integrator::RungeKutta4] {
            let run = || Run { fast: &fast, dynamics: &dynamics, integrator, x: &x, u: &u, to_sensor };
            for found in [vectorised(run()), run().run(Plain)] {
                for lane in 0..LANES {
                    let at = |quads: &[Quad]| -> Vec<f64> { quads.iter().map(|quad| quad.0[lane]).collect() };
                    let mut expected = StepSlopes::default();
                    let h = [1e-3, 1e-3, 2e-3, 5e-4][lane];
                    Stepper::new(integrator).step_slopes(&dynamics, &at(&x), &at(&u), h, &mut expected);
                    let close = |found: f64, expected: f64, scale: f64, what: &str| {
                        // rtol 1e-11 of the row's largest entry: sums of terms that cancel
                        let off = (found - expected).abs();
                        assert!(off <= 1e-11 * scale.max(1e-3), "{name} {what}: {found} against {expected}");
                    };
                    for i in 0..size {
                        close(at(&found.step.next)[i], expected.next[i], 1.0, "step");
                        let row = &expected.slopes[i * columns..(i + 1) * columns];
                        let largest = row.iter().fold(0.0f64, |a, b| a.max(b.abs()));
                        for c in 0..columns {
                            let slope = found.step.slopes[i * columns + c].0[lane];
                            close(slope, row[c], largest, &format!("{integrator:?} slope {i} {c}"));
                        }
                    }
                    let mut frame = SensorFrame::default();
                    frame.linearise(model.chain(), &at(&x)[..n], &at(&x)[n..2 * n]);
                    for (i, row) in to_sensor.iter().enumerate() {
                        let along = |v: nalgebra::Vector3<f64>| v.dot(&nalgebra::Vector3::from(*row));
                        for body in 0..n {
                            close(found.rates[3 * body + i].0[lane], along(frame.rate(body)), 1.0, "rate");
                            for j in 0..n {
                                let (by_q, by_qd) = found.slopes[(3 * body + i) * n + j];
                                close(by_q.0[lane], along(frame.slope(body, j)), 1.0, "rate by position");
                                close(by_qd.0[lane], along(frame.slope(body, n + j)), 1.0, "rate by speed");
                            }
                        }
                    }
                }
            }
        }
    }
}
