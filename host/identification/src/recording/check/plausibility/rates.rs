//! Gyros against encoders, below the frequencies at which transmissions swing: there a link goes where its motor does.
//! What the encoders predict of each gyro is compared with what it reads, but for a lag; where they do not agree, the mistake is
//! named that would make them.

use super::stats::{position, range, smooth};
use super::unit;
use crate::recording::check::{About, Findings};
use crate::recording::{Channel, Recording, Severity};
use crate::robot::{ChannelKind, Gyro, Robot, Symbol, Transmission};

/// Periods of the slowest transmission over which rates are smoothed, on either side: it is then cut to a twentieth where it swings, and
/// bends by a fifth where a third is left. At half of it a belt that swings is seen; at twice of it a motion of some hertz is not.
const SMOOTH_PERIODS: f64 = 1.5;
/// The same where all transmissions are rigid, s: long against the steps of encoders.
const SMOOTH_RIGID_S: f64 = 0.02;
/// And at most, s: a belt softer than 3 Hz is no belt, a start value is wrong.
const SMOOTH_MOST_S: f64 = 0.5;
/// A gyro may lag, or lead, by so much, s: its own filter, and another clock. More is told by no rate, but by a calibration.
const MOST_LAG_S: f64 = 0.05;
/// A gyro that misses more than this share of the motion does not agree. Wrong by 1.5 in scale is 0.1 … 0.25, a wrong
/// sign 4, another unit 0.97 or 3000.
const DISAGREES: f64 = 0.5;
/// From here on a gyro disagrees if a mistake is found that leaves this share of what it misses, and less.
const DOUBTFUL: f64 = 0.1;
const LEFT_BY_MISTAKE: f64 = 0.3;
/// A ratio of measured to predicted rates within this factor of 1 is the right unit.
const UNIT_FACTOR: f64 = 1.5;
/// A correlation from which on two rates differ by a factor only.
const ALIKE: f64 = 0.9;
/// What a mistake leaves missed if it is the one.
const EXPLAINS: f64 = 0.3;
/// A joint that uses more of its range than this is told in the right unit: each mistake is larger than a factor of ten.
const PLAUSIBLE_USE: f64 = 0.1;
/// Motion below this many sigmas of the gyro, or of speeds by the encoders, proves nothing.
const VISIBLE_SIGMAS: f64 = 3.0;
/// A motion shorter than this may be the swinging of a transmission.
const LEAST_MOTION_S: f64 = 1.0;
/// Fewest samples that prove something.
const LEAST_SAMPLES: usize = 200;
/// So many samples are looked at.
const MOST_SAMPLES: usize = 2000;

/// What encoders and gyros say of the slow part of a motion.
pub(super) struct Scene<'a> {
    recording: &'a Recording,
    /// Positions and speeds by sample, then joint.
    motion: Vec<(Vec<f64>, Vec<f64>)>,
    /// Readings by lag, then sample; the lag in the middle is none.
    gyros: Vec<(&'a Gyro, Vec<Vec<[f64; 3]>>)>,
    /// Time from one of these samples to the next, on the whole.
    period_s: f64,
    /// Variance of a predicted rate by the noise of the encoders, of all axes together, (rad/s)²: what a robot that stands still seems to do.
    still: f64,
}

/// What is assumed of the encoders.
struct Encoders {
    /// Column that each joint is read from.
    order: Vec<usize>,
    scale: Vec<f64>,
}

/// What might be wrong.
#[derive(Clone)]
struct Suspect {
    missed: f64,
    looks: String,
    advice: String,
}

