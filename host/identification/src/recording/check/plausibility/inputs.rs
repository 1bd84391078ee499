//! Inputs against the torque that the motion needs: which sign of an input, and whose, explains it?
//!
//! ```text
//!   s u = κ τ(q, q̇, q̈) + b q̈ + v q̇ + μ sgn q̇ + o + unknown moments of bodies        κ, b, v, μ ≥ 0, each sign s by itself
//! ```
//!
//! τ is what the chain of the robot file needs, weight and coupling included, so a motor that brakes, or holds a load, drives its joint as
//! rightly as one that moves it. What the drive adds is fitted, and none of it may feed energy in. Motions are taken over windows
//! that are long against the noise of encoders and, mostly, against the swinging of belts.

use nalgebra::{DMatrix, DVector};

use super::stats::{position, range};
use crate::recording::check::{About, Findings};
use crate::recording::{Recording, Severity};
use crate::robot::chain::Chain;
use crate::robot::{Robot, Symbol};

/// Half the window over which position, speed and acceleration are taken, s. Halved, accelerations by a coarse encoder (3 mrad) are noise; doubled,
/// motions of some hertz are flattened.
const HALF_WINDOW_S: f64 = 0.05;
/// Fewest samples on either side.
const HALF_SAMPLES: usize = 3;
/// So many samples are looked at.
const MOST_SAMPLES: usize = 3000;
/// Share of an input that a right model may leave unexplained and still say what drives what. Of 14 inputs of five measured machines, eleven leave
/// 0.001 to 0.36 with the right sign and 0.2 to 3 with the other; three (a noisy torque, a person who pushes, masses that are not known) leave
/// 0.7 to 0.9. At half of it three of the eleven could not be told, at twice of it anything is.
const TELLS: f64 = 0.5;
/// What is wrong leaves so many times more unexplained than what is right. At 1.5 a brake with a wrong mass is taken for a reversed
/// motor; at 6 a reversed motor of a noisy machine passes.
const TIMES_WORSE: f64 = 3.0;
/// What leaves this share unexplained explains nothing.
const NOTHING: f64 = 0.9;
/// A start value of a motor's constant may be off by this factor.
const CONSTANT_FACTOR: f64 = 5.0;
/// Share of the largest speed at which Coulomb friction has half its size.
const CREEP: f64 = 0.02;
/// A joint that nothing drives is not moved by others through more than this share of its range.
const PASSIVE_SHARE: f64 = 0.25;
/// An input so many times larger than nearly all others was never commanded.
const LONE_FACTOR: f64 = 100.0;
/// Fewest samples that prove something.
const LEAST_SAMPLES: usize = 200;

pub(super) fn look(recording: &Recording, findings: &mut Findings) {
    let joints = recording.robot.joints.len();
    for joint in 0..joints {
        constant(recording, joint, findings);
        lone(recording, joint, findings);
    }
    let Some(motion) = Motion::of(recording) else { return };
    let own: Vec<Option<[f64; 2]>> = (0..joints).map(|joint| motion.unexplained(joint, joint)).collect();
    if swapped(recording, &motion, &own, findings) {
        return;
    }
    for (joint, own) in own.into_iter().enumerate() {
        let Some([forwards, backwards]) = own else { continue };
        let channel = format!("u{}", joint + 1);
        let name = &recording.robot.joints[joint].name;
        tracing::debug!(joint, forwards, backwards, "shares of the input that the model's torque leaves unexplained");
        let percent = |share: f64| 100.0 * share.min(1.0);
        if backwards < TELLS && forwards > TIMES_WORSE * backwards {
            findings.add(
                Severity::Error,
                About::Units,
                Some(&channel),
                format!(
                    "{name} runs against its input (of which the model's torque leaves {:.0} % unexplained, with the other sign {:.0} %)",
                    percent(forwards),
                    percent(backwards)
                ),
                "swap the motor's wires or the encoder's channels, or change the sign of one column (sign = -1 under import.columns in the robot file)",
            );
        } else if forwards > TELLS || backwards < (TIMES_WORSE * forwards).min(NOTHING) {
            findings.add(
                Severity::Note,
                About::Units,
                Some(&channel),
                format!(
                    "whether {name} runs with its input cannot be told: the model's torque leaves {:.0} % of it unexplained, with the other sign {:.0} %",
                    percent(forwards),
                    percent(backwards)
                ),
                "check the sign of its column yourself: a motor that only brakes has either sign, and masses or start values that are far off hide it",
            );
        }
    }
}

