//! Derivatives against central differences, and the equations against hand-written ones.

use rand::{RngExt, SeedableRng, rngs::StdRng};

use super::{Integrator, Linear, Model, SensorFrame, StepSlopes, Stepper};
use crate::effect::Effect;
use crate::robot::Robot;

/// Doggy; the same with a rigid pitch joint, known b and Coriolis terms; the one-joint robot.
fn models() -> Vec<(&'static str, Model)> {
    let doggy = include_str!("../robot/builtin/doggy.toml");
    let rigid_pitch = {
        // The second joint's transmission and everything that only an elastic one has.
        let (before, rest) = doggy.split_at(doggy.find("name = \"pitch\"").unwrap());
        let (pitch, after) = rest.split_at(rest.find("name = \"roll\"").unwrap());
        let pitch = pitch
            .replace("transmission = \"elastic\"", "transmission = \"rigid\"")
            .lines()
            .filter(|line| !line.starts_with("k_s") && !line.starts_with("d_s"))
            .collect::<Vec<_>>()
            .join("\n");
        format!("{before}{pitch}\n{after}").replace("coriolis = false", "coriolis = true")
    };
    let unknown = doggy
        .replacen(
            "d_s = { start = 1.0, simulated = 1.5 }",
            "d_s = { start = 1.0 }\nJ = { start = 0.1 }\no = { start = 0.3 }",
            1,
        )
        .replacen(
            "d_s = { start = 1.0, simulated = 1.5 }",
            "d_s = { start = 1.0 }\nmx = { start = 0.2 }\nmz = { start = -0.1 }",
            1,
        )
        .replacen("speed = \"motor\"", "acts = \"link\"", 1)
        .replace("coriolis = false", "coriolis = true");
    vec![
        ("doggy", Model::new(&Robot::builtin("doggy").unwrap())),
        ("rigid pitch", Model::new(&Robot::parse(&rigid_pitch).unwrap())),
        ("one joint", Model::new(&Robot::builtin("one_joint").unwrap())),
        ("emps", Model::new(&Robot::builtin("emps").unwrap())),
        ("unknown inertia", Model::new(&Robot::parse(&unknown).unwrap())),
    ]
}

fn random_point(model: &Model, seed: u64) -> (Vec<f64>, Vec<f64>) {
    let mut rng = StdRng::seed_from_u64(seed);
    let layout = model.layout();
    let mut x: Vec<f64> = (0..layout.size()).map(|_| rng.random_range(-0.5..0.5)).collect();
    for i in 0..layout.joints() {
        // Slow enough that the friction's sigmoid is not saturated.
        x[layout.thetad(i)] = rng.random_range(-0.004..0.004);
    }
    (x, (0..layout.joints()).map(|_| rng.random_range(-0.9..0.9)).collect())
}

fn assert_close(a: f64, b: f64, rtol: f64, atol: f64, what: &str) {
    assert!((a - b).abs() <= atol + rtol * b.abs(), "{what}: {a:e} against {b:e}");
}

/// Central difference of `f` at `v` along component j, with a step suited to its size.
fn difference(v: &[f64], j: usize, step: f64, mut f: impl FnMut(&[f64]) -> Vec<f64>) -> Vec<f64> {
    let mut moved = v.to_vec();
    moved[j] = v[j] + step;
    let plus = f(&moved);
    moved[j] = v[j] - step;
    let minus = f(&moved);
    plus.iter().zip(&minus).map(|(p, m)| (p - m) / (2.0 * step)).collect()
}

