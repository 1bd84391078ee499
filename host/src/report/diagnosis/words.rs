//! What pages and the terminal say of a diagnosis: joints by name, laws by title, gains with intervals.

use crate::calibrate::ParameterEstimate;
use crate::diagnose::{AT_NOISE, Defect, Diagnosis, Finding, Gain, Stability, Verdict};
use crate::effect::{Effect, Row};
use crate::plan;
use crate::report::number::{percent, prefixed, significant, with_error};
use crate::robot::Robot;

/// So many of the laws that came nearest another motion is to tell apart, where none has explained what is missing.
const NEAREST: usize = 2;

/// The names of a robot's joints and the units of its sensors.
pub struct Names<'a> {
    diagnosis: &'a Diagnosis,
    robot: Option<Robot>,
}

impl<'a> Names<'a> {
    /// Of the robot that was diagnosed.
    pub fn of(diagnosis: &'a Diagnosis) -> Self {
        Names { diagnosis, robot: Robot::parse(&diagnosis.base.robot_toml).ok() }
    }

    /// A joint, counted from 1.
    pub fn joint(&self, axis: usize) -> String {
        let mut joints = self.robot.iter().flat_map(|robot| &robot.joints);
        let name = axis.checked_sub(1).and_then(|joint| joints.nth(joint));
        name.map_or_else(|| format!("joint {axis}"), |joint| joint.name.clone())
    }

    /// Joints in brackets after a name; nothing where no joint is concerned.
    pub fn joints(&self, axes: &[usize]) -> String {
        let names: Vec<String> = axes.iter().map(|axis| self.joint(*axis)).collect();
        if names.is_empty() { String::new() } else { format!(" ({})", names.join(", ")) }
    }

    /// A law by its title, with joints.
    pub fn law(&self, effect: &str, axes: &[usize]) -> String {
        format!("{}{}", title(effect), self.joints(axes))
    }

    /// A channel or sensor: `encoder2 (pitch)`.
    pub fn channel(&self, channel: &str) -> String {
        if let Some(state) = channel.strip_prefix("process.") {
            return self.state(state);
        }
        let number = channel.trim_start_matches(|c: char| !c.is_ascii_digit());
        let of_joint = channel.contains("encoder") || channel.contains("tachometer");
        match number.parse::<usize>() {
            Ok(axis) if of_joint => format!("{channel}{}", self.joints(&[axis])),
            _ => channel.to_owned(),
        }
    }

    /// A component of the state: `q[1]`.
    fn state(&self, state: &str) -> String {
        let (symbol, index) = state.split_once('[').unwrap_or((state, ""));
        let what = match symbol {
            "q" => "link position",
            "qd" => "link speed",
            "theta" => "motor position",
            "thetad" => "motor speed",
            other => other,
        };
        match index.trim_end_matches(']').parse::<usize>() {
            Ok(axis) => format!("step of the {what}{}", self.joints(&[axis])),
            Err(_) => format!("step of {state}"),
        }
    }

    /// The unit of a sensor's channels; empty where it is not known.
    pub fn unit(&self, sensor: &str) -> &'a str {
        let is_its = |channel: &str| channel == sensor || channel.split('.').next() == Some(sensor);
        let noise = self.diagnosis.base.noise.iter().find(|noise| is_its(&noise.channel));
        noise.map_or("", |noise| noise.unit.as_str())
    }

    /// A parameter of an effect without the effect's name, with the joint it is of: `dv[1] (yaw)`.
    pub fn parameter(&self, effect: &str, name: &str) -> String {
        let own = name.strip_prefix(effect).and_then(|own| own.strip_prefix('.')).unwrap_or(name);
        let axis = own.split_once('[').and_then(|(_, index)| index.trim_end_matches(']').parse::<usize>().ok());
        format!("{own}{}", axis.map_or_else(String::new, |axis| self.joints(&[axis])))
    }

    /// What stands in the robot file in the place of a law's parameter: `slope_s_rad (slope_s_m) of the robot file: 200.00`.
    pub fn in_robot_file(&self, effect: &str, name: &str) -> Option<String> {
        let (key, value) = Effect::by_id(effect).ok()?.in_robot_file(self.robot.as_ref()?, name)?;
        Some(format!("{key} of the robot file: {}", with_error(value, None)))
    }

    /// A place of a misfit.
    pub fn place(&self, defect: &Defect) -> String {
        let joint = defect.axis.map_or_else(String::new, |axis| format!(" of {}", self.joint(axis)));
        if defect.argument == Defect::UNKNOWN {
            return format!("{}{joint}, whose steps err most", equation(defect.row));
        }
        format!("{}{joint}, as a function of the {}", equation(defect.row), argument(&defect.argument))
    }
}

/// A law's title; its id where the catalogue has none of that name.
pub fn title(effect: &str) -> String {
    Effect::by_id(effect).map_or_else(|_| effect.to_owned(), |effect| effect.title.to_owned())
}

