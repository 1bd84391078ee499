//! A first guess of all states: encoders give θ, gyros q̇, and the windup q − θ is their leaky integral.
//!
//! Starting at q = θ, q̇ = θ̇ would make the columns of k_s and d_s exactly zero.

use nalgebra::Vector3;

use super::point::Point;
use super::series::Series;
use crate::model::Model;
use crate::robot::chain::MAX_JOINTS;
use crate::robot::{ChannelKind, Robot};

/// Half width of the window whose regression line gives a speed, samples.
const SPEED_HALF_WINDOW: usize = 4;

/// Time constant of the leak that keeps the integral of q̇ − θ̇ from drifting, s. Belts swing at some Hz: slower than that.
const LEAK_S: f64 = 0.3;

/// Where no gyro sees a joint its q̇ is taken as θ̇, give or take this much, rad/s.
const SPEED_PRIOR: f64 = 10.0;

/// The start of the search.
pub(super) fn start<'m>(model: &'m Model, robot: &Robot, series: &Series) -> Point<'m> {
    let z = model.coordinates().start();
    let rotations: Vec<_> = robot.gyros().map(|gyro| nalgebra::Matrix3::from_fn(|i, j| gyro.rotation[i][j])).collect();
    let biases = (0..series.recordings.len()).map(|recording| biases_at_rest(robot, series, recording)).collect();
    let mut point = Point {
        states: vec![0.0; series.stages() * model.layout().size()],
        dynamics: model.at(&z),
        z,
        rotations,
        biases,
    };
    for run in series.segments.clone() {
        fill_run(model, series, run, &mut point);
    }
    point
}

/// Mean reading of every gyro while no input has been given; the description's start value where there is no such time.
fn biases_at_rest(robot: &Robot, series: &Series, recording: usize) -> Vec<Vector3<f64>> {
    let rest = series.rest[recording].clone();
    let mut biases: Vec<Vector3<f64>> = robot.gyros().map(|gyro| Vector3::from(gyro.bias_rad_s)).collect();
    if rest.len() < super::problem::SHORTEST_REST {
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
    let (n, size) = (layout.joints(), layout.size());
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
    let zeros = || vec![0.0; run.len()];
    let columns = |channels: &[Option<usize>], other: &[Option<usize>]| -> Vec<Vec<f64>> {
        (0..n).map(|j| channels[j].or(other[j]).map_or_else(zeros, |c| column(series, run.clone(), c))).collect()
    };
    let theta = columns(&motor, &link);
    let thetad: Vec<_> = theta.iter().map(|theta| speeds(series, run.clone(), theta)).collect();
    let measured_q = columns(&link, &motor);
    let measured_qd: Vec<_> = measured_q.iter().map(|q| speeds(series, run.clone(), q)).collect();

    let mut windup = vec![0.0; n];
    let [mut theta_k, mut thetad_k, mut q_k, mut qd] = [0; 4].map(|_| vec![0.0; n]);
    for (i, k) in run.clone().enumerate() {
        for (to, from) in
            [(&mut theta_k, &theta), (&mut thetad_k, &thetad), (&mut q_k, &measured_q), (&mut qd, &measured_qd)]
        {
            for (to, column) in to.iter_mut().zip(from) {
                *to = column[i];
            }
        }
        link_speeds(model, series, k, &q_k, point, &mut qd);
        let step_s = if k + 1 < run.end { series.duration_s(k) } else { 0.0 };
        let state = &mut point.states[k * size..(k + 1) * size];
        for j in 0..n {
            let elastic = layout.is_elastic(j);
            let speed = if elastic { qd[j] } else { thetad_k[j] };
            state[layout.q(j)] = if link[j].is_some() { q_k[j] } else { theta_k[j] + windup[j] };
            state[layout.qd(j)] = speed;
            if elastic {
                state[layout.theta(j)] = theta_k[j];
                state[layout.thetad(j)] = thetad_k[j];
                windup[j] += step_s * (speed - thetad_k[j] - windup[j] / LEAK_S);
            }
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
        row[i] = 1.0 / (SPEED_PRIOR * SPEED_PRIOR);
    }
    let measured = series.measured(k);
    let biases = &point.biases[series.recording_of(k)];
    for (channel, spec) in series.channels.iter().enumerate() {
        let ChannelKind::GyroAxis { gyro, body, axis } = spec.kind else { continue };
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

/// Slopes of regression lines over a window that shrinks at the ends of the run.
fn speeds(series: &Series, run: std::ops::Range<usize>, values: &[f64]) -> Vec<f64> {
    let mut time = Vec::with_capacity(values.len());
    let mut now = 0.0;
    for k in run {
        time.push(now);
        let step_s = series.duration_s(k);
        now += if step_s.is_nan() { 0.0 } else { step_s };
    }
    (0..values.len())
        .map(|i| {
            let half = SPEED_HALF_WINDOW.min(values.len() - 1);
            let (from, to) = (i.saturating_sub(half), (i + half).min(values.len() - 1));
            let count = (to - from + 1) as f64;
            let mean_t = time[from..=to].iter().sum::<f64>() / count;
            let mean_v = values[from..=to].iter().sum::<f64>() / count;
            let (mut above, mut below) = (0.0, 0.0);
            for (t, v) in time[from..=to].iter().zip(&values[from..=to]) {
                above += (t - mean_t) * (v - mean_v);
                below += (t - mean_t) * (t - mean_t);
            }
            if below > 0.0 { above / below } else { 0.0 }
        })
        .collect()
}
