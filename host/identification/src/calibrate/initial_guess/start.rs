//! A first guess of all states: encoders give θ, gyros q̇, and the windup q − θ is their leaky integral.
//!
//! Starting at q = θ, q̇ = θ̇ would make the columns of k_s and d_s exactly zero.

use nalgebra::Vector3;

use super::torque_start::{self, TorqueStart};
use crate::calibrate::data::series::Series;
use crate::calibrate::residuals::point::Point;
use crate::model::Model;
use crate::robot::chain::MAX_JOINTS;
use crate::robot::{ChannelKind, Robot};

/// Half widths of the windows whose regression line gives a speed, samples: the widest that the readings agree with. A joint that sticks
/// moves slower than the noise of a short window, and friction makes much of the sign of a speed.
const SPEED_HALF_WINDOWS: [usize; 3] = [32, 12, 4];

/// Readings agree with a line that they miss by as many sigmas, root mean square.
const AGREES_SIGMAS: f64 = 1.5;

/// Samples whose sums count from one of them: from the first of a long run on, rounding would eat the small windows.
const RUN_OF_SUMS: usize = 256;

/// Time constant of the leak that keeps the integral of q̇ − θ̇ from drifting, s. Belts swing at some Hz: slower than that.
const LEAK_S: f64 = 0.3;

/// Where no gyro sees a joint its q̇ is taken as θ̇, give or take this much, rad/s.
const SPEED_PRIOR: f64 = 10.0;

/// That of a passive joint is zero, give or take this much, rad/s. A gyro that sees it swing tells tens of times better than this; one that sees
/// the sum of its speed and a driven joint's does not, and then it is the driven joint's.
const PASSIVE_SPEED_PRIOR: f64 = 0.1;

/// The start of the search, and what torques show where it is from them.
pub(crate) struct Start<'m> {
    pub point: Point<'m>,
    pub by_torques: Option<TorqueStart>,
}

/// Shared unknowns from torques where the robot is rigid, else from the description.
pub(crate) fn start<'m>(model: &'m Model, robot: &Robot, series: &Series) -> Start<'m> {
    let mut shared = shared(model, robot, series);
    let by_torques = torque_start::of(model, robot, series);
    if let Some(start) = &by_torques {
        shared.z.clone_from(&start.z);
    }
    Start { point: with_states(model, series, shared), by_torques }
}

/// The shared unknowns of the description; biases as the gyros read at rest.
pub(crate) fn shared(model: &Model, robot: &Robot, series: &Series) -> Shared {
    Shared {
        z: model.coordinates().start(),
        rotations: robot.gyros().map(|gyro| nalgebra::Matrix3::from_fn(|i, j| gyro.rotation[i][j])).collect(),
        biases: (0..series.recordings.len()).map(|recording| biases_at_rest(robot, series, recording)).collect(),
    }
}

/// Shared unknowns: what a search starts from besides the states.
#[derive(Debug, Clone)]
pub(crate) struct Shared {
    pub z: Vec<f64>,
    /// Body axes → sensor axes, one a gyro.
    pub rotations: Vec<nalgebra::Matrix3<f64>>,
    /// `[recording][gyro]`, rad/s.
    pub biases: Vec<Vec<Vector3<f64>>>,
}

/// A first guess of all states for these shared unknowns.
pub(crate) fn with_states<'m>(model: &'m Model, series: &Series, shared: Shared) -> Point<'m> {
    let mut point = without_states(model, series, shared);
    for run in series.segments.clone() {
        fill_run(model, series, run, &mut point);
    }
    point
}

/// These shared unknowns, with states that are all nothing.
pub(crate) fn without_states<'m>(model: &'m Model, series: &Series, shared: Shared) -> Point<'m> {
    let Shared { z, rotations, biases } = shared;
    let states = vec![0.0; series.stages() * model.layout().size()];
    Point { states, dynamics: model.at(&z), z, rotations, biases }
}

