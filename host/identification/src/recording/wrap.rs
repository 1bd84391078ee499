//! Positions that begin again after a turn: a counter that overflows, an angle between −π and π.
//!
//! ```text
//!   reading        ╱│  ╱│        Its whole span is one turn, its jumps are one turn, and a turn is where it is on
//!                 ╱ │ ╱ │ ╱      to within what it moves between other samples: then the turns are put back.
//!                ╱  │╱  │╱       Where one of these is not so, the jump is told and nothing is guessed.
//! ```

use super::Recording;
use crate::robot::{ChannelKind, JointKind};

/// Shares of a turn that the readings span: wrapped ones stay within it, but for noise that was added behind, and jump over most of it.
const SPAN: std::ops::RangeInclusive<f64> = 0.5..=1.02;
/// Share of a turn that a joint may move between two samples and still be followed: at half a turn, forth and back look the same. Halved, fast wheels
/// at low rates are refused; doubled, a wrong turn is counted unseen.
const FOLLOWED: f64 = 0.25;
/// Share of steps that may be wider than that in a position that wraps and has not quite a turn's span…
const MOST_WIDE: f64 = 0.1;
/// …which is one within this share.
const WHOLE: f64 = 0.02;
/// A jump less its turn is at most so many times the largest step elsewhere (and noise). At 1 a jump in the fastest moment is refused,
/// at 6 a reading that was set to zero passes where it stood near a whole turn.
const AS_ELSEWHERE: f64 = 3.0;
/// Sigmas of noise in a step.
const NOISE_SIGMAS: f64 = 8.0;
/// Readings that span fewer sigmas than this do not move.
const MOVED_SIGMAS: f64 = 100.0;
/// Fewest readings that say what a position does elsewhere.
const LEAST_READINGS: usize = 20;
/// A jump over this share of all that is read is told where it is no turn that is known…
const MOST_OF_SPAN: f64 = 0.9;
/// …and no other step, nor those beside it, is more than this share of it.
const SMALL: f64 = 0.1;

/// A position channel that jumps.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Wrapped {
    /// Index among the recording's channels.
    pub channel: usize,
    /// One turn, in the channel's unit.
    turn: Option<Turn>,
    /// Samples before which it jumps, at least one.
    pub jumps: Vec<usize>,
    /// Why turns cannot be put back.
    pub doubt: Option<Doubt>,
}

/// A jump that leaves open where the joint is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Doubt {
    /// The sample behind the jump.
    pub sample: usize,
    /// What is unclear.
    pub why: &'static str,
}

/// What a reading begins again after.
#[derive(Debug, Clone, PartialEq)]
struct Turn {
    size: f64,
    words: String,
}

/// The position channels of a recording that jump by a turn. `counts` has one of the table's counts in the channel's unit, where it
/// holds whole numbers; a device has none.
pub(super) fn find(recording: &Recording, counts: &[Option<f64>]) -> Vec<Wrapped> {
    let is_position = |kind| matches!(kind, ChannelKind::MotorPosition { .. } | ChannelKind::LinkPosition { .. });
    (0..recording.channels.len())
        .filter(|&channel| is_position(recording.channels[channel].spec.kind))
        .filter_map(|channel| of_channel(recording, channel, counts.get(channel).copied().flatten()))
        .collect()
}

impl Wrapped {
    /// How far it jumps to that sample, in the channel's unit.
    pub(super) fn jump(&self, recording: &Recording, sample: usize) -> f64 {
        let values = &recording.channels[self.channel].values;
        let before = values[..sample].iter().rev().find(|value| !value.is_nan());
        values[sample] - before.copied().unwrap_or(f64::NAN)
    }

    /// "one turn (6.2832 rad)".
    pub(super) fn words(&self, unit: &str) -> String {
        match &self.turn {
            Some(turn) => format!("{} ({:.4} {unit})", turn.words, turn.size),
            None => "most of all that it reads".to_owned(),
        }
    }

    /// Puts the turns back.
    pub(super) fn unwrap(&self, recording: &mut Recording) {
        let Some(turn) = self.turn.as_ref().filter(|_| self.doubt.is_none()) else { return };
        let values = &mut recording.channels[self.channel].values;
        let mut before = f64::NAN;
        let mut turns = 0.0;
        for value in values.iter_mut().filter(|value| !value.is_nan()) {
            let read = *value;
            if !before.is_nan() {
                turns -= ((read - before) / turn.size).round();
            }
            *value = read + turns * turn.size;
            before = read;
        }
    }
}

/// Steps of a channel from one valid reading to the next: the later sample, and how far.
fn steps(values: &[f64]) -> Vec<(usize, f64)> {
    let valid: Vec<usize> = (0..values.len()).filter(|&k| !values[k].is_nan()).collect();
    valid.windows(2).map(|pair| (pair[1], values[pair[1]] - values[pair[0]])).collect()
}

