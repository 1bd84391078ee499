//! DIAG.json: what a diagnosis found, as other programs read it.

use serde::{Deserialize, Serialize};

use super::interval::Gain;
use super::scores::stability::Stability;
use crate::calibrate::{Calibration, ParameterEstimate};
use crate::effect::Row;

/// The answer in one word.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// The base model fits: nothing that the data could show is wrong.
    None,
    /// At least one cause is supported by data that no fit has seen.
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
    /// Whether the base model fits at all, and how far ahead it can see.
    pub base_fit: BaseFit,
    /// What was accepted, in that order; each is in the extended model.
    pub findings: Vec<Finding>,
    /// What looked like a cause and is none, with the reason.
    pub rejected: Vec<Rejected>,
    /// What all findings together bring on the motion that no fit has seen.
    pub holdout_gain: Option<HoldoutGain>,
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
    /// Twice the log-likelihood of other blocks that it gained when it came in.
    pub score: f64,
    /// Share of worlds without any effect in which any law of the catalogue comes this far, by the scatter between blocks.
    pub p_value: f64,
    /// Its share of what the base model leaves unexplained: what blocks lose out of sample when it alone is dropped.
    pub explained_excess: f64,
    /// The same with its interval between blocks.
    pub cv_gain: Gain,
    /// What it brings on the motion that no fit has seen: the joint gain of all channels and horizons, against the model without it.
    pub holdout_gain: Option<Gain>,
    /// Its out-of-sample gain as a share of what it and the best curve on the same row gain together.
    pub coverage: f64,
    /// Whether blocks of time agree on its size.
    pub stability: Option<Stability>,
    /// Its weight among the laws that could stand for it.
    pub weight: f64,
    /// What a reader has to know beside the name.
    pub flags: Vec<Flag>,
    /// What it most likely is where its size is implausible.
    pub acts_like: Option<String>,
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

/// What a reader has to know beside a name.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Flag {
    /// A size is more than three standard deviations (on the logarithmic scale) beyond what is typical.
    Implausible,
    /// A size is at the end of what a robot can have.
    AtBoundary,
    /// It has parameters that are others in each recording.
    OwnPhase,
    /// It happened once: no other block can know of it.
    SingleEvent,
    /// Blocks of time do not agree on its size.
    NotConstant,
    /// A channel is predicted worse beside a joint gain.
    ChannelWorse,
    /// The other motion does not decide: the interval of its gain holds zero.
    NotShownByHoldout,
}

impl Flag {
    /// In words.
    pub fn words(self) -> &'static str {
        match self {
            Flag::Implausible => "its size is implausible",
            Flag::AtBoundary => "its size is at the end of what a robot can have",
            Flag::OwnPhase => "it has parameters that are others in each recording",
            Flag::SingleEvent => "it happened once, so that no other part of the recording can confirm it",
            Flag::NotConstant => "parts of the recording do not agree on its size",
            Flag::ChannelWorse => "some sensor is predicted worse beside the joint gain",
            Flag::NotShownByHoldout => "the other motion does not confirm it",
        }
    }
}

/// Whether the base model fits.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct BaseFit {
    /// Whether predictions are at the sensors' own noise, or nothing on any row gains anything out of sample.
    pub fits: bool,
    /// Of every channel, and of the steps of every state component that is estimated: χ² per degree of freedom of the base calibration.
    pub chi2_per_dof: Vec<ChannelFit>,
    /// Of every sensor: root mean square of predictions 500 ms ahead, in standard deviations of the sensor.
    pub ahead_500ms_sigma: Vec<ChannelFit>,
    /// In words.
    pub sentence: String,
}

/// A figure of a channel.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ChannelFit {
    /// The channel.
    pub channel: String,
    /// Its figure.
    pub value: f64,
}

/// What looked like a cause and is none.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Rejected {
    /// Id in the catalogue.
    pub effect: String,
    /// Joints.
    pub axes: Vec<usize>,
    /// Why it is none.
    pub why: String,
}

/// The joint gain of all findings on the motion that no fit has seen.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct HoldoutGain {
    /// Of all sensors and horizons: the share.
    pub share: f64,
    /// Its 95 % interval; none of fewer blocks than an interval takes.
    pub ci95: Option<[f64; 2]>,
    /// How many blocks it is of.
    pub blocks: usize,
    /// Of all sensors, by horizon.
    pub by_horizon: Vec<HorizonGain>,
    /// Errors over time, before and after, 500 ms ahead.
    pub over_time: Vec<OverTime>,
}