/// Mean reading of every gyro while no input has been given; the description's start value where there is no such time.
fn biases_at_rest(robot: &Robot, series: &Series, recording: usize) -> Vec<Vector3<f64>> {
    let rest = series.rest[recording].clone();
    let mut biases: Vec<Vector3<f64>> = robot.gyros().map(|gyro| Vector3::from(gyro.bias_rad_s)).collect();
    if rest.len() < crate::calibrate::residuals::problem::SHORTEST_REST {
        return biases;
    }
    for (channel, spec) in series.channels.iter().enumerate() {
        if let ChannelKind::GyroAxis { gyro, axis, .. } = spec.kind
            && robot.gyros().nth(gyro).is_some_and(|gyro| gyro.bias_free)
        {
            let values = rest.clone().map(|k| series.measured(k)[channel]).filter(|v| v.is_finite());
            let (count, sum) = values.fold((0usize, 0.0), |(count, sum), v| (count + 1, sum + v));
            if count > 0 {
                biases[gyro][axis] = sum / count as f64;
            }
        }
    }
    biases
}

/// One run of stages without a gap.
fn fill_run(model: &Model, series: &Series, run: std::ops::Range<usize>, point: &mut Point<'_>) {
    let layout = model.layout();
    let (n, m, size) = (layout.joints(), layout.chain(), layout.size());
    let joint_channels = |wanted: fn(ChannelKind) -> Option<usize>| -> Vec<Option<usize>> {
        let mut found = vec![None; n];
        for (channel, spec) in series.channels.iter().enumerate() {
            if let Some(joint) = wanted(spec.kind) {
                found[joint] = Some(channel);
            }
        }
        found
    };
    let motor = joint_channels(|kind| match kind {
        ChannelKind::MotorPosition { joint } => Some(joint),
        _ => None,
    });
    let link = joint_channels(|kind| match kind {
        ChannelKind::LinkPosition { joint } => Some(joint),
        _ => None,
    });
    let lagging = Lagging::of(model, series);
    let zeros = || vec![0.0; run.len()];
    let columns = |channels: &[Option<usize>], other: &[Option<usize>]| -> Vec<Vec<f64>> {
        (0..n).map(|j| channels[j].or(other[j]).map_or_else(zeros, |c| column(series, run.clone(), c))).collect()
    };
    let theta = columns(&motor, &link);
    let times = times(series, run.clone());
    let speeds = |values: &[Vec<f64>], channels: &[Option<usize>], other: &[Option<usize>]| -> Vec<Vec<f64>> {
        let sigma = |j: usize| channels[j].or(other[j]).map_or(0.0, |c| series.channels[c].sigma);
        values.iter().enumerate().map(|(j, values)| speeds(&times, values, sigma(j))).collect()
    };
    let thetad = speeds(&theta, &motor, &link);
    let mut measured_q = columns(&link, &motor);
    for (j, q) in measured_q.iter_mut().enumerate().filter(|(j, _)| link[*j].is_some()) {
        q.iter_mut().for_each(|q| *q = model.link_position(j, *q, &point.z));
    }
    let measured_qd = speeds(&measured_q, &link, &motor);

    let passive: Vec<usize> = layout.passive().collect();
    // Windups of the robot's joints; positions of passive ones, which rest at zero.
    let mut windup = vec![0.0; n];
    let mut tilt = vec![0.0; passive.len()];
    let (mut q_k, mut qd) = (vec![0.0; m], vec![0.0; m]);
    for (i, k) in run.clone().enumerate() {
        for j in 0..n {
            q_k[layout.q(j)] = measured_q[j][i];
            qd[layout.q(j)] = measured_qd[j][i];
        }
        // Speeds are those of passive joints at rest: where their positions count, small errors of both feed one another.
        for joint in &passive {
            qd[*joint] = 0.0;
        }
        link_speeds(model, series, k, &q_k, point, &mut qd);
        let step_s = if k + 1 < run.end { series.duration_s(k) } else { 0.0 };
        let state = &mut point.states[k * size..(k + 1) * size];
        for j in 0..n {
            let elastic = layout.is_elastic(j);
            let speed = if elastic { qd[layout.q(j)] } else { thetad[j][i] };
            state[layout.q(j)] = if link[j].is_some() { measured_q[j][i] } else { theta[j][i] + windup[j] };
            state[layout.qd(j)] = speed;
            if elastic {
                state[layout.theta(j)] = theta[j][i];
                state[layout.thetad(j)] = thetad[j][i];
                windup[j] += step_s * (speed - thetad[j][i] - windup[j] / LEAK_S);
            }
        }
        for (joint, tilt) in passive.iter().zip(&mut tilt) {
            state[*joint] = *tilt;
            state[m + joint] = qd[*joint];
            *tilt += step_s * (qd[*joint] - *tilt / LEAK_S);
        }
        lagging.begin(model, state);
    }
}

