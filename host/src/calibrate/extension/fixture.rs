//! A fit that tests of benches begin with.

use crate::calibrate::{Fit, Preset, fit};
use crate::robot::Robot;
use crate::simulate::{Direct, Options, SHORT_MOTION};
use solve::levenberg::Settings;

/// Doggy, and its base model on the first 8 s of the short motion.
pub(super) fn doggy() -> (Robot, Fit) {
    let robot = Robot::builtin("doggy").unwrap();
    let options = Options { seed: 3, ..Options::new(robot.clone()) };
    let whole = Direct::record(&options, SHORT_MOTION).unwrap().recording;
    let recording = whole.part(0..8_000.min(whole.len()));
    let base = fit(&robot, &[&recording], Preset::Default, &Settings::default(), |_, _| {}).unwrap();
    (robot, base)
}
