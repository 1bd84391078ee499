//! The catalogue as a whole, and the laws.

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::*;

mod laws;
mod typical;

fn doggy() -> Robot {
    Robot::builtin("doggy").unwrap()
}

fn hide(id: &str, size: Size) -> Hidden {
    Effect::by_id(id).unwrap().hide_in(&doggy(), size, &mut ChaCha8Rng::seed_from_u64(1)).unwrap()
}

/// The robots that an effect does not suit say why; Doggy can have every one.
#[test]
fn doggy_can_have_every_effect_and_other_robots_say_why_not() {
    for (i, effect) in CATALOGUE.iter().enumerate() {
        assert!(CATALOGUE[..i].iter().all(|other| other.id != effect.id), "{} twice", effect.id);
        for robot in Robot::builtin_names().map(|name| Robot::builtin(name).unwrap()) {
            for size in [Size::Small, Size::Medium, Size::Large, Size::Exact(0.01)] {
                match effect.hide_in(&robot, size, &mut ChaCha8Rng::seed_from_u64(7)) {
                    Ok(hidden) => assert!(hidden.values.iter().all(|v| v.value.is_finite() && v.value != 0.0)),
                    Err(error) => assert!(robot.name != "doggy", "{}: {error}", effect.id),
                }
            }
        }
    }
}

/// Every number is told under a name and unit of the catalogue, and none of the catalogue's is forgotten but nuisances, which no plant has.
#[test]
fn truths_carry_the_catalogues_names_and_units() {
    for effect in CATALOGUE {
        let hidden = hide(effect.id, Size::Medium);
        for value in &hidden.values {
            let symbol = value.name.strip_prefix(effect.id).and_then(|rest| rest.strip_prefix('.')).unwrap();
            let bare = symbol.split('[').next().unwrap();
            let of_catalogue = effect.parameter(&value.name);
            let parameter = of_catalogue.unwrap_or_else(|| panic!("{} is not in the catalogue", value.name));
            assert!(effect.parameters.iter().any(|listed| std::ptr::eq(listed, parameter)), "{}", value.name);
            assert_eq!(parameter.unit, value.unit, "{}", value.name);
            assert_eq!(parameter.name.contains('['), symbol.contains('['), "{}", value.name);
            let index = symbol.strip_prefix(bare).unwrap().trim_matches(['[', ']']);
            let allowed: &[&str] = match parameter.name.strip_prefix(bare).unwrap() {
                "" => &[""],
                "[x,y]" => &["x", "y"],
                "[i]" => &["1", "2", "3"],
                "[gyro]" => &["1", "2"],
                "[gyro.axis]" => &["1.x", "1.y", "1.z", "2.x", "2.y", "2.z"],
                other => panic!("{}: what is {other}?", parameter.name),
            };
            assert!(allowed.contains(&index), "{}", value.name);
        }
        for parameter in effect.parameters {
            assert!(parameter.role != Role::Nuisance, "{}: {}", effect.id, parameter.name);
            let bare = format!("{}.{}", effect.id, parameter.symbol());
            assert!(hidden.values.iter().any(|v| v.name.split('[').next() == Some(&bare)), "{bare} has no truth");
        }
    }
}

/// What an effect is confounded with can be looked up: other ids, or parameters of the base model.
#[test]
fn confounded_names_exist() {
    for effect in CATALOGUE {
        assert!(!effect.about.is_empty() && !effect.confounded_with.is_empty(), "{}", effect.id);
        for name in effect.confounded_with {
            let is_effect = CATALOGUE.iter().any(|other| other.id == *name && other.id != effect.id);
            let is_parameter = doggy().parameters().iter().any(|p| p.symbol.name() == *name);
            assert!(is_effect || is_parameter, "{}: {name}", effect.id);
        }
    }
}

