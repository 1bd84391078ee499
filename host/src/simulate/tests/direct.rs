//! Recordings made in memory.

use crate::recording::check::check;
use crate::robot::Robot;
use crate::simulate::{Direct, Options, SHORT_MOTION, SimulateError};

#[test]
fn the_short_motion_shows_everything_and_depends_on_the_seed_alone() {
    let options = |seed| Options { seed, process_noise: 1.0, ..Options::new(Robot::builtin("doggy").unwrap()) };
    let once = Direct::record(&options(3), SHORT_MOTION).unwrap();
    let recording = &once.recording;
    let seconds = recording.len() as f64 * recording.period_s;
    assert!((20.0..30.0).contains(&seconds), "{seconds} s");
    let checked = check(recording);
    let findings: Vec<_> = checked.findings.iter().map(|finding| &finding.message).collect();
    assert!(checked.usable && findings.is_empty(), "{findings:?}");

    let again = Direct::record(&options(3), SHORT_MOTION).unwrap();
    assert_eq!(again.truth, once.truth);
    for (a, b) in recording.channels.iter().zip(&again.recording.channels) {
        assert_eq!(a.values, b.values, "{}", a.spec.name);
    }
    assert_eq!(recording.duty, again.recording.duty);
    let second = Direct::record_nth(&options(3), SHORT_MOTION, 2).unwrap();
    assert_eq!(second.truth, once.truth);
    assert_ne!(second.recording.channels[0].values, recording.channels[0].values);
    let other = Direct::record(&options(4), SHORT_MOTION).unwrap();
    assert_ne!(other.truth, once.truth);
}

#[test]
fn what_is_no_motion_says_so() {
    let options = Options::new(Robot::builtin("doggy").unwrap());
    for motion in ["name = 3", &SHORT_MOTION.replace("amplitude = 0.25", "amplitude = 2.5")] {
        assert!(matches!(Direct::record(&options, motion), Err(SimulateError::Motion { .. })), "{motion}");
    }
}