impl<'a> Scene<'a> {
    /// Nothing without gyros, or where a joint has no encoder.
    pub(super) fn of(recording: &'a Recording) -> Option<Self> {
        let joints = recording.robot.joints.len();
        recording.robot.gyros().next()?;
        let encoders: Option<Vec<&Channel>> = (0..joints).map(|joint| position(recording, joint)).collect();
        let encoders = encoders?;
        let half = ((smoothing_s(recording) / recording.period_s).round() as usize).max(1);
        let span_s = 2.0 * half as f64 * recording.period_s;
        let still = encoders.iter().map(|encoder| 2.0 * (encoder.spec.sigma / span_s).powi(2)).sum();
        let positions: Vec<Vec<f64>> =
            encoders.iter().map(|encoder| smooth(recording, &encoder.values, half)).collect();
        let speeds: Vec<Vec<f64>> = positions.iter().map(|values| speeds(recording, values)).collect();
        let told: Vec<usize> =
            (0..recording.len()).filter(|&k| speeds.iter().all(|speed| !speed[k].is_nan())).collect();
        if told.len() < LEAST_SAMPLES {
            return None;
        }
        let step = told.len().div_ceil(MOST_SAMPLES);
        let picks: Vec<usize> = told.iter().copied().step_by(step).collect();
        let at = |columns: &[Vec<f64>], k: usize| columns.iter().map(|column| column[k]).collect::<Vec<f64>>();
        let motion = picks.iter().map(|&k| (at(&positions, k), at(&speeds, k))).collect();
        let lags = (MOST_LAG_S / recording.period_s).round() as isize;
        let gyros = recording.robot.gyros().enumerate().filter_map(|(index, gyro)| {
            let axis = |axis| {
                let kind = ChannelKind::GyroAxis { gyro: index, body: gyro.body, axis };
                let channel = recording.channels.iter().find(|channel| channel.spec.kind == kind)?;
                Some(smooth(recording, &channel.values, half))
            };
            let axes = [axis(0)?, axis(1)?, axis(2)?];
            let read = |k: usize, lag: isize| {
                let k = k.checked_add_signed(lag).filter(|k| *k < recording.len());
                k.map_or([f64::NAN; 3], |k| [axes[0][k], axes[1][k], axes[2][k]])
            };
            let by_lag =
                (-lags..=lags).step_by(lag_step(lags)).map(|lag| picks.iter().map(|&k| read(k, lag)).collect());
            Some((gyro, by_lag.collect()))
        });
        let gyros = gyros.collect();
        Some(Self { recording, motion, gyros, period_s: step as f64 * recording.period_s, still })
    }

    /// Share of the motion that the gyros miss, in the mean, if the encoders' columns are multiplied by `scale`; `None`
    /// if nothing is seen.
    pub(super) fn missed_with(&self, scale: &[f64]) -> Option<f64> {
        let order = (0..scale.len()).collect();
        self.mean_missed(&Encoders { order, scale: scale.to_vec() })
    }

    fn mean_missed(&self, encoders: &Encoders) -> Option<f64> {
        let rates = self.rates(encoders);
        let missed: Vec<f64> =
            self.gyros.iter().filter_map(|(gyro, read)| Some(self.compare(gyro, read, &rates)?.missed)).collect();
        (!missed.is_empty()).then(|| missed.iter().sum::<f64>() / missed.len() as f64)
    }

    /// Share of its range that a joint uses.
    fn range_share(&self, joint: usize) -> f64 {
        let limits = self.recording.robot.joints[joint].limits;
        let range = position(self.recording, joint).and_then(|channel| range(&channel.values));
        range.map_or(0.0, |(low, high)| (high - low) / (limits[1] - limits[0]))
    }

    /// Rate of every body in its own axes, by sample.
    fn rates(&self, encoders: &Encoders) -> Vec<Vec<[f64; 3]>> {
        let joints = encoders.order.len();
        let chain = self.recording.robot.chain();
        let (mut q, mut qd) = (vec![0.0; joints], vec![0.0; joints]);
        let of = |(positions, speeds): &(Vec<f64>, Vec<f64>)| {
            for joint in 0..joints {
                let (column, scale) = (encoders.order[joint], encoders.scale[joint]);
                q[joint] = scale * positions[column];
                qd[joint] = scale * speeds[column];
            }
            let mut rates = vec![[0.0; 3]; joints];
            chain.body_rates(&q, &qd, &mut rates);
            rates
        };
        self.motion.iter().map(of).collect()
    }

