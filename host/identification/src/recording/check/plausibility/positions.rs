//! Positions against the limits of the robot file.

use super::rates::Scene;
use super::stats::{position, range, spread};
use super::unit::{self, Mistake};
use crate::recording::check::{About, Findings};
use crate::recording::{Channel, Recording, Severity};
use crate::robot::ChannelKind;

/// Positions may pass the limits of the robot file by this factor.
const LIMIT_FACTOR: f64 = 1.2;
/// A joint that uses less of its range than this does not say that a unit fits, where nothing but its limits tells.
const LEAST_USE: f64 = 0.1;
/// The same where gyros tell.
const LEAST_USE_SEEN: f64 = 0.02;
/// A driven joint that uses less of its range than this makes one look at units.
const SMALL_USE: f64 = 0.05;
/// Share of the readings at either end that may be wrong.
const LONE_SHARE: f64 = 1e-3;
/// Positions that pass the limits by this factor are none, whatever the unit.
const IMPOSSIBLE: f64 = 100.0;
/// Gyros agree with encoders where they miss at most this share of the motion.
const AGREES: f64 = 0.3;

/// A joint whose positions its limits do not allow.
struct Exceeding<'a> {
    joint: usize,
    channel: &'a Channel,
    low: f64,
    high: f64,
    allowed: f64,
    /// Of the whole width.
    allowed_span: f64,
    mistakes: Vec<Mistake>,
}

pub(super) fn look(recording: &Recording, scene: Option<&Scene<'_>>, findings: &mut Findings) {
    let least_use = if scene.is_some() { LEAST_USE_SEEN } else { LEAST_USE };
    let mut exceeding = Vec::new();
    for joint in 0..recording.robot.joints.len() {
        let Some(channel) = position(recording, joint) else { continue };
        let limits = recording.robot.joints[joint].limits;
        let allowed = LIMIT_FACTOR * limits[0].abs().max(limits[1].abs());
        let Some((low, high)) = most_of(&channel.values) else { continue };
        let at_link = matches!(channel.spec.kind, ChannelKind::LinkPosition { .. });
        if scene.is_none() {
            small(recording, joint, channel, (high - low) / (limits[1] - limits[0]), at_link, findings);
        }
        lone(channel, allowed.max(high.abs()).max(low.abs()), findings);
        if low.abs().max(high.abs()) <= allowed {
            continue;
        }
        let allowed_span = LIMIT_FACTOR * (limits[1] - limits[0]);
        let fits = |mistake: &Mistake| {
            let used = (high - low) / mistake.factor / allowed_span;
            mistake.factor > 1.0 && (least_use..=1.0).contains(&used)
        };
        let mistakes = unit::of_position(recording, joint, at_link).into_iter().filter(fits).collect();
        exceeding.push(Exceeding { joint, channel, low, high, allowed, allowed_span, mistakes });
    }
    let scaled: Vec<&Exceeding<'_>> = exceeding.iter().filter(|e| e.high - e.low > e.allowed_span).collect();
    let chosen = choose(recording, scene, &scaled);
    for e in &exceeding {
        let fits = e.high - e.low <= e.allowed_span;
        let named = (!fits).then_some(chosen.as_deref()).flatten();
        let named = named.and_then(|looks| e.mistakes.iter().find(|mistake| mistake.looks == looks));
        let impossible = e.low.abs().max(e.high.abs()) > IMPOSSIBLE * e.allowed;
        // Readings of which some are where they may be can come from a joint that goes on beyond its limits.
        let outside = 0.5 * (e.low + e.high).abs() > e.allowed;
        let (severity, what, advice) = match named {
            _ if fits => (
                if outside { Severity::Error } else { Severity::Warning },
                "but its span fits".to_owned(),
                "set the zero position: hold the robot in its marked pose, command \"set zero\", record again; in a table, subtract it (zero under import.columns in the robot file)",
            ),
            Some(mistake) => (Severity::Error, format!("and {}", mistake.looks), mistake.advice.as_str()),
            None if impossible => (
                Severity::Error,
                "by so much that they are no positions of this robot".to_owned(),
                "check the column, its unit, the gear and the counts per turn in the robot file; is this another robot?",
            ),
            None => (
                Severity::Warning,
                "and the robot file's limits are not kept".to_owned(),
                "check unit, gear and limits in the robot file",
            ),
        };
        findings.add(
            severity,
            About::Units,
            Some(&e.channel.spec.name),
            format!(
                "positions of {} from {:.4} to {:.4} {} exceed the robot's {:.2} {what}",
                recording.robot.joints[e.joint].name, e.low, e.high, e.channel.spec.unit, e.allowed
            ),
            advice,
        );
    }
}

