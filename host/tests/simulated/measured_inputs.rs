//! Robots whose torque is a measurement: a pendulum under a position controller, read by one encoder.

use std::fmt::Write as _;
use std::path::Path;

use crate::program::{host, json};
use rand::{SeedableRng, rngs::StdRng};
use rand_distr::{Distribution, StandardNormal};
use serde_json::Value;

/// The pendulum: inertia kg m², weight N m, Coulomb friction N m and by how much of itself it grows with the motor's torque 1/(N m), viscous friction N m s/rad.
#[derive(Clone, Copy)]
struct Pendulum {
    inertia: f64,
    weight: f64,
    coulomb: f64,
    load: f64,
    viscous: f64,
}

const LIGHT: Pendulum = Pendulum { inertia: 0.15, weight: 3.0, coulomb: 0.1, load: 0.0, viscous: 0.05 };
const G: f64 = 9.81;
/// Slope of the smooth sign, s/rad: tanh(25 q̇).
const SLOPE: f64 = 50.0;

/// A table `t,u,q` of `seconds`: position control of `period_s` along a sum of sines of these amplitudes (rad) and frequencies (Hz); torque and position
/// with noise of these deviations (N m, rad).
fn table(pendulum: Pendulum, times: (f64, f64), sines: &[(f64, f64)], noise: (f64, f64), seed: u64) -> String {
    pushed_table(pendulum, times, sines, (noise, seed), |_| 0.0)
}

/// The same with a torque of time, s, that no column tells, N m.
fn pushed_table(
    pendulum: Pendulum,
    (period_s, seconds): (f64, f64),
    sines: &[(f64, f64)],
    (noise, seed): ((f64, f64), u64),
    push: impl Fn(f64) -> f64,
) -> String {
    let mut random = StdRng::seed_from_u64(seed);
    let mut normal = |sigma: f64| -> f64 {
        let value: f64 = StandardNormal.sample(&mut random);
        sigma * value
    };
    let tau = std::f64::consts::TAU;
    let wanted = |t: f64| -> (f64, f64) {
        sines
            .iter()
            .fold((0.0, 0.0), |(q, v), (a, f)| (q + a * (tau * f * t).sin(), v + a * tau * f * (tau * f * t).cos()))
    };
    let Pendulum { inertia, weight, coulomb, load, viscous } = pendulum;
    let (mut q, mut v) = wanted(0.0);
    let mut text = String::from("t,u,q\n");
    for k in 0..(seconds / period_s) as usize {
        let t = k as f64 * period_s;
        let (to, rate) = wanted(t);
        let u = weight * q.sin() + 40.0 * inertia / 0.15 * (to - q) + 2.5 * inertia / 0.15 * (rate - v);
        writeln!(text, "{t:.6},{:.6},{:.7}", u + normal(noise.0), q + normal(noise.1)).unwrap();
        let acceleration = |q: f64, v: f64| {
            let friction = coulomb * (1.0 + load * u.abs()) * (0.5 * SLOPE * v).tanh() + viscous * v;
            (u + push(t) - weight * q.sin() - friction) / inertia
        };
        let (parts, mut left) = (20, 20);
        let h = period_s / f64::from(parts);
        while left > 0 {
            let (a, b) = (acceleration(q, v), acceleration(q + 0.5 * h * v, v + 0.5 * h * acceleration(q, v)));
            q += h * (v + 0.5 * h * a);
            v += h * b;
            left -= 1;
        }
    }
    text
}

/// Its robot file: start values, and a body that the file knows.
fn robot(period_s: f64, sigma_rad: f64, starts: &str, mass_kg: f64) -> String {
    format!(
        "name = \"pendulum\"\ndescription = \"rigid pendulum\"\nsample_period_s = {period_s}\ncoriolis = true\n\
         gravity_m_s2 = [0.0, 0.0, -9.81]\n[input]\nunit = \"newton_metre\"\n[[joint]]\nname = \"arm\"\nkind = \"revolute\"\n\
         axis = [0.0, 1.0, 0.0]\nlimits_rad = [-3.2, 3.2]\ngravity = \"acts\"\ntransmission = \"rigid\"\n\
         friction = {{ law = \"coulomb\", slope_s_rad = {SLOPE:.1} }}\ngear = 1.0\n[joint.body]\nmass_kg = {mass_kg}\n\
         centre_m = [0.0, 0.0, -0.5]\ninertia_kg_m2 = {{ xx = 0.0, yy = 0.0, zz = 0.0 }}\n[joint.parameters]\n{starts}\n\
         [[sensor]]\nkind = \"motor_encoder\"\njoint = \"arm\"\nsigma_rad = {sigma_rad:e}\n\
         [import]\ntime = {{ column = \"t\", unit = \"s\" }}\n[import.columns]\nu1 = {{ column = \"u\", unit = \"N m\" }}\n\
         theta1 = {{ column = \"q\", unit = \"rad\" }}\n"
    )
}