/// Inputs that explain one another's joints, each once; whether there were any.
fn swapped(recording: &Recording, motion: &Motion<'_>, own: &[Option<[f64; 2]>], findings: &mut Findings) -> bool {
    let weak: Vec<usize> = (0..own.len()).filter(|&j| own[j].is_some_and(|own| own[0].min(own[1]) > TELLS)).collect();
    let mut swapped: Vec<(usize, usize, f64)> = Vec::new();
    for &joint in &weak {
        let others = weak.iter().filter(|&&input| input != joint);
        let best = others
            .filter_map(|&input| {
                let [forwards, backwards] = motion.unexplained(input, joint)?;
                Some((input, forwards.min(backwards)))
            })
            .min_by(|a, b| a.1.total_cmp(&b.1));
        match (best, own[joint]) {
            (Some((input, left)), Some(own)) if left < TELLS && own[0].min(own[1]) > TIMES_WORSE * left => {
                swapped.push((joint, input, left));
            }
            _ => {}
        }
    }
    let each_once = (1..swapped.len()).all(|i| swapped[..i].iter().all(|earlier| earlier.1 != swapped[i].1));
    if swapped.len() < 2 || !each_once {
        return false;
    }
    for (joint, input, left) in swapped {
        findings.add(
            Severity::Error,
            About::Units,
            Some(&format!("u{}", joint + 1)),
            format!(
                "{} follows u{} (of which its torque leaves {:.0} % unexplained), not u{}: the columns look swapped",
                recording.robot.joints[joint].name,
                input + 1,
                100.0 * left,
                joint + 1
            ),
            "check the order of the inputs u1… and of the encoders theta1…, in the table or under import.columns in the robot file",
        );
    }
    true
}

/// Position, speed, acceleration and input of every joint, over windows.
struct Motion<'a> {
    robot: &'a Robot,
    /// Of each window.
    samples: Vec<Sample>,
    /// Torque of the described bodies on each joint.
    torque: Vec<Vec<f64>>,
    /// Bodies of moment one that the robot file leaves open: the joint that moves it, which moment, and its torque on each joint.
    open: Vec<(usize, Symbol, Vec<Vec<f64>>)>,
}

struct Sample {
    q: Vec<f64>,
    qd: Vec<f64>,
    qdd: Vec<f64>,
    u: Vec<f64>,
}

impl<'a> Motion<'a> {
    /// Nothing where a joint has no encoder or too little is recorded.
    fn of(recording: &'a Recording) -> Option<Self> {
        let robot = &recording.robot;
        let joints = robot.joints.len();
        let columns = (0..joints).map(|joint| Some(position(recording, joint)?.values.as_slice()));
        let columns: Vec<&[f64]> = columns.collect::<Option<_>>()?;
        let half = ((HALF_WINDOW_S / recording.period_s).round() as usize).max(HALF_SAMPLES);
        let first = recording.rest_window().end;
        let moving = recording.segments().into_iter().flat_map(|run| run.start + half..run.end.saturating_sub(half));
        let places: Vec<usize> = moving.filter(|&k| k >= first).collect();
        let step = places.len().div_ceil(MOST_SAMPLES).max(1);
        let samples: Vec<Sample> =
            places.iter().step_by(step).filter_map(|&k| window(recording, &columns, k, half)).collect();
        if samples.len() < LEAST_SAMPLES {
            return None;
        }
        let mut chain = robot.chain();
        let mut open = Vec::new();
        for spec in robot.parameters().iter().filter(|spec| Symbol::OF_BODIES.contains(&spec.symbol)) {
            for &joint in &spec.joints {
                // What a joint's own inertia lacks is fitted with the motor's.
                if spec.symbol != Symbol::J || !spec.value.free {
                    chain = chain.with_moment(joint, spec.symbol, spec.value.start);
                }
                if spec.value.free {
                    let one = robot.chain().massless().with_moment(joint, spec.symbol, 1.0);
                    open.push((joint, spec.symbol, torques(&one, joints, &samples)));
                }
            }
        }
        let torque = torques(&chain, joints, &samples);
        Some(Self { robot, samples, torque, open })
    }

