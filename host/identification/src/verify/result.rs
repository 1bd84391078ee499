//! The result of `host verify`, as other programs read it.

use std::path::PathBuf;

use serde::{Deserialize, Serialize};

use super::metrics::ChannelError;
use super::stage::StageKind;
use crate::calibrate::Preset;

/// How well a calibrated model predicts a recording.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Verification {
    /// The robot.
    pub robot: String,
    /// Assumptions of the calibration; `paper` predicts by Euler steps.
    pub preset: Preset,
    /// Effects that extend the model.
    pub extensions: Vec<String>,
    /// What was predicted.
    pub recording: RecordingVerified,
    /// The paper's 5.2.
    pub free_run: FreeRunResult,
    /// The filter that the windows start from.
    pub filter: FilterResult,
    /// Windowed predictions, by horizon.
    pub horizons: Vec<HorizonResult>,
    /// Whether the model predicts this motion at all.
    #[serde(default)]
    pub status: Fit,
    /// What it does not predict, in sentences.
    #[serde(default)]
    pub misfit: Vec<String>,
}

/// Whether a model predicts a motion.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Fit {
    /// Every channel better than its own mean does, half a second ahead and less.
    #[default]
    Fits,
    /// Not so.
    DoesNotFit,
}

/// Horizons up to here have to be predicted, s: so far ahead a controller looks.
const HAS_TO_PREDICT_S: f64 = 0.5;
/// A channel that varies by less than so many standard deviations of its sensor tells nothing of a model.
const VARIES_SIGMA: f64 = 10.0;

impl ChannelError {
    /// Whether the model predicts a channel that varies no better than its mean does.
    fn is_missed(&self) -> bool {
        let spread_sigma = self.rmse_sigma / self.nrmse;
        self.count > 0 && (!self.rmse.is_finite() || self.nrmse >= 1.0 && spread_sigma >= VARIES_SIGMA)
    }
}

/// The recording that was predicted.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RecordingVerified {
    /// Its file.
    pub path: PathBuf,
    /// SHA-256 of the file.
    pub sha256: String,
    /// Whether the model was calibrated on it: then the figures say how well it fits, not how well it predicts.
    pub calibrated_on: bool,
    /// Samples.
    pub samples: usize,
    /// Places where ticks are missing.
    pub gaps: usize,
    /// Ticks that are missing.
    pub missing_ticks: u64,
    /// From the first to the last sample, s.
    pub duration_s: f64,
}

/// Where the first state of the free run comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FirstState {
    /// The calibration estimated it with the parameters, as in the paper.
    Calibrated,
    /// The robot at rest: mean encoder readings before the first input, relaxed transmissions, no speed.
    Rest,
    /// The filter's state once it has settled: the recording starts in motion.
    Filter,
}

/// The model run from one state over the whole recording with the recorded input.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FreeRunResult {
    /// Where its first state comes from.
    pub first_state: FirstState,
    /// The pieces it falls into: it starts again after every gap, from what the filter knows there.
    pub pieces: usize,
    /// Samples that no piece predicts, between a gap (or the start) and the filter's settling.
    pub left_out: usize,
    /// Error of every channel over all pieces.
    pub channels: Vec<ChannelError>,
    /// The same by stage of the motion.
    pub stages: Vec<StageResult>,
}

/// A stage of the motion.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct StageResult {
    /// What moves.
    pub kind: StageKind,
    /// Name for people.
    pub label: String,
    /// The joints that move, by name.
    pub joints: Vec<String>,
    /// Largest |input|.
    pub peak_input: f64,
    /// Its first sample, s after the first one of the recording.
    pub from_s: f64,
    /// Its last sample, s after the first one of the recording.
    pub to_s: f64,
    /// Error of every channel of the free run.
    pub channels: Vec<ChannelError>,
}

/// How the forward filter did.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FilterResult {
    /// Standard deviation of the random change of each velocity in one period that makes the readings most likely,
    /// rad/s (m/s): how far a step of the model is off.
    pub velocity_sigma: f64,
    /// Mean of (difference to the one-step prediction)² over its predicted variance; 1 if the filter knows its own
    /// uncertainty.
    pub mean_nis: f64,
    /// Gaps after which it had to start anew.
    pub restarts: usize,
}

/// Predictions over windows of one length.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct HorizonResult {
    /// From the window's start to the comparison, s.
    pub horizon_s: f64,
    /// Windows compared.
    pub windows: usize,
    /// Windows left out because a gap touches them.
    pub touching_gap: usize,
    /// Error of every channel at the window's end.
    pub channels: Vec<ChannelError>,
}

impl Verification {
    /// Sets the status by the channels whose mean is as good a prediction as the model's.
    pub(super) fn judge(&mut self) {
        let horizons = self.horizons.iter().filter(|horizon| horizon.horizon_s <= HAS_TO_PREDICT_S);
        let of_horizon = |horizon: &HorizonResult| -> Vec<String> {
            let missed = horizon.channels.iter().filter(|channel| channel.is_missed());
            let ahead_ms = 1e3 * horizon.horizon_s;
            let sentence = |c: &ChannelError| match c.rmse.is_finite() {
                true => format!(
                    "{} is predicted {ahead_ms:.0} ms ahead to {:.2e} {}, {:.1} times as badly as by its mean",
                    c.channel, c.rmse, c.unit, c.nrmse
                ),
                false => format!("{} is predicted {ahead_ms:.0} ms ahead by no number", c.channel),
            };
            missed.map(sentence).collect()
        };
        self.misfit = horizons.map(of_horizon).find(|sentences| !sentences.is_empty()).unwrap_or_default();
        self.status = if self.misfit.is_empty() { Fit::Fits } else { Fit::DoesNotFit };
    }

    /// The result for a horizon, if it was asked for.
    pub fn horizon(&self, horizon_s: f64) -> Option<&HorizonResult> {
        self.horizons.iter().find(|h| (h.horizon_s - horizon_s).abs() < 1e-9)
    }
}

impl HorizonResult {
    /// The channel that is predicted worst in terms of its sensor's noise; `None` without any window.
    pub fn worst(&self) -> Option<&ChannelError> {
        let compared = self.channels.iter().filter(|c| c.count > 0);
        compared.max_by(|a, b| a.rmse_sigma.total_cmp(&b.rmse_sigma))
    }
}
