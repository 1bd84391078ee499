//! What recordings and robots need for a calibration.

use super::data::series;
use super::error::CalibrateError;
use super::residuals::preset::Preset;
use crate::recording::{Recording, check};
use crate::robot::{ChannelKind, Robot};

/// Fewest samples of a recording.
pub const FEWEST_SAMPLES: usize = 200;

/// What makes any result of this recording worthless, see [`check::obstacles`]. A recording of fewer samples than a calibration needs shows
/// nothing; it is refused for that.
pub fn obstacles(recording: &Recording) -> Vec<check::Finding> {
    match recording.len() {
        0..FEWEST_SAMPLES => Vec::new(),
        _ => check::obstacles(recording),
    }
}

/// The columns of a table with so many inputs and these channels.
fn columns(inputs: usize, channels: &[crate::robot::Channel]) -> String {
    let inputs = (1..=inputs).map(|i| format!("u{i}"));
    inputs.chain(channels.iter().map(|channel| channel.column.clone())).collect::<Vec<_>>().join(",")
}

pub(crate) fn accept(robot: &Robot, recordings: &[&Recording], preset: Preset) -> Result<(), CalibrateError> {
    let first = recordings.first().ok_or(CalibrateError::NoRecording)?;
    let expected = columns(robot.joints.len(), &robot.channels());
    for (i, recording) in recordings.iter().enumerate() {
        let path = recording.source.path.display().to_string();
        let sha256 = &recording.source.sha256;
        if !sha256.is_empty() && recordings[..i].iter().any(|earlier| earlier.source.sha256 == *sha256) {
            return Err(CalibrateError::Twice { path });
        }
        let specs: Vec<_> = recording.channels.iter().map(|channel| channel.spec.clone()).collect();
        let found = columns(recording.duty.len(), &specs);
        if found != expected {
            let robot = robot.name.clone();
            return Err(CalibrateError::DifferentColumns { path, found, robot, expected });
        }
        let samples = series::usable_samples(recording);
        if samples < FEWEST_SAMPLES {
            return Err(CalibrateError::TooShort { path, samples, least: FEWEST_SAMPLES });
        }
        if recording.robot.name != first.robot.name {
            let (robot, expected) = (recording.robot.name.clone(), first.robot.name.clone());
            return Err(CalibrateError::DifferentRobot { path, robot, expected });
        }
    }
    let channels = robot.channels();
    let sees = |joint: usize| {
        channels.iter().any(|channel| {
            matches!(channel.kind,
                ChannelKind::MotorPosition { joint: j } | ChannelKind::LinkPosition { joint: j } if j == joint)
        })
    };
    if let Some(joint) = (0..robot.joints.len()).find(|&joint| !sees(joint)) {
        return Err(CalibrateError::NoPosition { joint: joint + 1, name: robot.joints[joint].name.clone() });
    }
    let papers_gyro = robot
        .gyros()
        .next()
        .is_none_or(|gyro| gyro.body == 0 && robot.joints[0].kind == crate::robot::JointKind::Revolute);
    if preset == Preset::Paper && !papers_gyro {
        return Err(CalibrateError::NotThePapersRobot);
    }
    Ok(())
}
