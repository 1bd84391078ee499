//! Roles and typical sizes: every result has a role, what is realistic is plausible, and what is absurd is not.

use super::*;
use crate::model::law::{Of, Parameters, unit_at};

/// RMS of torque (N m) and speed (rad/s) of Doggy's motors on a calibration motion of another simulator.
const DOGGY_TORQUE_RMS: [f64; 3] = [45.0, 38.0, 37.0];
const DOGGY_SPEED_RMS: [f64; 3] = [0.94, 0.66, 0.62];

fn doggys() -> RobotScales {
    RobotScales::of(&doggy(), &DOGGY_TORQUE_RMS, &DOGGY_SPEED_RMS)
}

/// EMPS as measured: 25 to 54 N and 0.088 m/s.
fn carriage(force_rms: f64) -> RobotScales {
    RobotScales::of(&Robot::builtin("emps").unwrap(), &[force_rms], &[0.088])
}

/// KUKA as measured on trajectory A.
fn kukas() -> RobotScales {
    let robot = Robot::builtin("kuka_kr300").unwrap();
    RobotScales::of(&robot, &[916.0, 2205.0, 3119.0], &[0.227, 0.235, 0.225])
}

fn implausibility(name: &str, value: f64, scales: &RobotScales) -> f64 {
    let effect = Effect::by_id(name.split('.').next().unwrap()).unwrap();
    assert!(effect.parameter(name).is_some(), "{name}");
    effect.implausibility(name, value, scales)
}

fn robots() -> Vec<Robot> {
    let arm = concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/robots/arm7.toml");
    let builtin = Robot::builtin_names().map(|name| Robot::builtin(name).unwrap());
    builtin.chain([Robot::load(arm).unwrap()]).collect()
}

/// Whatever a law tells is in the catalogue, in the catalogue's unit. Only what is no nuisance is listed as a parameter.
#[test]
fn every_result_of_every_law_has_a_role() {
    let check = |effect: &Effect, parameters: &Parameters, robot: &Robot| {
        for result in &parameters.results {
            let parameter = effect.parameter(&result.name);
            let parameter = parameter.unwrap_or_else(|| panic!("{} is not in the catalogue", result.name));
            let at_any_joint = |unit| robot.joints.iter().map(move |joint| unit_at(joint.kind, unit));
            let fits = result.unit == parameter.unit || at_any_joint(parameter.unit).any(|unit| unit == result.unit);
            assert!(fits, "{} in {}", result.name, result.unit);
        }
    };
    let mut laws = 0;
    for robot in robots() {
        for effect in CATALOGUE {
            for law in effect.laws(&robot).into_iter().flatten() {
                check(effect, law.parameters(), &robot);
                if let Some(other) = law.other_shape() {
                    check(effect, other.parameters(), &robot);
                }
                laws += 1;
            }
        }
    }
    assert!(laws > 200, "{laws}");
    for effect in CATALOGUE {
        assert!(effect.parameters.iter().all(|parameter| parameter.role != Role::Nuisance), "{}", effect.id);
        assert!(effect.nuisances.iter().all(|parameter| parameter.role == Role::Nuisance), "{}", effect.id);
    }
}

#[test]
fn typical_sizes_are_numbers() {
    for effect in CATALOGUE {
        for parameter in effect.parameters.iter().chain(effect.nuisances) {
            let name = format!("{}.{}", effect.id, parameter.name);
            assert!(!parameter.sizes.is_empty(), "{name}");
            if let Some(Typical { median, decades, .. }) = parameter.typical {
                assert!(median.is_finite() && median > 0.0, "{name}: {median}");
                assert!(decades.is_finite() && (0.05..1.5).contains(&decades), "{name}: {decades}");
            }
            // Without a number: a stop may be anywhere.
            let needs_one = parameter.role.is_size() && effect.id != "end_stop";
            assert!(parameter.typical.is_some() || !needs_one, "{name}");
        }
    }
}