/// With a capital at its beginning.
pub fn capital(text: &str) -> String {
    let mut rest = text.chars();
    rest.next().map_or_else(String::new, |first| first.to_uppercase().chain(rest).collect())
}

/// An equation in words.
pub fn equation(row: Row) -> &'static str {
    match row {
        Row::Link => "link equation",
        Row::Motor => "motor equation",
        Row::Sensor => "sensor readings",
        Row::Timing => "timing of the sensor readings",
    }
}

/// An argument in words: `motor_speed` is the motor speed.
pub fn argument(name: &str) -> String {
    name.replace('_', " ")
}

/// Causes in the order of what each brings on the other motion; of what it brings on this one, where no other has been predicted.
pub fn in_order(diagnosis: &Diagnosis) -> Vec<&Finding> {
    let brings = |finding: &Finding| {
        let gain = finding.holdout_gain.as_ref().filter(|gain| gain.share.is_finite()).unwrap_or(&finding.cv_gain);
        if gain.share.is_finite() { gain.share } else { f64::NEG_INFINITY }
    };
    let mut findings: Vec<&Finding> = diagnosis.findings.iter().collect();
    findings.sort_by(|a, b| brings(b).total_cmp(&brings(a)));
    findings
}

/// What the model lacks: the summary less what it says of the fit.
pub fn why(diagnosis: &Diagnosis) -> &str {
    diagnosis.summary.strip_prefix(&diagnosis.base_fit.sentence).unwrap_or(&diagnosis.summary).trim()
}

/// What all causes together do not mend: the sensor that is missed by most half a second ahead, where that is beyond its noise.
pub fn still_missed(diagnosis: &Diagnosis, names: &Names<'_>) -> Option<String> {
    let ahead = diagnosis.unexplained.ahead_500ms_sigma.iter().filter(|fit| fit.value.is_finite());
    let worst = ahead.max_by(|a, b| a.value.total_cmp(&b.value)).filter(|worst| worst.value > AT_NOISE)?;
    let channel = names.channel(&worst.channel);
    let shown = diagnosis.unexplained.places.iter().any(|defect| defect.argument != Defect::UNKNOWN);
    let nowhere = if !shown { ", and no curve of one joint's quantities shows why" } else { "" };
    Some(format!(
        "With all causes in the model, {channel} is still missed by {:.1} standard deviations of the sensor half a second ahead{nowhere}.",
        worst.value
    ))
}

/// The command that plans a motion which tells causes from what this one cannot tell from them; where nothing has a name, which shows what came nearest. `file` is the
/// diagnosis. None where there is no such question, or the firmware cannot play the robot a motion.
pub fn next_motion(diagnosis: &Diagnosis, file: &str) -> Option<String> {
    let robot = Robot::parse(&diagnosis.base.robot_toml).ok()?;
    let ids = to_separate(diagnosis, |id| Effect::by_id(id).is_ok_and(|effect| plan::can_show(&robot, effect)));
    let goal = match &ids[..] {
        [] => return None,
        [only] => format!("--for {only}"),
        several => format!("--separate {}", several.join(",")),
    };
    Some(format!(
        "A motion that would tell more: `host plan {file} {goal} -o MOTION.toml`, `host record --motion MOTION.toml`, then `host diagnose` of both recordings."
    ))
}

/// Ids of the effects that another motion should tell from one another, those for which one can be planned.
fn to_separate(diagnosis: &Diagnosis, can_show: impl Fn(&str) -> bool) -> Vec<&str> {
    let nearest = diagnosis.scan.iter().map(|candidate| candidate.effect.as_str());
    let open = diagnosis.findings.iter().filter(|finding| !finding.aliases.is_empty());
    let confused = open.flat_map(|f| std::iter::once(f.effect.as_str()).chain(f.aliases.iter().map(String::as_str)));
    let (all, most): (Vec<&str>, usize) = match diagnosis.verdict {
        Verdict::None => (Vec::new(), 0),
        Verdict::Unknown => (nearest.collect(), NEAREST),
        Verdict::Named | Verdict::NotSeparable => (confused.collect(), usize::MAX),
    };
    let mut ids: Vec<&str> = Vec::new();
    for id in all {
        if !ids.contains(&id) && can_show(id) {
            ids.push(id);
        }
    }
    ids.truncate(most);
    ids
}

/// Who was not seen by any fit.
pub fn other_motion(diagnosis: &Diagnosis) -> &str {
    diagnosis.holdout.as_deref().unwrap_or("the last third, which no fit has seen")
}

/// A share with its interval: `47 % [41, 55]`; nothing where it is no number.
pub fn share(share: f64, ci95: Option<[f64; 2]>) -> Option<String> {
    share.is_finite().then(|| format!("{}{}", percent(share), interval(ci95)))
}

/// A gain with its interval.
pub fn gain(gain: &Gain) -> Option<String> {
    share(gain.share, gain.ci95)
}

