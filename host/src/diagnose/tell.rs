//! What a search found as users read it: findings, verdict, places of what is left, pictures of the defect, one sentence.

use super::axes::{axes, is_of};
use super::found::{CurveFit, LEVEL, Search};
use super::result::{
    Candidate, ChannelGain, Defect, Diagnosis, Finding, NotTestable, Picture, Rival, Unexplained, Verdict,
};
use super::shapeless::Shape;
use crate::calibrate::{Bench, CalibrateError, Fit, Trial};
use crate::effect::Effect;
use crate::robot::{Robot, Symbol};

/// A curve that explains less of the base model's excess is not worth a line.
const LEAST_SHARE: f64 = 0.01;
/// The first shape is final where less than this share of its part is left.
const FINAL_SHARE: f64 = 0.05;

/// The result of a search from `base` on `bench`; the gain is that of the extended fit over the base model's.
///
/// # Errors
/// As a calibration's: what each finding explains is measured by leaving it out.
pub fn tell(
    bench: &Bench<'_>,
    base: &Trial,
    found: &Search,
    (base_fit, extended): (&Fit, Fit),
    gain: Vec<ChannelGain>,
    unsuited: Vec<(&'static str, String)>,
    holdout: Option<String>,
) -> Result<Diagnosis, CalibrateError> {
    let left = found.left.iter().map(|curve| curve.score.max(0.0)).fold(0.0, f64::max);
    // What the base model leaves over pure noise: what the laws took, and what the best curve would still take.
    let excess = (2.0 * (base.cost - found.trial.cost) + left).max(f64::MIN_POSITIVE);
    let mut findings = Vec::new();
    for (place, accepted) in found.accepted.iter().enumerate() {
        let effect = accepted.named.effect;
        let own = match found.accepted.len() {
            1 => 2.0 * (base.cost - found.trial.cost),
            _ => found.without(bench, place)?.1,
        };
        let parameters: Vec<_> =
            extended.calibration.parameters.iter().filter(|p| is_of(effect, &p.name)).cloned().collect();
        // A stop that is never met has a number on few samples, and none on all of them.
        let is_shown = |axis: &usize| {
            let suffix = format!("[{axis}]");
            parameters.iter().any(|p| p.identifiable && p.std_error.is_some() && p.name.ends_with(&suffix))
        };
        let mut axes = axes(effect, &found.trial);
        if axes.iter().any(is_shown) {
            axes.retain(is_shown);
        }
        let left_in_place = found.left.iter().filter(|c| c.curves.place.row() == effect.row && c.p_family < LEVEL);
        let left_in_place = left_in_place.map(|c| c.score.max(0.0)).fold(0.0, f64::max);
        findings.push(Finding {
            effect: effect.id.to_string(),
            axes,
            row: effect.row,
            score: accepted.score,
            p_value: accepted.p_family,
            explained_excess: (own / excess).clamp(0.0, 1.0),
            shape_final: left_in_place <= FINAL_SHARE * own,
            parameters,
            aliases: accepted
                .rivals
                .iter()
                .filter(|rival| rival.is_alias)
                .map(|r| r.named.effect.id.to_string())
                .collect(),
            rivals: accepted
                .rivals
                .iter()
                .map(|rival| Rival {
                    effect: rival.named.effect.id.to_string(),
                    axes: rival.axes.clone(),
                    score: rival.score,
                })
                .collect(),
            gain: gain.clone(),
        });
    }
    let significant = found.left.iter().filter(|curve| curve.p_family < LEVEL && curve.score > 0.0);
    // The best curve first: what the others have of the same defect is less.
    let mut places: Vec<Defect> = significant.flat_map(|curve| defects(curve, excess)).collect();
    places.retain(|defect| defect.share >= LEAST_SHARE);
    let unexplained = Unexplained { excess: (left / excess).clamp(0.0, 1.0), places };
    let verdict = verdict(found, &findings);
    let scan = found.first_scan.iter().map(|s| Candidate {
        effect: s.named.effect.id.to_string(),
        axes: s.axes.clone(),
        score: s.score,
        p_value: s.p_family,
        vif: s.vif,
    });
    let summary = summary(bench.robot(), verdict, &findings, &unexplained);
    Ok(Diagnosis {
        verdict,
        summary,
        unexplained,
        not_testable: not_testable(bench.robot(), unsuited),
        scan: scan.collect(),
        threshold_p: LEVEL,
        curves: found.first_curves.iter().filter(|curve| curve.p_family < LEVEL).flat_map(pictures).collect(),
        holdout,
        base: base_fit.calibration.clone(),
        extended: extended.calibration,
        findings,
    })
}

fn verdict(found: &Search, findings: &[Finding]) -> Verdict {
    let something_left = found.refused.is_some() || found.left.first().is_some_and(|curve| curve.p_family < LEVEL);
    match findings {
        [] if something_left => Verdict::Unknown,
        [] => Verdict::None,
        findings if findings.iter().all(|finding| !finding.aliases.is_empty()) => Verdict::NotSeparable,
        _ => Verdict::Named,
    }
}

/// A curve's share by joint, as the curves' own sizes are, the largest first.
fn defects(curve: &CurveFit, excess: f64) -> Vec<Defect> {
    let place = curve.curves.place;
    let joints = curve.curves.of_joints.len();
    let size = |joint: usize| {
        let Some((curve, coefficients)) = curve.curves.fitted(&curve.trial, joint) else { return 0.0 };
        // A smooth curve's coefficients are values of it, and its mean is no defect; waves have none.
        let mean = match curve.shape {
            Shape::Spline(_) => coefficients.iter().sum::<f64>() / coefficients.len() as f64,
            Shape::Ripple(_) => 0.0,
        };
        coefficients.iter().map(|c| (c - mean).powi(2)).sum::<f64>()
    };
    let sizes: Vec<f64> = (0..joints).map(size).collect();
    let all: f64 = sizes.iter().sum::<f64>().max(f64::MIN_POSITIVE);
    let of_joint = |(joint, size): (usize, &f64)| Defect {
        row: place.row(),
        axis: Some(joint + 1),
        argument: place.argument.name().to_string(),
        share: (curve.score / excess).clamp(0.0, 1.0) * size / all,
    };
    let mut defects: Vec<Defect> = sizes.iter().enumerate().map(of_joint).collect();
    defects.sort_by(|a, b| b.share.total_cmp(&a.share));
    defects
}

/// A curve of every joint, drawn.
fn pictures(curve: &CurveFit) -> Vec<Picture> {
    // Ten of them a wave, where there are many a turn.
    const POINTS: usize = 161;
    let place = curve.curves.place;
    let of_joint = |joint: usize| {
        let (shape, coefficients) = curve.curves.fitted(&curve.trial, joint)?;
        let [low, high] = shape.range();
        let at: Vec<f64> = (0..POINTS).map(|i| low + (high - low) * i as f64 / (POINTS - 1) as f64).collect();
        let torque: Vec<f64> = at.iter().map(|x| shape.value(&coefficients, *x)).collect();
        let mean = torque.iter().sum::<f64>() / POINTS as f64;
        Some(Picture {
            row: place.row(),
            axis: joint + 1,
            argument: place.argument.name().to_string(),
            argument_unit: place.argument.unit().to_string(),
            at,
            torque: torque.into_iter().map(|torque| torque - mean).collect(),
            score: curve.score,
        })
    };
    (0..curve.curves.of_joints.len()).filter_map(of_joint).collect()
}

/// What no data of this robot could show.
fn not_testable(robot: &Robot, unsuited: Vec<(&'static str, String)>) -> Vec<NotTestable> {
    let mut list: Vec<NotTestable> =
        unsuited.into_iter().map(|(effect, why)| NotTestable { effect: effect.to_string(), why }).collect();
    let common = [
        ("viscous_friction", Symbol::KMi, "the part common to all joints is the back-EMF term k_mi"),
        ("motor_mismatch", Symbol::B, "the part common to all joints is in b, k_pwm and k_mi"),
    ];
    for (effect, symbol, why) in common {
        let shared = robot.joint_parameter(symbol, 0).is_some_and(|spec| spec.value.free && spec.joints.len() > 1);
        if shared && !list.iter().any(|entry| entry.effect == effect) {
            list.push(NotTestable { effect: effect.to_string(), why: why.to_string() });
        }
    }
    list
}

/// The verdict as a mechanic understands it.
fn summary(robot: &Robot, verdict: Verdict, findings: &[Finding], unexplained: &Unexplained) -> String {
    let joints = |axes: &[usize]| -> String {
        let names: Vec<&str> =
            axes.iter().filter_map(|axis| robot.joints.get(axis - 1)).map(|joint| joint.name.as_str()).collect();
        if names.is_empty() { String::new() } else { format!(" ({})", names.join(", ")) }
    };
    // What explains most is said first, whenever it was found.
    let mut by_share: Vec<&Finding> = findings.iter().collect();
    by_share.sort_by(|a, b| b.explained_excess.total_cmp(&a.explained_excess));
    let causes: Vec<String> = by_share
        .into_iter()
        .map(|finding| {
            let title = Effect::by_id(&finding.effect).map_or("", |effect| effect.title);
            format!("{title}{}", joints(&finding.axes))
        })
        .collect();
    let place = unexplained.places.first().map(|defect| {
        let joint = defect.axis.and_then(|axis| robot.joints.get(axis - 1)).map_or("", |joint| joint.name.as_str());
        format!("a torque at {joint} that follows the {}", defect.argument.replace('_', " "))
    });
    match verdict {
        Verdict::None => {
            "The model explains this recording; nothing that this motion could show is missing.".to_string()
        }
        Verdict::Named => format!("The model lacks: {}.", causes.join("; ")),
        Verdict::NotSeparable => {
            let aliases: Vec<&str> = findings.iter().flat_map(|f| f.aliases.iter().map(String::as_str)).collect();
            format!("The model lacks {} or {}: this motion cannot tell which.", causes.join("; "), aliases.join(" or "))
        }
        Verdict::Unknown => {
            let place = place.unwrap_or_else(|| "something that no curve of one joint describes".to_string());
            format!("Something is missing that the catalogue has no name for: {place}.")
        }
    }
}