#[test]
fn derivatives_of_the_dynamics_are_those_of_differences() {
    for (name, model) in models() {
        let z = model.coordinates().start();
        let (size, columns) = (model.layout().size(), model.layout().size() + z.len());
        for seed in 0..5 {
            let (x, u) = random_point(&model, seed);
            let mut linear = Linear::default();
            model.at(&z).linearise(&x, &u, &mut linear);
            let mut plain = vec![0.0; size];
            model.at(&z).derivative(&x, &u, &mut plain);
            for i in 0..size {
                assert_close(linear.xdot[i], plain[i], 1e-12, 1e-12, name);
            }
            let f = |x: &[f64], z: &[f64]| {
                let mut xdot = vec![0.0; size];
                model.at(z).derivative(x, &u, &mut xdot);
                xdot
            };
            for j in 0..columns {
                let expected = if j < size {
                    difference(&x, j, 1e-7, |x| f(x, &z))
                } else {
                    difference(&z, j - size, 1e-6 * z[j - size].abs().max(1e-3), |z| f(&x, z))
                };
                for i in 0..size {
                    // atol: accelerations of up to 1e3 rad/s² lose 1e-13 of themselves over a step of 1e-7
                    assert_close(linear.slopes[i * columns + j], expected[i], 1e-5, 3e-3, &format!("{name} {i} {j}"));
                }
            }
        }
    }
}

#[test]
fn derivatives_of_a_step_are_those_of_differences() {
    for integrator in [Integrator::Euler, Integrator::RungeKutta4] {
        for (name, model) in models() {
            let z = model.coordinates().start();
            let (size, columns) = (model.layout().size(), model.layout().size() + z.len());
            let (x, u) = random_point(&model, 9);
            let mut stepper = Stepper::new(integrator);
            let mut slopes = StepSlopes::default();
            stepper.step_slopes(&model.at(&z), &x, &u, 1e-3, &mut slopes);
            let mut step = |x: &[f64], z: &[f64]| {
                let mut next = vec![0.0; size];
                stepper.step(&model.at(z), x, &u, 1e-3, &mut next);
                next
            };
            for (a, b) in slopes.next.iter().zip(step(&x, &z)) {
                assert_close(*a, b, 1e-13, 1e-15, name);
            }
            for j in 0..columns {
                let expected = if j < size {
                    difference(&x, j, 1e-6, |x| step(x, &z))
                } else {
                    difference(&z, j - size, 1e-4 * z[j - size].abs().max(1e-2), |z| step(&x, z))
                };
                for i in 0..size {
                    let what = format!("{name} {integrator:?} {i} {j}");
                    assert_close(slopes.slopes[i * columns + j], expected[i], 1e-5, 1e-7, &what);
                }
            }
        }
    }
}

/// Doggy with gyros that lag by this much, s, and the coordinates that say so.
fn lagging(time_constant_s: f64) -> (Model, Vec<f64>) {
    let robot = Robot::builtin("doggy").unwrap();
    let law = Effect::by_id("gyro_lag").unwrap().laws(&robot).unwrap().swap_remove(0);
    let model = Model::extended(&robot, vec![law]).unwrap();
    let mut z = model.coordinates().start();
    // The law's coordinates are the last ones, ln T of each gyro.
    let base = Model::new(&robot).coordinates().start().len();
    z[base..].fill(time_constant_s.ln());
    (model, z)
}

#[test]
fn a_gyro_that_lags_by_less_than_a_sample_is_followed() {
    for time_constant_s in [5e-5, 2e-4, 5e-4, 4e-3] {
        let (model, z) = lagging(time_constant_s);
        let first = model.lagging(0).unwrap().state;
        let (x, u) = random_point(&model, 5);
        let size = x.len();
        let mut stepper = Stepper::new(Integrator::RungeKutta4);
        let (mut once, mut often, mut from) = (vec![0.0; size], vec![0.0; size], x.clone());
        stepper.step(&model.at(&z), &x, &u, 1e-3, &mut once);
        for _ in 0..1000 {
            stepper.step(&model.at(&z), &from, &u, 1e-6, &mut often);
            from.copy_from_slice(&often);
        }
        for i in first..first + 6 {
            // Measured: 5.5e-5 of the change at the shortest lag, as the links' speeds are no parabola.
            let (off, change) = ((once[i] - often[i]).abs(), (often[i] - x[i]).abs());
            assert!(off <= 1e-4 * change + 1e-12, "{time_constant_s} s, state {i}: {} {}", once[i], often[i]);
        }
        let mut slopes = StepSlopes::default();
        stepper.step_slopes(&model.at(&z), &x, &u, 1e-3, &mut slopes);
        let columns = size + z.len();
        let mut step = |x: &[f64], z: &[f64]| {
            let mut next = vec![0.0; size];
            stepper.step(&model.at(z), x, &u, 1e-3, &mut next);
            next
        };
        for (j, expected) in (0..columns).map(|j| match j.checked_sub(size) {
            None => (j, difference(&x, j, 1e-6, |x| step(x, &z))),
            Some(c) => (j, difference(&z, c, 1e-4 * z[c].abs().max(1e-2), |z| step(&x, z))),
        }) {
            for i in first..first + 6 {
                let what = format!("{time_constant_s} s {i} {j}");
                // atol: stages of a short lag swing a thousandfold and cancel, which differences feel: 1.5e-7 was met
                assert_close(slopes.slopes[i * columns + j], expected[i], 1e-5, 1e-6, &what);
            }
        }
    }
}

