//! Gyro clipping: the robot turns faster than the gyro's range.
//!
//! ```text
//! reading = clip(R_imu ω + bias + noise, ±FS)      on each axis
//! ```

use rand::Rng;

use super::surrogate::{Arc, Law, Laws, Of, Parameters, Quantity, Readings, only, reads_gyros};
use super::{Effect, EffectError, EffectParameter, Hidden, Physics, Row, Scale, Size, draw};
use crate::model::law::GyroAt;
use crate::robot::{Robot, Vector3};

pub(super) const EFFECT: Effect = Effect {
    id: "gyro_clipping",
    row: Row::Sensor,
    title: "gyro range exceeded",
    equation: "clip(ω, ±FS)",
    parameters: &[EffectParameter::inverse_size("fs[gyro]", "rad/s")
        .typically(8.7, 0.4, Scale::Si)
        .sizes("5.4, 4.9, 4.4 rad/s (250 deg/s and up met); Doggy turns at up to 6.5")],
    nuisances: &[],
    confounded_with: &["current_limit", "gyro_scale"],
    about: "A gyro set to a smaller range than its description says puts out its full scale while the robot turns faster. \
            Peaks are flat, and everything below them is as it should be.",
    make,
    laws,
};

/// Full scale, rad/s. The stronger the effect, the smaller the range.
const FULL_SCALE_RAD_S: [f64; 3] = [5.4, 4.9, 4.4];

#[derive(Debug)]
struct GyroClipping {
    /// FS of every gyro, rad/s.
    full_scale: Vec<f64>,
}

impl Physics for GyroClipping {
    fn gyro_reading(&self, _time_s: f64, gyro: usize, reading: Vector3) -> Vector3 {
        let full_scale = self.full_scale[gyro];
        reading.map(|rate| rate.clamp(-full_scale, full_scale))
    }
}

fn make(robot: &Robot, size: Size, rng: &mut dyn Rng) -> Result<Hidden, EffectError> {
    let full_scale: Vec<f64> = robot.gyros().map(|_| size.draw(FULL_SCALE_RAD_S, rng)).collect();
    if full_scale.is_empty() {
        return Err(EffectError::Unsuited { effect: EFFECT.id, reason: "the robot has no gyro" });
    }
    let values = draw::of_gyros(EFFECT.id, "fs", "rad/s", &full_scale);
    Ok(Hidden { id: EFFECT.id, values, physics: Box::new(GyroClipping { full_scale }) })
}

/// Over what the law's corners are rounded, rad/s.
const CORNER_RAD_S: f64 = 2e-3;

/// The corners are rounded over some of the noise.
#[derive(Debug)]
struct ClippingLaw {
    parameters: Parameters,
}

impl Law for ClippingLaw {
    fn parameters(&self) -> &Parameters {
        &self.parameters
    }

    /// A gyro whose range ends has no reading beyond it, whatever the robot and its motion.
    fn starts_by_readings(&self, readings: &Readings) -> Vec<Arc<dyn Law>> {
        let ends = &readings.gyro_ends_rad_s;
        let starts = ends.iter().map(Vec::len).min().unwrap_or(0);
        let started = |start: usize| -> Arc<dyn Law> {
            let mut parameters = self.parameters.cleared();
            for (gyro, ends) in ends.iter().enumerate() {
                parameters.plain("fs", "rad/s", Of::Gyro(gyro), ends[start]);
            }
            Arc::new(Self { parameters })
        };
        (0..starts).map(started).collect()
    }

    fn sees_gyro(&self, _gyro: usize) -> bool {
        true
    }

    reads_gyros!();
}

impl ClippingLaw {
    fn read<T: Quantity>(&self, at: &GyroAt<'_, T>, rate: [T; 3], bias: [T; 3]) -> [T; 3] {
        let full_scale = at.parameters[0];
        std::array::from_fn(|axis| {
            let reading = rate[axis] + bias[axis];
            reading - (reading - full_scale).ramp(CORNER_RAD_S) + (-reading - full_scale).ramp(CORNER_RAD_S)
        })
    }
}

fn laws(robot: &Robot) -> Laws {
    let gyros = robot.gyros().count();
    if gyros == 0 {
        return Err(EffectError::Unsuited { effect: EFFECT.id, reason: "the robot has no gyro" });
    }
    // Where readings are at hand they say where the range ends ([`Law::starts_by_readings`]).
    let mut parameters = Parameters::on(EFFECT.id, robot);
    for gyro in 0..gyros {
        parameters.plain("fs", "rad/s", Of::Gyro(gyro), FULL_SCALE_RAD_S[1]);
    }
    only(ClippingLaw { parameters })
}
