//! The motion as the model itself makes it from the recorded inputs: states without any sensor's noise in them.
//!
//! Smoothed states jitter with the sensors' noise, and jitter looks like motion: the columns of a belt that never moved are not zero
//! there. Here they are, because nothing but the inputs moves a joint:
//!
//! ```text
//! first state   mean over the rest before the motion, speeds zero; without rest, the smoothed one
//! k → k+1       x ← φ(x, u),  then  θ, q += (θ_smoothed − θ) T / 1 s
//! gap           one more step under the last input
//! ```
//!
//! A robot that hangs in its torques, as an arm under gravity does, falls where it runs free. Where sensors read every link and the run leaves the
//! recorded motion all the same, the smoothed states are taken: they jitter little beside the motion.
//!
//! Friction decides where a free run stops, so positions would drift away; they are drawn to the smoothed ones, motor and link by the
//! same amount, which moves no speed and winds no belt.

use crate::calibrate::residuals::point::Point;
use crate::calibrate::residuals::problem::{Problem, SHORTEST_REST};
use crate::model::Stepper;
use crate::robot::ChannelKind;

/// Time constant with which positions follow the smoothed ones: moves take less, drift takes more, s.
const FOLLOW_S: f64 = 1.0;

/// No joint stands so far or moves so fast, rad or m, rad/s or m/s.
const RUN_AWAY: f64 = 1e4;

/// A motion without noise.
#[derive(Debug, Clone)]
pub(crate) struct NoiseFree<'m> {
    /// The states; shared unknowns as they were given.
    pub point: Point<'m>,
    /// What the motion did with each joint.
    pub joints: Vec<Moved>,
    /// Whether the run left every bound and had to begin again.
    pub ran_away: bool,
}

/// The largest that a joint did.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Moved {
    /// Motor speed (of a rigid joint, its own), rad/s or m/s.
    pub speed: f64,
    /// Link speed, rad/s or m/s.
    pub link_speed: f64,
    /// |q − θ|, rad or m.
    pub windup: f64,
}

impl<'m> NoiseFree<'m> {
    /// Runs the dynamics at `point` along the inputs of its recordings.
    pub fn of(problem: &Problem<'m>, point: &Point<'m>) -> Self {
        let (layout, series) = (problem.model.layout(), problem.series);
        let (n, size) = (layout.joints(), layout.size());
        let mut free = NoiseFree { point: point.clone(), joints: vec![Moved::default(); n], ran_away: false };
        let mut stepper = Stepper::new(problem.assumptions.integrator);
        let (mut x, mut next) = (vec![0.0; size], vec![0.0; size]);
        let mut late_input = [Vec::new(), Vec::new()];
        for (recording, stages) in series.recordings.iter().enumerate() {
            let mut step_s = stages.clone().map(|k| series.duration_s(k)).find(|s| s.is_finite()).unwrap_or(0.0);
            for k in stages.clone() {
                let smoothed = point.state(k);
                if k == stages.start {
                    first_state(problem, point, recording, &mut x);
                } else {
                    let input = problem.input(point, k - 1, &mut late_input);
                    stepper.step(&point.dynamics, &x, input, step_s, &mut next);
                    std::mem::swap(&mut x, &mut next);
                    for i in 0..n {
                        let by = if layout.is_elastic(i) { layout.theta(i) } else { layout.q(i) };
                        let shift = (smoothed[by] - x[by]) * (step_s / FOLLOW_S).min(1.0);
                        x[layout.q(i)] += shift;
                        if layout.is_elastic(i) {
                            x[layout.theta(i)] += shift;
                        }
                    }
                    if x.iter().any(|value| !value.is_finite() || value.abs() > RUN_AWAY) {
                        // Parameters so far off that one step runs away: nothing is known of this motion but its readings.
                        free.ran_away = true;
                        x.copy_from_slice(smoothed);
                        free.point.states[(k - 1) * size..k * size].copy_from_slice(point.state(k - 1));
                    }
                }
                if series.duration_s(k).is_finite() {
                    step_s = series.duration_s(k);
                }
                for (i, moved) in free.joints.iter_mut().enumerate() {
                    let elastic = layout.is_elastic(i);
                    let speed = x[if elastic { layout.thetad(i) } else { layout.qd(i) }];
                    moved.speed = moved.speed.max(speed.abs());
                    moved.link_speed = moved.link_speed.max(x[layout.qd(i)].abs());
                    if elastic {
                        moved.windup = moved.windup.max((x[layout.q(i)] - x[layout.theta(i)]).abs());
                    }
                }
                free.point.states[k * size..(k + 1) * size].copy_from_slice(&x);
            }
        }
        if reads_all_links(problem) && free.leaves(problem, point) {
            free.take(problem, point);
        }
        free
    }

    /// Whether the run strays from the motion of `point` by more than a quarter of what that moves, root mean square: the position of a link, or
    /// its speed.
    fn leaves(&self, problem: &Problem<'m>, point: &Point<'m>) -> bool {
        let layout = problem.model.layout();
        (0..layout.joints()).flat_map(|joint| [layout.q(joint), layout.qd(joint)]).any(|component| {
            let values =
                |of: &Point<'m>| -> Vec<f64> { (0..problem.series.stages()).map(|k| of.state(k)[component]).collect() };
            let (run, motion) = (values(&self.point), values(point));
            let mean = motion.iter().sum::<f64>() / motion.len().max(1) as f64;
            let strays: f64 = run.iter().zip(&motion).map(|(a, b)| (a - b) * (a - b)).sum();
            strays > 0.0625 * motion.iter().map(|x| (x - mean) * (x - mean)).sum::<f64>()
        })
    }

    /// Takes the motion of `point`.
    fn take(&mut self, problem: &Problem<'m>, point: &Point<'m>) {
        let layout = problem.model.layout();
        self.point.states.copy_from_slice(&point.states);
        for (joint, moved) in self.joints.iter_mut().enumerate() {
            *moved = Moved::default();
            for k in 0..problem.series.stages() {
                let x = point.state(k);
                moved.speed = moved.speed.max(x[layout.thetad(joint)].abs());
                moved.link_speed = moved.link_speed.max(x[layout.qd(joint)].abs());
                moved.windup = moved.windup.max((x[layout.q(joint)] - x[layout.theta(joint)]).abs());
            }
        }
    }
}

/// Whether a sensor reads the position of every link.
fn reads_all_links(problem: &Problem<'_>) -> bool {
    let layout = problem.model.layout();
    (0..layout.joints()).all(|joint| {
        problem.series.channels.iter().any(|channel| match channel.kind {
            ChannelKind::LinkPosition { joint: read } => read == joint,
            ChannelKind::MotorPosition { joint: read } => read == joint && !layout.is_elastic(joint),
            _ => false,
        })
    })
}

fn first_state(problem: &Problem<'_>, point: &Point<'_>, recording: usize, x: &mut [f64]) {
    let layout = problem.model.layout();
    let (stages, rest) = (&problem.series.recordings[recording], &problem.series.rest[recording]);
    if rest.len() < SHORTEST_REST {
        x.copy_from_slice(point.state(stages.start));
        return x[layout.inputs()].fill(0.0);
    }
    x.fill(0.0);
    for k in rest.clone() {
        for (mean, value) in x.iter_mut().zip(point.state(k)) {
            *mean += value / rest.len() as f64;
        }
    }
    x[layout.chain()..2 * layout.chain()].fill(0.0);
    x[layout.inputs()].fill(0.0);
    for i in 0..layout.joints() {
        if layout.is_elastic(i) {
            x[layout.thetad(i)] = 0.0;
        }
    }
}