#[test]
fn derivatives_of_body_rates_are_those_of_differences() {
    for (name, model) in models() {
        let n = model.layout().joints();
        let (x, _) = random_point(&model, 4);
        let mut frame = SensorFrame::default();
        frame.linearise(model.chain(), &x[..n], &x[n..2 * n]);
        for body in 0..n {
            for column in 0..2 * n {
                let expected = difference(&x[..2 * n], column, 1e-6, |v| {
                    let mut frame = SensorFrame::default();
                    frame.rates(model.chain(), &v[..n], &v[n..]);
                    frame.rate(body).as_slice().to_vec()
                });
                for axis in 0..3 {
                    assert_close(frame.slope(body, column)[axis], expected[axis], 1e-7, 1e-9, name);
                }
            }
        }
    }
}

#[test]
fn doggy_obeys_the_printed_equations() {
    let robot = Robot::builtin("doggy").unwrap();
    let model = Model::new(&robot);
    // k_pwm, k_mi, b, mu, k_s, d_s as Table 1 identified them, in the order of the robot's parameters.
    let physical = [4.696, 31.328, 2.428, 1.599, 2.565, 4.855, 187.555, 120.070, 103.056, 5.335, 4.143, 8.043];
    let names: Vec<_> = model.coordinates().iter().map(|c| c.spec.name.clone()).collect();
    let expected = "k_pwm k_mi b mu[1] mu[2] mu[3] k_s[1] k_s[2] k_s[3] d_s[1] d_s[2] d_s[3]";
    assert_eq!(names.join(" "), expected);
    let z = model.coordinates().from_physical(&physical);
    for (a, b) in model.coordinates().to_physical(&z).iter().zip(&physical) {
        assert_close(*a, *b, 1e-14, 0.0, "coordinates round trip");
    }
    let (mut x, u) = random_point(&model, 2);
    for i in 0..3 {
        x[9 + i] *= 100.0;
    }
    let mut xdot = [0.0; 12];
    model.at(&z).derivative(&x, &u, &mut xdot);
    let mut torque = [0.0; 3];
    model.chain().inverse_dynamics(&x[..3], None, &xdot[3..6], &mut torque);
    for i in 0..3 {
        let (mu, k_s, d_s) = (physical[3 + i], physical[6 + i], physical[9 + i]);
        let (q, qd, theta, thetad) = (x[i], x[3 + i], x[6 + i], x[9 + i]);
        let tau_c = k_s * (q - theta) + d_s * (qd - thetad);
        let tau_m = 4.696 * 32.0 * u[i] - 31.328 * thetad;
        let tau_f = 2.0 * mu * (1.0 / (1.0 + (-400.0 * thetad).exp()) - 0.5);
        assert_close(xdot[9 + i], (tau_c + tau_m - tau_f) / 2.428, 1e-12, 1e-12, "(9), motor");
        assert_close(torque[i], -tau_c, 1e-11, 1e-12, "(5)");
        assert_close(xdot[i], qd, 0.0, 0.0, "q");
        assert_close(xdot[6 + i], thetad, 0.0, 0.0, "theta");
    }
}

