//! Wrong units, signs and columns are named by their cause, and no effect of the catalogue is taken for one.

use std::collections::BTreeMap;

use host::calibrate::{Preset, extend, fit};
use host::effect::{CATALOGUE, Size};
use host::recording::Recording;
use host::recording::check::obstacles;
use host::robot::Robot;
use host::simulate::{Direct, EffectChoice, Options, SHORT_MOTION};
use solve::levenberg::Settings;

const DEGREES: f64 = 180.0 / std::f64::consts::PI;
const GEAR: f64 = 42.092;

fn record(effects: Vec<EffectChoice>) -> Recording {
    let options = Options { effects, seed: 5, ..Options::new(Robot::builtin("doggy").unwrap()) };
    Direct::record(&options, SHORT_MOTION).unwrap().recording
}

fn told(recording: &Recording) -> String {
    let line = |finding: &host::recording::check::Finding| {
        format!("{}: {}; {}\n", finding.channel.as_deref().unwrap_or(""), finding.message, finding.advice)
    };
    obstacles(recording).iter().map(line).collect()
}

/// A change of the recording, made on columns by their names (`u1`, `theta1`, `g1x`).
type Mistake = fn(&mut BTreeMap<String, Vec<f64>>);

fn scale(columns: &mut BTreeMap<String, Vec<f64>>, names: &[&str], factor: f64) {
    for name in names {
        columns.get_mut(*name).unwrap().iter_mut().for_each(|value| *value *= factor);
    }
}

fn swap(columns: &mut BTreeMap<String, Vec<f64>>, pairs: &[(&str, &str)]) {
    for (a, b) in pairs {
        let (left, right) = (columns.remove(*a).unwrap(), columns.remove(*b).unwrap());
        columns.insert((*a).to_owned(), right);
        columns.insert((*b).to_owned(), left);
    }
}

fn with(recording: &Recording, mistake: Mistake) -> Recording {
    let inputs = recording.duty.iter().enumerate().map(|(j, duty)| (format!("u{}", j + 1), duty.clone()));
    let channels = recording.channels.iter().map(|channel| (channel.spec.column.clone(), channel.values.clone()));
    let mut columns: BTreeMap<String, Vec<f64>> = inputs.chain(channels).collect();
    mistake(&mut columns);
    let mut changed = recording.clone();
    for (j, duty) in changed.duty.iter_mut().enumerate() {
        *duty = columns.remove(&format!("u{}", j + 1)).unwrap();
    }
    for channel in &mut changed.channels {
        channel.values = columns.remove(&channel.spec.column).unwrap();
    }
    changed
}

const ENCODERS: [&str; 3] = ["theta1", "theta2", "theta3"];
const GYROS: [&str; 6] = ["g1x", "g1y", "g1z", "g2x", "g2y", "g2z"];

