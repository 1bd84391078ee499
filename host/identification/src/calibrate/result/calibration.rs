//! CAL.json: the result of a calibration, as other programs read it.

use serde::{Deserialize, Serialize};

use crate::calibrate::identifiability::observability::Unobservable;
use crate::calibrate::residuals::preset::{NoiseSource, Preset};

/// How a calibration ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Status {
    /// The cost changed by less than 1e-9 of itself.
    Converged,
    /// No further step helps, and little is left to gain.
    Almost,
    /// No further step helps, though one should.
    NoProgress,
    /// The iterations were used up.
    IterationLimit,
    /// Converged, but the motion does not determine some parameters; see `unobservable`.
    Unidentifiable,
    /// Converged, but not to a robot that these recordings are of; see `misfit`.
    DoesNotFit,
}

impl Status {
    /// Whether the estimates may be used.
    pub fn is_usable(self) -> bool {
        matches!(self, Status::Converged | Status::Almost | Status::Unidentifiable)
    }
}

/// The result of a calibration.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Calibration {
    /// Name of the robot.
    pub robot: String,
    /// The description that was used, as TOML, so that the result stands alone.
    pub robot_toml: String,
    /// Assumptions.
    pub preset: Preset,
    /// Where the noise comes from.
    pub noise_source: NoiseSource,
    /// Ids of effects that extend the base model.
    pub extensions: Vec<String>,
    /// What was calibrated on.
    pub recordings: Vec<RecordingUsed>,
    /// How it ended.
    pub status: Status,
    /// Steps.
    pub iterations: usize,
    /// How many of them went by a factor of their own; 0 where an earlier version has not counted them.
    #[serde(default)]
    pub factorisations: usize,
    /// ½ Σ r² at the estimate.
    pub cost: f64,
    /// Rows less unknowns.
    pub dof: f64,
    /// Where the time went.
    pub seconds: Seconds,
    /// Every free parameter.
    pub parameters: Vec<ParameterEstimate>,
    /// How the errors of the estimates belong together.
    pub covariance: Covariance,
    /// Pairs of parameters whose errors are nearly one, largest correlation first.
    pub correlations: Vec<Correlation>,
    /// What the data cannot show; held at its start value.
    pub unobservable: Vec<Unobservable>,
    /// Matrices that take body axes to sensor axes, by gyro (`imu1` …), by rows.
    pub rotations: std::collections::BTreeMap<String, [[f64; 3]; 3]>,
    /// Noise of each channel and of each state component's step, and how the residuals compare with it.
    pub noise: Vec<ChannelNoise>,
    /// How well the smoothed states fit each channel.
    pub fit: Vec<ChannelFit>,
    /// What does not fit, in sentences.
    #[serde(default)]
    pub misfit: Vec<String>,
    /// What else a reader of the result should know, in sentences.
    #[serde(default)]
    pub notes: Vec<String>,
    /// Times at which a measured input misses far more than it does otherwise.
    #[serde(default)]
    pub pushes: Vec<Push>,
    /// How residuals scatter between blocks of time; none where there are too few blocks.
    #[serde(default)]
    pub scatter: Option<BlockScatter>,
    /// The estimated first state of each recording, in the order (q, q̇, θ, θ̇): x₀ of the paper's section 5.2.
    pub first_states: Vec<Vec<f64>>,
}

/// A time at which a measured input misses far more than it does otherwise.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Push {
    /// In which recording, 1-based.
    pub recording: usize,
    /// At which joint, 1-based.
    pub joint: usize,
    /// First and last sample, s since the start of the recording.
    pub from_s: f64,
    /// See `from_s`.
    pub to_s: f64,
    /// What acted beyond what was measured, in the input's unit: the mean over these samples.
    pub mean: f64,
}

/// How residuals scatter between blocks of time.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct BlockScatter {
    /// Blocks.
    pub blocks: usize,
    /// Variance of the blocks' scores over that of white residuals, mean over all parameters.
    pub ratio: f64,
    /// Whether it is more than white residuals have: standard errors are then those of the scatter.
    pub coloured: bool,
}

