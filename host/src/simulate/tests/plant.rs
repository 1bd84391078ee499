//! The plant's arithmetic: accuracy of the step, rest, energy, every kind of joint.

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::fast_duty;
use crate::effect::{Effect, Size};
use crate::robot::{Robot, Side, Symbol};
use crate::simulate::{Plant, ProcessNoise, STEP_S, Truth};

fn run(robot: &Robot, effect: Option<(&str, Size)>, step_s: f64, seconds: f64) -> Vec<[f64; 9]> {
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    let truth = Truth::drawn(robot, &mut rng);
    let effects =
        effect.map(|(id, size)| Effect::by_id(id).unwrap().hide_in(robot, size, &mut rng).unwrap()).into_iter();
    let mut plant = Plant::new(robot, &truth, effects.collect()).unwrap().with_step(step_s);
    let joints = robot.joints.len();
    (0..(seconds * 1e3) as usize)
        .map(|k| {
            let u: Vec<f64> = (0..joints).map(|j| fast_duty(j, k as f64 * 1e-3)).collect();
            plant.advance(&u, 1e-3);
            let mut readings = [0.0; 9];
            for joint in 0..joints {
                readings[joint] = plant.encoder(Side::Motor, joint);
            }
            for gyro in 0..robot.gyros().count() {
                readings[3 + 3 * gyro..][..3].copy_from_slice(&plant.gyro_rate(gyro));
            }
            readings
        })
        .collect()
}

/// Largest difference of two runs: positions, rates.
fn apart(a: &[[f64; 9]], b: &[[f64; 9]]) -> (f64, f64) {
    let most = |range: std::ops::Range<usize>| {
        let pairs = a.iter().zip(b).flat_map(|(a, b)| range.clone().map(move |i| (a[i] - b[i]).abs()));
        pairs.fold(0.0, f64::max)
    };
    (most(0..3), most(3..9))
}

#[test]
fn halving_the_step_changes_nothing_that_a_sensor_could_see() {
    let robot = Robot::builtin("doggy").unwrap();
    for effect in
        [None, Some(("base_bearing", Size::Large)), Some(("voltage_sag", Size::Large)), Some(("gyro_lag", Size::Small))]
    {
        let coarse = run(&robot, effect, STEP_S, 10.0);
        let (position, rate) = apart(&coarse, &run(&robot, effect, STEP_S / 2.0, 10.0));
        eprintln!("{effect:?}: half the step moves {position:.1e} rad, {rate:.1e} rad/s");
        assert!(position < 1e-7 && rate < 1e-6, "{effect:?}: {position:.1e} rad, {rate:.1e} rad/s");
        let (_, coarser) = apart(&coarse, &run(&robot, effect, STEP_S * 2.0, 10.0));
        assert!(coarser > 4.0 * rate, "fourth order: {coarser:.1e} after {rate:.1e}");
    }
}

#[test]
fn a_robot_at_rest_stays_at_rest() {
    for name in Robot::builtin_names() {
        let robot = Robot::builtin(name).unwrap();
        let truth = Truth::drawn(&robot, &mut ChaCha8Rng::seed_from_u64(9));
        let bearing = Effect::by_id("base_bearing").unwrap();
        // A slide along a rail does not tilt its base, nor does a pendulum whose base no gyro sees.
        let bearing = bearing.hide_in(&robot, Size::Large, &mut ChaCha8Rng::seed_from_u64(9));
        assert!(
            bearing.is_ok() || ["emps", "xl330_pendulum"].contains(&name) || name.starts_with("dfki"),
            "{name}: {bearing:?}"
        );
        let mut plant = Plant::new(&robot, &truth, bearing.into_iter().collect()).unwrap();
        let at_start: Vec<f64> = (0..robot.joints.len()).map(|joint| plant.link_position(joint)).collect();
        plant.advance(&vec![0.0; robot.joints.len()], 0.5);
        for (joint, start) in at_start.iter().enumerate() {
            assert!((plant.link_position(joint) - start).abs() < 1e-9, "{name}");
            assert!(plant.motor_position(joint).abs() < 1e-9, "{name}");
        }
    }
}

/// Rigid and sliding joints, without gravity: the driven joint accelerates as M + b says.
#[test]
fn a_rigid_slide_accelerates_by_its_masses() {
    let text = "name = 'slide'\nsample_period_s = 0.001\ncoriolis = true\ngravity_m_s2 = [0.0, 0.0, -9.81]\n\
        input = { unit = 'newton' }\n\
        [[joint]]\nname = 'x'\nkind = 'prismatic'\naxis = [1, 0, 0]\nlimits_m = [-9, 9]\ngravity = 'acts'\n\
        transmission = 'rigid'\nfriction = { law = 'none' }\ngear = 100\n\
        body = { mass_kg = 2.0, centre_m = [0, 0, 0], inertia_kg_m2 = { xx = 0.1, yy = 0.1, zz = 0.1 } }\n\
        parameters = { b = { fixed = 3.0 } }\n";
    let robot = Robot::parse(text).unwrap();
    let mut plant = Plant::new(&robot, &Truth::nominal(&robot), vec![]).unwrap();
    plant.advance(&[10.0], 2.0);
    assert!((plant.link_position(0) - 0.5 * 10.0 / 5.0 * 4.0).abs() < 1e-12);
    assert_eq!(plant.motor_position(0), plant.link_position(0));
}

