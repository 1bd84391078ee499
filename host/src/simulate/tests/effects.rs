//! Every effect of the catalogue inside a plant: it moves the robot, vanishes with its size, and obeys its equation.

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::fast_duty;
use crate::effect::{CATALOGUE, Effect, Hidden, Size, of_size};
use crate::robot::{Robot, Side};
use crate::simulate::{Plant, STEP_S, Truth};

fn doggy() -> Robot {
    Robot::builtin("doggy").unwrap()
}

fn hidden(id: &str, size: Size) -> Hidden {
    Effect::by_id(id).unwrap().hide_in(&doggy(), size, &mut ChaCha8Rng::seed_from_u64(5)).unwrap()
}

fn truth() -> Truth {
    Truth::drawn(&doggy(), &mut ChaCha8Rng::seed_from_u64(5))
}

fn plant(effects: Vec<Hidden>) -> Plant {
    Plant::new(&doggy(), &truth(), effects).unwrap()
}

/// What Doggy's sensors read, in their sigmas: three encoders, six gyro axes.
fn sensors(plant: &Plant) -> [f64; 9] {
    std::array::from_fn(|i| match i.checked_sub(3) {
        None => plant.encoder(Side::Motor, i) / 6.9259e-5,
        Some(axis) => plant.gyro_rate(axis / 3)[axis % 3] / 1.745e-3,
    })
}

/// The sensors of two seconds of fast motion, after `rest_s` of rest.
fn fast(mut plant: Plant, rest_s: f64) -> Vec<[f64; 9]> {
    plant.advance(&[0.0; 3], rest_s);
    (0..2000)
        .map(|k| {
            plant.advance(&[0, 1, 2].map(|joint| fast_duty(joint, f64::from(k) * 1e-3)), 1e-3);
            let readings = sensors(&plant);
            assert!(
                readings.iter().all(|reading| reading.is_finite()),
                "{:?}, tick {k}: {readings:?}",
                plant.effects()
            );
            readings
        })
        .collect()
}

/// Largest difference, sigmas.
fn apart(a: &[[f64; 9]], b: &[[f64; 9]]) -> f64 {
    let pairs = a.iter().flatten().zip(b.iter().flatten());
    pairs.fold(0.0, |most, (a, b)| most.max((a - b).abs()))
}

/// A medium effect changes some reading of two fast seconds by more than its sensor's noise, and no size breaks the
/// arithmetic. A skipping belt gets its seconds where it skips, a drifting bias after its minute.
#[test]
fn every_effect_can_be_seen() {
    let (clean, mut unseen) = (fast(plant(vec![]), 0.0), Vec::new());
    for effect in CATALOGUE {
        let mut told = format!("{:<22}", effect.id);
        for size in [Size::Small, Size::Medium, Size::Large] {
            let effects = vec![hidden(effect.id, size)];
            let when = effects[0].values.iter().find(|v| v.name.starts_with("belt_tooth_skip.t"));
            let rest_s = match effect.id {
                "gyro_bias_drift" => 60.0,
                _ => when.map_or(0.0, |t| t.value - 1.0),
            };
            let moved = fast(plant(effects), rest_s);
            let sigmas = apart(&clean, &moved);
            told += &format!(" {sigmas:9.1}");
            if size == Size::Medium && sigmas < 3.0 {
                unseen.push(effect.id);
            }
        }
        eprintln!("{told} sigmas");
    }
    assert!(unseen.is_empty(), "{unseen:?} at medium size");
}

