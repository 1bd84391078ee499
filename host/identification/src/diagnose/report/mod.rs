//! What a selection found as users read it: findings with their evidence, what was rejected, verdict, places of what is left, pictures of the defect, one sentence.

pub mod base_fit;
mod steps;

use crate::calibrate::{Fit, ParameterEstimate};
use crate::diagnose::axes::{axes, is_of, joint_of};
use crate::diagnose::criteria::{IMPLAUSIBLE, LEAST_SHARE, LEVEL, WEIGHT};
use crate::diagnose::curves::{Argument, Curves, Shape, Target};
use crate::diagnose::holdout::judge::Judged;
use crate::diagnose::interval::Gain;
use crate::diagnose::plausibility::Plausibility;
use crate::diagnose::refit::Refit;
use crate::diagnose::result::{
    Candidate, ChannelGain, Defect, Diagnosis, Finding, Flag, NotTestable, Picture, Rejected, Rival, Unexplained,
    Verdict,
};
use crate::diagnose::scores::jackknife::between_blocks;
use crate::diagnose::scores::stability::{Stability, stability};
use crate::diagnose::selection::{Accepted, Selection, share};
use crate::effect::{Effect, Role};
use crate::robot::{JointKind, Robot, Symbol};
use base_fit::{base_fit, channel_fits};
use steps::place_of_steps;

/// The first shape is final where less than this share of its part is left.
const FINAL_SHARE: f64 = 0.05;
/// Blocks do not agree on a size where constants would differ as much in less than this share of worlds.
const CONSTANT: f64 = 1e-3;

/// What a diagnosis has in its hands.
pub struct Evidence<'a> {
    /// The samples.
    pub refit: &'a Refit<'a>,
    /// The robot's scales.
    pub plausibility: &'a Plausibility,
    /// What was found.
    pub selection: &'a Selection,
    /// Curves on top of the base model, best first.
    pub first_curves: Vec<Curves>,
    /// Curves on top of the final model, best first.
    pub left: Vec<Curves>,
    /// Samples of the bench for each that the curves looked at.
    pub scale: f64,
}

