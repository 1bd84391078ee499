//! The noise of sensors and of the model's steps, found in recordings whose noise is known.

use host::calibrate::{Calibration, ChannelNoise, Method, NoiseSource, Preset, calibrate};
use host::recording::Recording;
use host::robot::Robot;
use host::simulate::{Direct, Options, ProcessNoise, SHORT_MOTION};
use solve::levenberg::Settings;

fn recorded(seed: u64, process_noise: f64) -> Recording {
    let robot = Robot::builtin("doggy").unwrap();
    let options = Options { seed, process_noise, ..Options::new(robot) };
    Direct::record(&options, SHORT_MOTION).unwrap().recording
}

fn calibrated(recording: &Recording, method: impl Into<Method>) -> Calibration {
    calibrate(&recording.robot, &[recording], method, &Settings::default(), |_, _| {}).unwrap()
}

fn show(calibration: &Calibration) {
    eprintln!("{:?} after {} iterations, {:?}", calibration.status, calibration.iterations, calibration.seconds);
    for noise in &calibration.noise {
        eprintln!(
            "{:20} σ {:.3e}  floor {:.2e}  freedom {:.5}  χ²/dof {:.3}",
            noise.channel,
            noise.sigma,
            noise.floor.unwrap_or(f64::NAN),
            noise.freedom.unwrap_or(f64::NAN),
            noise.chi2_per_dof.unwrap_or(f64::NAN),
        );
    }
}

fn of<'a>(calibration: &'a Calibration, channel: &str) -> &'a ChannelNoise {
    calibration.noise.iter().find(|noise| noise.channel == channel).unwrap()
}

const FIXED: Method = Method { preset: Preset::Default, noise: NoiseSource::Fixed };

/// χ² of every sensor channel is that of its degrees of freedom: 0.993 to 1.008 measured.
fn sensors_are_right(calibration: &Calibration) {
    for noise in calibration.noise.iter().filter(|noise| !noise.channel.starts_with("process")) {
        let chi2 = noise.chi2_per_dof.unwrap();
        assert!((0.97..1.03).contains(&chi2), "{}: {chi2}", noise.channel);
        // The simulated gyros have the 1.745e-3 rad/s of the robot file, the encoders 6.93e-5 rad with their step: 0.978 to 1.009 measured.
        let file = if noise.unit == "rad" { 6.9259e-5 } else { 1.745e-3 };
        let share = noise.sigma / file;
        assert!((0.95..1.05).contains(&share), "{}: {share} of the robot file's", noise.channel);
    }
}

#[test]
fn the_noise_of_a_shaken_robot_is_found() {
    let calibration = calibrated(&recorded(5, 1.0), Preset::Default);
    show(&calibration);
    assert_eq!(calibration.noise_source, NoiseSource::Estimated);
    sensors_are_right(&calibration);
    for joint in 1..=3 {
        // 0.90 to 1.07 measured; a motor's step has some 150 degrees of freedom here.
        for (speed, truth) in [("qd", ProcessNoise::UNIT.link_speed), ("thetad", ProcessNoise::UNIT.motor_speed)] {
            let share = of(&calibration, &format!("process.{speed}[{joint}]")).sigma / truth;
            assert!((0.75..1.3).contains(&share), "process.{speed}[{joint}]: {share} of the truth");
        }
    }
}

#[test]
fn the_noise_of_a_robot_that_nothing_shakes_falls_towards_its_floor() {
    let calibration = calibrated(&recorded(6, 0.0), Preset::Default);
    show(&calibration);
    sensors_are_right(&calibration);
    for noise in calibration.noise.iter().filter(|noise| noise.channel.starts_with("process")) {
        // 1.8e-5 measured at most, where the integrator's own error is 1.3e-5; the preset's fixed noise is 8.3e-5 and above for speeds.
        assert!(noise.sigma < 4e-5, "{}: {:e}", noise.channel, noise.sigma);
        assert!(noise.sigma >= noise.floor.unwrap(), "{}: below its floor", noise.channel);
    }
}

#[test]
fn fixed_noise_is_what_the_robot_file_and_the_preset_say() {
    let calibration = calibrated(&recorded(7, 0.0), FIXED);
    show(&calibration);
    assert_eq!(calibration.noise_source, NoiseSource::Fixed);
    assert_eq!(of(&calibration, "gyro1.x").sigma, 1.745e-3);
    assert!((of(&calibration, "process.qd[1]").sigma / 1.1e-4 - 1.0).abs() < 1e-12);
    // Looser than the truth, of which nothing shakes: 0.51 to 0.55 measured.
    for joint in 1..=3 {
        let chi2 = of(&calibration, &format!("process.qd[{joint}]")).chi2_per_dof.unwrap();
        assert!((0.3..0.8).contains(&chi2), "process.qd[{joint}]: {chi2}");
    }
}