#[test]
fn mistakes_are_named() {
    let right = record(Vec::new());
    assert_eq!(told(&right), "");
    let cases: [(Mistake, &[&str]); 20] = [
        (
            |c| scale(c, &ENCODERS, DEGREES),
            &["encoder1", "encoder2", "encoder3", "looks like degrees;", "unit = \"deg\""],
        ),
        (|c| scale(c, &ENCODERS, GEAR), &["looks like the motor's side of the gear;", "side = \"motor\""]),
        (|c| scale(c, &ENCODERS, GEAR * DEGREES), &["looks like degrees on the motor's side"]),
        (
            |c| scale(c, &ENCODERS, 1024.0 * GEAR / std::f64::consts::TAU),
            &["looks like encoder counts", "unit = \"counts\""],
        ),
        (|c| scale(c, &ENCODERS, 1.0 / GEAR), &["every encoder looks as if the gear had been applied twice"]),
        (|c| scale(c, &ENCODERS, 1.0 / DEGREES), &["every encoder looks converted from degrees twice"]),
        (|c| scale(c, &["theta3"], DEGREES), &["encoder3", "roll", "looks like degrees"]),
        (|c| scale(c, &["theta2"], 1.0 / GEAR), &["theta2 looks as if the gear had been applied twice"]),
        (|c| scale(c, &["theta2"], -1.0), &["theta2 has the wrong sign", "pitch runs against its input"]),
        (|c| scale(c, &["u1"], -1.0), &["u1: yaw runs against its input", "sign = -1"]),
        (|c| scale(c, &["u1", "u2", "u3"], -1.0), &["u1: yaw runs", "u2: pitch runs", "u3: roll runs"]),
        (|c| scale(c, &GYROS, DEGREES), &["gyro1: reads 5", "gyro2: reads 5", "it looks like degrees per second"]),
        (|c| scale(c, &GYROS[3..], DEGREES), &["gyro2: reads 5", "it looks like degrees per second"]),
        (|c| scale(c, &GYROS, 1e3 * DEGREES), &["it looks like thousandths of degrees per second"]),
        (|c| scale(c, &GYROS, 1.0 / DEGREES), &["it looks converted to rad/s twice"]),
        (|c| scale(c, &["g2y"], -1.0), &["gyro2: ", "look like (x, −y, z) of the described gyro"]),
        (|c| swap(c, &[("g2x", "g2y")]), &["gyro2: ", "look like (y, x, z) of the described gyro"]),
        (
            |c| swap(c, &[("g1x", "g2x"), ("g1y", "g2y"), ("g1z", "g2z")]),
            &["gyro1: ", "the columns of gyro2 fit in its place"],
        ),
        (|c| swap(c, &[("theta2", "theta3")]), &["theta2 and theta3 look swapped"]),
        (|c| swap(c, &[("u1", "u3")]), &["u1: yaw follows u3", "u3: roll follows u1", "look swapped"]),
    ];
    for (number, (mistake, parts)) in cases.into_iter().enumerate() {
        let text = told(&with(&right, mistake));
        for part in parts {
            assert!(text.contains(part), "case {number}: `{part}` is not in:\n{text}");
        }
    }
}

#[test]
fn no_effect_is_taken_for_a_mistake() {
    for effect in CATALOGUE {
        let recording = record(vec![EffectChoice { effect, size: Size::Large }]);
        assert_eq!(told(&recording), "", "{}", effect.id);
    }
}

/// No reading of the gyros is larger than this.
fn ended_at(recording: &Recording, full_scale_rad_s: f64) -> Recording {
    let mut ended = recording.clone();
    for channel in ended.channels.iter_mut().filter(|channel| GYROS.contains(&channel.spec.column.as_str())) {
        channel.values.iter_mut().for_each(|value| *value = value.clamp(-full_scale_rad_s, full_scale_rad_s));
    }
    ended
}

/// A range is set at the part: what it ends at has nothing to do with the robot or its motion.
#[test]
fn a_range_that_ends_is_no_wrong_scale_wherever_it_ends() {
    let right = record(Vec::new());
    for full_scale_rad_s in [3.0, 1.5, 0.75, 0.4] {
        assert_eq!(told(&ended_at(&right, full_scale_rad_s)), "", "{full_scale_rad_s} rad/s");
    }
    let scales: [Mistake; 3] = [|c| scale(c, &GYROS, 0.4), |c| scale(c, &GYROS, 0.6), |c| scale(c, &GYROS, 1.7)];
    for (number, mistake) in scales.into_iter().enumerate() {
        let text = told(&with(&right, mistake));
        assert!(text.contains("gyro1: reads"), "scale {number}: {text}");
    }
}

#[test]
fn the_end_of_a_range_is_estimated_wherever_it_is() {
    let right = record(Vec::new());
    for full_scale_rad_s in [3.0, 1.0] {
        let recording = ended_at(&right, full_scale_rad_s);
        let settings = Settings::default();
        let base = fit(&recording.robot, &[&recording], Preset::Default, &settings, |_, _| {}).unwrap();
        let extended =
            extend(&recording.robot, &[&recording], &base, &["gyro_clipping"], &settings, |_, _| {}).unwrap();
        let calibration = extended.calibration;
        assert!(calibration.status.is_usable(), "{full_scale_rad_s} rad/s: {:?}", calibration.status);
        let fs = calibration.parameter("gyro_clipping.fs[2]").unwrap();
        println!("full scale {full_scale_rad_s} rad/s: {} ± {:?}", fs.estimate, fs.std_error);
        // rtol 5e-3.
        assert!((fs.estimate / full_scale_rad_s - 1.0).abs() < 5e-3, "{fs:?}");
    }
}
