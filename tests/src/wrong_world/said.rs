//! Reading a diagnosis from JSON. Fields that a version does not have are absent from the outcome.

use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::family::Family;

/// How a finding compares with the truth.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Standing {
    /// The main effect or an equivalent of it.
    Main,
    /// A trace effect, or an equivalent of one.
    Trace,
    /// An error of the robot file that every robot of the family has.
    File,
    /// None of these: a false name.
    False,
}

/// A finding.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Finding {
    /// Id in the catalogue.
    pub effect: String,
    /// Joints, 1-based.
    pub axes: Vec<usize>,
    /// How it compares with the truth.
    pub standing: Standing,
    /// Gain on held-out data, where the version reports it: share, then the ends of its 95 % interval.
    pub holdout: Option<[f64; 3]>,
    /// Number of blocks of that interval.
    pub blocks: Option<u64>,
    /// Flags of the finding.
    pub flags: Vec<String>,
}

/// The joint gain of all findings on held-out data.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Whole {
    /// Share of the prediction error.
    pub share: f64,
    /// Its interval.
    pub ci95: Option<[f64; 2]>,
}

/// Horizon of the gains that are averaged where a version reports gains by channel, s.
const HORIZON_S: f64 = 0.5;

/// Whether two names mean the same on robots of a family.
pub fn same(family: Family, a: &str, b: &str) -> bool {
    a == b || family.classes().iter().any(|class| class.contains(&a) && class.contains(&b))
}

/// The findings, in their order.
pub fn findings(said: &Value, standing: impl Fn(&str) -> Standing) -> Vec<Finding> {
    let read = |finding: &Value| {
        let effect = finding["effect"].as_str().unwrap_or_default().to_owned();
        let axes = list(&finding["axes"]).iter().filter_map(|axis| axis.as_u64().map(|axis| axis as usize)).collect();
        let gain = &finding["holdout_gain"];
        let flags = list(&finding["flags"]).iter().filter_map(|flag| flag.as_str().map(str::to_owned)).collect();
        Finding {
            standing: standing(&effect),
            axes,
            holdout: interval(gain).and_then(|[low, high]| Some([gain["share"].as_f64()?, low, high])),
            blocks: gain["blocks"].as_u64(),
            flags,
            effect,
        }
    };
    list(&said["findings"]).iter().map(read).collect()
}

/// The joint gain on held-out data; in older versions, the mean gain over the channels half a second ahead.
pub fn whole(said: &Value) -> Option<Whole> {
    let joint = &said["holdout"];
    if let Some(share) = joint["share"].as_f64() {
        return Some(Whole { share, ci95: interval(joint) });
    }
    let channels = list(&said["findings"]).iter().flat_map(|finding| list(&finding["gain"]));
    let of_horizon = channels.filter(|gain| gain["horizon_s"].as_f64() == Some(HORIZON_S));
    // Sensors with several axes are listed beside their axes; the mean is over all entries.
    let gains: Vec<f64> = of_horizon.filter_map(|gain| gain["gain"].as_f64()).collect();
    (!gains.is_empty()).then(|| Whole { share: gains.iter().sum::<f64>() / gains.len() as f64, ci95: None })
}

/// Whether held-out predictions got worse: the 95 % interval lies below zero, or, without an interval, the mean does.
pub fn is_harmed(findings: &[Finding], whole: Option<&Whole>) -> bool {
    let surely_worse = findings.iter().any(|finding| finding.holdout.is_some_and(|[_, _, high]| high < 0.0));
    surely_worse || whole.is_some_and(|whole| whole.ci95.map_or(whole.share, |[_, high]| high) < 0.0)
}

/// An estimate and its interval.
#[derive(Debug, Clone, PartialEq)]
pub struct Estimated {
    /// Of the diagnosis.
    pub estimate: f64,
    /// Its interval, where there is one.
    pub ci95: Option<[f64; 2]>,
}

/// The estimate of a finding's parameter.
pub fn estimated(said: &Value, name: &str) -> Option<Estimated> {
    let parameters = list(&said["findings"]).iter().flat_map(|finding| list(&finding["parameters"]));
    let found = parameters.into_iter().find(|parameter| parameter["name"].as_str() == Some(name))?;
    Some(Estimated { estimate: found["estimate"].as_f64()?, ci95: interval(found) })
}

/// Ids of the rejected effects.
pub fn rejected(said: &Value) -> Vec<String> {
    list(&said["rejected"]).iter().filter_map(|one| one["effect"].as_str().map(str::to_owned)).collect()
}

/// Row, joint and argument of the largest unexplained defect.
pub fn place(said: &Value) -> Option<(String, Option<u64>, String)> {
    let place = list(&said["unexplained"]["where"]).first()?;
    let text = |field: &str| place[field].as_str().map(str::to_owned);
    Some((text("row")?, place["axis"].as_u64(), text("argument").unwrap_or_default()))
}

fn list(value: &Value) -> &[Value] {
    value.as_array().map_or(&[], Vec::as_slice)
}

fn interval(value: &Value) -> Option<[f64; 2]> {
    let ends = list(&value["ci95"]);
    Some([ends.first()?.as_f64()?, ends.get(1)?.as_f64()?])
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn both_versions_of_a_result_are_understood() {
        let older = json!({"findings": [{"effect": "cogging", "axes": [2], "gain": [
            {"horizon_s": 0.5, "channel": "encoder1", "gain": -0.4, "ci95": [-0.5, -0.2]},
            {"horizon_s": 0.1, "channel": "encoder1", "gain": 0.9, "ci95": [0.8, 0.95]},
        ]}]});
        let newer = json!({
            "findings": [{"effect": "cogging", "axes": [2], "holdout_gain": {"share": 0.3, "ci95": [0.1, 0.4], "blocks": 20}, "flags": ["implausible"]}],
            "holdout": {"share": 0.3, "ci95": [0.1, 0.4], "blocks": 20},
            "rejected": [{"effect": "stribeck", "why": "predicts worse"}],
        });
        let read = |said: &Value| {
            let findings = findings(said, |_| Standing::False);
            let whole = whole(said);
            (is_harmed(&findings, whole.as_ref()), findings)
        };
        let (harmed, found) = read(&older);
        assert!(harmed && found[0].axes == [2] && found[0].holdout.is_none());
        let (harmed, found) = read(&newer);
        assert!(!harmed && found[0].holdout == Some([0.3, 0.1, 0.4]) && found[0].blocks == Some(20));
        assert_eq!(found[0].flags, ["implausible"]);
        assert_eq!(rejected(&newer), ["stribeck"]);
    }
}
