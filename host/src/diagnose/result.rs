//! DIAG.json: what a diagnosis found, as other programs read it.

use serde::{Deserialize, Serialize};

use super::bootstrap::Gain;
use crate::calibrate::{Calibration, ParameterEstimate};
use crate::effect::Row;

/// The answer in one word.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// Nothing that the data could show is wrong.
    None,
    /// At least one cause is named.
    Named,
    /// Something is wrong and no law of the catalogue explains it.
    Unknown,
    /// Something is wrong, and this motion cannot tell which of several laws explains it.
    NotSeparable,
}

/// The result of a diagnosis.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Diagnosis {
    /// The answer in one word.
    pub verdict: Verdict,
    /// The answer in one sentence.
    pub summary: String,
    /// What was accepted, in that order; each is in the extended model.
    pub findings: Vec<Finding>,
    /// What is left over.
    pub unexplained: Unexplained,
    /// What the data cannot show, whatever is wrong.
    pub not_testable: Vec<NotTestable>,
    /// Every candidate on the base model.
    pub scan: Vec<Candidate>,
    /// From which score on a candidate is no chance.
    pub threshold_p: f64,
    /// What the base model misses as curves, best first: the picture of the defect, whatever its name.
    pub curves: Vec<Picture>,
    /// The recording that the gain was measured on; `null`: the last third of the first, which was held out.
    pub holdout: Option<String>,
    /// The calibration of the base model.
    pub base: Calibration,
    /// The calibration with all findings; the base's where there are none.
    pub extended: Calibration,
}

/// An accepted cause.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Finding {
    /// Id in the catalogue.
    pub effect: String,
    /// Joints whose equation or encoder is concerned, 1-based; empty where no joint is.
    pub axes: Vec<usize>,
    /// Which equation it stands in.
    pub row: Row,
    /// Twice the log-likelihood that it gains, refitted.
    pub score: f64,
    /// Share of noise that would bring any finding of the catalogue this far.
    pub p_value: f64,
    /// Its share of what the base model leaves unexplained: what is lost when it alone is dropped.
    pub explained_excess: f64,
    /// Whether less than a twentieth of its own part is left for a shapeless curve to explain.
    pub shape_final: bool,
    /// Its parameters.
    pub parameters: Vec<ParameterEstimate>,
    /// Ids that this motion cannot tell from it.
    pub aliases: Vec<String>,
    /// What else was refitted in its place.
    pub rivals: Vec<Rival>,
    /// What the extended model brings on another motion, by horizon and channel.
    pub gain: Vec<ChannelGain>,
}

/// A law that was tried in the place of a finding.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Rival {
    /// Id in the catalogue.
    pub effect: String,
    /// Joints.
    pub axes: Vec<usize>,
    /// Twice the log-likelihood that it gains, refitted.
    pub score: f64,
}

/// The gain of predictions over one horizon on one channel.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ChannelGain {
    /// How far ahead, s.
    pub horizon_s: f64,
    /// Channel, or the sensor of several (`gyro2`).
    pub channel: String,
    /// Errors before and after, in the channel's unit.
    #[serde(flatten)]
    pub gain: Gain,
}

/// What the extended model leaves over.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Unexplained {
    /// Share of the base model's excess over pure noise.
    pub excess: f64,
    /// Where it is: the joints of the best curve first.
    #[serde(rename = "where")]
    pub places: Vec<Defect>,
}

/// A place where a shapeless curve still finds something.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Defect {
    /// Which equation.
    pub row: Row,
    /// Joint, 1-based; `null` where no joint is concerned.
    pub axis: Option<usize>,
    /// What the defect is a function of: `motor_speed`, `motor_phase`, `windup`, `link_angle` …
    pub argument: String,
    /// Share of the base model's excess that such a curve explains.
    pub share: f64,
}

/// A curve that the base model misses.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Picture {
    /// Which equation.
    pub row: Row,
    /// Joint, 1-based.
    pub axis: usize,
    /// What it is a function of.
    pub argument: String,
    /// The argument's unit.
    pub argument_unit: String,
    /// Values of the argument.
    pub at: Vec<f64>,
    /// The torque that is missing there, N m (N), less its mean.
    pub torque: Vec<f64>,
    /// Twice the log-likelihood that all joints' curves of this argument gain.
    pub score: f64,
}

/// An effect that the data cannot show.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct NotTestable {
    /// Id in the catalogue.
    pub effect: String,
    /// Why.
    pub why: String,
}

/// One entry of the scan.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Candidate {
    /// Id in the catalogue.
    pub effect: String,
    /// Joints.
    pub axes: Vec<usize>,
    /// Twice the log-likelihood that it promises.
    pub score: f64,
    /// Share of noise that would bring any candidate this far.
    pub p_value: f64,
    /// By how much base parameters and states that follow reduce its information: 1 when it is independent of them.
    pub vif: Option<f64>,
}
