//! Gyro scale: each axis of a gyro has a sensitivity of its own.
//!
//! ```text
//! reading = (I + diag A) R_imu ω + bias
//! ```

use rand::Rng;

use super::surrogate::{Law, Laws, Of, Parameters, Quantity, only, reads_gyros};
use super::{Effect, EffectError, EffectParameter, Hidden, Physics, Row, Scale, Size, draw};
use crate::model::law::GyroAt;
use crate::robot::{Robot, Vector3};

pub(super) const EFFECT: Effect = Effect {
    id: "gyro_scale",
    row: Row::Sensor,
    title: "scale error of the gyros",
    equation: "(I + A) ω",
    parameters: &[EffectParameter::size("A[gyro.axis]", "1")
        .typically(0.016, 0.4, Scale::Si)
        .sizes("0.6, 1.6, 4.3 % (0.5 to 5 met), either sign")],
    nuisances: &[],
    confounded_with: &["link_inertia", "R_imu"],
    about: "Cheap gyros are trimmed to a per cent or two. The encoders say how far the robot turned, the gyro's integral \
            says something else, in the same proportion slow or fast.",
    make,
    laws,
};

const ERROR: [f64; 3] = [0.006, 0.016, 0.043];

#[derive(Debug)]
struct GyroScale {
    /// A of every gyro.
    errors: Vec<Vector3>,
}

impl Physics for GyroScale {
    fn gyro_rate(&self, _own: &[f64], gyro: usize, rate: Vector3) -> Vector3 {
        std::array::from_fn(|axis| (1.0 + self.errors[gyro][axis]) * rate[axis])
    }
}

fn make(robot: &Robot, size: Size, rng: &mut dyn Rng) -> Result<Hidden, EffectError> {
    let mut errors = Vec::new();
    for _ in robot.gyros() {
        let mut error = [0.0; 3].map(|_: f64| size.draw(ERROR, rng));
        draw::either_sign(&mut error, size, rng);
        errors.push(error);
    }
    if errors.is_empty() {
        return Err(EffectError::Unsuited { effect: EFFECT.id, reason: "the robot has no gyro" });
    }
    let values = draw::of_gyro_axes(EFFECT.id, "A", "1", &errors);
    Ok(Hidden { id: EFFECT.id, values, physics: Box::new(GyroScale { errors }) })
}

/// Linear in A.
#[derive(Debug)]
struct ScaleLaw {
    parameters: Parameters,
}

impl Law for ScaleLaw {
    fn parameters(&self) -> &Parameters {
        &self.parameters
    }

    fn sees_gyro(&self, _gyro: usize) -> bool {
        true
    }

    reads_gyros!();
}

impl ScaleLaw {
    fn read<T: Quantity>(&self, at: &GyroAt<'_, T>, rate: [T; 3], bias: [T; 3]) -> [T; 3] {
        std::array::from_fn(|axis| (T::from(1.0) + at.parameters[axis]) * rate[axis] + bias[axis])
    }
}

fn laws(robot: &Robot) -> Laws {
    let gyros = robot.gyros().count();
    if gyros == 0 {
        return Err(EffectError::Unsuited { effect: EFFECT.id, reason: "the robot has no gyro" });
    }
    let mut parameters = Parameters::on(EFFECT.id, robot);
    for (gyro, axis) in (0..gyros).flat_map(|gyro| [0, 1, 2].map(|axis| (gyro, axis))) {
        parameters.plain("A", "1", Of::GyroAxis(gyro, axis), 0.0);
    }
    only(ScaleLaw { parameters })
}