/// The result.
pub fn report(
    evidence: &Evidence<'_>,
    (judged, mut rejected): (Judged, Vec<Rejected>),
    (base, extended): (&Fit, Option<Fit>),
    unsuited: Vec<(&'static str, String)>,
    holdout: Option<String>,
) -> Diagnosis {
    let selection = evidence.selection;
    let robot = evidence.refit.bench.robot();
    let left = evidence.left.iter().find(|curve| curve.p_family < LEVEL);
    let left_gain = left.map_or(0.0, |curve| evidence.scale * curve.gain());
    let excess = evidence.excess(left_gain);
    let findings: Vec<Finding> = (0..selection.accepted.len())
        .map(|place| evidence.finding(place, &judged, extended.as_ref(), excess))
        .collect();
    let places: Vec<Defect> = evidence
        .left
        .iter()
        .filter(|curve| curve.p_family < LEVEL)
        .flat_map(|curve| defects(curve, evidence.scale * curve.gain() / excess))
        .filter(|defect| defect.share >= LEAST_SHARE)
        .collect();
    let ahead_500ms_sigma = channel_fits(judged.extended_ahead_sigma);
    let mut unexplained = Unexplained { excess: (left_gain / excess).clamp(0.0, 1.0), ahead_500ms_sigma, places };
    let refused = selection.scan.iter().filter(|s| s.p_family < LEVEL && s.score.gain() > 0.0);
    if selection.accepted.is_empty() {
        rejected.extend(refused.clone().take(5).map(|s| Rejected {
            effect: s.named.effect.id.to_string(),
            axes: s.axes.clone(),
            why: "its refit does not predict other blocks of this motion better for sure".into(),
        }));
    }
    let first_gains = evidence.first_curves.iter().any(|curve| curve.p_family < LEVEL);
    let gains = !findings.is_empty() || first_gains || refused.clone().next().is_some();
    let is_coloured = base.calibration.scatter.is_some_and(|scatter| scatter.coloured);
    let calibration = (base.calibration.status, is_coloured);
    let base_fit = base_fit(&base.calibration.noise, calibration, judged.ahead_sigma, gains);
    let verdict = verdict(&findings, base_fit.fits);
    if unexplained.places.is_empty() && verdict != Verdict::None {
        unexplained.places.extend(place_of_steps(robot, base, extended.as_ref().unwrap_or(base)));
    }
    let scan = selection.scan.iter().map(|s| Candidate {
        effect: s.named.effect.id.to_string(),
        axes: s.axes.clone(),
        score: s.score.score,
        cv_score: s.score.gain(),
        p_value: s.p_family,
        vif: Some(s.score.vif).filter(|vif| vif.is_finite()),
    });
    let scan = scan.collect();
    let summary = summary(robot, verdict, &findings, &unexplained, &base_fit.sentence);
    let mut not_testable = not_testable(robot, unsuited);
    not_testable.extend(selection.not_finite.iter().map(|(effect, columns)| NotTestable {
        effect: effect.to_string(),
        why: format!("{columns} columns of its law are not numbers along this motion"),
    }));
    let significant = evidence.first_curves.iter().filter(|curve| curve.p_family < LEVEL);
    Diagnosis {
        verdict,
        summary,
        base_fit,
        rejected,
        holdout_gain: judged.all,
        unexplained,
        not_testable,
        scan,
        threshold_p: LEVEL,
        curves: significant.take(3).flat_map(|curve| pictures(robot, curve)).collect(),
        holdout,
        base: base.calibration.clone(),
        extended: extended.map_or_else(|| base.calibration.clone(), |fit| fit.calibration),
        findings,
    }
}

impl Evidence<'_> {
    /// What the base model leaves unexplained: what the findings gain together, and what the best curve would still gain.
    fn excess(&self, left: f64) -> f64 {
        let selection = self.selection;
        let explained = if selection.accepted.is_empty() {
            0.0
        } else {
            selection.current.gains_over(&selection.base).iter().sum::<f64>()
        };
        (explained + left).max(f64::MIN_POSITIVE)
    }

    fn finding(&self, place: usize, judged: &Judged, extended: Option<&Fit>, excess: f64) -> Finding {
        let accepted = &self.selection.accepted[place];
        let effect = accepted.named.effect;
        let (lost, holdout_gain) = judged.of_each.get(place).cloned().unwrap_or_else(|| (accepted.gains.clone(), None));
        let cv_gain = share(&lost, excess);
        let own: f64 = lost.iter().sum();
        let in_place = self.left.iter().filter(|c| c.place.row() == effect.row && c.p_family < LEVEL);
        let left_in_place = in_place.map(|c| self.scale * c.gain()).fold(0.0, f64::max);
        let parameters = self.parameters(effect, extended);
        let is_shown = |axis: &usize| {
            parameters.iter().any(|p| p.identifiable && p.std_error.is_some() && joint_of(&p.name) == Some(*axis))
        };
        let mut axes = axes(effect, &self.selection.current.trial);
        if axes.iter().any(is_shown) {
            axes.retain(is_shown);
        }
        let stability = self.stability(accepted);
        let size = parameters
            .iter()
            .filter(|p| effect.parameter(&p.name).is_some_and(|parameter| parameter.role.is_size()))
            .map(|p| (self.plausibility.of_value(effect, &p.name, p.estimate), p))
            .max_by(|(a, _), (b, _)| a.total_cmp(b));
        let implausible = size.filter(|(far, _)| *far > IMPLAUSIBLE).map(|(_, parameter)| parameter);
        let acts_like = implausible.map(|p| acts_like(self.refit.bench.robot(), effect, p));
        let flags = self.flags(accepted, judged, holdout_gain.as_ref(), stability.as_ref(), implausible.is_some());
        let aliases = accepted.rivals.iter().filter(|rival| rival.weight > 1.0 - WEIGHT);
        Finding {
            effect: effect.id.to_string(),
            axes,
            row: effect.row,
            score: accepted.gains.iter().sum(),
            p_value: accepted.p_family,
            explained_excess: cv_gain.share.clamp(0.0, 1.0),
            cv_gain,
            holdout_gain,
            coverage: own / (own + left_in_place).max(f64::MIN_POSITIVE),
            stability,
            weight: accepted.weight,
            flags,
            acts_like,
            shape_final: left_in_place <= FINAL_SHARE * own,
            parameters,
            aliases: aliases.map(|rival| rival.named.effect.id.to_string()).collect(),
            rivals: accepted
                .rivals
                .iter()
                .map(|rival| Rival {
                    effect: rival.named.effect.id.to_string(),
                    axes: rival.axes.clone(),
                    score: rival.gain,
                    weight: rival.weight,
                })
                .collect(),
            gain: judged.by_channel.clone(),
        }
    }

    fn flags(
        &self,
        accepted: &Accepted,
        judged: &Judged,
        holdout: Option<&Gain>,
        stability: Option<&Stability>,
        is_implausible: bool,
    ) -> Vec<Flag> {
        let effect = accepted.named.effect;
        let trial = &self.selection.current.trial;
        let has_own =
            accepted.named.law.parameters().results.iter().any(|result| {
                effect.parameter(&result.name).is_some_and(|parameter| parameter.role == Role::PerRecording)
            });
        let worse = |gain: &ChannelGain| gain.horizon_s <= 0.5 && gain.ci95.is_some_and(|[_, high]| high < 0.0);
        let is_supported = holdout.is_some_and(Gain::is_supported);
        let all = [
            (Flag::Implausible, is_implausible),
            (Flag::AtBoundary, self.plausibility.is_at_boundary(effect, &*accepted.named.law, trial)),
            (Flag::OwnPhase, has_own),
            (Flag::SingleEvent, accepted.is_event),
            (Flag::NotConstant, stability.is_some_and(|stability| stability.p < CONSTANT)),
            (Flag::ChannelWorse, is_supported && judged.by_channel.iter().any(worse)),
            (Flag::NotShownByHoldout, holdout.is_none_or(|gain| !gain.is_supported())),
        ];
        all.into_iter().filter(|(_, is_set)| *is_set).map(|(flag, _)| flag).collect()
    }

    /// Whether blocks agree on the size of a law: each one's amplitude along the law's own coordinates.
    fn stability(&self, accepted: &Accepted) -> Option<Stability> {
        let fitted = &self.selection.current;
        let law = fitted.trial.laws.iter().position(|law| std::sync::Arc::ptr_eq(law, &accepted.named.law))?;
        let own = fitted.fit.laws.get(law)?.clone();
        let mut direction = vec![0.0; fitted.fit.free.nrows()];
        let parameters = accepted.named.law.parameters();
        for result in &parameters.results {
            let value = fitted.trial.value(&result.name)?.estimate;
            match result.form {
                crate::model::law::Form::Is(i) => direction[own.start + i] = value - parameters.coordinates[i].start,
                crate::model::law::Form::Exp(i) | crate::model::law::Form::Scaled(i, _) => {
                    direction[own.start + i] = 1.0;
                }
                crate::model::law::Form::Amplitude(c, s) | crate::model::law::Form::SignedAmplitude(c, s) => {
                    let index = result.name.split_once('[').map_or("", |(_, index)| index);
                    let phase = parameters.results.iter().find(|other| {
                        matches!(
                            other.form,
                            crate::model::law::Form::Phase(..) | crate::model::law::Form::SignedPhase(..)
                        ) && other.name.ends_with(index)
                    });
                    let phase =
                        phase.and_then(|phase| fitted.trial.value(&phase.name)).map_or(0.0, |phase| phase.estimate);
                    (direction[own.start + c], direction[own.start + s]) = (value * phase.cos(), value * phase.sin());
                }
                _ => {}
            }
        }
        let (amplitudes, information): (Vec<f64>, Vec<f64>) = fitted.fit.amplitudes(&direction).into_iter().unzip();
        let squares: f64 =
            fitted.own.iter().zip(&fitted.fit.weights).map(|(squares, weight)| squares * weight * weight).sum();
        let inflation = (squares / fitted.freedom.iter().sum::<f64>().max(1.0)).max(1.0);
        stability(&amplitudes, &information, inflation)
    }

    /// The parameters of an effect: estimates of all samples, errors by the scatter between blocks where that is more than what the noise says.
    fn parameters(&self, effect: &Effect, extended: Option<&Fit>) -> Vec<ParameterEstimate> {
        let fitted = &self.selection.current;
        let bench = &self.refit.bench;
        let errors = between_blocks(bench, (&fitted.trial, &fitted.fit), &self.refit.contiguous).unwrap_or_default();
        let fewer =
            extended.map_or(1.0, |fit| (bench.series().stages() as f64 / fit.series.stages().max(1) as f64).min(1.0));
        let between = |name: &str| {
            let found = errors.iter().find(|found| found.name == name)?;
            Some((found.error * fewer.sqrt(), found.t95()?)).filter(|(error, _)| error.is_finite())
        };
        let of_trial = || {
            fitted.trial.values.iter().map(|value| ParameterEstimate {
                name: value.name.clone(),
                unit: value.unit.to_string(),
                initial: 0.0,
                estimate: value.estimate,
                std_error: value.std_error,
                ci95: value.std_error.map(|error| [value.estimate - 1.96 * error, value.estimate + 1.96 * error]),
                identifiable: value.std_error.is_some(),
            })
        };
        let all: Vec<ParameterEstimate> =
            extended.map_or_else(|| of_trial().collect(), |fit| fit.calibration.parameters.clone());
        let widened = |mut p: ParameterEstimate| {
            if let (Some(own), Some((between, t))) = (p.std_error, between(&p.name))
                && between > own
            {
                p.std_error = Some(between);
                p.ci95 = Some([p.estimate - t * between, p.estimate + t * between]);
            }
            p
        };
        all.into_iter().filter(|p| is_of(effect, &p.name)).map(widened).collect()
    }
}

