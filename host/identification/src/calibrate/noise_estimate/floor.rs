//! Below what no noise is estimated.

use crate::calibrate::residuals::noise::{LEAST_SPEED, Noise};
use crate::calibrate::residuals::point::Point;
use crate::calibrate::residuals::problem::Problem;
use crate::model::Stepper;
use crate::robot::Robot;

/// Steps along a trajectory whose error is looked at.
const STEPS_LOOKED_AT: usize = 5_000;

/// Share of the robot file's standard deviation below which no channel's is taken to be.
const LEAST_SHARE: f64 = 0.5;

/// Least standard deviations that make sense at `point`: of a step, the integrator's own error (root mean square of one step less two
/// half steps, along the trajectory); of a channel, half of what the robot file says. Where the model is wrong, the likelihood likes to
/// believe one sensor to the last digit and none of the others; no sensor is that good.
pub(crate) fn floor(problem: &Problem<'_>, robot: &Robot, point: &Point<'_>) -> Noise {
    let (series, layout) = (problem.series, problem.model.layout());
    let size = layout.size();
    let mut stepper = Stepper::new(problem.assumptions.integrator);
    let (mut whole, mut half, mut halves) = (vec![0.0; size], vec![0.0; size], vec![0.0; size]);
    let mut squares = vec![0.0; size];
    let mut late: [Vec<f64>; 2] = Default::default();
    let mut count = 0usize;
    let mut period_s = 0.0;
    for k in (0..series.stages()).step_by((series.stages() / STEPS_LOOKED_AT).max(1)) {
        let duration_s = series.duration_s(k);
        if duration_s.is_nan() {
            continue;
        }
        let input = problem.input(point, k, &mut late);
        stepper.step(&point.dynamics, point.state(k), input, duration_s, &mut whole);
        stepper.step(&point.dynamics, point.state(k), input, 0.5 * duration_s, &mut half);
        stepper.step(&point.dynamics, &half, input, 0.5 * duration_s, &mut halves);
        for (square, (a, b)) in squares.iter_mut().zip(whole.iter().zip(&halves)) {
            *square += (a - b) * (a - b);
        }
        count += 1;
        period_s += duration_s;
    }
    let count = count.max(1) as f64;
    let mut floor = Noise {
        channels: series.channels.iter().map(|channel| LEAST_SHARE * channel.sigma).collect(),
        process: squares.into_iter().map(|square| (square / count).sqrt()).collect(),
    };
    floor.join_positions(layout, period_s / count, LEAST_SPEED);
    floor.allow_unmodelled(robot, layout);
    floor
}
