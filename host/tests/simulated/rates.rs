//! Tables of other loops than the firmware's: from 100 Hz to 8 kHz, with uneven stamps, inputs in volts, amperes and newton metres.

use std::fmt::Write as _;

use crate::program::{host, json};
use host::robot::{Robot, Side};
use host::simulate::{Plant, Truth};
use rand::{RngExt, SeedableRng, rngs::StdRng};
use rand_distr::{Distribution, StandardNormal};

/// A loop whose recording comes as a table.
struct Loop {
    name: &'static str,
    period_us: u64,
    /// Stamps come so much too early or late, share of the period.
    uneven: f64,
    seconds: u64,
    /// Most that is commanded, in the input's unit.
    most: f64,
    /// What the description says instead.
    input: &'static str,
    drive: &'static str,
    /// Slope of the friction law, s/rad: a step of 10 ms does not follow a steep one.
    slope_s_rad: &'static str,
    /// Largest error of a parameter of the dynamics that is accepted, share; ten times the measured one or more.
    worst: f64,
}

const DUTY: (&str, &str) = ("unit = \"duty\"\nsupply_v = 24.0", "k_pwm = { start = 1.5 }\nk_mi = { start = 3.0 }");

const LOOPS: [Loop; 5] = [
    Loop {
        name: "100 Hz",
        period_us: 10_000,
        uneven: 0.0,
        seconds: 60,
        most: 0.9,
        input: DUTY.0,
        drive: DUTY.1,
        slope_s_rad: "40.0",
        worst: 9e-3, // measured: 0.09 %
    },
    Loop {
        name: "100 Hz, uneven",
        period_us: 10_000,
        uneven: 0.2,
        seconds: 60,
        most: 0.9,
        input: DUTY.0,
        drive: DUTY.1,
        slope_s_rad: "40.0",
        worst: 6e-3, // measured: 0.06 %
    },
    Loop {
        name: "8 kHz",
        period_us: 125,
        uneven: 0.0,
        seconds: 12,
        most: 0.9,
        input: DUTY.0,
        drive: DUTY.1,
        slope_s_rad: "400.0",
        worst: 1e-3, // measured: 0.004 %
    },
    Loop {
        name: "250 Hz, amperes",
        period_us: 4_000,
        uneven: 0.1,
        seconds: 30,
        most: 12.0,
        input: "unit = \"ampere\"",
        drive: "k_t = { start = 1.5 }\nv = { start = 3.0 }",
        slope_s_rad: "100.0",
        worst: 3e-3, // measured: 0.03 %
    },
    Loop {
        name: "1 kHz, newton metres",
        period_us: 1_000,
        uneven: 0.05,
        seconds: 20,
        most: 15.0,
        input: "unit = \"newton_metre\"",
        drive: "v = { start = 2.0 }",
        slope_s_rad: "400.0",
        worst: 1e-3, // measured: 0.01 %
    },
];

/// The built-in robot with another loop and drive.
fn description(of: &Loop) -> String {
    let built_in = Robot::builtin("one_joint").unwrap().toml().to_owned();
    let changes = [
        ("sample_period_s = 0.001", format!("sample_period_s = {}", of.period_us as f64 * 1e-6)),
        ("slope_s_rad = 400.0", format!("slope_s_rad = {}", of.slope_s_rad)),
    ];
    let mut text = String::new();
    for line in built_in.lines() {
        let own = line.split(" = ").next().unwrap_or("").trim();
        match own {
            "unit" => writeln!(text, "{}", of.input).unwrap(),
            "k_pwm" => writeln!(text, "{}", of.drive).unwrap(),
            "supply_v" | "k_mi" => {}
            _ => writeln!(text, "{line}").unwrap(),
        }
    }
    changes.into_iter().fold(text, |text, (from, to)| text.replace(from, &to))
}