/// A change of an error: `30 % less error [23, 37]`, `56 % more error [30, 74]`.
pub fn error_change(gain: f64, ci95: Option<[f64; 2]>) -> Option<String> {
    if !gain.is_finite() {
        return None;
    }
    Some(if gain < 0.0 {
        format!("{} more error{}", percent(-gain), interval(ci95.map(|[low, high]| [-high, -low])))
    } else {
        format!("{} less error{}", percent(gain), interval(ci95))
    })
}

/// An interval in per cent in brackets, with a space before it.
fn interval(ci95: Option<[f64; 2]>) -> String {
    let end = |share: f64| percent(share).trim_end_matches(" %").to_owned();
    match ci95 {
        Some([low, high]) if low.is_finite() && high.is_finite() => format!(" [{}, {}]", end(low), end(high)),
        _ => String::new(),
    }
}

/// An estimate with its standard error and unit; nothing where it is no number.
pub fn estimate(p: &ParameterEstimate) -> String {
    let unit = if p.unit.is_empty() || p.unit == "1" { String::new() } else { format!(" {}", p.unit) };
    if p.estimate.is_finite() { format!("{}{unit}", with_error(p.estimate, p.std_error)) } else { String::new() }
}

/// The 95 % interval of an estimate, to the digits that its error gives it.
pub fn interval_of(p: &ParameterEstimate) -> Option<String> {
    let end = |value: f64| with_error(value, p.std_error).split(" ±").next().unwrap_or_default().to_owned();
    let [low, high] = p.ci95.filter(|ci95| ci95.iter().all(|end| end.is_finite()))?;
    Some(format!("{} … {}", end(low), end(high)))
}

/// Values in one unit, whose prefix fits the largest of them; nothing for what is no number.
pub fn in_unit<const N: usize>(values: [f64; N], unit: &str) -> [String; N] {
    let largest =
        values.iter().filter(|value| value.is_finite()).fold(0.0, |largest: f64, value| largest.max(value.abs()));
    let (unit, factor) = prefixed(largest, unit);
    let in_words = |value: f64| format!("{} {unit}", significant(value / factor, 3)).trim_end().to_owned();
    values.map(|value| if value.is_finite() { in_words(value) } else { String::new() })
}

/// Series in one unit, whose prefix fits the largest value of them.
pub fn scaled<const N: usize>(series: [&[f64]; N], unit: &str) -> ([Vec<f64>; N], String) {
    let finite = series.iter().flat_map(|values| values.iter()).filter(|value| value.is_finite());
    let (unit, factor) = prefixed(finite.fold(0.0, |largest: f64, value| largest.max(value.abs())), unit);
    (series.map(|values| values.iter().map(|value| value / factor).collect()), unit)
}

/// Whether blocks of time agree on a size.
pub fn stability(stability: &Stability, is_constant: bool) -> Option<String> {
    let Stability { q, dof, p } = stability;
    let agree = if is_constant { "agree" } else { "do not agree" };
    (q.is_finite() && p.is_finite()).then(|| {
        format!(
            "Blocks of time {agree} on its size: Cochran's Q is {} with {dof} degrees of freedom, p = {}.",
            significant(*q, 3),
            significant(*p, 2)
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::diagnosis::fixture;

    #[test]
    fn a_number_of_the_robot_file_stands_beside_what_is_found_in_its_place() {
        let mut diagnosed = fixture::diagnosis(0.7, "x");
        diagnosed.base.robot_toml = Robot::builtin("one_joint").unwrap().toml().into();
        let names = Names::of(&diagnosed);
        let told = names.in_robot_file("friction_slope", "friction_slope.slope[1]").unwrap();
        assert_eq!(told, "slope_s_rad (slope_s_m) of the robot file: 400.00");
        assert_eq!(names.in_robot_file("encoder_lag", "encoder_lag.T[1]"), None);
    }

    #[test]
    fn an_open_question_ends_with_the_command_of_a_motion_that_answers_it() {
        let mut diagnosed = fixture::diagnosis(0.7, "x");
        // What has no name in the catalogue, and what no derivative tells of, is left out.
        diagnosed.findings[1].aliases.push("end_stop".to_owned());
        let next = |diagnosed: &Diagnosis| next_motion(diagnosed, "d.json");
        let told = next(&diagnosed).unwrap();
        assert!(
            told.contains("`host plan d.json --separate asymmetric_friction,stribeck,cogging -o MOTION.toml`"),
            "{told}"
        );
        diagnosed.verdict = Verdict::Unknown;
        assert!(next(&diagnosed).unwrap().contains("--for cogging -o"), "only one came near");
        diagnosed.verdict = Verdict::Named;
        diagnosed.findings.iter_mut().for_each(|finding| finding.aliases.clear());
        assert_eq!(next(&diagnosed), None, "nothing is open");
        let mut emps = fixture::diagnosis(0.7, "x");
        emps.base.robot_toml = Robot::builtin("emps").unwrap().toml().into();
        assert_eq!(next(&emps), None, "the firmware cannot play it a motion");
    }
}