/// The gyros of a model that lag behind their bodies.
pub(crate) struct Lagging {
    /// First of a gyro's three own states, and the link that carries it.
    gyros: Vec<(usize, usize)>,
}

impl Lagging {
    pub(crate) fn of(model: &Model, series: &Series) -> Self {
        let lagging = series.channels.iter().filter_map(|channel| match channel.kind {
            ChannelKind::GyroAxis { gyro, body, axis: 0 } => Some((model.lagging(gyro)?.state, model.body(body))),
            _ => None,
        });
        Lagging { gyros: lagging.collect() }
    }

    /// Those whose states are among these components.
    pub(crate) fn among(mut self, components: &[usize]) -> Self {
        self.gyros.retain(|(first, _)| components.contains(first));
        self
    }

    /// Gives their states in `state` the rates of their bodies there: a gyro that lags by a few samples is near where its body is.
    pub(crate) fn begin(&self, model: &Model, state: &mut [f64]) {
        if self.gyros.is_empty() {
            return;
        }
        let m = model.layout().chain();
        let mut rates = [[0.0; 3]; MAX_JOINTS];
        model.chain().body_rates(&state[..m], &state[m..2 * m], &mut rates[..m]);
        for (first, body) in &self.gyros {
            state[*first..first + 3].copy_from_slice(&rates[*body]);
        }
    }
}

/// Link speeds that explain the gyros best on a base at rest; `qd` holds what they are without gyros.
fn link_speeds(model: &Model, series: &Series, k: usize, q: &[f64], point: &Point<'_>, qd: &mut [f64]) {
    let n = q.len();
    // Rates are linear in q̇: `columns[j]` are those of all bodies at unit speed of joint j.
    let mut columns = [[[0.0; 3]; MAX_JOINTS]; MAX_JOINTS];
    let mut unit = [0.0; MAX_JOINTS];
    for (j, column) in columns[..n].iter_mut().enumerate() {
        unit[j] = 1.0;
        model.chain().body_rates(q, &unit[..n], &mut column[..n]);
        unit[j] = 0.0;
    }
    let mut normal = [[0.0; MAX_JOINTS]; MAX_JOINTS];
    let mut right = [0.0; MAX_JOINTS];
    for (i, row) in normal.iter_mut().enumerate() {
        row[i] = SPEED_PRIOR.powi(-2);
    }
    for joint in model.layout().passive() {
        normal[joint][joint] = PASSIVE_SPEED_PRIOR.powi(-2);
    }
    let measured = series.measured(k);
    let biases = &point.biases[series.recording_of(k)];
    for (channel, spec) in series.channels.iter().enumerate() {
        let ChannelKind::GyroAxis { gyro, body, axis } = spec.kind else { continue };
        let body = model.body(body);
        if !measured[channel].is_finite() {
            continue;
        }
        let rotation = &point.rotations[gyro];
        let mut slopes = [0.0; MAX_JOINTS];
        let mut surplus = measured[channel] - biases[gyro][axis];
        for j in 0..n {
            slopes[j] = (0..3).map(|i| rotation[(axis, i)] * columns[j][body][i]).sum();
            surplus -= slopes[j] * qd[j];
        }
        let weight = 1.0 / (spec.sigma * spec.sigma);
        for i in 0..n {
            right[i] += weight * surplus * slopes[i];
            for j in 0..n {
                normal[i][j] += weight * slopes[i] * slopes[j];
            }
        }
    }
    // Elimination without exchange: the matrix is positive definite by the prior on its diagonal.
    for i in 0..n {
        for j in i + 1..n {
            let factor = normal[j][i] / normal[i][i];
            for c in i..n {
                normal[j][c] -= factor * normal[i][c];
            }
            right[j] -= factor * right[i];
        }
    }
    for i in (0..n).rev() {
        for c in i + 1..n {
            right[i] -= normal[i][c] * right[c];
        }
        right[i] /= normal[i][i];
        qd[i] += right[i];
    }
}