    /// At the lag at which prediction and reading go together most, whatever the axes.
    fn compare(&self, gyro: &Gyro, read: &[Vec<[f64; 3]>], rates: &[Vec<[f64; 3]>]) -> Option<Agreement> {
        let predicted: Vec<[f64; 3]> = rates
            .iter()
            .map(|rates| {
                let rate = rates[gyro.body];
                gyro.rotation.map(|row| row.iter().zip(rate).map(|(r, w)| r * w).sum::<f64>())
            })
            .collect();
        let at = |read: &Vec<[f64; 3]>| {
            let pairs = predicted.iter().zip(read).filter(|(_, read)| read.iter().all(|w| !w.is_nan()));
            let pairs: Vec<Pair> = pairs.map(|(p, r)| (*p, *r)).collect();
            Agreement::of(&pairs, gyro.sigma_rad_s, self)
        };
        let together = |agreement: &Agreement| {
            agreement.pr.iter().flatten().map(|both| both * both).sum::<f64>() / agreement.rr.iter().sum::<f64>()
        };
        read.iter().filter_map(at).max_by(|a, b| together(a).total_cmp(&together(b)))
    }
}

/// Lags are tried in steps of about a tenth of the longest, and none at all among them.
fn lag_step(lags: isize) -> usize {
    let lags = lags.unsigned_abs();
    (1..=(lags / 10).max(1)).rev().find(|step| lags.is_multiple_of(*step)).unwrap_or(1)
}

/// Half the width over which rates are smoothed, s.
fn smoothing_s(recording: &Recording) -> f64 {
    let robot = &recording.robot;
    let elastic = |joint: &usize| robot.joints[*joint].transmission == Transmission::Elastic;
    let periods = (0..robot.joints.len()).filter(elastic).filter_map(|joint| swing_s(robot, joint));
    match periods.reduce(f64::max) {
        Some(period_s) => (SMOOTH_PERIODS * period_s).clamp(SMOOTH_RIGID_S, SMOOTH_MOST_S),
        None => SMOOTH_RIGID_S,
    }
}

/// Period of a link that swings on its transmission while the motor stands, by the robot file, s.
fn swing_s(robot: &Robot, joint: usize) -> Option<f64> {
    let joints = robot.joints.len();
    let middle: Vec<f64> = robot.joints.iter().map(|joint| 0.5 * (joint.limits[0] + joint.limits[1])).collect();
    let mut inertia = vec![0.0; joints * joints];
    robot.chain().mass_matrix(&middle, &mut inertia);
    let stiffness = robot.joint_parameter(Symbol::KS, joint)?.value.start;
    let period_s = std::f64::consts::TAU * (inertia[joint * joints + joint] / stiffness).sqrt();
    period_s.is_finite().then_some(period_s)
}

/// Speeds of smooth positions; NaN beside gaps and ends.
fn speeds(recording: &Recording, values: &[f64]) -> Vec<f64> {
    let mut speeds = vec![f64::NAN; values.len()];
    for run in recording.segments() {
        for k in run.start + 1..run.end.saturating_sub(1) {
            speeds[k] = (values[k + 1] - values[k - 1]) / (recording.time_s(k + 1) - recording.time_s(k - 1));
        }
    }
    speeds
}

/// What is predicted of a gyro, and what it reads.
type Pair = ([f64; 3], [f64; 3]);

/// Second moments of what is predicted (p) and read (r), biases taken off: `pp[i][j]` = ⟨p_i p_j⟩, and so on.
struct Agreement {
    pp: [f64; 3],
    rr: [f64; 3],
    pr: [[f64; 3]; 3],
    /// Share of the motion that is missed.
    missed: f64,
    /// The encoders alone say that the gyro turns visibly, for longer than a transmission swings.
    is_turned: bool,
    /// Encoders or gyro say so: of a shorter motion, as between many gaps, no factor is told.
    lasts: bool,
    /// Read over predicted in the slower half of what turns: a scale error is the same there, a range that ends is not met. NaN where nothing turns.
    gain_when_slow: f64,
}

