//! Which part of a recording is which stage of the motion.
//!
//! A motion that was recorded with its plan says it itself ([`from_labels`]). For a table only the duty is left
//! ([`from_duty`]): how strong it is and on which joints it acts.
//!
//! ```text
//!   |u| per joint, largest of each tenth of a second, dips of 0.4 s filled
//!       ─▶ at rest:    no joint above 3 % of the recording's largest |u|
//!       ─▶ moving:     the joints above 35 % of the strongest one (the others are only held in place)
//!       ─▶ slow, fast: if the strengths, pauses of two seconds filled, fall into two groups at least 3 apart
//!                      (0.15 and 0.9, say)
//!       ─▶ runs shorter than 2 s: a rest joins the run before it, another its longer neighbour
//! ```
//!
//! The slow stage is one whatever moves in it, the fast one is split by joint: the five regions of the paper's 5.2.

use std::ops::Range;

use serde::{Deserialize, Serialize};

/// What moves in a stage.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum StageKind {
    /// Nothing moves.
    Rest,
    /// Weak duty, one joint after the other or all together.
    Slow,
    /// One joint moves.
    Joint,
    /// Several joints move together.
    Together,
    /// A stage that the motion's plan names.
    Planned,
}

/// A stretch of a recording.
#[derive(Debug, Clone, PartialEq)]
pub struct Stage {
    /// What moves.
    pub kind: StageKind,
    /// Name for people.
    pub label: String,
    /// Joints (0-based) that move in it.
    pub joints: Vec<usize>,
    /// Largest |u| in it.
    pub peak_input: f64,
    /// Its samples.
    pub samples: Range<usize>,
}

const BLOCK_S: f64 = 0.1;
const SPREAD_BLOCKS: usize = 2;
const PAUSE_BLOCKS: usize = 10;
const REST_SHARE: f64 = 0.03;
const MOVING_SHARE: f64 = 0.35;
const LEVEL_RATIO: f64 = 3.0;
const SHORTEST_S: f64 = 2.0;

/// What a block shows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Class {
    Rest,
    Slow,
    Joint(usize),
    Together,
}

/// Stages from the duty alone. `names` are the joints' names; gaps do not matter here.
pub fn from_duty(duty: &[&[f64]], period_s: f64, names: &[&str]) -> Vec<Stage> {
    let n = duty.first().map_or(0, |d| d.len());
    if n == 0 {
        return Vec::new();
    }
    let per_block = ((BLOCK_S / period_s).round() as usize).max(1);
    let strength = strengths(duty, per_block);
    let blocks = strength[0].len();
    let full = strength.iter().flatten().copied().fold(0.0, f64::max);
    let strongest = |b: usize| strength.iter().map(|s| s[b]).fold(0.0, f64::max);
    let levels = closed(&(0..blocks).map(strongest).collect::<Vec<f64>>(), PAUSE_BLOCKS);
    let boundary = slow_boundary((0..blocks).filter(|&b| strongest(b) > REST_SHARE * full).map(|b| levels[b]));
    let classes: Vec<Class> = (0..blocks)
        .map(|b| {
            let level = strongest(b);
            if level <= REST_SHARE * full || full == 0.0 {
                return Class::Rest;
            }
            let mut moving = (0..duty.len()).filter(|&j| strength[j][b] > MOVING_SHARE * level);
            match (boundary, moving.next(), moving.next()) {
                (Some(boundary), ..) if levels[b] < boundary => Class::Slow,
                (_, Some(joint), None) => Class::Joint(joint),
                _ => Class::Together,
            }
        })
        .collect();
    let shortest = (SHORTEST_S / BLOCK_S).round() as usize;
    merged(&classes, shortest)
        .into_iter()
        .map(|(class, run)| {
            let samples = run.start * per_block..(run.end * per_block).min(n);
            let samples = if run.end == blocks { samples.start..n } else { samples };
            stage(class, samples, duty, names, boundary.is_some())
        })
        .collect()
}

/// Stages from what the motion's plan says of each sample (`None`: not part of the motion). Consecutive samples with
/// the same name are one stage.
pub fn from_labels(labels: &[Option<&str>], duty: &[&[f64]]) -> Vec<Stage> {
    let mut stages: Vec<Stage> = Vec::new();
    for (k, label) in labels.iter().enumerate() {
        let Some(label) = label else { continue };
        match stages.last_mut() {
            Some(last) if last.label == *label && last.samples.end == k => last.samples.end = k + 1,
            _ => stages.push(Stage {
                kind: StageKind::Planned,
                label: (*label).to_owned(),
                joints: Vec::new(),
                peak_input: 0.0,
                samples: k..k + 1,
            }),
        }
    }
    for stage in &mut stages {
        let peaks = peaks(duty, &stage.samples);
        stage.peak_input = peaks.iter().copied().fold(0.0, f64::max);
        stage.joints = strong_joints(&peaks);
        if stage.peak_input == 0.0 {
            stage.kind = StageKind::Rest;
        }
    }
    stages
}

