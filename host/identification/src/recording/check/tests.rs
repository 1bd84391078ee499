//! A good recording has no finding; each fault put into it has its own.

use protocol::Flags;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::{About, Check, check};
use crate::recording::{
    Damage, Event, Firmware, LossBalance, Recorder, Recording, Row, Session, Severity, Source, Tick,
};
use crate::robot::{Robot, Sensor};

const BIAS_RAD_S: [f64; 3] = [0.02, -0.01, 0.005];

/// Input and speed at time t: 3.2 s of rest, a slow stage, a fast one.
fn motion(t: f64) -> (f64, f64) {
    let wave = |hz: f64| (std::f64::consts::TAU * hz * t).sin();
    match t {
        t if t < 3.2 => (0.0, 0.0),
        t if t < 15.2 => (0.15 * wave(0.25), 0.6 * wave(0.25)),
        _ => (0.9 * wave(2.5), 3.0 * wave(2.5)),
    }
}

/// 20 s of the one-joint robot, built from what its sensors must say; `change` may spoil each sample.
fn recording_with(change: impl FnMut(&mut Sample)) -> Recording {
    recording_of(Robot::builtin("one_joint").unwrap(), change)
}

/// The same of a robot like it.
fn recording_of(robot: Robot, mut change: impl FnMut(&mut Sample)) -> Recording {
    let rotation = robot.gyros().next().unwrap().rotation;
    let sigmas: Vec<f64> = robot.channels().iter().map(|channel| channel.sigma).collect();
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let mut normal = move || (0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0;
    let mut recorder = Recorder::new(Session::of(robot));
    let mut position = 0.0;
    for k in 0..20_000u64 {
        let (duty, speed) = motion(k as f64 * 1e-3);
        position += speed * 1e-3;
        let mut values = vec![position + sigmas[0] * normal()];
        for axis in 0..3 {
            values.push(rotation[axis][2] * speed + BIAS_RAD_S[axis] + sigmas[1 + axis] * normal());
        }
        let mut sample = Sample { k, t_us: 1000 * k, duty, values, flags: Flags::empty(), lost: false };
        change(&mut sample);
        if !sample.lost {
            let tick = Tick { flags: sample.flags.bits(), ..Tick::default() };
            let row = Row { t_us: sample.t_us, seq: k, phase: 0, tick, duty: &[sample.duty], values: &sample.values };
            recorder.push(&row).unwrap();
        }
    }
    recorder.finish(Source { path: "run.mcap".into(), sha256: String::new() })
}

struct Sample {
    k: u64,
    t_us: u64,
    duty: f64,
    values: Vec<f64>,
    flags: Flags,
    lost: bool,
}

fn checked(change: impl FnMut(&mut Sample)) -> Check {
    check(&recording_with(change))
}

/// There is this one finding, and nothing as bad beside it.
#[track_caller]
fn only(check: &Check, severity: Severity, about: About, says: &str) {
    let [finding] = &check.findings[..] else { panic!("{:#?}", check.findings) };
    assert_eq!((finding.severity, finding.about), (severity, about), "{finding:#?}");
    assert!(finding.message.contains(says), "{finding:#?}");
    assert!(!finding.advice.is_empty());
    assert_eq!(check.usable, severity != Severity::Error);
}

/// Among the findings is this one.
#[track_caller]
fn among(check: &Check, severity: Severity, about: About, says: &str) {
    let found = check.findings.iter().any(|f| f.severity == severity && f.about == about && f.message.contains(says));
    assert!(found, "{severity:?} {about:?} `{says}` is not in {:#?}", check.findings);
}

#[test]
fn a_good_recording_has_no_finding() {
    let check = checked(|_| {});
    assert!(check.usable && check.findings.is_empty(), "{:#?}", check.findings);
    assert_eq!((check.samples, check.missing_ticks, check.gaps, check.rate_hz), (20_000, 0, 0, 1000.0));
    assert!((check.rest_s - 3.2).abs() < 1.5e-3, "{}", check.rest_s);
    let joint = &check.joints[0];
    // Slow swing of 0.6 rad/s at 0.25 Hz spans 0.764 rad; the top speed is 3 rad/s less the window's smoothing.
    assert!((joint.range - 0.764).abs() < 0.01, "{}", joint.range);
    assert!((joint.max_speed - 3.0).abs() < 0.05, "{}", joint.max_speed);
    assert!((12.0..13.5).contains(&(joint.slow_s + 1.0)), "{}", joint.slow_s);
    for (rest, bias) in check.rest[1..].iter().zip(BIAS_RAD_S) {
        assert!((rest.mean - bias).abs() < 5.0 * rest.sigma_described / 3200f64.sqrt(), "{rest:?}");
    }
}

#[test]
fn findings_are_sorted_and_errors_make_it_unusable() {
    let mut check = checked(|_| {});
    for severity in [Severity::Note, Severity::Error, Severity::Warning] {
        let finding = super::Finding {
            severity,
            about: About::Identifiability,
            channel: None,
            message: "k_s[1] cannot be told".to_owned(),
            advice: "bend the belt".to_owned(),
        };
        check.add(finding);
    }
    let order: Vec<Severity> = check.findings.iter().map(|finding| finding.severity).collect();
    assert_eq!(order, [Severity::Error, Severity::Warning, Severity::Note]);
    assert!(!check.usable);
}

#[test]
fn missing_ticks_weigh_by_their_share() {
    only(&checked(|s| s.lost = s.k == 9000), Severity::Note, About::Gaps, "1 ticks (0.01 %) are missing in 1 gaps");
    let two_percent = checked(|s| s.lost = s.k % 50 == 7);
    among(&two_percent, Severity::Warning, About::Gaps, "in 400 gaps");
    assert!(two_percent.usable);
    assert!(!checked(|s| s.lost = s.k % 4 == 1).usable);
}

#[test]
fn the_balance_names_the_culprit() {
    let mut recording = recording_with(|s| s.lost = (5000..5010).contains(&s.k));
    let balance = LossBalance {
        ticks: 20_000,
        received: 19_990,
        missing: 10,
        line_lost: 10,
        damaged_frames: 3,
        closed: true,
        ..Default::default()
    };
    recording.balance = Some(balance);
    let result = check(&recording);
    among(&result, Severity::Note, About::Gaps, "10 lost on the line");
    among(&result, Severity::Note, About::Gaps, "3 frames arrived damaged");
    recording.balance = Some(LossBalance { line_lost: 7, ..balance });
    among(&check(&recording), Severity::Warning, About::Gaps, "does not close: 10 ticks missing, 7 accounted for");
    recording.balance = None;
    recording.firmware = Some(Firmware {
        version: "0.1.0".into(),
        protocol_version: 1,
        schema_key: String::new(),
        robot: "one_joint".into(),
        restarted_by: None,
        details: String::new(),
    });
    among(&check(&recording), Severity::Note, About::Gaps, "loss balance is missing");
    assert!(check(&recording).findings.iter().all(|finding| !finding.message.contains("restarted")));
    let firmware = recording.firmware.as_mut().unwrap();
    firmware.restarted_by = Some("a panic of the firmware at src/main.rs:7".into());
    among(
        &check(&recording),
        Severity::Note,
        About::Excitation,
        "restarted by a panic of the firmware at src/main.rs:7",
    );
}

#[test]
fn damage_and_events_are_told() {
    let mut recording = recording_with(|_| {});
    recording.damage.push(Damage::CutOff { at_byte: 1000, lost_bytes: 5 });
    only(&check(&recording), Severity::Note, About::Gaps, "cut off");
    recording.damage.clear();
    let text = "the host's heartbeats stayed away".to_owned();
    recording.events.push(Event { t_us: 12_500_000, seq: 12_500, severity: Severity::Error, text });
    only(&check(&recording), Severity::Warning, About::Excitation, "after 12.500 s: the host's heartbeats");
}

#[test]
fn the_window_at_rest_must_be_long_quiet_and_still() {
    // The first input comes after 1 s, the motion is as before.
    let short = checked(|s| s.duty = if s.k >= 1000 && s.duty == 0.0 { 1e-3 } else { s.duty });
    only(&short, Severity::Note, About::BiasWindow, "rests for 1.00 s");
    let loud = checked(|s| s.values[1] += if s.k % 2 == 0 { 0.01 } else { -0.01 });
    only(&loud, Severity::Warning, About::BiasWindow, "the robot file says");
    let pushed = checked(|s| s.values[2] += if s.k < 1600 { 0.0 } else { 0.01 });
    among(&pushed, Severity::Warning, About::BiasWindow, "does not rest");
    let stuck = checked(|s| s.values[1] = if s.k < 3300 { 0.02 } else { s.values[1] });
    only(&stuck, Severity::Warning, About::BiasWindow, "never changes at rest");
}

#[test]
fn a_motion_that_shows_too_little_is_told() {
    let never = checked(|s| s.duty = 0.0);
    only(&never, Severity::Error, About::Excitation, "zero in the whole recording");
    let blocked = checked(|s| s.values[0] = 0.3 + 1e-4 * f64::from((s.k % 3) as u32));
    among(&blocked, Severity::Error, About::Excitation, "swing does not move");
    let gentle = checked(|s| {
        s.duty *= if s.k < 15_200 { 1.0 } else { 0.15 };
    });
    among(&gentle, Severity::Warning, About::Excitation, "reaches 15 % of full");
    among(&gentle, Severity::Warning, About::Excitation, "reverses quickly 0 times");
}

#[test]
fn clipped_and_missing_readings_are_told() {
    let small_range = checked(|s| s.values[3] = s.values[3].clamp(-2.0, 2.0));
    only(&small_range, Severity::Warning, About::Saturation, "looks clipped");
    let stale = checked(|s| s.values[1] = if s.k % 40 == 0 { f64::NAN } else { s.values[1] });
    only(&stale, Severity::Warning, About::Saturation, "500 samples (2.50 %) have no valid reading");
    let limited = checked(|s| s.flags.set(Flags::POSITION_LIMITED, s.k == 8000));
    only(&limited, Severity::Note, About::Saturation, "in 1 ticks");
    let constant = checked(|s| s.values[0] = 0.25);
    among(&constant, Severity::Error, About::Saturation, "in every sample");
    let spike = checked(|s| s.values[2] = if s.k == 9000 { 1e30 } else { s.values[2] });
    among(&spike, Severity::Error, About::Saturation, "1 readings are no rates (up to 1.000e30");
    let leap = checked(|s| s.values[0] = if s.k == 9000 { -1e9 } else { s.values[0] });
    among(&leap, Severity::Error, About::Units, "1 readings are no positions (up to 1.000e9");
}

#[test]
fn another_rate_jitter_and_overruns_are_told() {
    let slow_clock = checked(|s| s.t_us += s.t_us / 200);
    only(&slow_clock, Severity::Warning, About::Timing, "995.0");
    let jitter = checked(|s| s.t_us += if s.k % 2 == 0 { 60 } else { 0 });
    only(&jitter, Severity::Warning, About::Timing, "jitter by 60.0 µs");
    let overrun = checked(|s| s.flags.set(Flags::OVERRUN, s.k == 8000));
    only(&overrun, Severity::Warning, About::Timing, "1 ticks overran");
}

#[test]
fn the_steps_of_an_encoder_at_rest_are_no_motion() {
    // Four times the gyro's visible rate by the encoder's noise alone, in 20 ms; the robot is slow only where it stands still.
    let mut robot = Robot::builtin("one_joint").unwrap();
    for sensor in &mut robot.sensors {
        if let Sensor::MotorEncoder(encoder) = sensor {
            encoder.sigma = 5e-4;
        }
    }
    let found = check(&recording_of(robot, |s| s.duty *= if s.k < 15_200 { 6.0 } else { 1.0 })).findings;
    assert!(!found.iter().any(|finding| finding.message.contains("does not turn")), "{found:#?}");
}

#[test]
fn wrong_units_signs_and_axes_are_told() {
    let scaled = |channels: std::ops::Range<usize>, factor: f64| {
        move |s: &mut Sample| s.values[channels.clone()].iter_mut().for_each(|value| *value *= factor)
    };
    let degrees = checked(scaled(0..1, 57.29578));
    among(&degrees, Severity::Error, About::Units, "looks like degrees");
    let motor_side = checked(scaled(0..1, 30.0));
    among(&motor_side, Severity::Error, About::Units, "motor's side of the gear");
    let not_zeroed = checked(|s| s.values[0] += 12.0);
    only(&not_zeroed, Severity::Error, About::Units, "but its span fits");
    let backwards = checked(scaled(0..1, -1.0));
    among(&backwards, Severity::Error, About::Units, "runs against its input");
    let gyro_in_degrees = checked(scaled(1..4, 57.29578));
    among(&gyro_in_degrees, Severity::Error, About::Units, "reads 57.2");
    let turned = checked(scaled(1..4, -1.0));
    only(&turned, Severity::Error, About::Units, "does not turn as the encoders say (correlation -1.00)");
}

/// A belt that swings by itself at 3.8 Hz, as the description of the one-joint robot has it, faster than the motor moves.
#[test]
fn a_belt_that_swings_is_no_mistake_of_its_gyro() {
    let robot = Robot::builtin("one_joint").unwrap();
    let rotation = robot.gyros().next().unwrap().rotation;
    let swinging = |s: &mut Sample, hz: f64, rad_s: f64| {
        let t = s.k as f64 * 1e-3;
        let swing = if t < 3.2 { 0.0 } else { rad_s * (std::f64::consts::TAU * hz * t).sin() };
        (0..3).for_each(|axis| s.values[1 + axis] += rotation[axis][2] * swing);
    };
    for hz in [3.8, 3.0, 5.0] {
        let found = checked(|s| swinging(s, hz, 2.0)).findings;
        assert!(!found.iter().any(|f| f.about == About::Units), "{hz} Hz: {found:#?}");
    }
    // A gyro that lags by 8 ms, as its filter makes it, is none either.
    let late = |t: f64| motion(t - 0.008).1;
    let found = checked(|s| {
        let t = s.k as f64 * 1e-3;
        (0..3).for_each(|axis| s.values[1 + axis] += rotation[axis][2] * (late(t) - motion(t).1));
    });
    assert!(!found.findings.iter().any(|f| f.about == About::Units), "{:#?}", found.findings);
    // Nor do readings that are missing now and then hide a mistake.
    let turned = checked(|s| {
        (1..4).for_each(|axis| s.values[axis] = if s.k % 40 == 0 { f64::NAN } else { -s.values[axis] });
    });
    among(&turned, Severity::Error, About::Units, "does not turn as the encoders say");
    // A gyro on another body is worth a word, but no reason to refuse.
    let other = checked(|s| {
        let t = s.k as f64 * 1e-3;
        (0..3).for_each(|axis| s.values[1 + axis] += rotation[axis][2] * (0.8 * (0.9 * t).cos() - motion(t).1));
    });
    among(&other, Severity::Warning, About::Units, "does not turn as the encoders say");
    assert!(other.usable);
}

/// 12 s of two joints in line that hang down, driven by torques: the elbow swings, the shoulder's motor brakes it. `change` is made
/// to inputs and positions.
fn braking_arm(mass_error: f64, change: impl Fn(&mut [f64; 2], &mut [f64; 2])) -> Check {
    braking_arm_with(mass_error, |_| 0.0, change)
}

/// The same with a torque over time on the shoulder as well.
fn braking_arm_with(
    mass_error: f64,
    shoulder: impl Fn(f64) -> f64,
    change: impl Fn(&mut [f64; 2], &mut [f64; 2]),
) -> Check {
    let joint = |name: &str, above_m: f64, mass_kg: f64, arm_m: f64, inertia: f64| {
        format!(
            "[[joint]]\nname = \"{name}\"\nkind = \"revolute\"\naxis = [0.0, 1.0, 0.0]\norigin_m = [0.0, 0.0, {above_m:?}]\nlimits_rad = [-3.0, 3.0]\n\
             gravity = \"acts\"\ntransmission = \"rigid\"\nfriction = {{ law = \"none\" }}\ngear = 1.0\n\
             body = {{ mass_kg = {mass_kg:?}, centre_m = [0.0, 0.0, {:?}], inertia_kg_m2 = {{ xx = {inertia:?}, yy = {inertia:?}, zz = {inertia:?} }} }}\n\
             parameters = {{ b = {{ start = 0.004 }}, v = {{ start = 0.02 }} }}\n",
            -arm_m
        )
    };
    let description = |error: f64| {
        "name = \"arm\"\nsample_period_s = 0.002\ncoriolis = true\ngravity_m_s2 = [0.0, 0.0, -9.81]\n[input]\nunit = \"newton_metre\"\n".to_owned()
            + &joint("shoulder", 0.0, 0.6 * error, 0.2, 0.001)
            + &joint("elbow", -0.2, 0.56 * error, 0.3, 0.004)
            + "[[sensor]]\nkind = \"motor_encoder\"\njoint = \"shoulder\"\nsigma_rad = 1e-4\n"
            + "[[sensor]]\nkind = \"motor_encoder\"\njoint = \"elbow\"\nsigma_rad = 1e-4\n"
    };
    let chain = Robot::parse(&description(1.0)).unwrap().chain();
    let accelerations = |x: &[f64; 4], u: &[f64; 2]| {
        let (q, qd) = ([x[0], x[1]], [x[2], x[3]]);
        let (mut m, mut bias) = ([0.0; 4], [0.0; 2]);
        chain.mass_matrix(&q, &mut m);
        chain.bias_torque(&q, &qd, &mut bias);
        let (a, b, d) = (m[0] + 0.004, m[1], m[3] + 0.004);
        let f = [u[0] - bias[0] - 0.02 * qd[0], u[1] - bias[1] - 0.02 * qd[1]];
        let det = a * d - b * b;
        [qd[0], qd[1], (d * f[0] - b * f[1]) / det, (a * f[1] - b * f[0]) / det]
    };
    let mut recorder = Recorder::new(Session::of(Robot::parse(&description(mass_error)).unwrap()));
    let mut x = [0.0; 4];
    for k in 0..6000u64 {
        let t = k as f64 * 2e-3;
        let wave = |hz: f64| (std::f64::consts::TAU * hz * (t - 1.0)).sin();
        let push = if t < 1.0 { 0.0 } else { shoulder(t) };
        let u = [push - 0.12 * x[2], if t < 1.0 { 0.0 } else { 0.9 * wave(0.4 + 0.05 * (t - 1.0)) + 0.4 * wave(0.31) }];
        let (mut input, mut read) = (u, [x[0], x[1]].map(|q| (q / 4e-4).round() * 4e-4));
        change(&mut input, &mut read);
        let row = Row { t_us: 2000 * k, seq: k, phase: 0, tick: Tick::default(), duty: &input, values: &read };
        recorder.push(&row).unwrap();
        for _ in 0..10 {
            let h = 2e-4;
            let at = |k: &[f64; 4], by: f64| std::array::from_fn(|i| x[i] + by * k[i]);
            let k1 = accelerations(&x, &u);
            let k2 = accelerations(&at(&k1, 0.5 * h), &u);
            let k3 = accelerations(&at(&k2, 0.5 * h), &u);
            let k4 = accelerations(&at(&k3, h), &u);
            x = std::array::from_fn(|i| x[i] + h / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]));
        }
    }
    check(&recorder.finish(Source { path: "run.mcap".into(), sha256: String::new() }))
}