/// Doggy has every scale, and what is drawn for it lies around the medians: within three standard deviations to either side, and the medium sizes of a
/// parameter, on average over joints and seeds, within one.
#[test]
fn realistic_sizes_are_plausible() {
    let scales = doggys();
    for effect in CATALOGUE {
        let mut medium: std::collections::BTreeMap<&str, Vec<f64>> = Default::default();
        for (size, seed) in
            [Size::Small, Size::Medium, Size::Large].into_iter().flat_map(|s| (0..6).map(move |k| (s, k)))
        {
            let hidden = effect.hide_in(&doggy(), size, &mut ChaCha8Rng::seed_from_u64(seed)).unwrap();
            for truth in &hidden.values {
                let off = effect.implausibility(&truth.name, truth.value, &scales);
                assert!(off < 3.0, "{} = {} {}: {off}", truth.name, truth.value, truth.unit);
                let parameter = effect.parameter(&truth.name).unwrap();
                let Some(typical) = parameter.typical else { continue };
                let scale = effect.scale(&truth.name, &scales).unwrap_or_else(|| panic!("no scale of {}", truth.name));
                // Differences that add up to nothing may be as small as chance has it.
                assert!(
                    typical.decades_off(truth.value, scale) < 3.0 || effect.id == "motor_mismatch",
                    "{} = {} {}",
                    truth.name,
                    truth.value,
                    truth.unit
                );
                if size == Size::Medium {
                    let deviation = (truth.value.abs() / (typical.median * scale)).log10() / typical.decades;
                    medium.entry(parameter.name).or_default().push(deviation);
                }
            }
        }
        for (name, deviations) in medium {
            let mean = deviations.iter().sum::<f64>() / deviations.len() as f64;
            assert!(mean.abs() < 1.0, "{}.{name}: {mean}", effect.id);
        }
    }
}

#[test]
fn what_was_measured_is_plausible() {
    for scales in [25.0, 54.0].map(carriage) {
        for (name, value) in [
            ("asymmetric_friction.dv[1]", -36.8),
            ("asymmetric_friction.dmu[1]", 3.0),
            ("stribeck.dmu[1]", -7.0),
            ("stribeck.v_s", 0.02),
            ("cogging.A[1]", 1.0),
        ] {
            let off = implausibility(name, value, &scales);
            assert!(off < 2.5, "{name} = {value}: {off}");
        }
    }
    for (name, value) in [("encoder_lag.T[2]", 2.8e-3), ("link_inertia.m", 300.0), ("backlash.h[1]", 3e-4)] {
        let off = implausibility(name, value, &kukas());
        assert!(off < 2.0, "{name} = {value}: {off}");
    }
}

#[test]
fn what_is_absurd_is_implausible() {
    for m in [4002.0, 59_478.0] {
        assert!(implausibility("link_inertia.m", m, &kukas()) > 3.0, "{m} kg");
    }
    assert!(implausibility("encoder_eccentricity.e[1]", 26.7, &doggys()) > 3.0);
    for e in [0.012, 0.017] {
        let off = implausibility("encoder_eccentricity.e[1]", e, &doggys());
        assert!((2.0..3.0).contains(&off), "{e} rad: {off}");
    }
    for (name, value) in [
        ("cogging.A[2]", 60.0),
        ("torque_offset.o[1]", -60.0),
        ("belt_hysteresis.k1[1]", 2e4),
        ("belt_hysteresis.tau[1]", 5.0),
        ("belt_hysteresis.tau[1]", 1e-5),
        ("current_limit.T", 1.0),
        ("gyro_clipping.fs[2]", 0.1),
        ("base_bearing.k[y]", 10.0),
        ("structure_mode.d[x]", 1e3),
        ("gyro_scale.A[1.z]", 2.0),
        ("coriolis.scale", 4.0),
        ("voltage_sag.r", 2.0),
        ("input_delay.T", 0.5),
    ] {
        let off = implausibility(name, value, &doggys());
        assert!(off > 3.0, "{name} = {value}: {off}");
    }
}

#[test]
fn only_the_side_on_which_an_effect_is_strong_counts() {
    let scales = doggys();
    let at = |name, value| implausibility(name, value, &scales);
    // A size that is small is a small effect; so is a stiff bearing or a high ceiling.
    for (name, value) in [("cogging.A[2]", 1e-9), ("base_bearing.k[x]", 1e12), ("current_limit.T", 1e9)] {
        assert_eq!(at(name, value), 0.0, "{name}");
    }
    assert_eq!((at("cogging.A[2]", 0.0), at("belt_hysteresis.tau[1]", 0.0)), (0.0, 0.0));
    assert_eq!((at("base_bearing.k[x]", 0.0), at("current_limit.T", 0.0)), (f64::INFINITY, f64::INFINITY));
    for value in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        for name in ["cogging.A[2]", "base_bearing.k[x]", "belt_hysteresis.tau[1]"] {
            assert_eq!(at(name, value), f64::INFINITY, "{name} = {value}");
        }
    }
    // The same to either sign.
    assert_eq!(at("torque_offset.o[1]", -7.0), at("torque_offset.o[1]", 7.0));
    // One standard deviation above is one.
    let typical = Effect::by_id("backlash").unwrap().parameter("backlash.h[3]").unwrap().typical.unwrap();
    assert!((at("backlash.h[3]", typical.median * 10f64.powf(typical.decades)) - 1.0).abs() < 1e-12);
    assert_eq!(typical.decades_off(1.0, 0.0), f64::INFINITY);
    assert_eq!(typical.decades_off(1.0, f64::NAN), f64::INFINITY);
}

