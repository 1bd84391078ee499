//! The diagnosis: what a calibrated model gets wrong, by which law, and what knowing it brings.
//!
//! ```text
//!   recording ─▶ calibration of the base model ─▶ bench (frozen yardstick) ─▶ search ─▶ verdict
//!                                                                               │
//!   second recording ────────────────────────────── gain of the extended calibration ◀──┘
//! ```
//!
//! The method is that of stochastic grey-box models (Kristensen, Madsen, Jørgensen 2004): fix the noise first, look for what explains the
//! residuals under it. New is that the cause is named: every law of the catalogue is tried, and a name has to hold its own against any smooth
//! curve on the same equation.

mod bootstrap;
mod candidate;
mod gain;
mod result;
mod search;
mod shapeless;
mod significance;
mod yardstick;

pub use bootstrap::Gain;
pub use result::{
    Candidate, ChannelGain, Defect, Diagnosis, Finding, NotTestable, Picture, Rival, Unexplained, Verdict,
};
pub use search::LEVEL;

use crate::calibrate::{Bench, CalibrateError, Fit, Preset, Trial, extend, fit};
use crate::recording::Recording;
use crate::robot::Robot;
use crate::solve::levenberg::Settings;
use crate::verify::VerifyError;
use search::{CurveFit, Search};

/// Samples that everything is tried on, and samples that decide; of a recording three times as long windows are taken.
const FEW_SAMPLES: usize = 4_000;
const ENOUGH_SAMPLES: usize = 12_000;
/// Trials end at this relative change of the cost: a thousandth of what tells two laws apart. Wrong models crawl on for long.
const ENOUGH: f64 = 1e-6;
/// And after so many iterations.
const MOST_ITERATIONS: usize = 25;
/// Windows of a bench.
const WINDOWS: usize = 8;
/// A curve that explains less of the base model's excess is not worth a line.
const LEAST_SHARE: f64 = 0.01;
/// The first shape is final where less than this share of its part is left.
const FINAL_SHARE: f64 = 0.05;

