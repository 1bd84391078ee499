//! The page of the demonstration: truth beside estimate, then how well the model predicts the other motion.

use super::{Page, calibration, verification};
use crate::calibrate::Calibration;
use crate::effect::TrueValue;
use crate::recording::Recording;
use crate::verify::{Traces, Verification};

/// The page: `truth` is what the simulator knows, `recording` the other motion that `verified` and `traces` are about.
pub fn page(
    calibrated: &Calibration,
    truth: &[TrueValue],
    recording: &Recording,
    verified: &Verification,
    traces: &Traces,
) -> Page {
    let true_value = |name: &str| truth.iter().find(|value| value.name == name).map(|value| value.value);
    let mut page = Page::new(format!("A simulated {}, recorded, calibrated and verified", calibrated.robot)).lead(
        "Everything here was recorded from a simulated robot that runs the firmware's control core, over a \
         pseudo-terminal; its true parameters stand beside the estimates.",
    );
    page.push(calibration::parameters(calibrated, Some(&true_value)));
    page.push(calibration::fit(calibrated));
    for section in verification::sections(verified, recording, traces) {
        page.push(section);
    }
    page
}