impl Agreement {
    fn of(pairs: &[Pair], sigma: f64, scene: &Scene<'_>) -> Option<Self> {
        if pairs.len() < LEAST_SAMPLES {
            return None;
        }
        let n = pairs.len() as f64;
        let mean = |of: &dyn Fn(&Pair) -> f64| pairs.iter().map(of).sum::<f64>() / n;
        let p: [f64; 3] = std::array::from_fn(|i| mean(&|pair| pair.0[i]));
        let r: [f64; 3] = std::array::from_fn(|i| mean(&|pair| pair.1[i]));
        let pp = std::array::from_fn(|i| mean(&|pair| (pair.0[i] - p[i]).powi(2)));
        let rr = std::array::from_fn(|i| mean(&|pair| (pair.1[i] - r[i]).powi(2)));
        let pr =
            std::array::from_fn(|i| std::array::from_fn(|j| mean(&|pair| (pair.0[i] - p[i]) * (pair.1[j] - r[j]))));
        let visible = 3.0 * (VISIBLE_SIGMAS * sigma).powi(2);
        let moves = visible.max(VISIBLE_SIGMAS.powi(2) * scene.still);
        let (turned, read) = (pp.iter().sum::<f64>() >= moves, rr.iter().sum::<f64>() >= visible);
        let square = |rate: &[f64; 3], mean: [f64; 3]| (0..3).map(|i| (rate[i] - mean[i]).powi(2)).sum::<f64>();
        let by_encoders = |pair: &Pair| square(&pair.0, [0.0; 3]) >= moves;
        let by_gyro = |pair: &Pair| square(&pair.1, r) >= visible;
        let lasts = |turns: &dyn Fn(&Pair) -> bool| {
            pairs.iter().filter(|pair| turns(pair)).count() as f64 * scene.period_s >= LEAST_MOTION_S
        };
        let is_turned = turned && lasts(&by_encoders);
        let lasts = lasts(&|pair| by_encoders(pair) || by_gyro(pair));
        let mut turning: Vec<&Pair> = pairs.iter().filter(|pair| by_encoders(pair)).collect();
        let slower_half = turning.len().div_ceil(2);
        if let Some(last) = slower_half.checked_sub(1) {
            let rate = |pair: &Pair| square(&pair.0, [0.0; 3]);
            turning.select_nth_unstable_by(last, |a, b| rate(a).total_cmp(&rate(b)));
        }
        turning.truncate(slower_half);
        let (both, predicted) = turning.iter().fold((0.0, 0.0), |(both, predicted), pair| {
            let product: f64 = (0..3).map(|i| pair.0[i] * (pair.1[i] - r[i])).sum();
            (both + product, predicted + square(&pair.0, [0.0; 3]))
        });
        let gain_when_slow = both / predicted;
        let mut all = Self { pp, rr, pr, missed: 0.0, is_turned, lasts, gain_when_slow };
        all.missed = all.missed_if([(0, 1.0), (1, 1.0), (2, 1.0)], 1.0);
        (turned || read).then_some(all)
    }

    /// ⟨|r − p'|²⟩ / ⟨|r|²⟩ where axis i of the gyro reads what axis `axes[i].0` should, with that sign, times `scale`.
    fn missed_if(&self, axes: [(usize, f64); 3], scale: f64) -> f64 {
        let read: f64 = self.rr.iter().sum();
        let predicted: f64 = self.pp.iter().sum();
        let both: f64 = (0..3).map(|i| axes[i].1 * self.pr[axes[i].0][i]).sum();
        (read - 2.0 * scale * both + scale * scale * predicted) / read.max(f64::MIN_POSITIVE)
    }

    /// Read over predicted, least squares.
    fn gain(&self) -> f64 {
        (0..3).map(|i| self.pr[i][i]).sum::<f64>() / self.pp.iter().sum::<f64>()
    }

    /// Correlation over all axes.
    fn coefficient(&self) -> f64 {
        let scale = (self.pp.iter().sum::<f64>() * self.rr.iter().sum::<f64>()).sqrt();
        if scale > 0.0 { (0..3).map(|i| self.pr[i][i]).sum::<f64>() / scale } else { 0.0 }
    }
}

