//! The yardstick of a diagnosis: noise that is fixed before any model is judged.
//!
//! A process noise that is estimated on the base model swallows the effect: χ² per degree of freedom becomes 1 and nothing is left to explain.
//! So the sensors' noise is what they show while the robot rests, or what the robot file says where that is more (a resting encoder repeats one
//! count), and a step of the model may be wrong by a little that no robot is below. The same weights then judge the base model and every
//! extended one. Looser ones would make scores too small: what is not the model's would pass for noise.

use crate::calibrate::{Noise, Series, of_inputs};
use crate::model::Model;
use crate::robot::Robot;

/// Fewest readings at rest that tell a deviation.
const FEWEST: usize = 200;

/// What a step of the model may miss of a speed over 1 ms, rad/s or m/s: an acceleration of 0.01 rad/s² that comes and goes.
const STEP_OF_SPEED: f64 = 1e-5;

/// The sensors' noise as the rest windows of `series` show it, or the robot file tells where that is more, and that of the steps.
pub fn yardstick(robot: &Robot, series: &Series) -> Noise {
    let model = Model::new(robot);
    let mut noise = Noise {
        channels: series.channels.iter().map(|channel| channel.sigma).collect(),
        process: vec![0.0; model.layout().size()],
    };
    // An input that is a measurement errs by a share of its root mean square.
    noise.process[model.layout().inputs()].copy_from_slice(&of_inputs(robot, model.layout(), series));
    let speed = STEP_OF_SPEED * (series.period_s / 1e-3).sqrt();
    noise.join_positions(model.layout(), series.period_s, speed);
    noise.exact_where_inputs_err(model.layout(), series.period_s);
    noise.allow_unmodelled(robot, model.layout());
    for (channel, sigma) in noise.channels.iter_mut().enumerate() {
        for rest in &series.rest {
            let readings: Vec<f64> =
                rest.clone().map(|k| series.measured(k)[channel]).filter(|value| value.is_finite()).collect();
            if readings.len() < FEWEST {
                continue;
            }
            // Differences of neighbours: a robot that settles moves slowly.
            let squares: f64 = readings.windows(2).map(|pair| (pair[1] - pair[0]).powi(2)).sum();
            *sigma = sigma.max((0.5 * squares / (readings.len() - 1) as f64).sqrt());
        }
    }
    noise
}
