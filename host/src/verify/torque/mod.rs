//! How well a rigid robot's torques are explained, and the recipe of inverse dynamics beside it.
//!
//! ```text
//! position ─▶ low-pass without phase ─▶ central differences: q̇, q̈ ─▶ torque that the motion needs ┐
//! input ───────────────────────────────────────────────────────────▶ torque of the motor ──────────┴─▶ both filtered, every tenth sample
//! ```
//! The recipe (Gautier; Janot, Vandanjon, Gautier 2014: inverse dynamics identification by least squares) fits the parameters to these
//! torques. It knows no noise of the sensors and nothing of friction between samples, but it is what published figures of rigid robots come from;
//! the calibrated values are judged by the same torques beside it. The relative error is |torque − model| / |torque| over all samples.

mod lowpass;

use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};

use super::{CalibratedModel, RecordingVerified, VerifyError};
use crate::calibrate::Calibration;
use crate::model::Input;
use crate::recording::Recording;
use crate::robot::ChannelKind;
use lowpass::Lowpass;

/// Corner of the low-pass of positions, Hz, or so much of the sampling frequency where that is less.
const CORNER_HZ: f64 = 100.0;
const MOST_OF_SAMPLING: f64 = 0.2;
/// Of so many samples one is kept; before that, torques are filtered at this share of what is then half the sampling frequency.
const DECIMATION: usize = 10;
const DECIMATION_SHARE: f64 = 0.8;
/// Samples at the ends of a run that differences do not reach or filters have not settled in.
const MARGIN: usize = 20;
/// Shorter runs are left out.
const SHORTEST_RUN: usize = 500;
/// The torques are linear in the parameters of the base model; laws may need a few rounds.
const ROUNDS: usize = 6;
/// Directions of the parameters that show less than this share of the strongest one stay where they are calibrated.
const LEAST_SHARE: f64 = 1e-9;

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
        "the drive's torque constant is estimated: with every torque unknown, zero fits best; fix `k_pwm` or `k_t` in the robot file"
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
    /// The calibration's estimate.
    pub calibrated: f64,
    /// The recipe's.
    pub identified: f64,
    /// The recipe's standard error; none where its torques do not show the parameter.
    pub std_error: Option<f64>,
}

/// Compares the torques of `recording` with the model of `calibration` at its own parameters and at those that the recipe finds on
/// `identified_on`.
///
/// # Errors
/// [`VerifyError`]; [`TorqueError`] for robots and models that the recipe is not for.
pub fn verify(
    calibration: &Calibration,
    recording: &Recording,
    identified_on: &Recording,
) -> Result<TorqueVerification, VerifyError> {
    let model = CalibratedModel::of(calibration, None)?;
    super::check(&model, recording)?;
    super::check(&model, identified_on)?;
    suits(&model)?;
    let (own, other) = (Motion::of(&model, identified_on)?, Motion::of(&model, recording)?);
    let found = identify(&model, &own);
    let (robot, coordinates) = (model.robot(), model.model().coordinates());
    let torques = other.torques(&model);
    let error = |left: &[Vec<f64>], joint: usize| norm(&left[joint]) / norm(&torques.driving[joint]);
    let identified = other.missing(&model, &found.z, true);
    let joints = robot.joints.iter().enumerate().map(|(j, joint)| JointTorque {
        joint: joint.name.clone(),
        unit: crate::model::law::unit_at(joint.kind, "N m").to_string(),
        rms: norm(&torques.driving[j]) / (other.rows().max(1) as f64).sqrt(),
        relative_error_calibrated: error(&torques.missing, j),
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
        filter_hz: corner(recording.period_s) / recording.period_s,
        decimation: DECIMATION,
        samples: other.rows(),
        joints,
        parameters: parameters.collect(),
    })
}

/// Corner of the positions' filter over the sampling frequency.
fn corner(period_s: f64) -> f64 {
    (CORNER_HZ * period_s).min(MOST_OF_SAMPLING)
}

