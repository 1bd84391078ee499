//! The noise of an observer from that of a calibration, and what it knows when it starts.

use observer::Start;

use super::ObserveError;
use crate::calibrate::process_names;
use crate::export::{Exported, Place, Program};
use crate::robot::ChannelKind;
use crate::verify::system::System;

/// Time in which a gyro's bias wanders by the standard deviation of one of its readings, s. Warm-up does that within some minutes; other times have
/// not been tried.
const BIAS_WANDERS_S: f64 = 1000.0;

/// What steps miss, and what is known at the start.
pub(super) struct Noise {
    /// Standard deviation of what a step of one period misses of each component.
    pub process: Vec<f64>,
    /// How each component starts.
    pub start: Vec<Start<f32>>,
}

impl Noise {
    /// Of the model's own components, then of the biases.
    pub(super) fn of(exported: &Exported<'_>, program: &Program, biases: &[usize]) -> Result<Self, ObserveError> {
        let mut noise = Noise { process: process(exported, program)?, start: of_components(exported) };
        let sigmas = exported.sigmas();
        let period_s = exported.calibrated.robot().sample_period_s;
        for bias in biases {
            let parameter = &exported.parameters[*bias];
            // The paper's Σ_bias is not printed; its sensor's own noise stands for what a bias changes by from one day to another.
            let reading = sigmas.iter().zip(&exported.readings).find(|(_, channel)| {
                matches!((channel.kind, parameter.place),
                    (ChannelKind::GyroAxis { gyro: a, axis: i, .. }, Place::Bias { gyro: b, axis: j }) if (a, i) == (b, j))
            });
            let sigma = reading.map_or(0.0, |(sigma, _)| *sigma);
            noise.process.push(sigma * (period_s / BIAS_WANDERS_S).sqrt());
            let known = sigma.max(parameter.std_error.unwrap_or(0.0));
            noise.start.push(Start { reading: None, value: parameter.value as f32, sigma: known as f32 });
        }
        Ok(noise)
    }
}

/// Whether each reading is of a gyro.
pub(super) fn is_gyro(exported: &Exported<'_>) -> Vec<bool> {
    exported.readings.iter().map(|channel| matches!(channel.kind, ChannelKind::GyroAxis { .. })).collect()
}

/// Standard deviations of steps, as the calibration found them. The error of a measured input, which it took for a state, is noise of what the input drives.
fn process(exported: &Exported<'_>, program: &Program) -> Result<Vec<f64>, ObserveError> {
    let calibrated = &exported.calibrated;
    let (layout, robot) = (calibrated.model().layout(), calibrated.robot());
    let sigma = |name: &str| exported.calibration.noise.iter().find(|noise| noise.channel == name).map(|n| n.sigma);
    let of_name = |(name, _): (String, &str)| sigma(&name).ok_or(ObserveError::MissingNoise { name });
    let mut process = process_names(robot, layout).into_iter().map(of_name).collect::<Result<Vec<f64>, _>>()?;
    let sizes = program.sizes;
    let parameters = exported.parameters.iter().map(|parameter| parameter.value);
    let at_rest: Vec<f64> =
        std::iter::repeat_n(0.0, sizes.states + sizes.inputs).chain(parameters).chain([0.0]).collect();
    for joint in 0..sizes.inputs {
        let Some(error) = sigma(&format!("process.input[{}]", joint + 1)) else { continue };
        let by_input: Vec<_> = (0..sizes.states)
            .map(|state| program.rate_slopes[state * sizes.columns() + sizes.states + joint])
            .collect();
        for (sigma, slope) in process.iter_mut().zip(program.evaluate(&by_input, &at_rest)) {
            *sigma = sigma.hypot(robot.sample_period_s * slope * error);
        }
    }
    Ok(process)
}

/// A robot at rest, as `verify`'s filter starts: positions from their sensors, transmissions relaxed, all else zero.
fn of_components(exported: &Exported<'_>) -> Vec<Start<f32>> {
    let calibrated = &exported.calibrated;
    let layout = calibrated.model().layout();
    let (_, deviations) = calibrated.system().first_guess(&vec![0.0; exported.readings.len()]);
    let read = |kind: ChannelKind| exported.readings.iter().position(|channel| channel.kind == kind);
    let mut from = vec![None; deviations.len()];
    for joint in 0..layout.joints() {
        let motor = read(ChannelKind::MotorPosition { joint });
        let link = read(ChannelKind::LinkPosition { joint });
        from[layout.theta(joint)] = motor.or(link);
        from[layout.q(joint)] = link.or(motor);
    }
    let start = |(reading, sigma): (Option<usize>, f64)| Start {
        reading: reading.and_then(|place| u16::try_from(place).ok()),
        value: 0.0,
        sigma: sigma as f32,
    };
    from.into_iter().zip(deviations).map(start).collect()
}