fn of_channel(recording: &Recording, channel: usize, count: Option<f64>) -> Option<Wrapped> {
    let spec = &recording.channels[channel].spec;
    let values = &recording.channels[channel].values;
    let valid = || values.iter().copied().filter(|value| !value.is_nan());
    let (low, high) = (valid().fold(f64::INFINITY, f64::min), valid().fold(f64::NEG_INFINITY, f64::max));
    let span = high - low;
    if valid().count() < LEAST_READINGS || span.is_nan() || span <= MOVED_SIGMAS * spec.sigma {
        return None;
    }
    let steps = steps(values);
    let noise = NOISE_SIGMAS * spec.sigma;
    for turn in turns(recording, channel, count) {
        if !SPAN.contains(&(span / turn.size)) {
            continue;
        }
        let is_jump = |step: f64| step.abs() > 0.5 * turn.size;
        let jumps: Vec<usize> = steps.iter().filter(|(_, step)| is_jump(*step)).map(|(k, _)| *k).collect();
        // A joint may go far while nothing is recorded.
        if !jumps.iter().any(|&k| !recording.gap_before(k)) {
            continue;
        }
        let rest = |step: f64| step - turn.size * (step / turn.size).round();
        // Where steps are as wide as turns, only a span of just one turn says that it wraps.
        let wide = steps.iter().filter(|(_, step)| rest(*step).abs() > FOLLOWED * turn.size).count();
        if wide as f64 > MOST_WIDE * steps.len() as f64 && (span / turn.size - 1.0).abs() > WHOLE {
            continue;
        }
        let without_gap = || steps.iter().filter(|(k, _)| !recording.gap_before(*k));
        let usual = without_gap().filter(|(_, step)| !is_jump(*step)).map(|(_, step)| step.abs()).fold(0.0, f64::max);
        // A jump is the clearest place to show.
        let (jumping, going): (Vec<_>, Vec<_>) = steps.iter().partition(|(_, step)| is_jump(*step));
        let doubt = jumping.into_iter().chain(going).find_map(|&(sample, step)| {
            let far = rest(step).abs() > FOLLOWED * turn.size;
            let why = match (recording.gap_before(sample), is_jump(step)) {
                (true, _) if far => "a gap lies there in which it may have made any number of turns",
                (false, _) if far => "it moves more than a quarter of a turn between two samples",
                (false, true) if rest(step).abs() > AS_ELSEWHERE * usual + noise => {
                    "a turn put back does not make it go on as it went before"
                }
                _ => return None,
            };
            Some(Doubt { sample, why })
        });
        return Some(Wrapped { channel, turn: Some(turn), jumps, doubt });
    }
    unknown(&steps, span, channel)
}

/// One jump and more from one end of the readings to the other, of a size that is no turn.
fn unknown(steps: &[(usize, f64)], span: f64, channel: usize) -> Option<Wrapped> {
    let jumps: Vec<usize> = (1..steps.len().saturating_sub(1))
        .filter(|&i| {
            let beside = steps[i - 1].1.abs().max(steps[i + 1].1.abs());
            steps[i].1.abs() > MOST_OF_SPAN * span && beside < SMALL * steps[i].1.abs()
        })
        .collect();
    let first = *jumps.first()?;
    let others = (0..steps.len()).filter(|i| !jumps.contains(i)).map(|i| steps[i].1.abs()).fold(0.0, f64::max);
    if others > SMALL * span {
        return None;
    }
    let doubt =
        Some(Doubt { sample: steps[first].0, why: "that is no turn of this joint, of its motor or of a counter" });
    Some(Wrapped { channel, turn: None, jumps: jumps.into_iter().map(|i| steps[i].0).collect(), doubt })
}

/// What a position may begin again after, the smallest first.
fn turns(recording: &Recording, channel: usize, count: Option<f64>) -> Vec<Turn> {
    const TURN: f64 = std::f64::consts::TAU;
    let (joint, on_motor) = match recording.channels[channel].spec.kind {
        ChannelKind::MotorPosition { joint } => (joint, true),
        ChannelKind::LinkPosition { joint } => (joint, false),
        _ => return Vec::new(),
    };
    let description = &recording.robot.joints[joint];
    let mut turns = Vec::new();
    let mut add = |size: f64, words: String| turns.push(Turn { size, words });
    if description.kind == JointKind::Revolute {
        add(TURN, "one turn".to_owned());
        add(360.0, "360, one turn in degrees".to_owned());
    }
    let geared = (description.gear - 1.0).abs() > 1e-9;
    if on_motor && (geared || description.kind == JointKind::Prismatic) {
        add(TURN / description.gear, "one turn of the motor".to_owned());
    }
    if let Some(count) = count {
        for bits in 8..=32 {
            add(count * f64::from(bits).exp2(), format!("{} counts, a counter of {bits} bit", 1u64 << bits));
        }
    }
    turns.sort_by(|a, b| a.size.total_cmp(&b.size));
    turns
}