fn suits(model: &CalibratedModel) -> Result<(), TorqueError> {
    let (robot, layout) = (model.robot(), model.model().layout());
    if let Some(joint) = (0..robot.joints.len()).find(|&joint| layout.is_elastic(joint)) {
        return Err(TorqueError::Elastic { joint: joint + 1, name: robot.joints[joint].name.clone() });
    }
    if layout.size() != 2 * robot.joints.len() {
        return Err(TorqueError::OwnStates);
    }
    let torque_constants = [crate::robot::Symbol::KPwm, crate::robot::Symbol::KT];
    if model.model().coordinates().iter().any(|coordinate| torque_constants.contains(&coordinate.spec.symbol)) {
        return Err(TorqueError::UnknownTorque);
    }
    Ok(())
}

/// A stretch of a recording without a gap: states, accelerations and inputs, `[k · joints + j]`.
struct Run {
    states: Vec<f64>,
    accelerations: Vec<f64>,
    inputs: Vec<f64>,
    time_s: Vec<f64>,
}

/// The motion of a recording by filtered differences.
struct Motion {
    joints: usize,
    runs: Vec<Run>,
    decimate: Lowpass,
}

impl Motion {
    fn of(model: &CalibratedModel, recording: &Recording) -> Result<Self, TorqueError> {
        let joints = model.robot().joints.len();
        let position = |joint: usize| {
            let kinds = [ChannelKind::MotorPosition { joint }, ChannelKind::LinkPosition { joint }];
            kinds.iter().find_map(|kind| recording.channels.iter().find(|channel| channel.spec.kind == *kind))
        };
        let channels: Option<Vec<_>> = (0..joints).map(position).collect();
        let channels = channels.ok_or(TorqueError::NoMotion)?;
        let segments = recording.segments();
        let inputs = model.inputs_as_they_act(&recording.duty, &segments);
        let filter = Lowpass::butterworth(corner(recording.period_s));
        let mut runs = Vec::new();
        for segment in segments.into_iter().filter(|segment| segment.len() >= SHORTEST_RUN) {
            let columns: Vec<&[f64]> = channels.iter().map(|channel| &channel.values[segment.clone()]).collect();
            if columns.iter().any(|column| column.iter().any(|value| !value.is_finite())) {
                continue;
            }
            let filtered: Vec<Vec<f64>> = columns.iter().map(|column| filter.zero_phase(column)).collect();
            let time: Vec<f64> = segment.clone().map(|k| recording.time_s(k)).collect();
            let difference = |values: &[f64]| -> Vec<f64> {
                let inner =
                    (1..values.len() - 1).map(|k| (values[k + 1] - values[k - 1]) / (time[k + 1] - time[k - 1]));
                std::iter::once(0.0).chain(inner).chain(std::iter::once(0.0)).collect()
            };
            let speeds: Vec<Vec<f64>> = filtered.iter().map(|column| difference(column)).collect();
            let accelerations: Vec<Vec<f64>> = speeds.iter().map(|column| difference(column)).collect();
            let inner = MARGIN..segment.len() - MARGIN;
            let by_sample = |columns: &[&[Vec<f64>]]| -> Vec<f64> {
                inner.clone().flat_map(|k| columns.iter().flat_map(move |of| of.iter().map(move |c| c[k]))).collect()
            };
            let parts: Vec<Vec<f64>> = inputs.iter().map(|input| input[segment.clone()].to_vec()).collect();
            runs.push(Run {
                states: by_sample(&[&filtered, &speeds]),
                accelerations: by_sample(&[&accelerations]),
                inputs: by_sample(&[&parts]),
                time_s: time[inner.clone()].to_vec(),
            });
        }
        if runs.is_empty() {
            return Err(TorqueError::NoMotion);
        }
        let decimate = Lowpass::chebyshev(0.5 * DECIMATION_SHARE / DECIMATION as f64);
        Ok(Motion { joints, runs, decimate })
    }

    /// Kept samples of one joint.
    fn rows(&self) -> usize {
        self.runs.iter().map(|run| run.time_s.len().div_ceil(DECIMATION)).sum()
    }

