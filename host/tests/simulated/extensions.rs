//! Effects in a simulated robot are found again by the models that know them.

use host::calibrate::{Preset, extend, fit};
use host::effect::{CATALOGUE, Effect, Hidden, Size};
use host::recording::{NO_PHASE, Recorder, Recording, Row, Session, Source, Tick};
use host::robot::{Robot, Side};
use host::simulate::{Plant, Truth};
use rand::{RngExt, SeedableRng, rngs::StdRng};
use rand_distr::{Distribution, StandardNormal};
use solve::levenberg::Settings;

/// A recording of a Doggy that moves much, with effects inside.
fn simulated(robot: &Robot, samples: usize, seed: u64, effects: Vec<Hidden>) -> (Recording, Truth) {
    let mut rng = StdRng::seed_from_u64(seed);
    let truth = Truth::drawn(robot, &mut rng);
    let mut plant = Plant::new(robot, &truth, effects).expect("passive joints fit");
    let mut recorder = Recorder::new(Session::of(robot.clone()));
    let channels = robot.channels();
    let mut duty = [0.0; 3];
    let mut target = [0.0; 3];
    for k in 0..samples {
        let mut noise = |sigma: f64| -> f64 {
            let noise: f64 = StandardNormal.sample(&mut rng);
            sigma * noise
        };
        let mut values = Vec::with_capacity(channels.len());
        for joint in 0..3 {
            values.push(plant.encoder(Side::Motor, joint) + noise(channels[joint].sigma));
        }
        for gyro in 0..2 {
            let noise = [0, 1, 2].map(|axis| noise(channels[3 + 3 * gyro + axis].sigma));
            values.extend(plant.gyro_reading(gyro, noise));
        }
        let (t_us, seq) = (1000 * k as u64, k as u64);
        let row = Row { t_us, seq, phase: NO_PHASE, tick: Tick::default(), duty: &duty, values: &values };
        recorder.push(&row).expect("rows are in order");
        plant.advance(&duty, 1e-3);
        let time_s = 1e-3 * k as f64;
        let fast = (k / 5_000) % 3 != 0;
        for joint in 0..3 {
            let period = if fast { 350 } else { 1_500 };
            if (k + 137 * joint) % period == 0 {
                target[joint] = rng.random_range(-1.0..1.0) * if joint == 0 { 0.9 } else { 0.5 };
            }
            let limit = if fast { 0.9 } else { 0.15 };
            let sweep = 9.0 + 4.0 * (time_s * 0.7).sin();
            let chirp = if fast { 0.25 * (sweep * time_s * 2.0 + joint as f64).sin() } else { 0.0 };
            duty[joint] = (3.0 * (target[joint] - plant.motor_position(joint)) + chirp).clamp(-limit, limit);
            if k < 1_500 {
                duty[joint] = 0.0;
            }
        }
    }
    (recorder.finish(Source { path: "simulated".into(), sha256: String::new() }), truth)
}

/// How far off an estimate may be, share of the truth, where it is not within four standard errors.
const USUAL: f64 = 0.05;
/// Effects that are tried when `EFFECTS` names no others: along the line from the input to the transmission, and passive joints. All of the catalogue takes a
/// quarter of an hour.
const USUALLY: [&str; 11] = [
    "input_delay",
    "pwm_dead_zone",
    "voltage_sag",
    "electrical_lag",
    "current_limit",
    "motor_mismatch",
    "cogging",
    "torque_offset",
    "friction_slope",
    "base_bearing",
    "structure_mode",
];
/// Base parameters come back within this share, or four standard errors.
const BASE: f64 = 0.02;

/// Extends the base model by `effect` on a recording that has it, and complains of what does not come back.
fn recover(robot: &Robot, effect: &'static Effect, samples: usize) -> Vec<String> {
    let hidden = effect.hide_in(robot, Size::Medium, &mut StdRng::seed_from_u64(5)).unwrap();
    let mut truth: Vec<(String, f64)> = hidden.values.iter().map(|v| (v.name.clone(), v.value)).collect();
    let (recording, base_truth) = simulated(robot, samples, 11, vec![hidden]);
    let mut base_truth: Vec<(String, f64)> =
        base_truth.values(robot)[..12].iter().map(|v| (v.name.clone(), v.value)).collect();
    if effect.id == "viscous_friction" {
        // What is common to all joints is back-EMF.
        let common = truth.iter().map(|(_, v)| v).sum::<f64>() / truth.len() as f64;
        truth.iter_mut().for_each(|(_, v)| *v -= common);
        base_truth.iter_mut().filter(|(name, _)| name == "k_mi").for_each(|(_, v)| *v += common);
    }
    let settings = Settings::default();
    let base = fit(robot, &[&recording], Preset::Default, &settings, |_, _| {}).unwrap();
    let clock = std::time::Instant::now();
    let extended = match extend(robot, &[&recording], &base, &[effect.id], &settings, |_, _| {}) {
        Ok(extended) => extended.calibration,
        Err(error) => return vec![format!("{}: {error}", effect.id)],
    };
    println!(
        "{:<22} {:?}, {} iterations, {:.1} s (alternatives and start {:.1} s), cost/dof {:.3} -> {:.3}",
        effect.id,
        extended.status,
        extended.iterations,
        clock.elapsed().as_secs_f64(),
        extended.seconds.start,
        2.0 * base.calibration.cost / base.calibration.dof,
        2.0 * extended.cost / extended.dof
    );
    let mut complaints = Vec::new();
    if !extended.status.is_usable() {
        complaints.push(format!("{}: {:?}", effect.id, extended.status));
    }
    let own = extended.parameters.iter().filter(|p| p.name.contains('.'));
    let own = own.map(|p| (p, truth.iter().find(|(name, _)| *name == p.name).map(|(_, value)| *value), USUAL));
    let of_base = base_truth.iter().map(|(name, value)| (extended.parameter(name).unwrap(), Some(*value), BASE));
    for (p, value, tolerance) in own.chain(of_base) {
        let Some(value) = value else { continue };
        let (off, error) = (p.estimate - value, p.std_error.unwrap_or(f64::NAN));
        let line = format!(
            "{:<28} {:>13.6} true {value:>13.6} ({:+.2} %, {:+.1} se)",
            p.name,
            p.estimate,
            100.0 * off / value,
            off / error
        );
        println!("    {line}");
        if p.std_error.is_some() && off.abs() > (tolerance * value.abs()).max(4.0 * error) {
            complaints.push(format!("{}: {line}", effect.id));
        }
    }
    complaints
}

/// Effects at medium size in the plant, eight seconds of motion. `EFFECTS=id,id` takes these, `EFFECTS=all` the whole catalogue, `SAMPLES`
/// another length.
#[test]
fn effects_are_recovered() {
    let robot = Robot::builtin("doggy").unwrap();
    let only = std::env::var("EFFECTS").unwrap_or_default();
    let samples = std::env::var("SAMPLES").ok().and_then(|samples| samples.parse().ok()).unwrap_or(8_000);
    let wanted = |id: &str| match only.as_str() {
        "" => USUALLY.contains(&id),
        "all" => true,
        list => list.split(',').any(|wanted| wanted == id),
    };
    let effects = CATALOGUE.into_iter().filter(|effect| wanted(effect.id));
    let complaints: Vec<String> = effects.flat_map(|effect| recover(&robot, effect, samples)).collect();
    assert!(complaints.is_empty(), "{complaints:#?}");
}