#[test]
fn sizes_come_from_names_numbers_and_the_seed() {
    assert_eq!(Size::parse("backlash", "large").unwrap(), Size::Large);
    assert_eq!(Size::parse("backlash", "0.003").unwrap(), Size::Exact(0.003));
    assert_eq!(Size::parse("backlash", "@-1.5").unwrap(), Size::Level(-1.5));
    let error = Size::parse("backlash", "huge").unwrap_err().to_string();
    assert!(error.contains("backlash") && error.contains("huge"), "{error}");
    let error = Effect::by_id("base_baering").unwrap_err().to_string();
    assert!(error.contains("did you mean `base_bearing`"), "{error}");

    assert_eq!(hide("backlash", Size::Medium).values, hide("backlash", Size::Medium).values, "one seed, one robot");
    assert!(hide("backlash", Size::Exact(0.003)).values.iter().all(|v| v.value == 0.003));
    let refused =
        Effect::by_id("backlash").unwrap().hide_in(&doggy(), Size::Exact(-1.0), &mut ChaCha8Rng::seed_from_u64(1));
    assert!(matches!(refused, Err(EffectError::Size { .. })));
    for (size, k) in [(Size::Small, 12000.0), (Size::Medium, 7000.0), (Size::Large, 2500.0)] {
        let bearing = hide("base_bearing", size);
        assert!((bearing.values[0].value / k - 1.0).abs() < 0.17, "{size:?}: {:?}", bearing.values);
    }
}

#[test]
fn levels_go_through_the_named_sizes_and_on() {
    let near = |a: &Hidden, b: &Hidden| {
        for (a, b) in a.values.iter().zip(&b.values) {
            assert!((a.value - b.value).abs() <= 1e-12 * b.value.abs(), "{a:?} {b:?}");
        }
    };
    for effect in CATALOGUE {
        for (level, size) in [(-1.0, Size::Small), (0.0, Size::Medium), (1.0, Size::Large)] {
            near(&hide(effect.id, Size::Level(level)), &hide(effect.id, size));
        }
    }
    let gap = |level| hide("backlash", Size::Level(level)).values[0].value;
    assert!((gap(-3.0) / gap(-2.0) / (gap(-1.0) / gap(0.0)) - 1.0).abs() < 1e-12);
    let refused =
        Effect::by_id("backlash").unwrap().hide_in(&doggy(), Size::Level(f64::NAN), &mut ChaCha8Rng::seed_from_u64(1));
    assert!(matches!(refused, Err(EffectError::Size { .. })));
}

#[test]
fn a_lag_shorter_than_the_plants_step_is_refused() {
    for id in ["gyro_lag", "electrical_lag"] {
        let effect = Effect::by_id(id).unwrap();
        let refused = effect.hide_in(&doggy(), Size::Exact(1e-6), &mut ChaCha8Rng::seed_from_u64(1)).unwrap_err();
        assert!(refused.to_string().contains("0.000001 s is too short"), "{refused}");
    }
}

#[test]
fn a_robot_without_the_parts_is_told_so() {
    let text = doggy().toml().replace("unit = \"duty\"", "unit = \"volt\"").replace("supply_v = 32.0\n", "");
    let volts = Robot::parse(&text).unwrap();
    let refused =
        Effect::by_id("voltage_sag").unwrap().hide_in(&volts, Size::Medium, &mut ChaCha8Rng::seed_from_u64(1));
    assert!(refused.unwrap_err().to_string().contains("not driven by a duty"));
}

#[test]
fn backlash_lets_go_inside_and_pulls_outside() {
    let hidden = hide("backlash", Size::Exact(0.01));
    let torque = |wind: f64, wind_rate: f64| {
        let at = Moment { joint: 1, q: wind, qd: wind_rate, k_s: 400.0, d_s: 2.0, ..Moment::default() };
        hidden.physics.transmission_torque(&at, 400.0 * wind + 2.0 * wind_rate)
    };
    assert!(torque(0.0099, 5.0).abs() < 1e-12, "no torque and no damping inside");
    assert!((torque(0.02, 0.5) - (4.0 + 1.0)).abs() < 1e-12);
    assert!((torque(-0.02, 0.5) - (-4.0 + 1.0)).abs() < 1e-12);
    assert!((torque(0.0105, 1.0) - (0.2 + 1.0)).abs() < 1e-12, "half the damping half a milliradian in");
    // Half a gap of 1 mrad has its damping half a milliradian in.
    let hidden = hide("backlash", Size::Exact(0.001));
    let torque = |wind: f64| {
        let at = Moment { joint: 1, q: wind, qd: 1.0, k_s: 400.0, d_s: 2.0, ..Moment::default() };
        hidden.physics.transmission_torque(&at, 400.0 * wind + 2.0)
    };
    assert!((torque(0.00125) - (0.1 + 1.0)).abs() < 1e-12);
    assert!((torque(0.0015) - (0.2 + 2.0)).abs() < 1e-12);
}

