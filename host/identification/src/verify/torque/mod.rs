//! How well a rigid robot's torques are explained, and the recipe of [`inverse dynamics`](crate::inverse_dynamics) beside it.
//!
//! The recipe fits the parameters to the torques along filtered differences. It knows no noise of the sensors and nothing of friction between samples, but it
//! is what published figures of rigid robots come from; the calibrated values are judged by the same torques beside it. The relative error is
//! |torque − model| / |torque| over all samples.

use serde::{Deserialize, Serialize};

use super::{CalibratedModel, RecordingVerified, VerifyError};
use crate::calibrate::Calibration;
use crate::inverse_dynamics::{self, HIGHEST_CORNER, Loss, Motion, Readings, SHORTEST_RUN, norm};
use crate::recording::Recording;
use crate::robot::ChannelKind;

/// Why torques cannot be compared.
#[derive(Debug, thiserror::Error, PartialEq, Eq)]
pub enum TorqueError {
    /// Torques in a spring are not seen.
    #[error(
        "joint {joint} (`{name}`) is elastic: the recipe of inverse dynamics is for rigid robots; leave --metric torque out"
    )]
    Elastic {
        /// 1-based.
        joint: usize,
        /// Its name.
        name: String,
    },
    /// States that no sensor shows.
    #[error(
        "the calibration's effects have states of their own, which inverse dynamics cannot know: calibrate without them"
    )]
    OwnStates,
    /// Nothing to compare with.
    #[error(
        "the drive's torque constant is estimated and no known torque, as of a body's weight, sets the scale: zero fits best; fix `k_pwm` or `k_t` in the robot file"
    )]
    UnknownTorque,
    /// No motion.
    #[error("no run of {SHORTEST_RUN} samples without a gap and with torque: nothing to compare")]
    NoMotion,
}

/// What the comparison says.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TorqueVerification {
    /// `torque`.
    pub metric: String,
    /// Name of the robot.
    pub robot: String,
    /// Effects of the calibrated model.
    pub extensions: Vec<String>,
    /// The recording whose torques are compared.
    pub recording: RecordingVerified,
    /// The recording on which the recipe found its parameters.
    pub identified_on: RecordingVerified,
    /// Corner of the low-pass, Hz.
    pub filter_hz: f64,
    /// Of so many samples one is kept.
    pub decimation: usize,
    /// Samples compared.
    pub samples: usize,
    /// One a joint.
    pub joints: Vec<JointTorque>,
    /// One a parameter of the dynamics.
    pub parameters: Vec<TorqueParameter>,
}

/// A joint's torques.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct JointTorque {
    /// Its name.
    pub joint: String,
    /// N m or N.
    pub unit: String,
    /// Root mean square of the motor's torque.
    pub rms: f64,
    /// |torque − model| / |torque| with the calibrated parameters.
    pub relative_error_calibrated: f64,
    /// The same with those of the recipe.
    pub relative_error_identified: f64,
}

/// A parameter of the dynamics.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TorqueParameter {
    /// As in the calibration.
    pub name: String,
    /// Its unit.
    pub unit: String,
    /// Whether physics wants it to be above zero.
    #[serde(default)]
    pub must_be_positive: bool,
    /// The calibration's estimate.
    pub calibrated: f64,
    /// The recipe's.
    pub identified: f64,
    /// The recipe's standard error; none where its torques do not show the parameter.
    pub std_error: Option<f64>,
}