const STARTS: &str = "b = { start = 0.1 }\nv = { start = 0.03 }\nmu = { start = 0.07 }\nmz = { start = -0.25 }";

/// The calibration of a table under a robot file, which ends with `code`, and what it said.
fn calibrated(folder: &Path, (table, robot): (&str, &str), code: i32) -> (Value, String) {
    std::fs::write(folder.join("run.csv"), table).unwrap();
    std::fs::write(folder.join("robot.toml"), robot).unwrap();
    host(folder, &["import", "run.csv", "--robot", "robot.toml", "-o", "run.mcap", "--force"], 0);
    let said = host(folder, &["calibrate", "run.mcap", "-o", "cal.json", "--force"], code);
    (json(&folder.join("cal.json")), said)
}

/// Estimate and standard error.
fn parameter(calibration: &Value, name: &str) -> (f64, f64) {
    let list = calibration["parameters"].as_array().unwrap();
    let found = list.iter().find(|parameter| parameter["name"] == name).unwrap();
    (found["estimate"].as_f64().unwrap(), found["std_error"].as_f64().unwrap_or(f64::NAN))
}

const SLOW: [(f64, f64); 3] = [(0.5, 0.23), (0.25, 0.71), (0.1, 1.3)];

/// A third of the torque is noise. Regressed on such a torque, accelerations would make the inertia twice as large.
#[test]
fn noise_of_a_measured_torque_is_no_inertia() {
    let folder = tempfile::tempdir().unwrap();
    let robot = robot(0.01, 1e-4, STARTS, 0.0);
    let runs = 12;
    let (mut inside, mut sum) = ([0usize; 2], 0.0);
    for seed in 0..runs {
        let table = table(LIGHT, (0.01, 30.0), &SLOW, (0.5, 1e-4), seed);
        let (calibration, _) = calibrated(folder.path(), (&table, &robot), 0);
        for (inside, (name, truth)) in inside.iter_mut().zip([("b[1]", LIGHT.inertia), ("mz[1]", -LIGHT.weight / G)]) {
            let (estimate, error) = parameter(&calibration, name);
            assert!(
                (estimate - truth).abs() < 4.0 * error,
                "seed {seed}: {name} {estimate} ± {error}, in truth {truth}"
            );
            *inside += usize::from((estimate - truth).abs() < 1.96 * error);
        }
        sum += parameter(&calibration, "b[1]").0;
        let noise = calibration["noise"].as_array().unwrap().iter().find(|row| row["channel"] == "process.input[1]");
        let sigma = noise.unwrap()["sigma"].as_f64().unwrap();
        // 3000 readings of a torque tell its noise to 1.3 %, and less as far as the motion follows it.
        assert!((sigma / 0.5 - 1.0).abs() < 0.06, "seed {seed}: noise of {sigma} N m, in truth 0.5");
    }
    // Nine of twelve or more hold the truth in 99.8 % of all cases, if intervals are right.
    assert!(inside.iter().all(|inside| *inside >= 9), "{inside:?} of {runs} hold b and mz");
    let mean = sum / runs as f64;
    // The mean of twelve is known to about 0.7 %.
    assert!((mean / LIGHT.inertia - 1.0).abs() < 0.025, "b is {mean} on average");
}