#[test]
fn a_motor_that_brakes_runs_with_its_input() {
    let of_inputs = |check: &Check, severity| {
        let units = check.findings.iter().filter(|f| f.about == About::Units && f.severity == severity);
        units
            .filter(|f| f.channel.as_ref().is_some_and(|c| c.starts_with('u')))
            .map(|f| f.message.clone())
            .collect::<Vec<_>>()
    };
    // The elbow is told. A brake goes with its speed as well as against it, with more friction: the shoulder is not.
    let right = braking_arm(1.0, |_, _| {});
    let notes = of_inputs(&right, Severity::Note);
    assert!(of_inputs(&right, Severity::Error).is_empty(), "{:#?}", right.findings);
    assert!(
        matches!(&notes[..], [only] if only.contains("whether shoulder runs with its input cannot be told")),
        "{notes:?}"
    );
    // Masses that are a quarter off are no reason to refuse, though they may leave the brake untold.
    for error in [0.75, 1.25] {
        let off = braking_arm(error, |_, _| {});
        assert!(of_inputs(&off, Severity::Error).is_empty(), "{:#?}", off.findings);
    }
    let elbow = braking_arm(1.0, |u, _| u[1] = -u[1]);
    among(&elbow, Severity::Error, About::Units, "elbow runs against its input");
    // A shoulder that is driven, too, is told as well.
    let driven = |sign: f64| braking_arm_with(1.0, |t| 0.5 * (4.0 * t).sin(), move |u, _| u[0] *= sign);
    among(&driven(-1.0), Severity::Error, About::Units, "shoulder runs against its input");
    let rightly = driven(1.0);
    assert!(
        of_inputs(&rightly, Severity::Error).is_empty() && of_inputs(&rightly, Severity::Note).is_empty(),
        "{:#?}",
        rightly.findings
    );
    let swapped = braking_arm(1.0, |u, _| u.swap(0, 1));
    among(&swapped, Severity::Error, About::Units, "the columns look swapped");
    // An input that has nothing to do with the motion says nothing of signs.
    let unlike = braking_arm(1.0, |u, q| u[1] = (40.0 * q[0]).sin());
    among(&unlike, Severity::Note, About::Units, "whether elbow runs with its input cannot be told");
}

