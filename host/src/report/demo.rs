//! The page of the demonstration: what was found, truth beside estimate, how well the model predicts the other motion.

use super::{Page, calibration, diagnosis, verification};
use crate::diagnose::Diagnosis;
use crate::effect::TrueValue;
use crate::recording::Recording;
use crate::verify::{Traces, Verification};

/// The page: `truth` is what the simulator knows, `recording` the other motion that `verified` and `traces` are about.
pub fn page(
    diagnosed: &Diagnosis,
    truth: &[TrueValue],
    recording: &Recording,
    verified: &Verification,
    traces: &Traces,
) -> Page {
    let calibrated = &diagnosed.extended;
    let true_value = |name: &str| truth.iter().find(|value| value.name == name).map(|value| value.value);
    let title = format!("A simulated {}, recorded, calibrated and diagnosed", calibrated.robot);
    let mut page = Page::new(title).lead(format!(
        "{} Everything here was recorded from a simulated robot that runs the firmware's control core, over a \
         pseudo-terminal; its true parameters stand beside the estimates.",
        diagnosed.summary
    ));
    for section in diagnosis::sections(diagnosed) {
        page.push(section);
    }
    page.push(calibration::parameters(calibrated, Some(&true_value)));
    page.push(calibration::fit(calibrated));
    for section in verification::sections(verified, recording, traces) {
        page.push(section);
    }
    page
}