/// An effect whose size goes to nothing leaves the base plant. Springs that give way, ceilings and stops vanish upwards;
/// lags go as far down as the step can follow. Bristles that carry no bump still bend by 5 µrad (measured: 0.79 sigmas).
/// `integrator_error` has no size.
#[test]
fn an_effect_without_size_is_none() {
    let (clean, mut stayed) = (fast(plant(vec![]), 0.0), Vec::new());
    for effect in CATALOGUE.into_iter().filter(|effect| effect.id != "integrator_error") {
        let nothing = match effect.id {
            "base_bearing" | "structure_mode" => 1e7,
            "current_limit" | "end_stop" | "gyro_clipping" => 1e3,
            "electrical_lag" | "gyro_lag" => 1e-4,
            // That of the description, s/rad.
            "friction_slope" => 400.0,
            _ => 1e-9,
        };
        let left = apart(&clean, &fast(plant(vec![hidden(effect.id, Size::Exact(nothing))]), 0.0));
        eprintln!("{:<22} {left:.1e} sigmas left", effect.id);
        let limit = match effect.id {
            "base_bearing" | "structure_mode" => 1.0,
            "stribeck" => 1.5,
            "electrical_lag" | "gyro_lag" => 40.0,
            _ => 1e-3,
        };
        if left > limit {
            stayed.push((effect.id, left));
        }
    }
    assert!(stayed.is_empty(), "{stayed:?}");
}

/// Half the step moves no reading of two fast seconds as far as its noise, with every effect at its largest. Bristles,
/// free play and stops, whose contacts a fixed step cannot hit, are the worst: a few hundredths of a sigma.
#[test]
fn halving_the_step_cannot_be_seen() {
    let mut seen = Vec::new();
    for effect in CATALOGUE.into_iter().filter(|effect| effect.id != "integrator_error") {
        let coarse = fast(plant(vec![hidden(effect.id, Size::Large)]), 0.0);
        let fine = fast(plant(vec![hidden(effect.id, Size::Large)]).with_step(0.5 * STEP_S), 0.0);
        let moved = apart(&coarse, &fine);
        eprintln!("{:<22} half the step moves {moved:.1e} sigmas", effect.id);
        if moved > 0.3 {
            seen.push((effect.id, moved));
        }
    }
    assert!(seen.is_empty(), "{seen:?}");
}

/// A dead time of two ticks is the clean robot under the duty of two ticks before.
#[test]
fn a_late_command_is_the_command_of_before() {
    let mut late = plant(vec![hidden("input_delay", Size::Exact(2e-3))]);
    let mut clean = plant(vec![]);
    let duty = |k: i32| [0, 1, 2].map(|joint| if k < 0 { 0.0 } else { fast_duty(joint, f64::from(k) * 1e-3) });
    for k in 0..1000 {
        late.advance(&duty(k), 1e-3);
        clean.advance(&duty(k - 2), 1e-3);
        let (a, b) = (sensors(&late), sensors(&clean));
        assert!(a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-5), "tick {k}: {a:?} {b:?}");
    }
}

/// One encoder reads what it would have read two ticks before; nothing else changes.
#[test]
fn a_late_encoder_reads_the_angle_of_before() {
    let lag = hidden("encoder_lag", Size::Exact(2e-3));
    let joint = lag.values[0].name.bytes().find(u8::is_ascii_digit).map(|digit| usize::from(digit - b'1')).unwrap();
    let (late, clean) = (fast(plant(vec![lag]), 0.0), fast(plant(vec![]), 0.0));
    for k in 2..2000 {
        for channel in 0..9 {
            let expected = clean[if channel == joint { k - 2 } else { k }][channel];
            assert!((late[k][channel] - expected).abs() < 1e-5, "tick {k}, channel {channel}");
        }
    }
    assert!((late[500][joint] - clean[500][joint]).abs() > 10.0);
}

/// Switched on as an effect or in the description: the same torques.
#[test]
fn coriolis_is_what_the_description_could_say() {
    let described = Robot::parse(&doggy().toml().replace("coriolis = false", "coriolis = true")).unwrap();
    let described = fast(Plant::new(&described, &truth(), vec![]).unwrap(), 0.0);
    assert!(fast(plant(vec![hidden("coriolis", Size::Medium)]), 0.0) == described);
    assert!(apart(&described, &fast(plant(vec![]), 0.0)) > 10.0);
}

