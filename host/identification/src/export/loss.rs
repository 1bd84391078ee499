//! What a file keeps of the model, and what not.

use crate::effect::Effect;

use super::Exported;
use super::xml::comment;

/// What becomes of a part of the model in a file.
#[derive(Debug, Clone, PartialEq)]
pub struct Loss {
    /// The part: an id of the catalogue, or what the base model calls it.
    pub part: String,
    /// How it is kept.
    pub kept: Kept,
    /// How, and what it costs.
    pub how: String,
}

/// How a part of the model is kept.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kept {
    /// As it is.
    Exact,
    /// With an error that is told.
    Approximate,
    /// Not at all.
    Lost,
}

impl Kept {
    fn word(self) -> &'static str {
        match self {
            Kept::Exact => "exact",
            Kept::Approximate => "approximate",
            Kept::Lost => "lost",
        }
    }
}

impl Loss {
    /// Kept as it is.
    pub fn exact(part: &str, how: impl Into<String>) -> Self {
        Loss { part: part.to_owned(), kept: Kept::Exact, how: how.into() }
    }

    /// Kept with an error.
    pub fn approximate(part: &str, how: impl Into<String>) -> Self {
        Loss { part: part.to_owned(), kept: Kept::Approximate, how: how.into() }
    }

    /// Not kept.
    pub fn lost(part: &str, how: impl Into<String>) -> Self {
        Loss { part: part.to_owned(), kept: Kept::Lost, how: how.into() }
    }
}

impl std::fmt::Display for Loss {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{:<12} {}: {}", self.kept.word(), self.part, self.how)
    }
}

/// What programs in C and Rust keep.
pub(super) fn of_programs(exported: &Exported<'_>) -> Vec<Loss> {
    let model = exported.calibrated.model();
    let mut losses = vec![
        Loss::exact("chain, drives, friction, sensors", "the model's own equations, in all parameters"),
        Loss::exact(
            "integration",
            "a step is the estimator's; into how many parts friction divides it follows from the calibrated parameters",
        ),
    ];
    for id in &exported.calibration.extensions {
        let loss = match id.as_str() {
            "input_delay" => {
                let late_s = model.input_delay().map_or(0.0, |delay| exported.calibrated.z()[delay]);
                Loss::lost(id, format!("u is the input as it acts: give what was commanded {late_s} s before"))
            }
            "integrator_error" => Loss::exact(id, "a step is one of explicit Euler"),
            "encoder_lag" => Loss::approximate(id, "by the speed: a reading is the position less T times the speed"),
            _ if model.lags().next().is_some() && id == "gyro_lag" => {
                Loss::exact(id, "with three states a gyro, which a step carries exactly")
            }
            _ => Loss::exact(id, title(id)),
        };
        losses.push(loss);
    }
    if model.has_gyro_lags() {
        let z = exported.calibrated.z();
        let lags = (0..exported.calibrated.robot().gyros().count()).map(|gyro| model.gyro_lag(gyro, z).0.to_string());
        let told = format!(
            "gyros are those of the moment itself; a real one is {} s later beside what the device tells",
            lags.collect::<Vec<_>>().join(" and ")
        );
        losses.push(Loss::lost("lag of the gyros", told));
    }
    losses.push(Loss::exact("noise of sensors", "standard deviations in a table; readings are without noise"));
    losses.push(Loss::lost("process noise", "a step is without noise; its size stands in the calibration"));
    let covariance = &exported.calibration.covariance;
    losses.push(match covariance.matrix.is_empty() {
        true => Loss::lost("covariance of the parameters", "the calibration has none"),
        false => Loss::exact("covariance of the parameters", "in a table; zero where one is not determined"),
    });
    losses
}

/// What an effect is, in a few words.
pub(super) fn title(id: &str) -> String {
    Effect::by_id(id).map_or_else(|_| "an effect of this calibration".to_owned(), |effect| effect.title.to_owned())
}

/// The head of an XML file, inside a comment: where it comes from, what it keeps, and what the recordings did not identify.
pub(super) fn xml_head(exported: &Exported<'_>, losses: &[Loss]) -> String {
    let unknown: Vec<_> = exported.parameters.iter().filter(|p| p.std_error.is_none()).map(|p| &*p.name).collect();
    let mut lines = exported.origin();
    lines.push("What this file keeps of the model:".to_owned());
    lines.extend(losses.iter().map(|loss| format!("  {loss}")));
    if !unknown.is_empty() {
        lines.push(format!("NOT IDENTIFIED by the recordings: {}", unknown.join(", ")));
    }
    lines.iter().map(|line| format!("  {}\n", comment(line))).collect()
}