/// `[joint][block]`: the largest |u| of the block, short dips filled.
fn strengths(duty: &[&[f64]], per_block: usize) -> Vec<Vec<f64>> {
    duty.iter()
        .map(|u| {
            let peaks: Vec<f64> =
                u.chunks(per_block).map(|block| block.iter().fold(0.0, |peak: f64, u| peak.max(u.abs()))).collect();
            closed(&peaks, SPREAD_BLOCKS)
        })
        .collect()
}

/// Fills dips narrower than twice `reach`, and leaves edges where they are: the least of the largest around each value.
fn closed(values: &[f64], reach: usize) -> Vec<f64> {
    let around = |values: &[f64], pick: fn(f64, f64) -> f64| -> Vec<f64> {
        (0..values.len())
            .map(|b| values[b.saturating_sub(reach)..(b + reach + 1).min(values.len())].iter().copied().reduce(pick))
            .map(Option::unwrap_or_default)
            .collect()
    };
    around(&around(values, f64::max), f64::min)
}

/// Splits the strengths into two groups such that the logarithms within each group differ least (Otsu's criterion).
/// `None` if the groups' geometric means are less than [`LEVEL_RATIO`] apart.
fn slow_boundary(strengths: impl Iterator<Item = f64>) -> Option<f64> {
    let mut logs: Vec<f64> = strengths.map(f64::ln).collect();
    logs.sort_unstable_by(f64::total_cmp);
    let n = logs.len();
    let total: f64 = logs.iter().sum();
    let mut below = 0.0;
    let mut best: Option<(f64, f64, f64)> = None;
    for i in 1..n {
        below += logs[i - 1];
        let (low, high) = (below / i as f64, (total - below) / (n - i) as f64);
        let between = i as f64 * (n - i) as f64 * (high - low).powi(2);
        if logs[i] > logs[i - 1] && best.is_none_or(|(most, ..)| between > most) {
            best = Some((between, high - low, 0.5 * (logs[i - 1] + logs[i])));
        }
    }
    best.filter(|(_, apart, _)| *apart >= LEVEL_RATIO.ln()).map(|(.., boundary)| boundary.exp())
}

/// Runs of equal class. A short rest belongs to the motion that it ends; then the shortest run below the limit joins its
/// longer neighbour until none is left.
fn merged(classes: &[Class], shortest: usize) -> Vec<(Class, Range<usize>)> {
    let mut runs: Vec<(Class, Range<usize>)> = Vec::new();
    for (b, class) in classes.iter().enumerate() {
        push_run(&mut runs, *class, b..b + 1);
    }
    let mut joined: Vec<(Class, Range<usize>)> = Vec::with_capacity(runs.len());
    for (class, run) in runs {
        let before = joined.last().map(|r| r.0).filter(|_| class == Class::Rest && run.len() < shortest);
        push_run(&mut joined, before.unwrap_or(class), run);
    }
    let mut runs = joined;
    while let Some(i) = (0..runs.len()).filter(|&i| runs[i].1.len() < shortest).min_by_key(|&i| runs[i].1.len()) {
        let length = |j: usize| runs.get(j).map_or(0, |r| r.1.len());
        let before = i.checked_sub(1).map_or(0, length);
        let after = length(i + 1);
        if before == 0 && after == 0 {
            break; // the only run
        }
        runs[i].0 = if before >= after { runs[i - 1].0 } else { runs[i + 1].0 };
        let mut joined = Vec::with_capacity(runs.len());
        for (class, run) in runs {
            push_run(&mut joined, class, run);
        }
        runs = joined;
    }
    runs
}

fn push_run(runs: &mut Vec<(Class, Range<usize>)>, class: Class, run: Range<usize>) {
    match runs.last_mut() {
        Some(last) if last.0 == class => last.1.end = run.end,
        _ => runs.push((class, run)),
    }
}

fn stage(class: Class, samples: Range<usize>, duty: &[&[f64]], names: &[&str], two_levels: bool) -> Stage {
    let peaks = peaks(duty, &samples);
    let fast = if two_levels { "fast: " } else { "" };
    let strong = strong_joints(&peaks);
    let (kind, label, joints) = match class {
        Class::Rest => (StageKind::Rest, "at rest".to_owned(), Vec::new()),
        Class::Slow => (StageKind::Slow, "slow: weak duty".to_owned(), strong),
        Class::Joint(j) => {
            let name = names.get(j).copied().unwrap_or("joint");
            (StageKind::Joint, format!("{fast}{name} moves"), vec![j])
        }
        Class::Together => {
            let which = if strong.len() == duty.len() { "all" } else { "several" };
            (StageKind::Together, format!("{fast}{which} joints together"), strong)
        }
    };
    let peak_input = peaks.iter().copied().fold(0.0, f64::max);
    Stage { kind, label, joints, peak_input, samples }
}