#[test]
fn nuisances_and_what_is_own_to_a_recording_never_count() {
    let scales = doggys();
    for effect in CATALOGUE {
        for parameter in effect.parameters.iter().chain(effect.nuisances) {
            if !matches!(parameter.role, Role::Nuisance | Role::PerRecording) && parameter.typical.is_some() {
                continue;
            }
            let index = match parameter.name.strip_prefix(parameter.symbol()).unwrap() {
                "" => "",
                "[i]" => "[2]",
                "[gyro.axis]" => "[1.x]",
                other => panic!("{}: {other}", parameter.name),
            };
            let name = format!("{}.{}{index}", effect.id, parameter.symbol());
            for value in [1e-300, 1e300, f64::NAN] {
                assert_eq!(implausibility(&name, value, &scales), 0.0, "{name}");
            }
        }
    }
}

#[test]
fn a_result_is_looked_up_by_its_name() {
    let cogging = Effect::by_id("cogging").unwrap();
    assert_eq!(cogging.parameter("cogging.A[2]").unwrap().name, "A[i]");
    assert_eq!(cogging.parameter("cogging.p").unwrap().role, Role::Shape);
    assert_eq!(Effect::by_id("stribeck").unwrap().parameter("stribeck.bending[1]").unwrap().role, Role::Nuisance);
    for wrong in ["cogging.A", "cogging.A[]", "cogging.A[0]", "cogging.A[x]", "cogging.A[2", "cogging.p[1]"] {
        assert!(cogging.parameter(wrong).is_none(), "{wrong}");
    }
    for wrong in ["A[2]", "cogging", "cogging.", "cogging.B[1]", "stribeck.dmu[1]", ""] {
        assert!(cogging.parameter(wrong).is_none(), "{wrong}");
        assert_eq!(cogging.implausibility(wrong, 1e9, &doggys()), 0.0, "{wrong}");
    }
}

/// Nothing is implausible by a scale that a robot does not have; shares are of the joint, of all of them the largest.
#[test]
fn scales_follow_from_the_robot_and_its_motion() {
    let scales = doggys();
    let of = |scale, place| scales.scale(scale, place);
    assert_eq!(of(Scale::TorqueRms, Of::Joint(1)), Some(38.0));
    assert_eq!(of(Scale::TorqueRms, Of::All), Some(45.0));
    assert_eq!(of(Scale::TorqueRms, Of::Joint(3)), None);
    assert_eq!(of(Scale::SupplyPerTorqueRms, Of::All), Some(32.0 / 45.0));
    assert!((of(Scale::BodyMass, Of::All).unwrap() - 1.315).abs() < 1e-12, "a tenth of the moving mass");
    assert_eq!(of(Scale::Friction, Of::Joint(0)), Some(2.0));
    assert_eq!(of(Scale::Stiffness, Of::All), Some(600.0));
    assert_eq!(of(Scale::GyroSigma, Of::GyroAxis(1, 2)), Some(1.745e-3));
    assert!((of(Scale::BaseInertia, Of::Axis(0)).unwrap() - 9.1).abs() < 0.1);

    let emps = carriage(54.0);
    assert_eq!(emps.scale(Scale::Stiffness, Of::Joint(0)), None);
    assert_eq!(emps.scale(Scale::BaseInertia, Of::Axis(0)), None);
    assert_eq!(emps.scale(Scale::SupplyPerTorqueRms, Of::All), None);
    assert!((emps.scale(Scale::Radian, Of::All).unwrap() - 0.175).abs() < 1e-12);
    assert_eq!(implausibility("belt_hysteresis.k1[1]", 1e30, &emps), 0.0);

    let without_friction = RobotScales { joints: vec![JointScales { friction: 0.0, ..scales.joints[0] }], ..scales };
    let friction = without_friction.scale(Scale::Friction, Of::Joint(0)).unwrap();
    assert!((friction - 0.9).abs() < 1e-12, "2 % of the torque RMS");
    let at_rest = RobotScales::of(&doggy(), &[0.0; 3], &[0.0; 3]);
    assert_eq!(at_rest.scale(Scale::TorqueRmsPerSpeed, Of::Joint(0)), None);
    assert_eq!(implausibility("cogging.A[1]", 1e9, &at_rest), 0.0);
}
