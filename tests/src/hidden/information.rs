//! Sizes by information: an effect is made as large as the recording tells so much of it, whatever that is in N m or s.
//!
//! ```text
//! ln margin │            ╱·  3000  large          margin: 2 Δ log L of the effect's law over its nearest rival's refit,
//!           │        ·╱       300  medium                 measured on the same robot with other noise
//!           │    ╱·            30  small          level:  the catalogue's sizes on a logarithmic scale
//!           └──────────────── level
//! ```
//!
//! For small effects the margin grows with the square of the size, so that a few secant steps arrive. An effect that is met or not (a
//! ceiling, a stop) may jump from none to more than what is asked for, and one whose plant is another model altogether (bristles, where there
//! was a sign) shows at any size; then the nearest level that was tried is taken, and says its margin.

use host::diagnose::margin;
use host::effect::{Effect, Size};
use host::robot::Robot;
use host::simulate::{Direct, EffectChoice, Options, SHORT_MOTION};
use serde::{Deserialize, Serialize};
use solve::levenberg::Settings;

/// Recordings at most.
const MOST_PROBES: usize = 7;
/// Margins within this factor are as asked.
const NEAR: f64 = 1.4;
/// The first level: below the catalogue's small.
const FIRST: f64 = -3.0;
/// Steps between levels.
const FARTHEST: f64 = 6.0;
/// Where nothing is to be seen yet.
const UP: f64 = 1.5;
/// What the logarithm of a margin grows by with a level, before two are known: the square of 2.7, the usual ratio of sizes.
const USUAL_SLOPE: f64 = 2.0;
/// Slopes that are believed, and one over it.
const STEEPEST: f64 = 10.0;
/// Less than this is nothing: noise makes as much.
const LEAST: f64 = 2.0;
/// Motions of one robot: the first is the case itself.
const OF_PROBES: u64 = 2;

/// A level of an effect, and the margin there.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Sized {
    /// See [`Size::Level`].
    pub level: f64,
    /// 2 Δ log L.
    pub margin: f64,
}

/// What a size's name asks for.
pub fn asked(size: &str) -> f64 {
    match size {
        "small" => 30.0,
        "large" => 3000.0,
        _ => 300.0,
    }
}

/// The level at which the robot of this seed shows as much of `effect` as `target`, as near as it can be had.
///
/// # Panics
/// If a built-in robot cannot be diagnosed.
pub fn sized(effect: &'static Effect, seed: u64, target: f64) -> Sized {
    let robot = Robot::builtin("doggy").expect("the built-in robot is valid");
    let settings = Settings { threads: 1, ..Settings::default() };
    let probe = |level: f64| {
        let effects = vec![EffectChoice { effect, size: Size::Level(level) }];
        let options = Options { seed, effects, ..Options::new(robot.clone()) };
        // A lag may be shorter than the plant's step can follow.
        let simulated = Direct::record_nth(&options, SHORT_MOTION, OF_PROBES).ok()?;
        let margin = margin(&robot, &simulated.recording, effect, &settings).unwrap_or(0.0);
        tracing::debug!(effect = effect.id, seed, level, margin, target, "probe");
        Some(margin)
    };
    search(probe, target)
}

/// Looks for the level of a growing function where it is `target`; `None` is a level that cannot be had, being too small.
fn search(mut probe: impl FnMut(f64) -> Option<f64>, target: f64) -> Sized {
    let off = |margin: f64| (margin / target).ln();
    // The nearest below and above.
    let (mut below, mut above): (Option<Sized>, Option<Sized>) = (None, None);
    let mut best: Option<Sized> = None;
    let (mut seen, mut level) = (Vec::new(), FIRST);
    for _ in 0..MOST_PROBES {
        let margin = probe(level);
        let at = Sized { level, margin: margin.unwrap_or(0.0) };
        // Nothing is near to no size, however small.
        let shows = at.margin > LEAST;
        if shows && best.is_none_or(|best| off(at.margin).abs() < off(best.margin).abs()) {
            best = Some(at);
        }
        if shows && off(at.margin).abs() < NEAR.ln() {
            break;
        }
        if at.margin < target {
            below = Some(at);
        } else if above.is_some_and(|above| at.margin >= above.margin) {
            // It shows more the smaller it is: no size is small.
            break;
        } else {
            above = Some(at);
        }
        if shows {
            seen.push(at);
        }
        level = next(&seen, target, level);
        // Inside of what is known, and not into its corners.
        let width = above.zip(below).map_or(f64::INFINITY, |(above, below)| above.level - below.level);
        // Where nothing shows below, no line leads: halfway.
        let blind = below.is_some_and(|below| below.margin <= LEAST);
        let share = if blind { 0.5 } else { 0.15 };
        let corner = if width.is_finite() { share * width } else { 1e-3 };
        let low = below.map_or(f64::NEG_INFINITY, |below| below.level + corner);
        let high = above.map_or(f64::INFINITY, |above| above.level - corner);
        level = level.max(low).min(high);
    }
    best.unwrap_or(Sized { level, margin: 0.0 })
}

/// Where a straight line through the logarithms of the two margins nearest to the target leads; with one margin, a line of the usual slope, and
/// with none up.
fn next(seen: &[Sized], target: f64, level: f64) -> f64 {
    let off = |at: &Sized| (at.margin / target).ln();
    let mut nearest = seen.to_vec();
    nearest.sort_by(|a, b| off(a).abs().total_cmp(&off(b).abs()));
    let Some(first) = nearest.first() else { return level + UP };
    let slope = nearest.get(1).map(|second| (off(first) - off(second)) / (first.level - second.level));
    let slope = slope.filter(|slope| (STEEPEST.recip()..STEEPEST).contains(slope)).unwrap_or(USUAL_SLOPE);
    first.level - (off(first) / slope).clamp(-FARTHEST, FARTHEST)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_square_law_is_met_in_a_few_steps() {
        for (target, slope) in [(30.0, 1.3), (300.0, 2.6), (3000.0, 0.7)] {
            let mut probes = 0;
            let found = search(
                |level| {
                    probes += 1;
                    Some(1e5 * (slope * (level + 1.0_f64)).exp())
                },
                target,
            );
            assert!((found.margin / target).ln().abs() < NEAR.ln(), "{found:?}");
            assert!(probes <= 5, "{probes}");
        }
    }

    #[test]
    fn what_shows_at_any_size_is_not_looked_for_for_long() {
        let mut probes = 0;
        let found = search(
            |level| {
                probes += 1;
                Some(1e6 * (1.0 + (level + 6.0).powi(2)))
            },
            300.0,
        );
        // −8.2: the second one; the third shows more.
        assert!((-8.5..-7.9).contains(&found.level), "{found:?}");
        assert_eq!(probes, 3);
    }

    #[test]
    fn what_jumps_or_cannot_be_had_is_as_near_as_it_comes() {
        // A ceiling that is met from a level on.
        let found = search(|level| Some(if level > -1.5 { 5000.0 * (level + 1.5) } else { 0.0 }), 30.0);
        assert!(found.margin > 0.0 && found.level > -1.5, "{found:?}");
        // A lag that the plant cannot follow below a level.
        let found = search(|level| (level > -2.0).then(|| 400.0 * (2.0 * (level + 2.0)).exp()), 30.0);
        assert!((-2.0..-1.0).contains(&found.level), "{found:?}");
    }
}