    /// Share of an input that the motion of a joint leaves unexplained: as it stands, and with its sign turned. Nothing for an input that is
    /// always the same.
    fn unexplained(&self, input: usize, joint: usize) -> Option<[f64; 2]> {
        let of = |value: &dyn Fn(&Sample) -> f64| self.samples.iter().map(value).collect::<Vec<f64>>();
        let u = of(&|sample| sample.u[input]);
        let mean = u.iter().sum::<f64>() / u.len() as f64;
        let power: f64 = u.iter().map(|u| (u - mean).powi(2)).sum();
        if power <= 0.0 {
            return None;
        }
        let fastest = self.samples.iter().map(|sample| sample.qd[joint].abs()).fold(0.0, f64::max);
        let constant = match self.robot.input.unit.torque_constant() {
            None => [1.0, 1.0],
            Some(symbol) => {
                let spec = self.robot.joint_parameter(symbol, joint)?;
                let one = 1.0 / (spec.value.start * self.robot.input.scale);
                if spec.value.free { [one / CONSTANT_FACTOR, one * CONSTANT_FACTOR] } else { [one, one] }
            }
        };
        let dissipating = [0.0, f64::INFINITY];
        let any = [f64::NEG_INFINITY, f64::INFINITY];
        let mut columns: Vec<(Vec<f64>, [f64; 2])> = vec![
            (self.torque[joint].clone(), constant),
            (of(&|sample| sample.qdd[joint]), dissipating),
            (of(&|sample| sample.qd[joint]), dissipating),
            (of(&|sample| sample.qd[joint] / (sample.qd[joint].abs() + CREEP * fastest)), dissipating),
            (vec![1.0; u.len()], any),
        ];
        let loads = |(of, symbol): (usize, Symbol)| of > joint || of == joint && symbol != Symbol::J;
        let open = self.open.iter().filter(|(of, symbol, _)| loads((*of, *symbol)));
        columns.extend(open.map(|(_, _, torque)| (torque[joint].clone(), any)));
        let turned: Vec<f64> = u.iter().map(|u| -u).collect();
        Some([least(&columns, &u) / power, least(&columns, &turned) / power])
    }
}

/// Torque on each joint, by sample.
fn torques(chain: &Chain, joints: usize, samples: &[Sample]) -> Vec<Vec<f64>> {
    let mut columns = vec![Vec::with_capacity(samples.len()); joints];
    let mut torque = vec![0.0; joints];
    for sample in samples {
        chain.link_torque(&sample.q, &sample.qd, &sample.qdd, &mut torque);
        columns.iter_mut().zip(&torque).for_each(|(column, torque)| column.push(*torque));
    }
    columns
}

/// Parabolas through the positions of a window, and the mean input beside them; nothing where a reading is none.
fn window(recording: &Recording, columns: &[&[f64]], k: usize, half: usize) -> Option<Sample> {
    let window = k - half..=k + half;
    let t: Vec<f64> = window.clone().map(|i| recording.time_s(i) - recording.time_s(k)).collect();
    let moments: Vec<f64> = (0..5).map(|power| t.iter().map(|t| t.powi(power)).sum()).collect();
    let normal = nalgebra::Matrix3::from_fn(|i, j| moments[i + j]);
    let inverse = normal.try_inverse()?;
    let mut sample = Sample { q: Vec::new(), qd: Vec::new(), qdd: Vec::new(), u: Vec::new() };
    for column in columns {
        let sums = nalgebra::Vector3::from_fn(|i, _| {
            window.clone().zip(&t).map(|(k, t)| column[k] * t.powi(i as i32)).sum::<f64>()
        });
        let fit = inverse * sums;
        if !fit.iter().all(|value| value.is_finite()) {
            return None;
        }
        sample.q.push(fit[0]);
        sample.qd.push(fit[1]);
        sample.qdd.push(2.0 * fit[2]);
    }
    // An acceleration by a parabola is a mean that falls to the ends of the window as this weight does. An input holds until the next sample.
    let width = t[t.len() - 1].max(-t[0]) + 0.5 * recording.period_s;
    let weight = |at_s: f64| (1.0 - (at_s / width).powi(2)).max(0.0).powi(2);
    let weights: Vec<f64> = t.iter().map(|t| weight(t + 0.5 * recording.period_s)).collect();
    let whole: f64 = weights.iter().sum();
    for input in &recording.duty {
        sample.u.push(window.clone().zip(&weights).map(|(k, weight)| weight * input[k]).sum::<f64>() / whole);
    }
    Some(sample)
}