#[test]
fn the_supply_balances_the_power_drawn() {
    let hidden = hide("voltage_sag", Size::Exact(0.02));
    let (duty, k_pwm, k_mi) = ([0.9, -0.5], [4.0, 5.0], [30.0, 20.0]);
    let sagged = |speed: [f64; 2]| {
        let drive = Drive { duty: &duty, speed: &speed, k_pwm: &k_pwm, k_mi: &k_mi };
        hidden.physics.supply_v(&drive, 32.0)
    };
    let speed = [1.0, -0.5];
    let volts = sagged(speed);
    let power: f64 = (0..2).map(|j| duty[j] * (k_pwm[j] * volts * duty[j] - k_mi[j] * speed[j])).sum();
    assert!((volts - (32.0 - 0.02 * power)).abs() < 1e-12 && volts < 31.5, "{volts}");
    assert_eq!(sagged([30.0, -30.0]), 32.0, "braking does not lift it");
}

#[test]
fn a_robot_may_have_more_gyros_than_joints() {
    let text = Robot::builtin("one_joint").unwrap().toml().to_owned();
    let (_, gyro) = text.rsplit_once("[[sensor]]").unwrap();
    let robot = Robot::parse(&format!("{text}\n[[sensor]]{gyro}")).unwrap();
    assert_eq!((robot.joints.len(), robot.gyros().count()), (1, 2));
    for effect in CATALOGUE {
        let Ok(hidden) = effect.hide_in(&robot, Size::Medium, &mut ChaCha8Rng::seed_from_u64(1)) else { continue };
        let gyros = effect.parameters.iter().filter(|parameter| parameter.name.ends_with("[gyro]"));
        for parameter in gyros {
            let symbol = parameter.name.trim_end_matches("[gyro]");
            let of_gyro = |name: &&str| name.contains('[');
            let names: Vec<&str> = hidden.values.iter().map(|value| value.name.as_str()).filter(of_gyro).collect();
            assert_eq!(names, [1, 2].map(|gyro| format!("{}.{symbol}[{gyro}]", effect.id)));
        }
    }
    assert!(
        Effect::by_id("gyro_lag").unwrap().hide_in(&robot, Size::Medium, &mut ChaCha8Rng::seed_from_u64(1)).is_ok()
    );
}

#[test]
fn a_lagging_gyro_follows_with_its_time_constant() {
    let hidden = hide("gyro_lag", Size::Exact(2e-3));
    let mut own = vec![0.0; hidden.physics.states()];
    let truth = [[1.0, 0.0, -2.0], [0.0, 3.0, 0.0]];
    let mut rates = own.clone();
    let steps = 20_000;
    for _ in 0..steps {
        let line = Line { joints: &[], motor_torque: &[], gyro_rates: &truth };
        hidden.physics.state_rates(&own, &line, &mut rates);
        for (own, rate) in own.iter_mut().zip(&rates) {
            *own += 2e-3 / f64::from(steps) * rate;
        }
    }
    let share = 1.0 - (-1.0f64).exp();
    for (gyro, truth) in truth.iter().enumerate() {
        let seen = hidden.physics.gyro_rate(&own, gyro, *truth);
        for axis in 0..3 {
            assert!((seen[axis] - share * truth[axis]).abs() < 1e-4, "63 % after one time constant");
        }
    }
}