/// What a size that no robot has most likely stands for: a number of the robot file.
fn acts_like(robot: &Robot, effect: &Effect, p: &ParameterEstimate) -> String {
    let link = joint_of(&p.name).and_then(|joint| robot.joints.get(joint - 1)).or(robot.joints.last());
    let link = link.map_or("the last link", |joint| joint.name.as_str());
    let culprit = match effect.id {
        "link_inertia" => format!("masses and inertias of {link} in the robot file"),
        "gravity_residual" | "cable_spring" | "torque_offset" => {
            format!("mass, centre and gravity of {link} in the robot file")
        }
        "viscous_friction"
        | "asymmetric_friction"
        | "stribeck"
        | "friction_slope"
        | "load_friction"
        | "position_friction"
        | "friction_drift"
        | "link_friction"
        | "quadratic_drag" => format!("friction of {link} in the robot file, or its scale of torque"),
        "encoder_eccentricity" | "encoder_lag" => {
            format!("resolution, gear or zero of the encoder of {link} in the robot file")
        }
        "motor_mismatch" | "cogging" | "voltage_sag" | "current_limit" => {
            format!("the motor constants, gear or unit of the input of {link} in the robot file")
        }
        _ => format!("the numbers of {link} in the robot file"),
    };
    format!("acts like {} = {:.4} {}, which no robot has: most likely {culprit} are wrong", p.name, p.estimate, p.unit)
}

