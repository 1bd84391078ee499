//! A fit that tests of benches begin with.

use crate::calibrate::{Fit, Preset, fit};
use crate::robot::Robot;
use crate::simulated::{Options, SHORT_MOTION, record};
use solve::levenberg::Settings;

/// Doggy, and its base model on the first 8 s of the short motion.
pub(super) fn doggy() -> (Robot, Fit) {
    let robot = Robot::builtin("doggy").unwrap();
    let options = Options { seed: 3, ..Options::new(robot.clone()) };
    let whole = record(&options, SHORT_MOTION).recording;
    let recording = whole.part(0..8_000.min(whole.len()));
    let base = fit(&robot, &[&recording], Preset::Default, &Settings::default(), |_, _| {}).unwrap();
    (robot, base)
}