fn peaks(duty: &[&[f64]], samples: &Range<usize>) -> Vec<f64> {
    duty.iter().map(|u| u[samples.clone()].iter().fold(0.0, |peak: f64, u| peak.max(u.abs()))).collect()
}

fn strong_joints(peaks: &[f64]) -> Vec<usize> {
    let most = peaks.iter().copied().fold(0.0, f64::max);
    (0..peaks.len()).filter(|&j| most > 0.0 && peaks[j] > MOVING_SHARE * most).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const NAMES: [&str; 3] = ["yaw", "pitch", "roll"];

    /// Square waves of 1 Hz with holding duties on the other joints, as a P controller leaves them: (seconds, joints, level).
    fn motion(parts: &[(f64, &[usize], f64)]) -> Vec<Vec<f64>> {
        let mut duty = vec![Vec::new(); 3];
        for &(seconds, joints, level) in parts {
            for k in 0..(seconds * 1000.0) as usize {
                for (j, u) in duty.iter_mut().enumerate() {
                    let sign = if k % 1000 < 500 { 1.0 } else { -1.0 };
                    // After each move the joint stands still for a while.
                    let pause = if k % 1000 > 850 { 0.1 } else { 1.0 };
                    let moved = if joints.contains(&j) { pause * level } else { 0.03 * level };
                    u.push(sign * moved);
                }
            }
        }
        duty
    }

    fn stages_of(parts: &[(f64, &[usize], f64)]) -> Vec<(String, f64)> {
        let duty = motion(parts);
        let columns: Vec<&[f64]> = duty.iter().map(Vec::as_slice).collect();
        let stages = from_duty(&columns, 1e-3, &NAMES);
        assert_eq!(stages[0].samples.start, 0);
        assert_eq!(stages.last().unwrap().samples.end, duty[0].len());
        assert!(stages.windows(2).all(|w| w[0].samples.end == w[1].samples.start));
        stages.into_iter().map(|s| (s.label, s.samples.start as f64 * 1e-3)).collect()
    }

    #[test]
    fn the_papers_five_regions() {
        let found = stages_of(&[
            (3.0, &[], 0.0),
            (6.0, &[0], 0.15),
            (6.0, &[1], 0.15),
            (6.0, &[2], 0.15),
            (6.0, &[0, 1, 2], 0.15),
            (8.0, &[0], 0.9),
            (8.0, &[1], 0.9),
            (8.0, &[2], 0.9),
            (8.0, &[0, 1, 2], 0.9),
        ]);
        let expected = [
            ("at rest", 0.0),
            ("slow: weak duty", 3.0),
            ("fast: yaw moves", 27.0),
            ("fast: pitch moves", 35.0),
            ("fast: roll moves", 43.0),
            ("fast: all joints together", 51.0),
        ];
        assert_eq!(found.len(), expected.len(), "{found:?}");
        for ((label, from), (name, at)) in found.iter().zip(expected) {
            assert_eq!(label, name);
            assert!((from - at).abs() < 0.5, "{label} starts at {from}, not {at}");
        }
    }

    #[test]
    fn one_level_of_duty_is_not_called_slow_or_fast() {
        let found = stages_of(&[(3.0, &[], 0.0), (10.0, &[0, 1], 0.4), (10.0, &[0, 1, 2], 0.7), (5.0, &[1], 0.6)]);
        let labels: Vec<&str> = found.iter().map(|f| f.0.as_str()).collect();
        assert_eq!(labels, ["at rest", "all joints together", "pitch moves"]);
    }

    #[test]
    fn a_recording_without_any_input_rests() {
        assert_eq!(stages_of(&[(0.7, &[], 0.0)]), [("at rest".to_owned(), 0.0)]);
        assert!(from_duty(&[], 1e-3, &[]).is_empty());
        assert!(from_duty(&[&[]], 1e-3, &["a"]).is_empty());
    }

    #[test]
    fn the_plan_of_the_motion_names_its_stages() {
        let labels = [None, Some("rest"), Some("rest"), Some("slow"), Some("slow"), Some("rest"), None];
        let u = [0.0, 0.0, 0.0, 0.1, -0.15, 0.0, 0.0];
        let stages = from_labels(&labels, &[&u, &[0.0; 7]]);
        let spans: Vec<_> = stages.iter().map(|s| (s.label.as_str(), s.samples.clone())).collect();
        assert_eq!(spans, [("rest", 1..3), ("slow", 3..5), ("rest", 5..6)]);
        assert_eq!(stages[0].kind, StageKind::Rest);
        assert_eq!((stages[1].kind, stages[1].peak_input), (StageKind::Planned, 0.15));
        assert_eq!(stages[1].joints, [0]);
    }
}