/// Least sum of squares of `y` less a combination of columns whose coefficients keep their bounds. Of a convex problem it is that of
/// the best choice of which bounds are met.
fn least(columns: &[(Vec<f64>, [f64; 2])], y: &[f64]) -> f64 {
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let n = columns.len();
    let gram = DMatrix::from_fn(n, n, |i, j| dot(&columns[i].0, &columns[j].0));
    let right = DVector::from_fn(n, |i, _| dot(&columns[i].0, y));
    let whole = dot(y, y);
    let bounds: Vec<Vec<f64>> =
        columns.iter().map(|(_, [low, high])| [*low, *high].into_iter().filter(|b| b.is_finite()).collect()).collect();
    // Of each coefficient: free, or at one of its bounds; equal bounds leave no choice.
    let choices: Vec<Vec<Option<f64>>> = columns
        .iter()
        .zip(&bounds)
        .map(|((_, [low, high]), bounds)| {
            if low == high {
                vec![Some(*low)]
            } else {
                std::iter::once(None).chain(bounds.iter().copied().map(Some)).collect()
            }
        })
        .collect();
    let count: usize = choices.iter().map(Vec::len).product();
    let mut best = f64::INFINITY;
    for mut number in 0..count {
        let chosen: Vec<Option<f64>> = choices
            .iter()
            .map(|choices| {
                let choice = choices[number % choices.len()];
                number /= choices.len();
                choice
            })
            .collect();
        let free: Vec<usize> = (0..n).filter(|&i| chosen[i].is_none()).collect();
        let mut solution = DVector::from_fn(n, |i, _| chosen[i].unwrap_or(0.0));
        let rest = &right - &gram * &solution;
        // A column that others repeat changes nothing.
        let ridge =
            |i: usize, j: usize| if i == j { 1e-10 * gram[(free[i], free[i])] + f64::MIN_POSITIVE } else { 0.0 };
        let part = DMatrix::from_fn(free.len(), free.len(), |i, j| gram[(free[i], free[j])] + ridge(i, j));
        let Some(factor) = part.cholesky() else { continue };
        let fitted = factor.solve(&DVector::from_fn(free.len(), |i, _| rest[free[i]]));
        free.iter().zip(fitted.iter()).for_each(|(&i, value)| solution[i] = *value);
        let keeps = |i: &usize| {
            let [low, high] = columns[*i].1;
            (low..=high).contains(&solution[*i])
        };
        if free.iter().all(keeps) {
            best = best.min(whole - 2.0 * right.dot(&solution) + solution.dot(&(&gram * &solution)));
        }
    }
    best.max(0.0)
}
/// An input that is the same in every sample is not what moved the robot; a joint that rests needs none.
fn constant(recording: &Recording, joint: usize, findings: &mut Findings) {
    let input = &recording.duty[joint];
    let same = input.len() > 1 && input.windows(2).all(|pair| pair[0] == pair[1]);
    if same && input[0] != 0.0 {
        findings.add(
            Severity::Error,
            About::Units,
            Some(&format!("u{}", joint + 1)),
            format!("the input is {} in every sample", input[0]),
            "is this the column of the input that was commanded?",
        );
    }
    let limits = recording.robot.joints[joint].limits;
    let moved =
        position(recording, joint).and_then(|channel| range(&channel.values)).map_or(0.0, |(low, high)| high - low);
    let driven = recording.rest_window().len() < recording.len();
    if same && input[0] == 0.0 && driven && moved > PASSIVE_SHARE * (limits[1] - limits[0]) {
        findings.add(
            Severity::Error,
            About::Units,
            Some(&format!("u{}", joint + 1)),
            format!("{} moves by {moved:.3} without any input", recording.robot.joints[joint].name),
            "is this the column of the input that was commanded, and the joint's own?",
        );
    }
}

/// A few inputs that are far from all others. Duties cannot be.
fn lone(recording: &Recording, joint: usize, findings: &mut Findings) {
    let mut sizes: Vec<f64> =
        recording.duty[joint].iter().map(|input| input.abs()).filter(|size| *size > 0.0).collect();
    if sizes.len() < LEAST_SAMPLES {
        return;
    }
    let most = sizes.len() - 1 - sizes.len() / 200;
    let usual = *sizes.select_nth_unstable_by(most, f64::total_cmp).1;
    let far = sizes.iter().filter(|size| **size > LONE_FACTOR * usual).count();
    if far > 0 {
        let worst = sizes.iter().copied().fold(0.0, f64::max);
        findings.add(
            Severity::Error,
            About::Units,
            Some(&format!("u{}", joint + 1)),
            format!("{far} inputs are far beyond all others (up to {worst:.3e}, the others up to {usual:.3e})"),
            "leave these rows out of the table (the ticks are then missing), and look for what made them",
        );
    }
}