/// Explicit Euler converges with its step to the plant of no effect, in first order; when sensors are read does not
/// matter to it.
#[test]
fn coarse_integration_is_euler_at_the_period() {
    let clean = fast(plant(vec![]), 0.0);
    let euler = |period_s: f64| {
        let mut robot = doggy();
        robot.sample_period_s = period_s;
        let effect = Effect::by_id("integrator_error").unwrap();
        let effect = effect.hide_in(&robot, Size::Medium, &mut ChaCha8Rng::seed_from_u64(1)).unwrap();
        plant(vec![effect])
    };
    let [coarse, fine, finest] = [1e-3, 1e-4, 1e-5].map(|period_s| apart(&clean, &fast(euler(period_s), 0.0)));
    eprintln!("Euler at 1, 0.1, 0.01 ms: {coarse:.1} {fine:.2} {finest:.3} sigmas");
    assert!((7.0..13.0).contains(&(fine / finest)), "{fine} {finest}");
    assert!(coarse > 5.0 * fine);

    let (mut whole, mut parts) = (euler(1e-3), euler(1e-3));
    for k in 0..500 {
        let duty = [0, 1, 2].map(|joint| fast_duty(joint, f64::from(k) * 1e-3));
        whole.advance(&duty, 1e-3);
        parts.advance(&duty, 0.3e-3);
        parts.advance(&duty, 0.7e-3);
        let (a, b) = (sensors(&whole), sensors(&parts));
        assert!(a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-6), "tick {k}");
    }
}

/// At the moment of the jump nothing stands anywhere else; then the link swings to where the belt now holds it.
#[test]
fn a_skipped_belt_holds_the_link_beside_its_motor() {
    let mut skipping = plant(vec![of_size::skip(0, 0.05, 0.1)]);
    skipping.advance(&[0.0; 3], 0.1);
    assert!(skipping.link_position(0).abs() < 1e-9 && skipping.motor_position(0).abs() < 1e-9);
    skipping.advance(&[0.0; 3], 1e-3);
    let (k_s, rate) = (400.0, skipping.link_position(0) / 1e-3);
    assert!(rate > 0.0 && rate < k_s * 0.05 / 0.1 * 1e-3, "it starts from rest: {rate} rad/s");
    skipping.advance(&[0.0; 3], 10.0);
    let beside = skipping.link_position(0) - skipping.motor_position(0);
    assert!((beside - 0.05).abs() < 1e-4, "{beside} rad");
    skipping.begin_motion();
    assert!((skipping.link_position(0) - skipping.motor_position(0) - beside).abs() < 1e-12, "it stays there");
    assert!(skipping.link_position(1).abs() < 1e-2);
}

/// Time of an effect is that of the motion: a robot that waits in its marked pose is still cold, and has not moved.
#[test]
fn effects_count_from_the_start_of_the_motion() {
    let mut waited = plant(vec![hidden("friction_drift", Size::Large), hidden("torque_offset", Size::Large)]).held();
    waited.advance(&[0.5; 3], 30.0);
    assert!(sensors(&waited)[..3].iter().all(|reading| *reading == 0.0), "held");
    waited.begin_motion();
    let cold = plant(vec![hidden("friction_drift", Size::Large), hidden("torque_offset", Size::Large)]);
    assert!(fast(waited, 0.0) == fast(cold, 0.0));
}

/// What acts late acts before what acts at once, however they were asked for.
#[test]
fn effects_act_in_the_order_of_the_line() {
    let pair =
        |first: &str, second: &str| fast(plant(vec![hidden(first, Size::Large), hidden(second, Size::Large)]), 0.0);
    let both = pair("input_delay", "pwm_dead_zone");
    assert!(both == pair("pwm_dead_zone", "input_delay"));
    for alone in ["input_delay", "pwm_dead_zone"] {
        assert!(apart(&both, &fast(plant(vec![hidden(alone, Size::Large)]), 0.0)) > 3.0, "{alone}");
    }
}
