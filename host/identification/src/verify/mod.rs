//! How well a calibrated model predicts a recording: the free run of the paper's section 5.2 and windowed predictions.
//!
//! ```text
//!   CAL.json ─▶ CalibratedModel ─┬─▶ free run from x₀ ──────────────────▶ by stage of the motion     (paper 5.2)
//!   recording ───────────────────┼─▶ filter (forward only) ─▶ windows ──▶ by horizon and channel
//!                                └─▶ stages ────────────────▶ Traces ───▶ the page's plots
//! ```
//!
//! The two answer different questions. In the free run friction decides where the robot stops, so positions drift even
//! under the right model and say little; it is the paper's picture. The windows start from a state that the past alone
//! gives and end before drift takes over: their error in sigmas of the sensor says how good the model is, 1 being the
//! sensor's noise alone.
//!
//! [`torque`] is another question: how well does the model explain the torques of a rigid robot, and what does the recipe of inverse dynamics
//! find on the same recording?
//!
//! [`filter`], [`window`] and [`free_run`] know numbers only ([`system::System`]); [`calibrated`] makes a system of a
//! calibrated robot.

pub mod calibrated;
pub mod filter;
pub mod free_run;
pub mod metrics;
pub mod stage;
pub mod system;
pub mod torque;
pub mod window;

mod result;
mod traces;

#[cfg(test)]
mod tests;

pub use calibrated::CalibratedModel;
pub use metrics::ChannelError;
pub use result::{
    FilterResult, FirstState, Fit, FreeRunResult, HorizonResult, RecordingVerified, StageResult, Verification,
};
pub use traces::Traces;
pub use window::Windows;

use std::ops::Range;

use crate::calibrate::Calibration;
use crate::calibrate::data::instants::of_known_age;
use crate::recording::Recording;
use crate::robot::{ChannelKind, RobotError};
use filter::ProcessNoise;
use free_run::FreeRun;
use metrics::Errors;
use solve::levenberg::Settings;
use stage::Stage;
use system::{Columns, System};

/// The horizons of a verification, s.
pub const HORIZONS_S: [f64; 4] = [0.01, 0.1, 0.5, 2.0];

/// A recording shorter than this has no window at the second horizon once the filter has settled, s.
const SHORTEST_S: f64 = 0.5;

