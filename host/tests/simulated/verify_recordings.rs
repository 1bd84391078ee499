//! The prediction of recordings of a simulated Doggy whose true parameters are known.
//!
//! Takes the folder `recordings` from the environment variable `RECORDINGS_DIR`.

use std::path::PathBuf;

use host::model::Integrator;
use host::model::rotation::boxminus;
use host::recording::{Recording, import};
use host::robot::Robot;
use host::verify::{self, CalibratedModel, Verification};
use nalgebra::Matrix3;

fn recordings() -> Option<PathBuf> {
    let folder = std::env::var_os("RECORDINGS_DIR").map(PathBuf::from);
    if folder.is_none() {
        eprintln!("SKIPPED: set RECORDINGS_DIR to the folder of recordings to run this test");
    }
    folder
}

fn read(folder: &std::path::Path, name: &str) -> Recording {
    import::read(&folder.join(name), &Robot::builtin("doggy").unwrap(), None).unwrap().recording
}

/// The true parameters of `clean`, from the README of the recordings.
fn truth() -> CalibratedModel {
    let imu1 =
        Matrix3::new(-0.998842, -0.026152, 0.040383, -0.039590, -0.030159, -0.998761, 0.027337, -0.999203, 0.029089);
    let imu2 =
        Matrix3::new(0.011996, 0.016735, 0.999788, -0.009147, -0.999816, 0.016845, 0.999886, -0.009347, -0.011841);
    let robot = Robot::builtin("doggy").unwrap();
    let delta: Vec<_> = robot
        .gyros()
        .zip([imu1, imu2])
        .map(|(gyro, true_rotation)| boxminus(&true_rotation, &Matrix3::from_fn(|i, j| gyro.rotation[i][j])))
        .collect();
    let axis = |c: char| match c {
        'x' => 0,
        'y' => 1,
        _ => 2,
    };
    let value = |name: &str| {
        let values = [
            ("k_pwm", 5.0521),
            ("k_mi", 35.4322),
            ("b", 2.6236),
            ("mu[1]", 1.6228),
            ("mu[2]", 2.6626),
            ("mu[3]", 4.7854),
            ("k_s[1]", 448.24),
            ("k_s[2]", 415.96),
            ("k_s[3]", 559.26),
            ("d_s[1]", 1.4944),
            ("d_s[2]", 1.7018),
            ("d_s[3]", 2.8204),
            ("bias1[x]", 0.051941),
            ("bias1[y]", 0.000233),
            ("bias1[z]", -0.023291),
            ("bias2[x]", 0.049849),
            ("bias2[y]", -0.001943),
            ("bias2[z]", -0.012035),
        ];
        let component = |gyro: usize| delta[gyro][axis(name.chars().rev().nth(1)?)].into();
        if name.starts_with("R_imu1") {
            component(0)
        } else if name.starts_with("R_imu2") {
            component(1)
        } else {
            values.iter().find(|(known, _)| *known == name).map(|(_, value)| *value)
        }
    };
    CalibratedModel::from_values(robot, Integrator::RungeKutta4, value).unwrap()
}

fn print(verification: &Verification) {
    eprintln!("filter {:?}", verification.filter);
    for horizon in &verification.horizons {
        let sigmas: Vec<String> =
            horizon.channels.iter().map(|c| format!("{} {:.3}", c.channel, c.rmse_sigma)).collect();
        eprintln!("{} s, {} windows: {}", horizon.horizon_s, horizon.windows, sigmas.join("  "));
    }
    for stage in &verification.free_run.stages {
        let sigmas: Vec<String> = stage.channels.iter().map(|c| format!("{:.3}", c.nrmse)).collect();
        eprintln!("{:.1} to {:.1} s {}: {}", stage.from_s, stage.to_s, stage.label, sigmas.join(" "));
    }
}

#[test]
fn the_true_model_predicts_the_clean_validation_recording_to_its_sensors_noise() {
    let Some(folder) = recordings() else { return };
    let recording = read(&folder, "clean/validation.csv.gz");
    let start = std::time::Instant::now();
    let (verification, _) = verify::predict(&truth(), &recording, None, |_| {}).unwrap();
    eprintln!("{:.2} s", start.elapsed().as_secs_f64());
    print(&verification);
    for channel in &verification.horizon(0.1).unwrap().channels {
        assert!((0.9..1.10).contains(&channel.rmse_sigma), "{} {}", channel.channel, channel.rmse_sigma);
    }
}

#[test]
fn the_calibration_recording_falls_into_the_papers_five_regions() {
    let Some(folder) = recordings() else { return };
    let recording = read(&folder, "clean/calibration.csv.gz");
    let duty: Vec<&[f64]> = recording.duty.iter().map(Vec::as_slice).collect();
    let stages = verify::stage::from_duty(&duty, recording.period_s, &["yaw", "pitch", "roll"]);
    let found: Vec<(&str, f64)> =
        stages.iter().map(|s| (s.label.as_str(), recording.time_s(s.samples.start))).collect();
    let expected = [
        ("at rest", 0.0),
        ("slow: weak duty", 3.4),
        ("fast: yaw moves", 30.9),
        ("fast: pitch moves", 39.8),
        ("fast: roll moves", 47.8),
        ("fast: all joints together", 55.8),
    ];
    assert_eq!(found.len(), expected.len(), "{found:?}");
    for ((label, at), (name, from)) in found.iter().zip(expected) {
        assert_eq!(*label, name);
        assert!((at - from).abs() < 0.4, "{label} starts at {at} s, not {from} s");
    }
}

#[test]
fn the_page_shows_the_papers_figures() {
    let Some(folder) = recordings() else { return };
    let recording = read(&folder, "clean/validation.csv.gz");
    let (verification, traces) = verify::predict(&truth(), &recording, None, |_| {}).unwrap();
    let page = host::report::verification::page(&verification, &recording, &traces).to_html();
    for text in [
        "as well as the sensor itself can tell",
        "Free run, stage by stage",
        "All joints together",
        "Gyro 2",
        "Motor velocity",
    ] {
        assert!(page.contains(text), "{text}");
    }
    // Measured 0.37 MB: one stage of four plots.
    assert!((200_000..800_000).contains(&page.len()), "{}", page.len());
}
