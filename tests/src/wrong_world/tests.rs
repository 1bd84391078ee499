//! The plant against conservation of energy, and against the estimator on machines without model errors.

use host::calibrate::{Method, Preset, calibrate, comparable_truth};
use host::effect::{Effect, TrueValue};
use host::recording::check::check;
use solve::levenberg::Settings;

use super::chain::{Chain, Link, MOST, Values};
use super::dynamics::{Acting, State};
use super::effect::{Hiding, Size};
use super::family::Family;
use super::machine::{Fidelity, Machine};
use super::noise::{Purpose, stream};
use super::outsider::Usage;
use super::session::{STEP_S, play};
use super::unmodelled::Unmodelled;
use super::{Case, Main, cases, draw};

/// Robots of both parities: all descriptions of the study.
const ROBOTS: [(Family, u64); 6] = [
    (Family::Doggy, 2),
    (Family::Rigid, 2),
    (Family::Rigid, 3),
    (Family::Elastic2, 2),
    (Family::Arm, 2),
    (Family::Arm, 3),
];

#[test]
fn a_chain_without_friction_keeps_its_energy() {
    let robot = Family::Arm.robot(3);
    let (mut machine, _) = Machine::draw(&robot, Fidelity::WrongWorld, &mut stream(0, 1, Purpose::Machine));
    // Gravity without counter-springs, so that its energy is that of the masses.
    machine.chain.links.iter_mut().for_each(|link| link.is_compensated = false);
    for drive in &mut machine.joints {
        (drive.friction.coulomb, drive.friction.viscous) = (0.0, 0.0);
        if let Some(belt) = &mut drive.belt {
            belt.damping = 0.0;
        }
    }
    let energy = |state: &State| {
        let (q, qd) = (state.chain_positions(), state.chain_speeds());
        let pose = machine.chain.pose(&q);
        let mass = machine.chain.mass_matrix(&pose);
        let mut energy = 0.5 * qd.dot(&(mass * qd)) + machine.chain.potential_energy(&pose);
        for (joint, drive) in machine.joints.iter().enumerate() {
            let view = machine.view(state, joint, &Acting::default());
            let wind = view.q - view.theta;
            energy += 0.5 * drive.inertia * view.thetad.powi(2);
            energy += 0.5 * drive.belt.map_or(0.0, |belt| belt.stiffness) * wind * wind;
        }
        energy
    };
    let mut state = State::at_rest(&machine, &[0.2, -0.4, 0.3]);
    state.set_speeds(&machine, &[2.0, -1.5, 3.0]);
    let start = energy(&state);
    let mut swing = 0.0_f64;
    for _ in 0..15_000 {
        machine.step(&mut state, &Acting::default(), STEP_S);
        swing = swing.max((machine.chain.potential_energy(&machine.chain.pose(&state.chain_positions()))).abs());
    }
    // rtol 1e-6 of the largest potential energy over 3 s, with steps of 0.2 ms
    let lost = energy(&state) - start;
    assert!(lost.abs() < 1e-6 * swing, "{lost} J of {swing} J");
}

#[test]
fn both_chains_have_the_same_mass_gravity_and_coriolis_torques() {
    for (family, seed) in ROBOTS {
        let robot = family.robot(seed);
        let n = robot.joints.len();
        let gravity = nalgebra::Vector3::from(robot.gravity_m_s2);
        let chain = Chain { links: robot.joints.iter().map(Link::of).collect(), gravity };
        let theirs = robot.chain().with_coriolis(true);
        let mut q = Values::zeros();
        let mut qd = Values::zeros();
        for joint in 0..n {
            q[joint] = 0.3 - 0.25 * joint as f64;
            qd[joint] = 1.1 - 0.7 * joint as f64;
        }
        let pose = chain.pose(&q);
        let (mass, torques) =
            (chain.mass_matrix(&pose), chain.gravity_torques(&pose) + chain.coriolis_torques(&pose, &qd));
        let (mut m, mut bias) = (vec![0.0; n * n], vec![0.0; n]);
        theirs.mass_matrix(&q.as_slice()[..n], &mut m);
        theirs.bias_torque(&q.as_slice()[..n], &qd.as_slice()[..n], &mut bias);
        let mut rates = vec![[0.0; 3]; n];
        theirs.body_rates(&q.as_slice()[..n], &qd.as_slice()[..n], &mut rates);
        let ours = chain.body_rates(&pose, &qd);
        for i in 0..n {
            // rtol 1e-12 of the largest: rounding
            assert!((torques[i] - bias[i]).abs() < 1e-12 * (1.0 + bias[i].abs()), "{}: torque {i}", robot.name);
            for j in 0..n {
                assert!((mass[(i, j)] - m[i * n + j]).abs() < 1e-12 * (1.0 + m[0]), "{}: M {i} {j}", robot.name);
            }
            for axis in 0..3 {
                assert!((ours[i][axis] - rates[i][axis]).abs() < 1e-12, "{}: rate of body {i}", robot.name);
            }
        }
    }
}

/// Relative tolerance of estimates: noise, and the estimator's integration step of one sample period.
const RTOL: f64 = 0.01;
/// Where three standard errors are more, they are the tolerance, up to this: dampings of joints with one encoder.
const MOST_RTOL: f64 = 0.03;
/// Absolute tolerance of parameters near zero: first moments (kg m), zeros (rad), gyro biases (rad/s) and misalignments (rad).
const ATOL: f64 = 2e-3;

