//! Gyro bias drift: the bias moves as the chip warms up.
//!
//! ```text
//! bias + a (1 − e^(−t/T))      t from the start of the motion
//! ```

use rand::{Rng, RngExt};

use super::surrogate::{Law, Laws, Of, Parameters, Quantity, only, reads_gyros};
use super::{Effect, EffectError, EffectParameter, Hidden, Physics, Row, Scale, Size, draw};
use crate::model::law::GyroAt;
use crate::robot::{Robot, Vector3};

pub(super) const EFFECT: Effect = Effect {
    id: "gyro_bias_drift",
    row: Row::Sensor,
    title: "drift of the gyros' bias",
    equation: "bias + a (1 − e^(−t/T))",
    parameters: &[
        EffectParameter::own_to_recording("a[gyro.axis]", "rad/s")
            .typically(9.0, 0.5, Scale::GyroSigma)
            .sizes("0.006, 0.016, 0.043 rad/s (0.005 to 0.05 met), either sign"),
        EffectParameter::own_to_recording("T", "s").typically(25.0, 0.35, Scale::Si).sizes("10 to 60 s"),
    ],
    nuisances: &[],
    confounded_with: &["bias", "friction_drift"],
    about: "The bias of a gyro depends on its temperature. What the first three seconds at rest say of it no longer holds \
            a minute later. The encoders do not drift along.",
    make,
    laws,
};

const DRIFT_RAD_S: [f64; 3] = [0.006, 0.016, 0.043];
const TIME_CONSTANT_S: std::ops::Range<f64> = 10.0..60.0;

#[derive(Debug)]
struct GyroBiasDrift {
    /// a of every gyro, rad/s.
    drift: Vec<Vector3>,
    /// T, s.
    time_constant_s: f64,
}

impl Physics for GyroBiasDrift {
    fn gyro_reading(&self, time_s: f64, gyro: usize, reading: Vector3) -> Vector3 {
        let grown = -(-time_s / self.time_constant_s).exp_m1();
        std::array::from_fn(|axis| reading[axis] + grown * self.drift[gyro][axis])
    }
}

fn make(robot: &Robot, size: Size, rng: &mut dyn Rng) -> Result<Hidden, EffectError> {
    let mut drift = Vec::new();
    for _ in robot.gyros() {
        let mut a = [0.0; 3].map(|_: f64| size.draw(DRIFT_RAD_S, rng));
        draw::either_sign(&mut a, size, rng);
        drift.push(a);
    }
    if drift.is_empty() {
        return Err(EffectError::Unsuited { effect: EFFECT.id, reason: "the robot has no gyro" });
    }
    let time_constant_s = rng.random_range(TIME_CONSTANT_S);
    let mut values = draw::of_gyro_axes(EFFECT.id, "a", "rad/s", &drift);
    values.push(draw::single(EFFECT.id, "T", "s", time_constant_s));
    Ok(Hidden { id: EFFECT.id, values, physics: Box::new(GyroBiasDrift { drift, time_constant_s }) })
}

/// Where the search for T starts, s.
const START_S: f64 = 25.0;

/// Linear in a; T by its logarithm.
#[derive(Debug)]
struct BiasLaw {
    parameters: Parameters,
}

impl Law for BiasLaw {
    fn parameters(&self) -> &Parameters {
        &self.parameters
    }

    fn sees_gyro(&self, _gyro: usize) -> bool {
        true
    }

    reads_gyros!();
}

impl BiasLaw {
    fn read<T: Quantity>(&self, at: &GyroAt<'_, T>, rate: [T; 3], bias: [T; 3]) -> [T; 3] {
        // The last one is ln T.
        let grown = T::from(1.0) - (-((-at.parameters[3]).exp() * at.time_s)).exp();
        std::array::from_fn(|axis| rate[axis] + bias[axis] + grown * at.parameters[axis])
    }
}

fn laws(robot: &Robot) -> Laws {
    let gyros = robot.gyros().count();
    if gyros == 0 {
        return Err(EffectError::Unsuited { effect: EFFECT.id, reason: "the robot has no gyro" });
    }
    let mut parameters = Parameters::on(EFFECT.id, robot);
    for (gyro, axis) in (0..gyros).flat_map(|gyro| [0, 1, 2].map(|axis| (gyro, axis))) {
        parameters.plain("a", "rad/s", Of::GyroAxis(gyro, axis), 0.0);
    }
    parameters.positive("T", "s", Of::All, START_S);
    only(BiasLaw { parameters })
}
