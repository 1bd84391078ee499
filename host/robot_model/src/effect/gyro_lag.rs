//! Gyro lag: the sensor's own filter delays what it measures.
//!
//! ```text
//! T ω̇_f = ω − ω_f     on each axis; the reading is ω_f
//! ```

use rand::Rng;

use super::surrogate::{Law, Laws, Of, Parameters, each};
use super::{Effect, EffectError, EffectParameter, Hidden, Line, Physics, Row, Scale, Size, draw};
use crate::robot::{Robot, Vector3};

pub(super) const EFFECT: Effect = Effect {
    id: "gyro_lag",
    row: Row::Sensor,
    title: "delay of the gyros' filters",
    equation: "T ω̇_f = ω − ω_f, the reading is ω_f",
    parameters: &[EffectParameter::size("T[gyro]", "s")
        .typically(1.3e-3, 0.45, Scale::Si)
        .sizes("0.5, 1.5, 4 ms (0.3 to 5 met)")],
    nuisances: &[],
    confounded_with: &["encoder_lag", "input_delay"],
    about: "A gyro filters its signal before it is read; the lower the bandwidth, the later the reading. Against \
            encoders that are read at once the links seem to follow their motors late, like behind a softer belt.",
    make,
    laws,
};

const TIME_CONSTANT_S: [f64; 3] = [0.5e-3, 1.5e-3, 4e-3];
/// The least T that is looked for, in sample periods: of a shorter lag readings taken once a period tell nothing but its product with the acceleration,
/// and noise has more to say.
const FINEST: f64 = 0.05;

#[derive(Debug)]
struct GyroLag {
    /// T of every gyro, s.
    time_constant: Vec<f64>,
}

impl Physics for GyroLag {
    fn states(&self) -> usize {
        3 * self.time_constant.len()
    }

    fn state_rates(&self, own: &[f64], line: &Line<'_>, out: &mut [f64]) {
        for (gyro, time_constant) in self.time_constant.iter().enumerate() {
            for axis in 0..3 {
                let k = 3 * gyro + axis;
                out[k] = (line.gyro_rates[gyro][axis] - own[k]) / time_constant;
            }
        }
    }

    fn gyro_rate(&self, own: &[f64], gyro: usize, _rate: Vector3) -> Vector3 {
        [own[3 * gyro], own[3 * gyro + 1], own[3 * gyro + 2]]
    }
}

fn make(robot: &Robot, size: Size, rng: &mut dyn Rng) -> Result<Hidden, EffectError> {
    let mut time_constant = Vec::new();
    for _ in robot.gyros() {
        time_constant.push(draw::lag(EFFECT.id, size, TIME_CONSTANT_S, rng)?);
    }
    if time_constant.is_empty() {
        return Err(EffectError::Unsuited { effect: EFFECT.id, reason: "the robot has no gyro" });
    }
    let values = draw::of_gyros(EFFECT.id, "T", "s", &time_constant);
    Ok(Hidden { id: EFFECT.id, values, physics: Box::new(GyroLag { time_constant }) })
}

/// The same filter, whose three states a gyro are in the body's axes; T by its logarithm.
#[derive(Debug)]
struct FilterLaw {
    parameters: Parameters,
}

impl Law for FilterLaw {
    fn parameters(&self) -> &Parameters {
        &self.parameters
    }

    fn gyro_lag(&self, gyro: usize) -> Option<usize> {
        Some(gyro)
    }
}

fn laws(robot: &Robot) -> Laws {
    let gyros = robot.gyros().count();
    if gyros == 0 {
        return Err(EffectError::Unsuited { effect: EFFECT.id, reason: "the robot has no gyro" });
    }
    let with = |start_s: f64| {
        let mut parameters = Parameters::on(EFFECT.id, robot);
        for gyro in 0..gyros {
            parameters.positive("T", "s", Of::Gyro(gyro), start_s);
        }
        parameters.within("T", [0.0, 0.05]);
        parameters.no_finer("T", FINEST * robot.sample_period_s);
        FilterLaw { parameters }
    };
    each([1.5, 0.7, 4.0].map(|periods| with(periods * robot.sample_period_s)))
}