/// A table of the robot's motion, and its true parameters.
fn table(of: &Loop, robot: &Robot) -> (String, Truth) {
    let mut rng = StdRng::seed_from_u64(8);
    let truth = Truth::drawn(robot, &mut rng);
    let mut plant = Plant::new(robot, &truth, Vec::new()).unwrap();
    let channels = robot.channels();
    let mut table = String::from("t_us,u1,theta1,g1x,g1y,g1z\n");
    let (mut input, mut target) = (0.0, 0.0);
    let mut stamp_us = 0_u64;
    let mut next_target_us = 0;
    for k in 1..=of.seconds * 1_000_000 / of.period_us {
        let mut noise = |sigma: f64| -> f64 {
            let noise: f64 = StandardNormal.sample(&mut rng);
            sigma * noise
        };
        let theta = plant.encoder(Side::Motor, 0) + noise(channels[0].sigma);
        let gyro = [1, 2, 3].map(|channel| noise(channels[channel].sigma));
        let [x, y, z] = plant.gyro_reading(0, gyro);
        writeln!(table, "{stamp_us},{input},{theta},{x},{y},{z}").unwrap();
        let early = (of.uneven * of.period_us as f64 * rng.random_range(-1.0..1.0)) as i64;
        let until_us = (k * of.period_us).saturating_add_signed(early);
        plant.advance(&[input], (until_us - stamp_us) as f64 * 1e-6);
        stamp_us = until_us;
        let time_s = stamp_us as f64 * 1e-6;
        let slow = time_s % 12.0 < 4.0;
        if stamp_us >= next_target_us {
            target = rng.random_range(-0.9..0.9);
            next_target_us = stamp_us + if slow { 1_500_000 } else { 500_000 };
        }
        let swing = if slow { 0.0 } else { 0.3 * (time_s * (12.0 + 8.0 * (0.5 * time_s).sin())).sin() };
        let most = if slow { 0.2 } else { 1.0 };
        input = of.most * (2.0 * (target - plant.motor_position(0)) + swing).clamp(-most, most);
        if time_s < 2.0 {
            input = 0.0;
        }
    }
    (table, truth)
}

#[test]
fn any_rate_and_any_input_is_calibrated() {
    for of in &LOOPS {
        let scratch = tempfile::tempdir().unwrap();
        let at = scratch.path();
        let text = description(of);
        let robot = Robot::parse(&text).unwrap_or_else(|error| panic!("{}: {error}\n{text}", of.name));
        let (table, truth) = table(of, &robot);
        std::fs::write(at.join("robot.toml"), text).unwrap();
        std::fs::write(at.join("run.csv"), table).unwrap();
        host(at, &["import", "run.csv", "--robot", "robot.toml", "-o", "run.mcap"], 0);
        host(at, &["check", "run.mcap", "-o", "check.json"], 0);
        let said = host(at, &["calibrate", "run.mcap", "-o", "cal.json"], 0);
        let (check, cal) = (json(&at.join("check.json")), json(&at.join("cal.json")));
        assert_eq!((&check["missing_ticks"], &check["gaps"]), (&0.into(), &0.into()), "{}", of.name);
        assert_eq!(cal["status"], "converged", "{}: {said}", of.name);
        let errors: Vec<(f64, String)> = truth
            .values(&robot)
            .into_iter()
            .filter_map(|value| {
                let found = cal["parameters"].as_array()?.iter().find(|p| p["name"] == *value.name)?;
                let dynamic = !value.name.starts_with("bias") && !value.name.starts_with("R_imu");
                dynamic
                    .then(|| ((found["estimate"].as_f64().unwrap() / value.value - 1.0).abs(), value.name.to_string()))
            })
            .collect();
        let worst = errors.iter().max_by(|a, b| a.0.total_cmp(&b.0)).unwrap();
        eprintln!(
            "{}: {} samples, worst of {} {:.4} % ({}), {:.1} s",
            of.name,
            cal["recordings"][0]["samples"],
            errors.len(),
            100.0 * worst.0,
            worst.1,
            cal["seconds"]["total"].as_f64().unwrap()
        );
        assert!((1e-5..of.worst).contains(&worst.0), "{}: {errors:?}", of.name);
    }
}