/// A channel over a run; a missing reading repeats the last one (a start value only, it makes no residual).
fn column(series: &Series, run: std::ops::Range<usize>, channel: usize) -> Vec<f64> {
    let first = run.clone().map(|k| series.measured(k)[channel]).find(|v| v.is_finite()).unwrap_or(0.0);
    run.scan(first, |last, k| {
        let value = series.measured(k)[channel];
        if value.is_finite() {
            *last = value;
        }
        Some(*last)
    })
    .collect()
}

/// Time of every sample of a run since its first one, s.
fn times(series: &Series, run: std::ops::Range<usize>) -> Vec<f64> {
    let next = |t: &mut f64, k| {
        let this = *t;
        let step_s = series.duration_s(k);
        *t += if step_s.is_nan() { 0.0 } else { step_s };
        Some(this)
    };
    run.scan(0.0, next).collect()
}

/// Slopes of regression lines over windows that shrink at the ends of the run; `sigma` is that of a reading.
fn speeds(times: &[f64], values: &[f64], sigma: f64) -> Vec<f64> {
    const WIDEST: usize = SPEED_HALF_WINDOWS[0];
    let allowed = (AGREES_SIGMAS * sigma).powi(2);
    let mut speeds = Vec::with_capacity(values.len());
    let mut sums = Vec::with_capacity(RUN_OF_SUMS + 2 * WIDEST + 1);
    for first in (0..values.len()).step_by(RUN_OF_SUMS) {
        let end = (first + RUN_OF_SUMS).min(values.len());
        let (begin, behind) = (first.saturating_sub(WIDEST), (end + WIDEST).min(values.len()));
        // Sums of t, v, t², tv and v² of all readings before one, from here: a window's are a difference, however wide it is.
        let mut sum = [0.0; 5];
        sums.clear();
        sums.push(sum);
        for (t, v) in times[begin..behind].iter().zip(&values[begin..behind]) {
            let (t, v) = (t - times[begin], v - values[begin]);
            for (sum, term) in sum.iter_mut().zip([t, v, t * t, t * v, v * v]) {
                *sum += term;
            }
            sums.push(sum);
        }
        // The slope, and the mean square that the line misses by.
        let line = |i: usize, half: usize| {
            let (from, to) = (i.saturating_sub(half).max(begin), (i + half + 1).min(behind));
            let count = (to - from) as f64;
            let [t, v, tt, tv, vv] = std::array::from_fn(|j| (sums[to - begin][j] - sums[from - begin][j]) / count);
            let (above, below) = (tv - t * v, tt - t * t);
            let slope = if below > 0.0 { above / below } else { 0.0 };
            (slope, vv - v * v - slope * above)
        };
        speeds.extend((first..end).map(|i| {
            let lines = SPEED_HALF_WINDOWS.map(|half| line(i, half));
            lines.into_iter().find(|(_, missed)| *missed <= allowed).unwrap_or(lines[lines.len() - 1]).0
        }));
    }
    speeds
}

#[cfg(test)]
mod tests {
    use super::*;

    /// After a quarter of an hour at 1 kHz a speed is known as well as in the first second: the readings of one swing, again and again.
    #[test]
    fn speeds_do_not_wear_out_with_time() {
        let (swing, samples) = (500, 1_000_000);
        let times: Vec<f64> = (0..samples).map(|k| 1e-3 * k as f64).collect();
        let values: Vec<f64> =
            (0..samples).map(|k| 0.3 * (std::f64::consts::TAU * (k % swing) as f64 / swing as f64).sin()).collect();
        let speeds = speeds(&times, &values, 7e-5);
        let (early, late) = (&speeds[2 * swing..3 * swing], &speeds[samples - 2 * swing..samples - swing]);
        for (early, late) in early.iter().zip(late) {
            // atol: nanoradians a window of 9 ms; sums from the first sample on left thousands of rad/s.
            assert!((early - late).abs() < 1e-7, "{early} rad/s early, {late} rad/s late");
        }
        let fastest = speeds.iter().fold(0.0f64, |most, v| most.max(v.abs()));
        // 0.3 rad at 2 Hz, of which a line over 25 ms takes 0.25 %.
        assert!((fastest / (0.3 * std::f64::consts::TAU * 2.0) - 1.0).abs() < 4e-3, "{fastest} rad/s");
    }
}