/// Hung on a spring against gravity, a link rests where the spring holds it.
#[test]
fn a_loaded_spring_is_wound_at_the_start() {
    let text = Robot::builtin("one_joint").unwrap().toml().replace("axis = [0.0, 0.0, 1.0]", "axis = [0.0, 1.0, 0.0]");
    let robot = Robot::parse(&text).unwrap();
    let truth = Truth::nominal(&robot);
    let plant = Plant::new(&robot, &truth, vec![]).unwrap();
    let q = plant.link_position(0);
    let k_s = truth.get(&robot, Symbol::KS, 0).unwrap();
    let (mass, arm) = (robot.joints[0].body.mass_kg, robot.joints[0].body.centre_m[0]);
    // A positive pitch lowers the bar: k q = m g r cos q.
    assert!((k_s * q - mass * 9.81 * arm * q.cos()).abs() < 1e-9, "{q}");
    assert!(q > 0.03);
}

#[test]
fn truth_is_drawn_within_its_spread_and_by_its_seed() {
    let robot = Robot::builtin("doggy").unwrap();
    let draw = |seed| Truth::drawn(&robot, &mut ChaCha8Rng::seed_from_u64(seed));
    assert_eq!(draw(3), draw(3));
    assert_ne!(draw(3), draw(4));
    for seed in 0..50 {
        let truth = draw(seed);
        for (drawn, spec) in truth.values(&robot).iter().zip(robot.parameters()) {
            if !matches!(spec.symbol, Symbol::Misalignment { .. }) {
                let share = drawn.value / spec.value.simulated;
                assert!((0.85..1.15).contains(&share), "{}: {share}", spec.name);
            }
        }
        for gyro in 0..2 {
            let delta = [0, 1, 2].map(|axis| truth.get(&robot, Symbol::Misalignment { gyro, axis }, 0).unwrap());
            let angle = delta.iter().map(|d| d * d).sum::<f64>().sqrt().to_degrees();
            assert!((1.0..4.0).contains(&angle), "gyro {gyro} turned by {angle}°");
            let rotation = truth.rotation(&robot, gyro);
            let nominal = robot.gyros().nth(gyro).unwrap().rotation;
            let trace: f64 = (0..3).flat_map(|i| (0..3).map(move |j| rotation[i][j] * nominal[i][j])).sum();
            assert!((((trace - 1.0) / 2.0).acos().to_degrees() - angle).abs() < 1e-9);
        }
    }
    assert_eq!(draw(1).get(&robot, Symbol::KT, 0), None);
    assert_eq!(draw(1).get(&robot, Symbol::KPwm, 0), draw(1).get(&robot, Symbol::KPwm, 2), "one value for all motors");
}

/// Link speeds after two milliseconds, for many seeds: the spread is that of a random walk, whatever the step. Belts
/// answer more slowly than that.
#[test]
fn process_noise_is_a_random_walk_of_the_speeds_whatever_the_step() {
    let robot = Robot::builtin("doggy").unwrap();
    let truth = Truth::nominal(&robot);
    for step_s in [STEP_S, 4.0 * STEP_S] {
        let (mut squares, runs) = (0.0, 400);
        for seed in 0..runs {
            let plant = Plant::new(&robot, &truth, vec![]).unwrap().with_step(step_s);
            let mut plant = plant.with_process_noise(ProcessNoise::UNIT, seed);
            plant.begin_motion();
            plant.advance(&[0.0; 3], 2e-3);
            // Gyro 2 stands on the head: in the marked pose its three axes are the three joints'.
            let bias = truth.bias(&robot, 1);
            let rate = plant.gyro_rate(1);
            squares += (0..3).map(|i| (rate[i] - bias[i]).powi(2)).sum::<f64>();
        }
        // Three independent link speeds, 2 ms each.
        let spread = (squares / (3.0 * f64::from(runs as u32) * 2.0)).sqrt() / ProcessNoise::UNIT.link_speed;
        // 1200 squares: 2 % one sigma.
        assert!((0.93..1.07).contains(&spread), "step {step_s}: {spread}");
    }
    let shaken = |seed| {
        let mut plant = Plant::new(&robot, &truth, vec![]).unwrap().with_process_noise(ProcessNoise::UNIT, seed);
        plant.begin_motion();
        plant.advance(&[0.5; 3], 0.1);
        [0, 1, 2].map(|joint| plant.motor_position(joint))
    };
    assert_eq!(shaken(3), shaken(3));
    assert_ne!(shaken(3), shaken(4));
}