/// Compares the torques of `recording` with the model of `calibration` at its own parameters and at those that the recipe finds on
/// `identified_on`. Positions are filtered at `corner_hz`, or where it is not given at the highest corner whose motion explains the torques.
///
/// # Errors
/// [`VerifyError`]; [`TorqueError`] for robots and models that the recipe is not for.
pub fn verify(
    calibration: &Calibration,
    recording: &Recording,
    identified_on: &Recording,
    corner_hz: Option<f64>,
) -> Result<TorqueVerification, VerifyError> {
    let model = CalibratedModel::of(calibration, None)?;
    super::check(&model, recording)?;
    super::check(&model, identified_on)?;
    suits(&model)?;
    let own = motion(&model, identified_on, corner_hz)?;
    // Torques of both are filtered alike.
    let filter_hz = own.corner() / identified_on.period_s;
    let other = motion(&model, recording, Some(filter_hz))?;
    let found = own.identify(model.model(), model.z(), &[], Loss::Squares);
    if estimates_torque(&model) && !own.is_scaled(model.model(), &found.z).iter().all(|scaled| *scaled) {
        return Err(TorqueError::UnknownTorque.into());
    }
    let (robot, coordinates) = (model.robot(), model.model().coordinates());
    let calibrated = Torques::of(&other, &model, model.z());
    let identified = Torques::of(&other, &model, &found.z);
    let error = |torques: &Torques, joint: usize| norm(&torques.missing[joint]) / norm(&torques.driving[joint]);
    let joints = robot.joints.iter().enumerate().map(|(j, joint)| JointTorque {
        joint: joint.name.clone(),
        unit: crate::model::law::unit_at(joint.kind, "N m").to_string(),
        rms: norm(&calibrated.driving[j]) / (other.rows().max(1) as f64).sqrt(),
        relative_error_calibrated: error(&calibrated, j),
        relative_error_identified: error(&identified, j),
    });
    let joints = joints.collect();
    let parameters = coordinates.names().enumerate().map(|(i, (name, unit))| {
        let (value, slopes) = coordinates.physical_and_slopes(&found.z, i);
        let variance: f64 = slopes
            .iter()
            .flat_map(|(a, by_a)| slopes.iter().map(move |(b, by_b)| (*a, *b, by_a * by_b)))
            .map(|(a, b, by)| by * found.covariance[(a, b)])
            .sum();
        TorqueParameter {
            name: name.to_string(),
            unit: unit.to_string(),
            must_be_positive: coordinates.iter().nth(i).is_some_and(|c| !c.spec.symbol.has_either_sign()),
            calibrated: coordinates.physical_and_slopes(model.z(), i).0,
            identified: value,
            std_error: Some(variance.sqrt()).filter(|error| error.is_finite() && *error > 0.0),
        }
    });
    let used = |recording: &Recording| RecordingVerified {
        path: recording.source.path.clone(),
        sha256: recording.source.sha256.clone(),
        calibrated_on: calibration.recordings.iter().any(|used| used.sha256 == recording.source.sha256),
        samples: recording.len(),
        gaps: recording.gaps(),
        missing_ticks: recording.missing_ticks(),
        duration_s: recording.duration_s(),
    };
    Ok(TorqueVerification {
        metric: "torque".to_string(),
        robot: robot.name.clone(),
        extensions: calibration.extensions.clone(),
        recording: used(recording),
        identified_on: used(identified_on),
        filter_hz,
        decimation: other.decimation(),
        samples: other.rows(),
        joints,
        parameters: parameters.collect(),
    })
}

fn suits(model: &CalibratedModel) -> Result<(), TorqueError> {
    let (robot, layout) = (model.robot(), model.model().layout());
    if let Some(joint) = (0..robot.joints.len()).find(|&joint| layout.is_elastic(joint)) {
        return Err(TorqueError::Elastic { joint: joint + 1, name: robot.joints[joint].name.clone() });
    }
    if layout.size() != 2 * robot.joints.len() {
        return Err(TorqueError::OwnStates);
    }
    Ok(())
}

/// Whether a drive's torque for its input is estimated.
fn estimates_torque(model: &CalibratedModel) -> bool {
    let constant = model.robot().input.unit.torque_constant();
    model.model().coordinates().iter().any(|coordinate| Some(coordinate.spec.symbol) == constant)
}

/// The motion of a recording, positions filtered at `corner_hz` or at a corner that they choose.
fn motion(model: &CalibratedModel, recording: &Recording, corner_hz: Option<f64>) -> Result<Motion, TorqueError> {
    let joints = model.robot().joints.len();
    let position = |joint: usize| {
        let kinds = [ChannelKind::MotorPosition { joint }, ChannelKind::LinkPosition { joint }];
        kinds.iter().find_map(|kind| recording.channels.iter().find(|channel| channel.spec.kind == *kind))
    };
    let channels: Option<Vec<_>> = (0..joints).map(position).collect();
    let channels = channels.ok_or(TorqueError::NoMotion)?;
    let segments = recording.segments();
    let inputs = model.inputs_as_they_act(&recording.duty, &segments);
    let readings = segments.into_iter().map(|segment| Readings {
        positions: channels.iter().map(|channel| channel.values[segment.clone()].to_vec()).collect(),
        inputs: inputs.iter().map(|input| input[segment.clone()].to_vec()).collect(),
        time_s: segment.map(|k| recording.time_s(k)).collect(),
    });
    let whole = |run: &Readings| run.positions.iter().flatten().all(|value| value.is_finite());
    let readings: Vec<Readings> = readings.filter(whole).collect();
    let motion = match corner_hz {
        Some(hz) => Motion::of(&readings, (hz * recording.period_s).min(HIGHEST_CORNER)),
        None => inverse_dynamics::corner(&readings, model.model(), model.z(), &[]).map(|found| found.motion),
    };
    motion.ok_or(TorqueError::NoMotion)
}

/// Torques of a motion, filtered and decimated, joint by joint.
struct Torques {
    /// The motors'.
    driving: Vec<Vec<f64>>,
    /// What these miss.
    missing: Vec<Vec<f64>>,
}

impl Torques {
    /// Of a motion, with these parameters.
    fn of(motion: &Motion, model: &CalibratedModel, z: &[f64]) -> Self {
        let missing = motion.missing(model.model(), z, true);
        let undriven = motion.missing(model.model(), z, false);
        let driving =
            undriven.iter().zip(&missing).map(|(a, b)| a.iter().zip(b).map(|(a, b)| a - b).collect()).collect();
        Torques { driving, missing }
    }
}