fn calibrates_to_its_truth(family: Family, seed: u64) {
    let robot = family.robot(seed);
    let stream = |purpose| stream(family.stream(), seed, purpose);
    let (machine, truth) = Machine::draw(&robot, Fidelity::TrueToFile, &mut stream(Purpose::Machine));
    let motion = family.motion(&robot, &mut stream(Purpose::Motion));
    let rng = &mut stream(Purpose::Sensors);
    let played = play((&robot, &machine), motion, Unmodelled::none(), Fidelity::TrueToFile, rng).expect("it plays");
    let checked = check(&played.recording);
    assert!(checked.usable, "{}: {:?}", robot.name, checked.findings);
    let settings = Settings { threads: 1, ..Settings::default() };
    let method = Method::suited(Preset::Default, &robot);
    let found = calibrate(&robot, &[&played.recording], method, &settings, |_, _| {}).expect("it calibrates");
    let truth: Vec<TrueValue> = truth.into_iter().map(|(name, value)| TrueValue { name, unit: "", value }).collect();
    let mut wrong = Vec::new();
    for TrueValue { name, value, .. } in comparable_truth(&robot, &truth) {
        let Some(parameter) = found.parameter(&name).filter(|parameter| parameter.identifiable) else { continue };
        let noise = 3.0 * parameter.std_error.unwrap_or(0.0);
        let allowed = if value.abs() > 10.0 * ATOL && !name.starts_with("R_imu") {
            noise.clamp(RTOL * value.abs(), MOST_RTOL * value.abs())
        } else {
            ATOL
        };
        if (parameter.estimate - value).abs() > allowed {
            wrong.push(format!("{name}: {} of {value}", parameter.estimate));
        }
    }
    assert!(wrong.is_empty(), "{}, {:?}: {wrong:#?}", robot.name, found.status);
}

#[test]
fn doggy_is_calibrated_to_its_truth() {
    calibrates_to_its_truth(Family::Doggy, 2);
}

#[test]
fn a_pendulum_is_calibrated_to_its_truth() {
    calibrates_to_its_truth(Family::Rigid, 2);
}

#[test]
fn a_carriage_is_calibrated_to_its_truth() {
    calibrates_to_its_truth(Family::Rigid, 3);
}

#[test]
fn an_elastic_joint_is_calibrated_to_its_truth() {
    calibrates_to_its_truth(Family::Elastic2, 2);
}

#[test]
fn an_arm_of_rigid_joints_is_calibrated_to_its_truth() {
    calibrates_to_its_truth(Family::Arm, 2);
}

#[test]
fn an_arm_of_elastic_joints_is_calibrated_to_its_truth() {
    calibrates_to_its_truth(Family::Arm, 3);
}

#[test]
fn every_effect_of_a_family_can_be_hidden_and_has_a_law_that_could_find_it() {
    for (family, seed) in ROBOTS {
        let robot = family.robot(seed);
        let usage = vec![
            Usage {
                input: 1.0,
                torque: 20.0,
                torque_peak: 60.0,
                speed: 1.0,
                position: 0.3,
                windup: 0.1,
                transmitted: 10.0
            };
            robot.joints.len()
        ];
        let gyro_peaks = vec![5.0; robot.gyros().count()];
        for id in family.effects(seed) {
            let laws =
                Effect::by_id(id).unwrap().laws(&robot).unwrap_or_else(|error| panic!("{}: {error}", robot.name));
            let (sound, _) = Machine::draw(&robot, Fidelity::WrongWorld, &mut stream(0, 1, Purpose::Machine));
            for size in [Size::Large, Size::Trace] {
                let mut machine = sound.clone();
                let rng = &mut stream(0, 1, Purpose::Main);
                let mut hiding = Hiding {
                    machine: &mut machine,
                    robot: &robot,
                    usage: &usage,
                    gyro_peaks: &gyro_peaks,
                    gaps: family.gaps(),
                    rng,
                };
                let truths = hiding.hide(id, size).unwrap_or_else(|| panic!("{}: `{id}` cannot be hidden", robot.name));
                assert!(!truths.is_empty() && machine.chain.links.len() <= MOST);
                let told: Vec<&str> = laws[0].parameters().results.iter().map(|result| result.name.as_str()).collect();
                for truth in truths {
                    assert!(told.contains(&truth.name.as_str()), "{}: {} is none of {told:?}", robot.name, truth.name);
                    assert!(truth.value.is_finite());
                }
            }
        }
    }
}

#[test]
fn a_case_depends_on_its_seed_alone_and_passes_the_checks() {
    for (family, seed) in [(Family::Rigid, 4), (Family::Elastic2, 5)] {
        let case = |main| Case { family, seed, main, size: Size::Medium };
        let once = draw(&case(Main::None)).unwrap();
        let again = draw(&case(Main::None)).unwrap();
        assert_eq!(once.recording.duty, again.recording.duty);
        assert_eq!(once.recording.t_us, again.recording.t_us);
        assert_eq!(once.traces, again.traces);
        let other = draw(&case(Main::Effect("cogging".to_owned()))).unwrap();
        assert_ne!(once.recording.channels[0].values, other.recording.channels[0].values);
        let checked = check(&once.recording);
        assert!(checked.usable, "{}: {:?}", once.robot.name, checked.findings);
        let seconds = once.recording.duration_s();
        assert!((15.0..30.0).contains(&seconds), "{seconds} s");
    }
}

#[test]
fn the_study_holds_every_effect_at_three_sizes_in_every_family() {
    let cases = cases(2, 2);
    for (family, seed) in ROBOTS {
        let of_robot = || cases.iter().filter(|case| case.family == family && case.seed == seed);
        for id in family.effects(seed) {
            assert_eq!(of_robot().filter(|case| case.effect() == Some(id)).count(), 3, "{id} in {family:?}");
        }
        let outsiders = of_robot().filter(|case| matches!(case.main, Main::Outsider(_))).count();
        assert!(outsiders >= 6, "{outsiders} in {family:?}");
    }
}