fn verdict(findings: &[Finding], fits: bool) -> Verdict {
    match findings {
        [] if fits => Verdict::None,
        [] => Verdict::Unknown,
        findings if findings.iter().all(|finding| finding.weight < WEIGHT && !finding.aliases.is_empty()) => {
            Verdict::NotSeparable
        }
        _ => Verdict::Named,
    }
}

/// A curve's share by joint, the largest first.
fn defects(curve: &Curves, share: f64) -> Vec<Defect> {
    let of_joint = |(joint, size): &(Option<usize>, f64)| Defect {
        row: curve.place.row(),
        axis: joint.map(|joint| joint + 1),
        argument: curve.place.argument.name().to_string(),
        share: share.clamp(0.0, 1.0) * size,
    };
    let mut defects: Vec<Defect> = curve.size_of.iter().map(of_joint).collect();
    defects.sort_by(|a, b| b.share.total_cmp(&a.share));
    defects
}

/// A curve of every joint, drawn.
fn pictures(robot: &Robot, curve: &Curves) -> Vec<Picture> {
    // Ten of them a wave, where there are many a turn.
    const POINTS: usize = 161;
    let of_joint = |(joint, shape, coefficients): &(usize, crate::diagnose::curves::Curve, Vec<f64>)| {
        let [low, high] = shape.range();
        let at: Vec<f64> = (0..POINTS).map(|i| low + (high - low) * i as f64 / (POINTS - 1) as f64).collect();
        let torque: Vec<f64> = at.iter().map(|x| shape.value(coefficients, *x)).collect();
        let of_kind = |unit: &str| match robot.joints[*joint].kind {
            JointKind::Revolute => unit.to_string(),
            JointKind::Prismatic => unit.replace("N m", "N").replace("rad", "m"),
        };
        let mean = match shape.shape {
            Shape::Spline(_) => torque.iter().sum::<f64>() / POINTS as f64,
            Shape::Ripple(_) => 0.0,
        };
        Picture {
            row: curve.place.row(),
            axis: joint + 1,
            argument: curve.place.argument.name().to_string(),
            argument_unit: match curve.place.argument {
                Argument::MotorPhase => "rad".to_string(),
                argument => of_kind(argument.unit()),
            },
            at,
            torque: torque.into_iter().map(|torque| torque - mean).collect(),
            unit: of_kind(match curve.place.target {
                Target::Torque(_) => "N m",
                Target::Position(_) => "rad",
                Target::Gyro => "rad/s",
            }),
            score: curve.gain(),
        }
    };
    curve.of_joints.iter().map(of_joint).collect()
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

/// The verdict as a mechanic understands it: first whether the model fits, then why not.
fn summary(robot: &Robot, verdict: Verdict, findings: &[Finding], unexplained: &Unexplained, fit: &str) -> String {
    let joint = |axis: usize| robot.joints.get(axis - 1).map_or("", |joint| joint.name.as_str());
    let joints = |axes: &[usize]| -> String {
        let names: Vec<&str> = axes.iter().map(|axis| joint(*axis)).collect();
        if names.is_empty() { String::new() } else { format!(" ({})", names.join(", ")) }
    };
    // What explains most is said first, whenever it was found.
    let mut by_share: Vec<&Finding> = findings.iter().collect();
    by_share.sort_by(|a, b| b.explained_excess.total_cmp(&a.explained_excess));
    let causes: Vec<String> = by_share
        .into_iter()
        .map(|finding| {
            let title = Effect::by_id(&finding.effect).map_or("", |effect| effect.title);
            let name = format!("{title}{}", joints(&finding.axes));
            finding.acts_like.as_ref().map_or(name.clone(), |acts_like| format!("what {acts_like}"))
        })
        .collect();
    let place = unexplained.places.first().map(|defect| {
        let joint = defect.axis.map_or(String::new(), |axis| format!(" at {}", joint(axis)));
        let row = format!("{:?}", defect.row).to_lowercase();
        if defect.argument == Defect::UNKNOWN {
            return format!("something on the {row} row{joint} that no curve of one joint's quantities describes");
        }
        format!("something on the {row} row{joint} that follows the {}", defect.argument.replace('_', " "))
    });
    let why = match verdict {
        Verdict::None => "Nothing that this motion could show is missing.".to_string(),
        Verdict::Named => format!("The model lacks: {}.", causes.join("; ")),
        Verdict::NotSeparable => {
            let aliases: Vec<&str> = findings.iter().flat_map(|f| f.aliases.iter().map(String::as_str)).collect();
            format!("The model lacks {} or {}: this motion cannot tell which.", causes.join("; "), aliases.join(" or "))
        }
        Verdict::Unknown => {
            let place = place.unwrap_or_else(|| "something that no curve of one joint describes".to_string());
            format!("Something is missing that the catalogue has no name for: {place}.")
        }
    };
    format!("{fit} {why}")
}