/// Whatever number stands in the file, a rigid robot comes out the same.
#[test]
fn the_answer_does_not_depend_on_the_start() {
    let folder = tempfile::tempdir().unwrap();
    let table = table(LIGHT, (0.01, 30.0), &SLOW, (0.1, 1e-4), 7);
    let mut first: Option<Value> = None;
    for times in [0.01, 0.1, 1.0, 10.0, 100.0] {
        let starts = format!(
            "b = {{ start = {} }}\nv = {{ start = {} }}\nmu = {{ start = {} }}\nmz = {{ start = {} }}\no = {{ start = 0.0 }}",
            times * LIGHT.inertia,
            times * LIGHT.viscous,
            times * LIGHT.coulomb,
            -times * LIGHT.weight / G
        );
        let (calibration, _) = calibrated(folder.path(), (&table, &robot(0.01, 1e-4, &starts, 0.0)), 0);
        let before = first.get_or_insert_with(|| calibration.clone());
        for name in ["b[1]", "v[1]", "mu[1]", "mz[1]", "o[1]"] {
            let ((estimate, error), (other, _)) = (parameter(&calibration, name), parameter(before, name));
            assert!(
                (estimate - other).abs() < 0.1 * error,
                "{times}: {name} is {estimate} ± {error}, from another start {other}"
            );
        }
    }
}

/// A mass in the file that is a tenth wrong leaves a torque that no noise is: errors are those of the scatter between blocks.
#[test]
fn a_wrong_mass_in_the_file_widens_the_errors() {
    let folder = tempfile::tempdir().unwrap();
    let heavy = Pendulum { inertia: 4.06, weight: 60.0, coulomb: 5.0, load: 0.0, viscous: 8.0 };
    let slow = [(0.8, 0.08), (0.15, 0.21)];
    let table = table(heavy, (0.01, 40.0), &slow, (0.5, 5e-5), 5);
    let mass = heavy.weight / G / 0.5;
    let starts =
        format!("b = {{ fixed = {} }}\nv = {{ start = 5.0 }}\nmu = {{ start = 4.0 }}", heavy.inertia - 0.25 * mass);
    let (right, _) = calibrated(folder.path(), (&table, &robot(0.01, 5e-5, &starts, mass)), 0);
    assert_eq!(right["scatter"]["coloured"], false, "{}", right["scatter"]);
    let (v, error) = parameter(&right, "v[1]");
    assert!((v - heavy.viscous).abs() < 4.0 * error && error < 0.5, "v is {v} ± {error}");
    for wrong in [0.9, 1.1] {
        let (calibration, said) = calibrated(folder.path(), (&table, &robot(0.01, 5e-5, &starts, wrong * mass)), 0);
        assert_eq!(calibration["scatter"]["coloured"], true, "{wrong}: {}", calibration["scatter"]);
        assert!(said.contains("no white noise"), "{said}");
        let (_, wide) = parameter(&calibration, "v[1]");
        assert!(wide > 2.0 * error, "{wrong}: v ± {wide}, with the right mass ± {error}");
    }
}

/// An inertia in the file that is larger than all there is leaves less than nothing for the motor: said first, in the status and in the exit code.
#[test]
fn an_inertia_below_zero_does_not_fit() {
    let folder = tempfile::tempdir().unwrap();
    let table = table(LIGHT, (0.01, 30.0), &SLOW, (0.05, 1e-4), 3);
    let robot = |body: f64| {
        robot(0.01, 1e-4, STARTS, 0.0)
            .replace("xx = 0.0, yy = 0.0, zz = 0.0", &format!("xx = {body}, yy = {body}, zz = {body}"))
    };
    let (fits, _) = calibrated(folder.path(), (&table, &robot(0.1)), 0);
    assert_eq!(fits["status"], "converged");
    let (b, error) = parameter(&fits, "b[1]");
    assert!((b - 0.05).abs() < 4.0 * error, "b is {b} ± {error} beside a body of 0.1");
    let (calibration, said) = calibrated(folder.path(), (&table, &robot(0.2)), 4);
    assert_eq!(calibration["status"], "does_not_fit");
    assert!(said.starts_with("does not fit: b[1] is -0.05"), "{said}");
    host(folder.path(), &["calibrate", "run.mcap", "-o", "cal.json", "--force", "--unchecked"], 0);
}