/// Why a recording cannot be diagnosed.
#[derive(Debug, thiserror::Error)]
pub enum DiagnoseError {
    /// No base model to begin with.
    #[error(transparent)]
    Calibrate(#[from] CalibrateError),
    /// The second recording cannot be predicted.
    #[error(transparent)]
    Verify(#[from] VerifyError),
    /// An id that `--without` names.
    #[error(transparent)]
    Effect(#[from] crate::effect::EffectError),
}

/// How to diagnose.
#[derive(Debug, Clone, Default)]
pub struct Options {
    /// Ids of the catalogue that are left out.
    pub without: Vec<String>,
    /// Of all searches.
    pub settings: Settings,
}

/// Diagnoses `recording` of `robot`. The gain is measured on `holdout`, or on the last third of the recording, which the fits then do not see.
/// `step` is told what begins.
///
/// # Errors
/// [`DiagnoseError`].
pub fn diagnose(
    robot: &Robot,
    recording: &Recording,
    holdout: Option<&Recording>,
    options: &Options,
    step: &dyn Fn(&str),
) -> Result<Diagnosis, DiagnoseError> {
    for id in &options.without {
        crate::effect::Effect::by_id(id)?;
    }
    let cut = recording.len() * 2 / 3;
    let parts = holdout.is_none().then(|| [recording.part(0..cut), recording.part(cut..recording.len())]);
    let (fitted, unseen) = match (&parts, holdout) {
        (Some([first, last]), _) => (first, last),
        (None, Some(holdout)) => (recording, holdout),
        (None, None) => (recording, recording),
    };
    step("calibrating the base model");
    let base = fit(robot, &[fitted], Preset::Default, &options.settings, |_, _| {})?;
    let series = &base.series;
    let noise = yardstick::yardstick(robot, series);
    let bench = |samples: usize| {
        let part = series.excerpt(samples, WINDOWS).unwrap_or_else(|| series.clone());
        let settings =
            Settings { relative_cost_change: ENOUGH, max_iterations: MOST_ITERATIONS, ..options.settings.clone() };
        Bench::new(robot, part, &base, noise.clone(), settings)
    };
    let ((few, few_base), (bench, trial)) = (bench(FEW_SAMPLES)?, bench(ENOUGH_SAMPLES)?);
    let (candidates, unsuited) = candidate::catalogue(robot, &options.without);
    let found = search::search((&few, &few_base), (&bench, &trial), &candidates, step)?;

    step("calibrating the extended model");
    let ids: Vec<&str> = found.accepted.iter().map(|accepted| accepted.named.effect.id).collect();
    let extended = if ids.is_empty() {
        base.clone()
    } else {
        extend(robot, &[fitted], &base, &ids, &options.settings, |_, _| {})?
    };
    step("measuring the gain");
    let gain = if ids.is_empty() { Vec::new() } else { gain::gain(&base.calibration, &extended.calibration, unseen)? };
    let holdout = holdout.map(|recording| recording.source.path.display().to_string());
    Ok(tell(&bench, &trial, &found, (&base, extended), gain, unsuited, holdout)?)
}

fn tell(
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
        let own = found.lost_without(bench, place)?;
        let parameters: Vec<_> =
            extended.calibration.parameters.iter().filter(|p| search::is_of(effect, &p.name)).cloned().collect();
        let left_in_place = found.left.iter().filter(|c| c.curves.place.row() == effect.row && c.p_family < LEVEL);
        let left_in_place = left_in_place.map(|c| c.score.max(0.0)).fold(0.0, f64::max);
        findings.push(Finding {
            effect: effect.id.to_string(),
            axes: search::axes(effect, &found.trial),
            row: effect.row,
            score: accepted.score,
            p_value: accepted.p_family,
            explained_excess: (own / excess).clamp(0.0, 1.0),
            shape_final: left_in_place <= FINAL_SHARE * own,
            parameters,
            aliases: accepted.rivals.iter().filter(|rival| rival.is_alias).map(|r| r.effect.id.to_string()).collect(),
            rivals: accepted
                .rivals
                .iter()
                .map(|rival| Rival {
                    effect: rival.effect.id.to_string(),
                    axes: rival.axes.clone(),
                    score: rival.score,
                })
                .collect(),
            gain: gain.clone(),
        });
    }
    let significant = found.left.iter().filter(|curve| curve.p_family < LEVEL && curve.score > 0.0);
    let mut places: Vec<Defect> = significant.flat_map(|curve| defects(curve, excess)).collect();
    places.sort_by(|a, b| b.share.total_cmp(&a.share));
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

/// A curve's share by joint, as the curves' own sizes are.
fn defects(curve: &CurveFit, excess: f64) -> Vec<Defect> {
    let place = curve.curves.place;
    let joints = curve.curves.knots.len();
    let size = |joint: usize| {
        let Some(coefficients) = curve.curves.coefficients(&curve.trial, joint) else { return 0.0 };
        let mean = coefficients.iter().sum::<f64>() / coefficients.len() as f64;
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
    sizes.iter().enumerate().map(of_joint).collect()
}

/// A curve of every joint, drawn.
fn pictures(curve: &CurveFit) -> Vec<Picture> {
    const POINTS: usize = 81;
    let place = curve.curves.place;
    let of_joint = |(joint, knots): (usize, &Option<shapeless::Knots>)| {
        let (knots, coefficients) = ((*knots)?, curve.curves.coefficients(&curve.trial, joint)?);
        let [low, high] = knots.range();
        let at: Vec<f64> = (0..POINTS).map(|i| low + (high - low) * i as f64 / (POINTS - 1) as f64).collect();
        let torque: Vec<f64> = at.iter().map(|x| knots.value(&coefficients, *x)).collect();
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
    curve.curves.knots.iter().enumerate().filter_map(of_joint).collect()
}

/// What no data of this robot could show.
fn not_testable(robot: &Robot, unsuited: Vec<(&'static str, String)>) -> Vec<NotTestable> {
    let mut list: Vec<NotTestable> =
        unsuited.into_iter().map(|(effect, why)| NotTestable { effect: effect.to_string(), why }).collect();
    let common = [
        ("viscous_friction", crate::robot::Symbol::KMi, "the part common to all joints is the back-EMF term k_mi"),
        ("motor_mismatch", crate::robot::Symbol::B, "the part common to all joints is in b, k_pwm and k_mi"),
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
    let causes: Vec<String> = findings
        .iter()
        .map(|finding| {
            let title = crate::effect::Effect::by_id(&finding.effect).map_or("", |effect| effect.title);
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
