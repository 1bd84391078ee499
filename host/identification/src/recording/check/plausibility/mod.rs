//! Units, signs, axes and columns: does what one sensor says agree with what another says, and with the robot file?
//!
//! ```text
//! jumps       positions that begin again after a turn
//! positions   against the joint's limits            degrees, counts, the motor's side of the gear, no zero position
//! inputs      against the torque of the motion      signs, swapped columns
//! pairs       motor encoder, link encoder, tachometer of one joint: a factor between them
//! rates       gyros against encoders                hypotheses: what would make them agree?
//! ```

mod correlation;
mod inputs;
mod jumps;
mod pairs;
mod positions;
mod rates;
mod unit;

use super::{Findings, stats};
use crate::recording::{Recording, Severity};

pub(super) fn look(recording: &Recording, findings: &mut Findings) {
    jumps::look(recording, findings);
    let scene = rates::Scene::of(recording);
    positions::look(recording, scene.as_ref(), findings);
    let clear = |findings: &Findings| {
        findings.0.iter().all(|finding| finding.about != super::About::Units || finding.severity < Severity::Error)
    };
    // What is wrong with one position is wrong with all that is held against it.
    if clear(findings) {
        pairs::look(recording, findings);
    }
    if clear(findings)
        && let Some(scene) = scene
    {
        rates::look(&scene, findings);
    }
    inputs::look(recording, findings);
}
