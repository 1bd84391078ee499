//! Gyro lag: the sensor's own filter delays what it measures.
//!
//! ```text
//! T ω̇_f = ω − ω_f                      on each axis; the reading is ω_f
//! 1 / (1 + T s / 2)²                    of two poles, each of half the delay T
//! (1 − T s / 4) / (1 + 3 T s / 4)       what stands for it: the same up to (T s)², with the states of one pole
//! ```
//!
//! Filters inside of gyros are of second order as often as of first; both delay what is slow by T.

use rand::Rng;

use super::surrogate::{Arc, Law, Laws, LowPass, Of, Parameters, each};
use super::{Effect, EffectError, EffectParameter, Hidden, Line, Physics, Row, Scale, Size, draw};
use crate::robot::{Robot, Vector3};

pub(super) const EFFECT: Effect = Effect {
    id: "gyro_lag",
    row: Row::Sensor,
    title: "delay of the gyros' filters",
    equation: "1/(1 + T s) or 1/(1 + T s/2)² of ω",
    parameters: &[
        EffectParameter::size("T[gyro]", "s").typically(1.3e-3, 0.45, Scale::Si).sizes("0.5, 1.5, 4 ms (0.3 to 5 met)"),
        EffectParameter::shape("poles", "1").sizes("1 or 2"),
    ],
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

/// One pole a gyro.
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
    let mut values = draw::of_gyros(EFFECT.id, "T", "s", &time_constant);
    values.push(draw::single(EFFECT.id, "poles", "1", 1.0));
    Ok(Hidden { id: EFFECT.id, values, physics: Box::new(GyroLag { time_constant }) })
}

/// g of what is read for two poles: `(1 − g T₁ s) / (1 + T₁ s)` with T = (1 + g) T₁ agrees with `1/(1 + T s/2)²` up to (T s)².
const BEYOND: f64 = 1.0 / 3.0;

/// The filter with three states a gyro, in the body's axes; the time constant of the states by its logarithm.
#[derive(Debug)]
struct FilterLaw {
    parameters: Parameters,
    /// T of the start, s.
    start_s: f64,
    finest_s: f64,
    beyond: f64,
}

impl FilterLaw {
    /// With one or two poles, from a T on.
    fn new(mut parameters: Parameters, gyros: usize, (poles, start_s): (f64, f64), finest_s: f64) -> Self {
        let beyond = if poles == 1.0 { 0.0 } else { BEYOND };
        for gyro in 0..gyros {
            parameters.scaled("T", "s", Of::Gyro(gyro), 1.0 + beyond, start_s);
        }
        parameters.within("T", [0.0, 0.05]);
        parameters.no_finer("T", finest_s);
        parameters.chosen("poles", "1", poles);
        FilterLaw { parameters, start_s, finest_s, beyond }
    }
}

impl Law for FilterLaw {
    fn parameters(&self) -> &Parameters {
        &self.parameters
    }

    fn other_shape(&self) -> Option<Arc<dyn Law>> {
        let poles = if self.beyond == 0.0 { 2.0 } else { 1.0 };
        Some(Arc::new(FilterLaw::new(
            self.parameters.cleared(),
            self.parameters.coordinates.len(),
            (poles, self.start_s),
            self.finest_s,
        )))
    }

    fn gyro_lag(&self, gyro: usize) -> Option<LowPass> {
        Some(LowPass { coordinate: gyro, beyond: self.beyond })
    }
}

fn laws(robot: &Robot) -> Laws {
    let gyros = robot.gyros().count();
    if gyros == 0 {
        return Err(EffectError::Unsuited { effect: EFFECT.id, reason: "the robot has no gyro" });
    }
    let with = |(poles, periods): (f64, f64)| {
        let start_s = periods * robot.sample_period_s;
        FilterLaw::new(Parameters::on(EFFECT.id, robot), gyros, (poles, start_s), FINEST * robot.sample_period_s)
    };
    each([(1.0, 1.5), (1.0, 0.7), (1.0, 4.0), (2.0, 1.5), (2.0, 4.0)].map(with))
}

#[cfg(test)]
mod tests {
    use nalgebra::Complex;

    use super::*;

    /// What a law reads of a rate that swings with s = iω, as a share of it.
    fn response(law: &FilterLaw, delay_s: f64, s: Complex<f64>) -> Complex<f64> {
        let LowPass { coordinate, beyond } = law.gyro_lag(0).unwrap();
        let z = law.parameters.recall(
            &law.parameters
                .results
                .iter()
                .map(|result| match result.form {
                    crate::model::law::Form::Chosen(value) => value,
                    _ => delay_s,
                })
                .collect::<Vec<f64>>(),
        );
        let filtered = (Complex::from(1.0) + s * z[coordinate].exp()).inv();
        filtered + (filtered - 1.0) * beyond
    }

    #[test]
    fn each_shape_is_the_filter_of_its_poles() {
        let with = |poles: f64| FilterLaw::new(Parameters::new(EFFECT.id), 1, (poles, 1e-3), 1e-5);
        let delay_s = 3.5e-3;
        for hz in [1.0, 5.0, 20.0] {
            let s = Complex::new(0.0, std::f64::consts::TAU * hz);
            let one = (Complex::from(1.0) + s * delay_s).inv();
            let two = (Complex::from(1.0) + s * (0.5 * delay_s)).powi(-2);
            assert!((response(&with(1.0), delay_s, s) - one).norm() < 1e-12, "rtol of rounding");
            // What is left is of third order: (T s)³ / 16.
            let left = (s * delay_s).norm().powi(3) / 16.0;
            let off = (response(&with(2.0), delay_s, s) - two).norm();
            assert!(off < 1.1 * left, "{hz} Hz: {off:e} of {left:e}");
            assert!((one - two).norm() > 3.0 * off, "{hz} Hz");
        }
    }
}