pub(super) fn look(scene: &Scene<'_>, findings: &mut Findings) {
    let joints = scene.recording.robot.joints.len();
    let as_given = Encoders { order: (0..joints).collect(), scale: vec![1.0; joints] };
    let rates = scene.rates(&as_given);
    let agreements: Vec<Option<Agreement>> =
        scene.gyros.iter().map(|(gyro, read)| scene.compare(gyro, read, &rates)).collect();
    let missed = |g: usize| agreements[g].as_ref().map_or(0.0, |agreement| agreement.missed);
    if (0..agreements.len()).all(|g| missed(g) <= DOUBTFUL) {
        return;
    }
    let encoders = encoder_suspect(scene);
    let mean = scene.missed_with(&as_given.scale).unwrap_or(0.0);
    let by_encoders = encoders.as_ref().is_some_and(|suspect| suspect.missed < LEFT_BY_MISTAKE * mean);
    let wrong = |g: usize| {
        let Some(agreement) = &agreements[g] else { return false };
        let off = !(1.0 / UNIT_FACTOR..UNIT_FACTOR).contains(&agreement.gain());
        agreement.missed > DISAGREES || off || (agreement.missed > DOUBTFUL && by_encoders)
    };
    let bad: Vec<usize> = (0..agreements.len()).filter(|&g| wrong(g)).collect();
    for (place, &index) in bad.iter().enumerate() {
        let Some(agreement) = &agreements[index] else { continue };
        let mut suspects: Vec<Suspect> =
            [axes_suspect(agreement, index), exchange_suspect(scene, &rates, index)].into_iter().flatten().collect();
        suspects.extend(encoders.clone());
        suspects.retain(|suspect| suspect.missed < EXPLAINS);
        let best = suspects.iter().map(|suspect| suspect.missed).fold(f64::INFINITY, f64::min);
        suspects.retain(|suspect| suspect.missed <= 2.0 * best + 0.02);
        let of_encoders = |suspect: &Suspect| encoders.iter().any(|e| e.looks == suspect.looks);
        // One mistake of the encoders is likelier than the same one of several gyros.
        if bad.len() > 1 && suspects.iter().any(of_encoders) {
            suspects.retain(of_encoders);
        }
        // A base that gives way misses much, too: without a mistake that explains it only a clean factor is one. No likeness at all to a
        // motion that the encoders see is worth a word.
        let correlation = agreement.coefficient();
        // A factor is the same at all rates; what shrinks fast motion alone is a range that ends, which a diagnosis finds.
        let is_off = |gain: f64| !(1.0 / UNIT_FACTOR..UNIT_FACTOR).contains(&gain);
        let is_factor =
            agreement.lasts && correlation > ALIKE && is_off(agreement.gain()) && is_off(agreement.gain_when_slow);
        let is_unlike = agreement.is_turned && correlation <= DISAGREES;
        if suspects.is_empty() && !is_factor && !is_unlike {
            continue;
        }
        let severity = if suspects.is_empty() && !is_factor { Severity::Warning } else { Severity::Error };
        tell(findings, severity, &format!("gyro{}", index + 1), agreement, &suspects);
        if place == 0 && suspects.iter().any(of_encoders) && suspects.len() == 1 {
            return; // told once
        }
    }
}

fn tell(findings: &mut Findings, severity: Severity, name: &str, agreement: &Agreement, suspects: &[Suspect]) {
    let (gain, correlation) = (agreement.gain(), agreement.coefficient());
    let looks = suspects.iter().map(|suspect| suspect.looks.clone()).collect::<Vec<_>>().join(", or ");
    let looks = if looks.is_empty() { String::new() } else { format!(": {looks}") };
    let message = if correlation > DISAGREES {
        format!("reads {gain:.4} times the rates that the encoders give{looks}")
    } else {
        format!("does not turn as the encoders say (correlation {correlation:.2}){looks}")
    };
    let advice = match suspects.first() {
        Some(suspect) => suspect.advice.as_str(),
        None if correlation > DISAGREES => {
            "check the gyro's scale (range setting) and the encoders' counts per turn and gear"
        }
        None => {
            "check the order and signs of its axes, the nominal rotation in the robot file, and the body that it sits on"
        }
    };
    findings.add(severity, About::Units, Some(name), message, advice);
}