/// The joint gain of all sensors over one horizon.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct HorizonGain {
    /// How far ahead, s.
    pub horizon_s: f64,
    /// The gain: its share.
    pub share: f64,
    /// Its 95 % interval.
    pub ci95: Option<[f64; 2]>,
    /// How many blocks it is of.
    pub blocks: usize,
}

impl HoldoutGain {
    /// The joint gain of all sensors and horizons.
    pub fn joint(&self) -> Gain {
        Gain { share: self.share, ci95: self.ci95, blocks: self.blocks }
    }
}

impl HorizonGain {
    /// The gain over one horizon.
    pub fn of(horizon_s: f64, gain: Gain) -> Self {
        let Gain { share, ci95, blocks } = gain;
        HorizonGain { horizon_s, share, ci95, blocks }
    }

    /// The joint gain of all sensors.
    pub fn gain(&self) -> Gain {
        Gain { share: self.share, ci95: self.ci95, blocks: self.blocks }
    }
}

/// Measured against predicted half a second ahead, of one channel on the motion that no fit has seen.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct OverTime {
    /// The channel.
    pub channel: String,
    /// Its unit.
    pub unit: String,
    /// When it was measured, s after the start.
    pub t_s: Vec<f64>,
    /// Measured.
    pub measured: Vec<f64>,
    /// Predicted by the base model.
    pub base: Vec<f64>,
    /// Predicted by the extended model.
    pub extended: Vec<f64>,
}

/// A law that was tried in the place of a finding.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Rival {
    /// Id in the catalogue.
    pub effect: String,
    /// Joints.
    pub axes: Vec<usize>,
    /// Twice the log-likelihood of other blocks that it gains, refitted.
    pub score: f64,
    /// Its weight beside the finding's.
    pub weight: f64,
}

/// The gain of predictions over one horizon on one channel.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ChannelGain {
    /// How far ahead, s.
    pub horizon_s: f64,
    /// Channel, or the sensor of several (`gyro2`).
    pub channel: String,
    /// Root mean square of the base model's errors, in the channel's unit.
    pub rmse_base: f64,
    /// Of the extended model's.
    pub rmse_extended: f64,
    /// 1 − extended / base.
    pub gain: f64,
    /// Its 95 % interval between blocks; none of too few.
    pub ci95: Option<[f64; 2]>,
}

/// What the extended model leaves over.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Unexplained {
    /// Share of the base model's excess over pure noise that the best curve still explains.
    pub excess: f64,
    /// Of the extended model, half a second ahead on the other motion, in standard deviations of the sensors; empty where nothing was found.
    #[serde(default)]
    pub ahead_500ms_sigma: Vec<ChannelFit>,
    /// Where it is: the joints of the best curve first.
    #[serde(rename = "where")]
    pub places: Vec<Defect>,
}

/// A place where a shapeless curve still finds something, or the steps of the model err most.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Defect {
    /// Which equation.
    pub row: Row,
    /// Joint, 1-based; `null` where no joint is concerned.
    pub axis: Option<usize>,
    /// What the defect is a function of: `motor_speed`, `motor_phase`, `windup`, `link_angle` …; [`Defect::UNKNOWN`] where no curve of one joint's quantities shows it.
    pub argument: String,
    /// Share of the base model's excess that such a curve explains; where none does, share of the squares by which the steps of all equations err.
    pub share: f64,
}

impl Defect {
    /// The argument of a defect that no curve of one joint's quantities shows.
    pub const UNKNOWN: &'static str = "unknown";
}

/// A curve that the base model misses, as a torque or as what a sensor reads.
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
    /// What is missing there, in `unit`, less its mean.
    pub torque: Vec<f64>,
    /// Unit of what is missing: N m or N of a torque row, rad or m of a position sensor.
    pub unit: String,
    /// Twice the log-likelihood of other blocks that all joints' curves of this argument gain.
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
    /// Twice the log-likelihood that its tangent promises.
    pub score: f64,
    /// The same of blocks by what the others say.
    pub cv_score: f64,
    /// Share of worlds without any effect in which any law comes this far, by the scatter between blocks.
    pub p_value: f64,
    /// By how much base parameters and states that follow reduce its information: 1 when it is independent of them.
    pub vif: Option<f64>,
}