/// Somebody pushes the pendulum twice, by more than all of the motor's torque. Squares of that would make an inertia of nothing; it is left alone instead.
#[test]
fn pushes_by_hand_do_not_draw_the_parameters() {
    let folder = tempfile::tempdir().unwrap();
    let robot = robot(0.01, 1e-4, STARTS, 0.0);
    let push = |t: f64| match t {
        8.0..8.3 => 12.0,
        19.0..19.4 => -9.0,
        _ => 0.0,
    };
    for seed in 0..3 {
        let table = pushed_table(LIGHT, (0.01, 30.0), &SLOW, ((0.1, 1e-4), seed), push);
        let (calibration, said) = calibrated(folder.path(), (&table, &robot), 0);
        assert!(said.contains("does not explain the motion at 2 times"), "seed {seed}: {said}");
        let pushes = calibration["pushes"].as_array().unwrap();
        for (told, [from, to, torque]) in pushes.iter().zip([[8.0, 8.3, 12.0], [19.0, 19.4, -9.0]]) {
            let value = |name: &str| told[name].as_f64().unwrap();
            // Two samples, and a tenth of the torque.
            eprintln!("seed {seed}: {told} of {torque}");
            assert!(
                (value("from_s") - from).abs() < 0.021 && (value("to_s") - to).abs() < 0.021,
                "seed {seed}: {told}"
            );
            assert!((value("mean") / torque - 1.0).abs() < 0.1, "seed {seed}: {told}");
        }
        assert_eq!(pushes.len(), 2, "seed {seed}: {pushes:?}");
        for (name, truth) in [("b[1]", LIGHT.inertia), ("mz[1]", -LIGHT.weight / G)] {
            let (estimate, error) = parameter(&calibration, name);
            assert!((estimate - truth).abs() < 4.0 * error, "seed {seed}: {name} {estimate} ± {error} of {truth}");
            // Two standard errors of a fit without pushes: noise of 0.1 N m over 30 s.
            assert!((estimate / truth - 1.0).abs() < 0.03, "seed {seed}: {name} {estimate}, in truth {truth}");
        }
    }
}

/// A rotor of 0.01 kg m² drives the pendulum through a gear that gives: at 30 Hz it swings alone. The table of a rigid joint under a controller that an encoder of
/// 2.9 mrad a count makes nervous.
fn springy_table(seed: u64) -> String {
    let mut random = StdRng::seed_from_u64(seed);
    let (rotor, link, weight) = (0.01, LIGHT.inertia - 0.01, LIGHT.weight);
    let (stiffness, damping) = (330.0, 0.02);
    let (period_s, parts, count) = (0.002, 20, 2.9e-3f64);
    let tau = std::f64::consts::TAU;
    let mut text = String::from("t,u,q\n");
    let (mut theta, mut thetad, mut q, mut v, mut last) = (0.0f64, 0.0f64, 0.0f64, 0.0f64, 0.0);
    for k in 0..10_000 {
        let t = k as f64 * period_s;
        let wanted: f64 = SLOW.iter().map(|(a, f)| 2.0 * a * (tau * f * t).sin()).sum();
        let read = (theta / count).round() * count;
        let noise: f64 = StandardNormal.sample(&mut random);
        let u = 20.0 * (wanted - read) - 1.0 * (read - last) / period_s + weight * read.sin();
        last = read;
        writeln!(text, "{t:.6},{:.6},{read:.7}", u + 0.02 * noise).unwrap();
        for _ in 0..parts {
            let h = period_s / f64::from(parts);
            let spring = stiffness * (theta - q) + damping * (thetad - v);
            let friction = LIGHT.coulomb * (0.5 * SLOPE * thetad).tanh() + LIGHT.viscous * thetad;
            thetad += h * (u - spring - friction) / rotor;
            v += h * (spring - weight * q.sin()) / link;
            theta += h * thetad;
            q += h * v;
        }
    }
    text
}

/// Fast motion is not that of a rigid joint: the numbers are those of the slow one, or it is said that nothing fits, and both where both are so.
#[test]
fn a_gear_that_gives_takes_no_inertia_away() {
    let folder = tempfile::tempdir().unwrap();
    let robot = robot(0.002, 2.9e-3 / 12f64.sqrt(), STARTS, 0.0);
    for seed in 0..3 {
        std::fs::write(folder.path().join("run.csv"), springy_table(seed)).unwrap();
        std::fs::write(folder.path().join("robot.toml"), &robot).unwrap();
        host(folder.path(), &["import", "run.csv", "--robot", "robot.toml", "-o", "run.mcap", "--force"], 0);
        let calibrate = ["calibrate", "run.mcap", "-o", "cal.json", "--force", "--unchecked"];
        let said = host(folder.path(), &calibrate, 0);
        let calibration = json(&folder.path().join("cal.json"));
        let (b, _) = parameter(&calibration, "b[1]");
        let (mz, _) = parameter(&calibration, "mz[1]");
        println!("seed {seed}: b {b:.4}, mz {mz:.4}, {}", calibration["status"]);
        assert!((b / LIGHT.inertia - 1.0).abs() < 0.1, "seed {seed}: b is {b}\n{said}");
        assert!((mz / (-LIGHT.weight / G) - 1.0).abs() < 0.05, "seed {seed}: mz is {mz}\n{said}");
    }
}

