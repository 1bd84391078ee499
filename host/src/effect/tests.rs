//! The catalogue as a whole, and each law at points that can be worked out by hand.

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::*;

fn doggy() -> Robot {
    Robot::builtin("doggy").unwrap()
}

fn hide(id: &str, size: Size) -> Hidden {
    Effect::by_id(id).unwrap().hide_in(&doggy(), size, &mut ChaCha8Rng::seed_from_u64(1)).unwrap()
}

#[test]
fn ids_are_unique_and_every_robot_built_in_can_have_every_effect() {
    for (i, effect) in CATALOGUE.iter().enumerate() {
        assert!(CATALOGUE[..i].iter().all(|other| other.id != effect.id));
        for robot in Robot::builtin_names().map(|name| Robot::builtin(name).unwrap()) {
            for size in [Size::Small, Size::Medium, Size::Large] {
                let hidden = effect.hide_in(&robot, size, &mut ChaCha8Rng::seed_from_u64(7)).unwrap();
                assert!(hidden.values.iter().all(|v| v.value > 0.0 && v.name.starts_with(effect.id)), "{hidden:?}");
            }
        }
    }
}

#[test]
fn sizes_come_from_names_numbers_and_the_seed() {
    assert_eq!(Size::parse("backlash", "large").unwrap(), Size::Large);
    assert_eq!(Size::parse("backlash", "0.003").unwrap(), Size::Exact(0.003));
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
        let belt = Belt { wind, wind_rate, k_s: 400.0, d_s: 2.0 };
        hidden.physics.transmission_torque(1, &belt, 400.0 * wind + 2.0 * wind_rate)
    };
    assert_eq!(torque(0.0099, 5.0), 0.0, "no torque and no damping inside");
    assert!((torque(0.02, 0.5) - (4.0 + 1.0)).abs() < 1e-12);
    assert!((torque(-0.02, 0.5) - (-4.0 + 1.0)).abs() < 1e-12);
    assert!((torque(0.0105, 1.0) - (0.2 + 1.0)).abs() < 1e-12, "half the damping half a milliradian in");
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
fn a_lagging_gyro_follows_with_its_time_constant() {
    let hidden = hide("gyro_lag", Size::Exact(2e-3));
    let mut own = vec![0.0; hidden.physics.states()];
    let truth = [[1.0, 0.0, -2.0], [0.0, 3.0, 0.0]];
    let mut rates = own.clone();
    let steps = 20_000;
    for _ in 0..steps {
        hidden.physics.state_rates(&own, &truth, &mut rates);
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