#[test]
fn a_count_that_comes_and_goes_is_no_motion() {
    // Steps of 3 mrad, a joint that rests between two of them for a while and then on one: sigma says 0.06 mrad.
    let check = checked(|s| {
        s.values[0] = ((s.values[0] + if s.k % 900 < 400 { 1.51e-3 } else { 1.49e-3 }) / 3e-3).round() * 3e-3
    });
    assert!(!check.findings.iter().any(|f| f.message.contains("does not rest")), "{:#?}", check.findings);
    // Over four steps and more it does.
    let moved = checked(|s| s.values[0] = ((s.values[0] + 2e-6 * s.k as f64) / 5e-4).round() * 5e-4);
    among(&moved, Severity::Warning, About::BiasWindow, "does not rest");
}

#[test]
fn a_position_that_begins_again_after_a_turn_is_told_with_its_rows() {
    // A wheel on the joint's encoder: turned by hand, as nothing else here matters.
    let wheel = |k: u64| (1e-3 * k as f64).rem_euclid(std::f64::consts::TAU);
    let check = checked(|s| s.values[0] = wheel(s.k));
    among(&check, Severity::Error, About::Units, "jumps by one turn (6.2832 rad) between rows 6284 and 6285");
}

#[test]
fn advice_speaks_of_what_the_robot_has() {
    let torque = Robot::builtin("emps").unwrap();
    let mut recorder = Recorder::new(Session::of(torque));
    for k in 0..2000u64 {
        let x = k as f64 * 1e-3;
        let (u, q) = (0.2 * (3.0 * x).sin(), 0.001 * (3.0 * x).sin());
        let row = Row { t_us: 1000 * k, seq: k, phase: 0, tick: Tick::default(), duty: &[u], values: &[q] };
        recorder.push(&row).unwrap();
    }
    let check = check(&recorder.finish(Source { path: "run.mcap".into(), sha256: String::new() }));
    assert!(!check.findings.is_empty());
    for word in ["duty", "back-EMF", "gyro"] {
        assert!(
            !check.findings.iter().any(|f| f.advice.contains(word) || f.message.contains(word)),
            "{word}: {:#?}",
            check.findings
        );
    }
}