/// An encoder of 2.9 mrad a count says nothing of accelerations at 100 Hz: the corner of the torques' filter follows from it.
#[test]
fn the_recipe_of_torques_chooses_its_corner() {
    let folder = tempfile::tempdir().unwrap();
    let mut table = table(LIGHT, (0.002, 30.0), &SLOW, (0.0, 0.0), 1);
    let count = 2.9e-3;
    let coarse = table.lines().skip(1).map(|line| {
        let (head, q) = line.rsplit_once(',').unwrap();
        let q: f64 = q.parse().unwrap();
        format!("{head},{:.7}\n", (q / count).round() * count)
    });
    table = std::iter::once("t,u,q\n".to_string()).chain(coarse).collect();
    let (calibration, _) = calibrated(folder.path(), (&table, &robot(0.002, count / 12f64.sqrt(), STARTS, 0.0)), 0);
    let (b, _) = parameter(&calibration, "b[1]");
    assert!((b / LIGHT.inertia - 1.0).abs() < 0.02, "b is {b}");
    let torque = ["verify", "cal.json", "run.mcap", "--metric", "torque", "-o", "torque.json", "--force"];
    host(folder.path(), &torque, 0);
    let unexplained = |file: &Value| file["joints"][0]["relative_error_identified"].as_f64().unwrap();
    let chosen = json(&folder.path().join("torque.json"));
    let (corner, left) = (chosen["filter_hz"].as_f64().unwrap(), unexplained(&chosen));
    assert!((1.0..20.0).contains(&corner) && left < 0.1, "{corner} Hz leave {left}");
    let found = chosen["parameters"][0]["identified"].as_f64().unwrap();
    assert!((found / LIGHT.inertia - 1.0).abs() < 0.03, "the recipe has b = {found}");
    // Given, it is taken: what differences of counts are at 100 Hz explains nothing.
    host(folder.path(), &[&torque[..], &["--corner", "100"]].concat(), 0);
    let given = json(&folder.path().join("torque.json"));
    assert!((given["filter_hz"].as_f64().unwrap() - 100.0).abs() < 1e-9);
    assert!(unexplained(&given) > 2.0 * left, "{} at 100 Hz", unexplained(&given));
    host(folder.path(), &[&torque[..], &["--corner", "-3"]].concat(), 2);
}

/// A gear rubs more the more it carries: at 3 N m two and a half times as much as at rest. A diagnosis names it on a joint without any spring.
#[test]
fn friction_that_grows_with_the_load_of_a_rigid_joint_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let loaded = Pendulum { coulomb: 0.3, load: 0.5, ..LIGHT };
    std::fs::write(folder.path().join("robot.toml"), robot(0.01, 1e-4, STARTS, 0.0)).unwrap();
    for seed in 0..2 {
        let table = table(loaded, (0.01, 40.0), &SLOW, (0.02, 1e-4), seed);
        std::fs::write(folder.path().join("run.csv"), table).unwrap();
        host(folder.path(), &["import", "run.csv", "--robot", "robot.toml", "-o", "run.mcap", "--force"], 0);
        host(folder.path(), &["diagnose", "run.mcap", "-o", "diag.json", "--force"], 10);
        let diagnosis = json(&folder.path().join("diag.json"));
        let findings = diagnosis["findings"].as_array().unwrap();
        let names: Vec<&str> = findings.iter().map(|finding| finding["effect"].as_str().unwrap()).collect();
        assert_eq!(names, ["load_friction"], "seed {seed}");
        let (a, error) = parameter(&findings[0], "load_friction.a[1]");
        let (mu, of_mu) = parameter(&diagnosis["extended"], "mu[1]");
        eprintln!("seed {seed}: a {a:.4} ± {error:.4} of 0.5, mu {mu:.4} ± {of_mu:.4} of 0.3");
        assert!((a - 0.5).abs() < 4.0 * error && error < 0.05, "seed {seed}: a is {a} ± {error}");
        assert!((mu - 0.3).abs() < 4.0 * of_mu, "seed {seed}: mu is {mu} ± {of_mu}");
    }
}