/// Why a recording cannot be predicted.
#[derive(Debug, thiserror::Error)]
pub enum VerifyError {
    /// Another robot.
    #[error(
        "the calibration is of the robot `{calibrated}`, the recording of `{recorded}`: give a recording of the same robot"
    )]
    DifferentRobot {
        /// Of the calibration.
        calibrated: String,
        /// Of the recording.
        recorded: String,
    },
    /// Other sensors, though the robot has the same name.
    #[error(
        "the calibration predicts the channels {calibrated}, the recording holds {recorded}: calibrate with the robot file that the recording was made with"
    )]
    DifferentChannels {
        /// Of the calibration.
        calibrated: String,
        /// Of the recording.
        recorded: String,
    },
    /// Too short to predict anything.
    #[error("the recording is {duration_s:.3} s long, a verification needs at least {SHORTEST_S} s")]
    TooShort {
        /// Its length.
        duration_s: f64,
    },
    /// No estimate of a free parameter.
    #[error("the calibration has no estimate of `{name}`, which its robot lists as free: calibrate again")]
    MissingParameter {
        /// The parameter.
        name: String,
    },
    /// An effect of the calibration.
    #[error("the calibration's effects do not fit its robot: {0}; calibrate again")]
    Effect(#[from] crate::effect::EffectError),
    /// Torques that the recipe cannot work with.
    #[error(transparent)]
    Torque(#[from] torque::TorqueError),
    /// The calibration's extended model.
    #[error("the calibration's model cannot be built: {0}; calibrate again")]
    Model(#[from] crate::model::ModelError),
    /// The robot description inside the calibration.
    #[error("the robot description inside the calibration cannot be read; calibrate again")]
    Robot(#[from] RobotError),
}

/// Predicts `recording` by the model of `calibration`. `step` is told what begins.
///
/// # Errors
/// [`VerifyError`].
pub fn verify(
    calibration: &Calibration,
    recording: &Recording,
    step: impl Fn(&'static str),
) -> Result<(Verification, Traces), VerifyError> {
    let own = calibration.recordings.iter().position(|used| used.sha256 == recording.source.sha256);
    let model = CalibratedModel::of(calibration, own)?;
    let estimated = own.and_then(|i| calibration.first_states.get(i));
    let (mut verification, traces) = predict(&model, recording, estimated.map(Vec::as_slice), step)?;
    verification.preset = calibration.preset;
    verification.extensions.clone_from(&calibration.extensions);
    verification.recording.calibrated_on = own.is_some();
    Ok((verification, traces))
}

/// Predicts `recording` by `model`; the free run starts from `first_state` if there is one.
///
/// # Errors
/// [`VerifyError`].
pub fn predict(
    model: &CalibratedModel,
    recording: &Recording,
    first_state: Option<&[f64]>,
    step: impl Fn(&'static str),
) -> Result<(Verification, Traces), VerifyError> {
    check(model, recording)?;
    let known = of_known_age(recording);
    let recording = known.as_ref();
    let t_s: Vec<f64> = (0..recording.len()).map(|k| recording.motion_time_s(k)).collect();
    let duty = model.inputs_as_they_act(&recording.duty, &recording.segments());
    let columns = columns(recording, &t_s, &duty);
    let system = model.system_of(recording, &t_s);

    step("filtering");
    let track = filter::run(&system, &columns, None);
    step("predicting windows");
    let windows = window::predict(&system, &columns, &track, &HORIZONS_S, Settings::default().threads);
    step("running free");
    let rest = rest_state(model, recording, &columns);
    let (first, origin) = match (first_state.filter(|x| x.len() == system.states()), &rest) {
        (Some(x), _) => (Some(x), FirstState::Calibrated),
        (None, Some(x)) => (Some(x.as_slice()), FirstState::Rest),
        (None, None) => (None, FirstState::Filter),
    };
    let run = free_run::run(&system, &columns, first, &track);
    let stages = stages(model, recording, &columns);

    let channel_errors = |samples: Range<usize>| errors(recording, &run, samples);
    let mut verification = Verification {
        robot: model.robot().name.clone(),
        preset: crate::calibrate::Preset::Default,
        extensions: Vec::new(),
        recording: RecordingVerified {
            path: recording.source.path.clone(),
            sha256: recording.source.sha256.clone(),
            calibrated_on: false,
            samples: recording.len(),
            gaps: recording.gaps(),
            missing_ticks: recording.missing_ticks(),
            duration_s: recording.duration_s(),
        },
        free_run: FreeRunResult {
            first_state: origin,
            pieces: run.pieces.len(),
            left_out: run.left_out,
            channels: channel_errors(0..recording.len()),
            stages: stages
                .iter()
                .map(|stage| StageResult {
                    kind: stage.kind,
                    label: stage.label.clone(),
                    joints: stage.joints.iter().map(|&j| model.robot().joints[j].name.clone()).collect(),
                    peak_input: stage.peak_input,
                    from_s: t_s[stage.samples.start],
                    to_s: t_s[stage.samples.end - 1],
                    channels: channel_errors(stage.samples.clone()),
                })
                .collect(),
        },
        filter: FilterResult {
            velocity_sigma: track.noise.velocity_sigma,
            mean_nis: track.mean_nis,
            restarts: track.restarts,
        },
        horizons: windows
            .iter()
            .map(|windows| HorizonResult {
                horizon_s: windows.horizon_s,
                windows: windows.starts.len(),
                touching_gap: windows.touching_gap,
                channels: of_channels(recording, &windows.sums),
            })
            .collect(),
        status: Fit::Fits,
        misfit: Vec::new(),
    };
    verification.judge();
    let traces = Traces::new(model, recording, t_s, run, stages);
    Ok((verification, traces))
}

/// The windowed predictions of `recording` by `model` over those of [`HORIZONS_S`] that are no longer than `longest_s`, window by window, on so many
/// threads. They come with the process noise of the filter whose states they start from; it is no less than `least`.
///
/// # Errors
/// [`VerifyError`].
pub fn windows(
    model: &CalibratedModel,
    recording: &Recording,
    longest_s: f64,
    least: Option<ProcessNoise>,
    threads: usize,
) -> Result<(Vec<Windows>, ProcessNoise), VerifyError> {
    check(model, recording)?;
    let known = of_known_age(recording);
    let recording = known.as_ref();
    let t_s: Vec<f64> = (0..recording.len()).map(|k| recording.motion_time_s(k)).collect();
    let duty = model.inputs_as_they_act(&recording.duty, &recording.segments());
    let columns = columns(recording, &t_s, &duty);
    let system = model.system_of(recording, &t_s);
    let track = filter::run(&system, &columns, least);
    let count = HORIZONS_S.iter().take_while(|horizon_s| **horizon_s <= longest_s).count();
    Ok((window::predict(&system, &columns, &track, &HORIZONS_S[..count], threads), track.noise))
}

fn columns<'a>(recording: &'a Recording, t_s: &'a [f64], duty: &'a [Vec<f64>]) -> Columns<'a> {
    Columns {
        t_s,
        duty: duty.iter().map(Vec::as_slice).collect(),
        measured: recording.channels.iter().map(|c| c.values.as_slice()).collect(),
        sigma: recording.channels.iter().map(|c| c.spec.sigma).collect(),
        segments: recording.segments(),
        period_s: recording.period_s,
    }
}

pub(crate) fn check(model: &CalibratedModel, recording: &Recording) -> Result<(), VerifyError> {
    let (calibrated, recorded) = (model.robot(), &recording.robot);
    if calibrated.name != recorded.name {
        return Err(VerifyError::DifferentRobot {
            calibrated: calibrated.name.clone(),
            recorded: recorded.name.clone(),
        });
    }
    let kinds = |channels: Vec<crate::robot::Channel>| channels.into_iter().map(|c| c.column).collect::<Vec<_>>();
    let (calibrated, recorded) = (kinds(calibrated.channels()), kinds(recorded.channels()));
    if calibrated != recorded {
        return Err(VerifyError::DifferentChannels { calibrated: calibrated.join(" "), recorded: recorded.join(" ") });
    }
    if recording.duration_s() < SHORTEST_S {
        return Err(VerifyError::TooShort { duration_s: recording.duration_s() });
    }
    Ok(())
}

/// The state before the first input, if the recording has 0.1 s of it without a gap and its encoders stood still.
fn rest_state(model: &CalibratedModel, recording: &Recording, columns: &Columns<'_>) -> Option<Vec<f64>> {
    const SHORTEST_REST_S: f64 = 0.1;
    const STILL_SIGMAS: f64 = 6.0;
    let rest = 0..recording.rest_window().end.min(columns.segments.first()?.end);
    if (rest.len() as f64) * columns.period_s < SHORTEST_REST_S {
        return None;
    }
    let mut readings = vec![f64::NAN; recording.channels.len()];
    for (reading, channel) in readings.iter_mut().zip(&recording.channels) {
        let valid = || channel.values[rest.clone()].iter().copied().filter(|v| v.is_finite());
        let mean = valid().sum::<f64>() / valid().count() as f64;
        *reading = mean;
        let is_position =
            matches!(channel.spec.kind, ChannelKind::MotorPosition { .. } | ChannelKind::LinkPosition { .. });
        if is_position && valid().any(|v| (v - mean).abs() > STILL_SIGMAS * channel.spec.sigma) {
            return None;
        }
    }
    Some(model.rest_state(&readings))
}

/// Stages as the motion's plan names them, if it tells at least three moving ones apart; else from the duty.
fn stages(model: &CalibratedModel, recording: &Recording, columns: &Columns<'_>) -> Vec<Stage> {
    let names: Vec<&str> = model.robot().joints.iter().map(|j| j.name.as_str()).collect();
    if let Some(mut planned) = planned_stages(recording, columns) {
        for stage in &mut planned {
            if let [joint] = stage.joints[..] {
                stage.label = format!("{}: {} moves", stage.label, names[joint]);
            }
        }
        return planned;
    }
    stage::from_duty(&columns.duty, columns.period_s, &names)
}

fn planned_stages(recording: &Recording, columns: &Columns<'_>) -> Option<Vec<Stage>> {
    const FEWEST_MOVING: usize = 3;
    let motion: protocol::motion::Motion = toml::from_str(&recording.motion.as_ref()?.toml).ok()?;
    let label = |phase: &u8| {
        let segment = motion.segments.get(usize::from(*phase))?;
        motion.stages.get(usize::from(segment.stage)).map(|name| &**name)
    };
    let labels: Vec<Option<&str>> = recording.phase.iter().map(label).collect();
    let stages = stage::from_labels(&labels, &columns.duty);
    let moving = stages.iter().filter(|stage| stage.kind != stage::StageKind::Rest).count();
    (moving >= FEWEST_MOVING).then_some(stages)
}

/// Errors of the free run over `samples`, where it predicts them.
fn errors(recording: &Recording, run: &FreeRun, samples: Range<usize>) -> Vec<ChannelError> {
    let mut sums = vec![Errors::default(); recording.channels.len()];
    for piece in &run.pieces {
        for k in piece.start.max(samples.start)..piece.end.min(samples.end) {
            for ((sums, channel), predicted) in sums.iter_mut().zip(&recording.channels).zip(&run.outputs) {
                sums.add(channel.values[k], predicted[k]);
            }
        }
    }
    of_channels(recording, &sums)
}

fn of_channels(recording: &Recording, sums: &[Errors]) -> Vec<ChannelError> {
    let channels = recording.channels.iter().zip(sums);
    channels.map(|(c, sums)| sums.of_channel(&c.spec.name, c.spec.unit, c.spec.sigma)).collect()
}