    /// What the motors' torques miss at `z`, filtered and decimated, joint by joint; without the motors' torque where `driven` is false.
    fn missing(&self, model: &CalibratedModel, z: &[f64], driven: bool) -> Vec<Vec<f64>> {
        let dynamics = model.model().at(z);
        let n = self.joints;
        let mut out = vec![Vec::with_capacity(self.rows()); n];
        let nothing = vec![0.0; n];
        for run in &self.runs {
            let mut columns = vec![Vec::with_capacity(run.time_s.len()); n];
            let mut missing = vec![0.0; n];
            for (k, &time_s) in run.time_s.iter().enumerate() {
                let u = if driven { &run.inputs[k * n..(k + 1) * n] } else { &nothing };
                let input = Input { u, by_delay: &[], time_s };
                let accelerations = &run.accelerations[k * n..(k + 1) * n];
                dynamics.missing_torque(&run.states[2 * k * n..2 * (k + 1) * n], input, accelerations, &mut missing);
                columns.iter_mut().zip(&missing).for_each(|(column, missing)| column.push(*missing));
            }
            for (out, column) in out.iter_mut().zip(columns) {
                out.extend(self.decimate.zero_phase(&column).into_iter().step_by(DECIMATION));
            }
        }
        out
    }

    /// Torques with the calibrated parameters.
    fn torques(&self, model: &CalibratedModel) -> Torques {
        let (missing, undriven) = (self.missing(model, model.z(), true), self.missing(model, model.z(), false));
        let driving =
            undriven.iter().zip(&missing).map(|(a, b)| a.iter().zip(b).map(|(a, b)| a - b).collect()).collect();
        Torques { driving, missing }
    }
}

/// Torques of a motion, filtered and decimated, joint by joint.
struct Torques {
    /// The motors'.
    driving: Vec<Vec<f64>>,
    /// What these miss.
    missing: Vec<Vec<f64>>,
}

fn norm(values: &[f64]) -> f64 {
    values.iter().map(|value| value * value).sum::<f64>().sqrt()
}

/// What the recipe finds.
struct Identified {
    z: Vec<f64>,
    covariance: DMatrix<f64>,
}

/// Least squares of the torques from the calibrated values on, joints weighted by what is left of theirs.
fn identify(model: &CalibratedModel, motion: &Motion) -> Identified {
    let unknowns = model.z().len();
    let mut z = model.z().to_vec();
    let mut covariance = DMatrix::zeros(unknowns, unknowns);
    for _ in 0..ROUNDS {
        let missing = motion.missing(model, &z, true);
        let weights: Vec<f64> =
            missing.iter().map(|m| (m.len() as f64).sqrt() / norm(m).max(f64::MIN_POSITIVE)).collect();
        let weighted = |columns: &[Vec<f64>]| -> Vec<f64> {
            columns.iter().zip(&weights).flat_map(|(column, w)| column.iter().map(move |value| w * value)).collect()
        };
        let residual = DVector::from_vec(weighted(&missing));
        let mut columns = DMatrix::zeros(residual.len(), unknowns);
        let mut scale = vec![0.0; unknowns];
        for i in 0..unknowns {
            // The torques are linear in most of them: a large step loses no digits.
            let by = 1e-2 * z[i].abs().max(1e-2);
            let mut moved = z.clone();
            moved[i] += by;
            let column = (DVector::from_vec(weighted(&motion.missing(model, &moved, true))) - &residual) / by;
            scale[i] = column.norm().max(f64::MIN_POSITIVE);
            columns.set_column(i, &(column / scale[i]));
        }
        let svd = columns.svd(true, true);
        let least = LEAST_SHARE.sqrt() * svd.singular_values.max();
        let Ok(step) = svd.solve(&residual, least) else { break };
        let promised = step.norm() / residual.norm().max(f64::MIN_POSITIVE);
        for (z, (step, scale)) in z.iter_mut().zip(step.iter().zip(&scale)) {
            *z -= step / scale;
        }
        if let Some(v_t) = &svd.v_t {
            let seen = svd.singular_values.map(|s| if s > least { 1.0 / (s * s) } else { 0.0 });
            let inverse = v_t.transpose() * DMatrix::from_diagonal(&seen) * v_t;
            covariance = DMatrix::from_fn(unknowns, unknowns, |i, j| inverse[(i, j)] / (scale[i] * scale[j]));
        }
        if promised < 1e-9 {
            break;
        }
    }
    Identified { z, covariance }
}