/// The mistake that explains all joints that exceed their limits: gyros tell, else whole numbers, else the noise at rest,
/// else the range that would be used.
fn choose(recording: &Recording, scene: Option<&Scene<'_>>, joints: &[&Exceeding<'_>]) -> Option<String> {
    let first = joints.first()?;
    let factor_of = |e: &Exceeding<'_>, looks: &str| {
        e.mistakes.iter().find(|mistake| mistake.looks == looks).map(|mistake| mistake.factor)
    };
    let common = |mistake: &&Mistake| joints.iter().all(|e| factor_of(e, &mistake.looks).is_some());
    let candidates: Vec<&Mistake> = first.mistakes.iter().filter(common).collect();
    let told = |distance: &dyn Fn(&Mistake) -> f64| {
        let nearest = candidates.iter().min_by(|a, b| distance(a).total_cmp(&distance(b)));
        nearest.map(|mistake| mistake.looks.clone())
    };
    if let Some(scene) = scene {
        let missed = |mistake: &Mistake| {
            let mut scale = vec![1.0; recording.robot.joints.len()];
            for e in joints {
                scale[e.joint] = 1.0 / factor_of(e, &mistake.looks).unwrap_or(1.0);
            }
            scene.missed_with(&scale).unwrap_or(f64::INFINITY)
        };
        if candidates.iter().any(|mistake| missed(mistake) < AGREES) {
            return told(&missed);
        }
        if scene.missed_with(&vec![1.0; recording.robot.joints.len()]).is_some() {
            return None; // gyros see the motion, and no unit makes the encoders agree with them
        }
    }
    let whole = first.channel.values.iter().all(|value| value.is_nan() || value.fract() == 0.0);
    if whole && let Some(counts) = candidates.iter().find(|mistake| mistake.looks.contains("counts")) {
        return Some(counts.looks.clone());
    }
    let rest = spread(&first.channel.values[recording.rest_window()]).filter(|rest| rest.deviation > 0.0);
    match rest {
        Some(rest) => told(&|mistake| (rest.deviation / first.channel.spec.sigma / mistake.factor).ln().abs()),
        None => told(&|mistake| (first.allowed_span / ((first.high - first.low) / mistake.factor)).ln()),
    }
}

/// A joint that is driven and hardly moves, where no other sensor tells: perhaps a factor was applied twice.
fn small(recording: &Recording, joint: usize, channel: &Channel, used: f64, at_link: bool, findings: &mut Findings) {
    let driven = recording.duty[joint].iter().any(|input| *input != 0.0);
    let mut mistakes = unit::of_position(recording, joint, at_link);
    mistakes.retain(|mistake| mistake.factor < 1.0 && (LEAST_USE..=1.0).contains(&(used / mistake.factor)));
    let Some(first) = mistakes.first().filter(|_| driven && used < SMALL_USE) else { return };
    let looks = mistakes.iter().map(|mistake| mistake.looks.as_str()).collect::<Vec<_>>().join(", or ");
    findings.add(
        Severity::Warning,
        About::Units,
        Some(&channel.spec.name),
        format!("{} uses {:.2} % of its range: it {looks}", recording.robot.joints[joint].name, 100.0 * used),
        &first.advice,
    );
}

/// Least and greatest reading but for a thousandth at either end.
fn most_of(values: &[f64]) -> Option<(f64, f64)> {
    let mut valid: Vec<f64> = values.iter().copied().filter(|value| !value.is_nan()).collect();
    if valid.is_empty() {
        return None;
    }
    let lone = (LONE_SHARE * valid.len() as f64) as usize;
    let last = valid.len() - 1;
    let low = *valid.select_nth_unstable_by(lone, f64::total_cmp).1;
    let high = *valid.select_nth_unstable_by(last - lone, f64::total_cmp).1;
    Some((low, high))
}

/// A few readings that are far from all others.
fn lone(channel: &Channel, expected: f64, findings: &mut Findings) {
    let impossible = channel.values.iter().filter(|value| value.abs() > IMPOSSIBLE * expected).count();
    let worst = range(&channel.values).map_or(0.0, |(low, high)| low.abs().max(high.abs()));
    if impossible > 0 {
        findings.add(
            Severity::Error,
            About::Units,
            Some(&channel.spec.name),
            format!("{impossible} readings are no positions (up to {worst:.3e} {})", channel.spec.unit),
            "leave these fields empty in the table (the sensor had no valid reading), and look for what made them",
        );
    }
}