#[test]
fn links_are_known_from_another_model_where_a_law_leaves_them_alone() {
    let robot = Robot::builtin("doggy").unwrap();
    let base = Model::new(&robot);
    let (x, u) = random_point(&base, 5);
    let of_base = base.at(&base.coordinates().start());
    for (id, is_same) in [("viscous_friction", true), ("backlash", true), ("link_inertia", false), ("coriolis", false)]
    {
        let law = Effect::by_id(id).unwrap().laws(&robot).unwrap().swap_remove(0);
        let model = Model::extended(&robot, vec![law]).unwrap();
        let mut z = model.coordinates().start();
        for value in &mut z[base.coordinates().len()..] {
            *value += 0.01;
        }
        let dynamics = model.at(&z);
        assert_eq!(dynamics.has_links_of(&of_base), is_same, "{id}");
        assert_eq!(dynamics.links_at(&x) == of_base.links_at(&x), is_same, "{id}");
        if is_same {
            let (mut own, mut known) = (vec![0.0; x.len()], vec![0.0; x.len()]);
            dynamics.derivative(&x, &u[..], &mut own);
            dynamics.derivative_with(&x, &u[..], &of_base.links_at(&x), &mut known);
            assert_eq!(own, known, "{id}: bit for bit");
        }
    }
}

#[test]
fn a_step_has_as_many_parts_as_the_slope_that_a_law_finds_needs() {
    let robot = Robot::builtin("one_joint").unwrap();
    let law = Effect::by_id("friction_slope").unwrap().laws(&robot).unwrap().swap_remove(0);
    let (base, extended) = (Model::new(&robot), Model::extended(&robot, vec![law]).unwrap());
    let parts = |model: &Model, z: &[f64]| Integrator::RungeKutta4.parts_near_rest(&model.at(z), 8e-3);
    let mut z = extended.coordinates().start();
    let described = parts(&base, &base.coordinates().start());
    assert_eq!(parts(&extended, &z), described);
    z[extended.coordinates().first_of_law(0)] += 2f64.ln();
    assert_eq!(parts(&extended, &z), 2 * described, "a slope twice as steep");
    assert!(described > 1);
}

#[test]
fn a_step_across_a_reversal_has_the_impulse_of_friction_wherever_it_begins() {
    let robot = Robot::builtin("emps").unwrap();
    let model = Model::new(&robot);
    let period_s = robot.sample_period_s;
    let mut rng = StdRng::seed_from_u64(7);
    let mut stepper = Stepper::new(Integrator::RungeKutta4);
    let mut x = vec![0.0; model.layout().size()];
    let (mut next, mut fine, mut most) = (x.clone(), x.clone(), [0.0_f64; 2]);
    for _ in 0..4000 {
        let mut z = model.coordinates().start();
        let mu = model.coordinates().names().position(|(name, _)| name.starts_with("mu")).unwrap();
        // Friction takes an eighth of a width of its sign's bend in a step to four, the drive up to 12.
        z[mu] *= rng.random_range(-2.5..1.0_f64).exp();
        let dynamics = model.at(&z);
        let (speed, half_slope_s, per_s) = dynamics.rubbing().next().unwrap();
        let width = half_slope_s.recip();
        x[speed] = rng.random_range(-12.0..12.0) * width;
        let force = 50.0 * rng.random_range(-8.0..8.0) * width / period_s;
        stepper.step(&dynamics, &x, &[force][..], period_s, &mut next);
        fine.copy_from_slice(&x);
        for _ in 0..256 {
            let from = fine.clone();
            stepper.step(&dynamics, &from, &[force][..], period_s / 256.0, &mut fine);
        }
        let friction = per_s * width * period_s;
        let is_divided = !Integrator::RungeKutta4.leaves_whole(&dynamics, period_s);
        let most = &mut most[usize::from(is_divided)];
        *most = most.max((next[speed] - fine[speed]).abs() / friction);
    }
    println!("most {most:?}");
    // Of μ T over the inertia. atol: what the parts of a step are chosen for, and what whole steps leave.
    let [whole, divided] = most;
    assert!(divided < 2.5e-3, "{divided} of friction's impulse");
    assert!((0.1..0.4).contains(&whole), "{whole} of friction's impulse");
}
