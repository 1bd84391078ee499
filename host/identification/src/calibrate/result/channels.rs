//! What is left of every channel and of every state component's step at the estimate, against the noise they were weighted by.

use std::ops::{Add, Range};

use super::calibration::ChannelFit;
use super::calibration::ChannelNoise;
use crate::calibrate::noise_estimate::reml::{self, Residue};
use crate::calibrate::residuals::noise;
use crate::calibrate::residuals::point::Point;
use crate::calibrate::residuals::problem::Problem;
use crate::robot::Robot;
use solve::LeastSquares;
use solve::threads::both;

/// What a channel's rows and readings add up to.
#[derive(Debug, Clone, Copy, Default)]
struct ChannelSums {
    rows: usize,
    residual_squares: f64,
    readings: usize,
    sum: f64,
    squares: f64,
}

impl ChannelSums {
    /// Of every channel, over some stages.
    fn of<'m>(problem: &Problem<'m>, end: &Point<'m>, stages: Range<usize>) -> Vec<Self> {
        let mut sums = vec![ChannelSums::default(); problem.series.channels.len()];
        let mut scratch = problem.scratch();
        for k in stages {
            problem.sensor_rows(end, k, &mut scratch, false, &mut |row| {
                if let Some(channel) = row.channel {
                    sums[channel].rows += 1;
                    sums[channel].residual_squares += row.residual * row.residual;
                }
            });
            for (sums, value) in sums.iter_mut().zip(problem.series.measured(k)) {
                if value.is_finite() {
                    sums.readings += 1;
                    sums.sum += value;
                    sums.squares += value * value;
                }
            }
        }
        sums
    }
}

impl Add for ChannelSums {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        ChannelSums {
            rows: self.rows + other.rows,
            residual_squares: self.residual_squares + other.residual_squares,
            readings: self.readings + other.readings,
            sum: self.sum + other.sum,
            squares: self.squares + other.squares,
        }
    }
}

/// Residuals of every channel and of every state component's step at the smoothed states.
pub(crate) fn channels(
    robot: &Robot,
    problem: &Problem<'_>,
    end: &Point<'_>,
    residue: &Residue,
    threads: usize,
) -> (Vec<ChannelNoise>, Vec<ChannelFit>) {
    let specs = &problem.series.channels;
    let stages = problem.shape().stages;
    let sums = |stages| ChannelSums::of(problem, end, stages);
    let (first, second) = both(threads, || sums(0..stages / 2), || sums(stages / 2..stages));
    let chi2 = |(rows, squares): (usize, f64), freedom: f64| {
        (rows > 0 && freedom * rows as f64 > reml::FEWEST_DEGREES).then(|| squares / (freedom * rows as f64))
    };
    let share = |rows: usize, freedom: f64| (rows > 0 && freedom.is_finite()).then_some(freedom);
    let mut noise = Vec::new();
    let mut fit = Vec::new();
    for (c, (spec, sums)) in specs.iter().zip(first.into_iter().zip(second)).enumerate() {
        let ChannelSums { rows, residual_squares: squares, readings: count, sum, squares: sum_squares } =
            sums.0 + sums.1;
        let sigma = problem.noise().channels[c];
        let mean_square = (rows > 0).then(|| squares / rows as f64);
        let mean = sum / count as f64;
        let deviation = (sum_squares / count as f64 - mean * mean).max(0.0).sqrt();
        noise.push(ChannelNoise {
            channel: spec.name.clone(),
            unit: spec.unit.to_string(),
            sigma,
            floor: residue.floor.as_ref().map(|floor| floor.channels[c]),
            freedom: share(rows, residue.freedom[c]),
            chi2_per_dof: chi2((rows, squares / (sigma * sigma)), residue.freedom[c]),
            left_out: 0,
        });
        fit.push(ChannelFit {
            channel: spec.name.clone(),
            rms: mean_square.map(f64::sqrt),
            nrmse: mean_square.filter(|_| deviation > 0.0).map(|square| square.sqrt() / deviation),
        });
    }
    for (i, (name, unit)) in noise::process_names(robot, problem.model.layout()).into_iter().enumerate() {
        let freedom = residue.freedom[specs.len() + i];
        noise.push(ChannelNoise {
            channel: name,
            unit: unit.to_string(),
            sigma: problem.noise().process[i],
            floor: residue.floor.as_ref().map(|floor| floor.process[i]),
            freedom: freedom.is_finite().then_some(freedom),
            chi2_per_dof: residue.process_chi2_per_dof[i],
            left_out: 0,
        });
    }
    (noise, fit)
}