/// Another unit, other axes or both.
fn axes_suspect(agreement: &Agreement, index: usize) -> Option<Suspect> {
    const ORDERS: [[usize; 3]; 6] = [[0, 1, 2], [1, 0, 2], [2, 1, 0], [0, 2, 1], [1, 2, 0], [2, 0, 1]];
    let mut best: Option<Suspect> = None;
    let mut consider = |suspect: Suspect| {
        // What changes less comes first, and what comes later has to be clearly better.
        if best.as_ref().is_none_or(|best| suspect.missed < 0.7 * best.missed - 1e-3) {
            best = Some(suspect);
        }
    };
    let same = [(0, 1.0), (1, 1.0), (2, 1.0)];
    for mistake in unit::of_rate() {
        let looks = format!("it {}", mistake.looks);
        consider(Suspect { missed: agreement.missed_if(same, mistake.factor), looks, advice: mistake.advice });
    }
    for order in ORDERS {
        for signs in 0..8 {
            let sign = |axis: usize| if signs >> axis & 1 == 1 { -1.0 } else { 1.0 };
            let axes = std::array::from_fn(|i| (order[i], sign(i)));
            if axes == same {
                continue;
            }
            let letters = |i: usize| format!("{}{}", if sign(i) < 0.0 { "−" } else { "" }, ["x", "y", "z"][order[i]]);
            let named = format!("({}, {}, {})", letters(0), letters(1), letters(2));
            consider(Suspect {
                missed: agreement.missed_if(axes, 1.0),
                looks: format!("its columns (x, y, z) look like {named} of the described gyro"),
                advice: format!(
                    "check the order and signs of g{0}x, g{0}y, g{0}z, or the nominal rotation in the robot file",
                    index + 1
                ),
            });
        }
    }
    best
}

/// The columns of another gyro.
fn exchange_suspect(scene: &Scene<'_>, rates: &[Vec<[f64; 3]>], index: usize) -> Option<Suspect> {
    let (gyro, _) = scene.gyros[index];
    let others = (0..scene.gyros.len()).filter(|&other| other != index);
    let best = others
        .filter_map(|other| Some((other, scene.compare(gyro, &scene.gyros[other].1, rates)?.missed)))
        .min_by(|a, b| a.1.total_cmp(&b.1))?;
    Some(Suspect {
        missed: best.1,
        looks: format!("the columns of gyro{} fit in its place, they look swapped", best.0 + 1),
        advice: "exchange the columns of the two gyros, in the table or under import.columns in the robot file"
            .to_owned(),
    })
}

/// One mistake of the encoders that makes all gyros agree.
fn encoder_suspect(scene: &Scene<'_>) -> Option<Suspect> {
    let robot = &scene.recording.robot;
    let joints = robot.joints.len();
    let mut best: Option<Suspect> = None;
    let mut consider = |encoders: &Encoders, looks: String, advice: String| {
        let Some(missed) = scene.mean_missed(encoders) else { return };
        if best.as_ref().is_none_or(|best| missed < 0.7 * best.missed - 1e-3) {
            best = Some(Suspect { missed, looks, advice });
        }
    };
    let order = || (0..joints).collect::<Vec<usize>>();
    let sets = std::iter::once((0..joints).collect::<Vec<usize>>())
        .chain((0..joints).filter(|_| joints > 1).map(|joint| vec![joint]));
    for set in sets {
        let who = match set.as_slice() {
            [joint] => format!("theta{}", joint + 1),
            _ => "every encoder".to_owned(),
        };
        let used = set.iter().map(|&joint| scene.range_share(joint)).fold(0.0, f64::max);
        for mistake in unit::of_position(scene.recording, set[0], false) {
            if used > PLAUSIBLE_USE {
                break; // these encoders show such a motion as the joints can make
            }
            let mut scale = vec![1.0; joints];
            for &joint in &set {
                let own = unit::of_position(scene.recording, joint, false);
                let same = own.into_iter().find(|own| own.looks == mistake.looks);
                scale[joint] = same.map_or(1.0, |own| 1.0 / own.factor);
            }
            consider(&Encoders { order: order(), scale }, format!("{who} {}", mistake.looks), mistake.advice);
        }
        let mut scale = vec![1.0; joints];
        set.iter().for_each(|&joint| scale[joint] = -1.0);
        let advice =
            "change its sign (sign = -1 under import.columns in the robot file), or turn the joint's axis there";
        consider(&Encoders { order: order(), scale }, format!("{who} has the wrong sign"), advice.to_owned());
    }
    for a in 0..joints {
        for b in 0..a {
            let mut order = order();
            order.swap(a, b);
            let looks = format!("theta{} and theta{} look swapped", b + 1, a + 1);
            let advice = "exchange the two columns, in the table or under import.columns in the robot file";
            consider(&Encoders { order, scale: vec![1.0; joints] }, looks, advice.to_owned());
        }
    }
    best
}