/// A recording that went into a calibration.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RecordingUsed {
    /// Its file.
    pub path: String,
    /// SHA-256 of the file.
    pub sha256: String,
    /// Samples.
    pub samples: usize,
    /// Places where ticks are missing: the chain breaks there.
    pub gaps: usize,
    /// Ticks that are missing.
    pub missing_ticks: u64,
}

/// Seconds spent.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Seconds {
    /// First guess of the states.
    pub start: f64,
    /// Estimating the noise.
    pub noise: f64,
    /// Residuals with their derivatives.
    pub linearise: f64,
    /// Eliminating the states.
    pub factor: f64,
    /// Trial steps.
    pub solve: f64,
    /// Everything, results included.
    pub total: f64,
}

/// Covariance of the identifiable parameters.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Covariance {
    /// Their names, in the order of the results.
    pub parameters: Vec<String>,
    /// By rows, in the product of the parameters' units. Empty where the information matrix is singular.
    pub matrix: Vec<Vec<f64>>,
}

/// Two parameters whose errors go together.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Correlation {
    /// Their names.
    pub parameters: [String; 2],
    /// −1 to 1.
    pub correlation: f64,
}

impl Covariance {
    /// Pairs whose correlation is at least `least` in size, the largest first.
    pub fn correlations(&self, least: f64) -> Vec<Correlation> {
        let mut pairs = Vec::new();
        for (i, row) in self.matrix.iter().enumerate() {
            for (j, covariance) in row.iter().enumerate().take(i) {
                let correlation = covariance / (row[i] * self.matrix[j][j]).sqrt();
                if correlation.abs() >= least {
                    let parameters = [self.parameters[j].clone(), self.parameters[i].clone()];
                    pairs.push(Correlation { parameters, correlation });
                }
            }
        }
        pairs.sort_by(|a, b| b.correlation.abs().total_cmp(&a.correlation.abs()));
        pairs
    }
}

/// One parameter. Without an identifiable estimate there is no interval.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ParameterEstimate {
    /// Name, as `k_s[2]`.
    pub name: String,
    /// Unit.
    pub unit: String,
    /// Start value.
    pub initial: f64,
    /// Estimate.
    pub estimate: f64,
    /// Standard error; null where not identifiable.
    pub std_error: Option<f64>,
    /// 95 % interval; null where not identifiable.
    pub ci95: Option<[f64; 2]>,
    /// Whether the data determine it.
    pub identifiable: bool,
}

/// Noise of a channel, or of a state component's step.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ChannelNoise {
    /// Channel, as `gyro1.x`; then `process.qd[2]`: what one step of the model misses of q̇ of joint 2.
    pub channel: String,
    /// Unit.
    pub unit: String,
    /// Standard deviation that the rows were weighted by.
    pub sigma: f64,
    /// What an estimate could not fall below: the integrator's own error, for steps. Null where nothing was estimated.
    pub floor: Option<f64>,
    /// Degrees of freedom that a row has: the share of a residual that the states do not follow. Null where there is no row.
    pub freedom: Option<f64>,
    /// Σ (r/σ)² over the degrees of freedom; about 1 when σ is right. Null where the preset makes no row of this channel.
    pub chi2_per_dof: Option<f64>,
    /// Readings that were left out as outliers.
    #[serde(default)]
    pub left_out: usize,
}

/// Fit of a channel.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ChannelFit {
    /// Channel.
    pub channel: String,
    /// Root mean square of the residual, in the channel's unit. Null where the preset makes no row of this channel.
    pub rms: Option<f64>,
    /// The same as a share of the channel's standard deviation.
    pub nrmse: Option<f64>,
}

impl Calibration {
    /// The estimate of a parameter by name.
    pub fn parameter(&self, name: &str) -> Option<&ParameterEstimate> {
        self.parameters.iter().find(|parameter| parameter.name == name)
    }
}
