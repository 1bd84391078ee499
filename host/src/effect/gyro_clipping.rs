//! Gyro clipping: the robot turns faster than the gyro's range.
//!
//! ```text
//! reading = clip(R_imu ω + bias + noise, ±FS)      on each axis
//! ```

use rand::Rng;

use super::{Effect, EffectError, EffectParameter, Hidden, Physics, Size, draw};
use crate::robot::{Robot, Vector3};

pub(super) const EFFECT: Effect = Effect {
    id: "gyro_clipping",
    title: "gyro range exceeded",
    equation: "clip(ω, ±FS)",
    parameters: &[EffectParameter {
        name: "fs[gyro]",
        unit: "rad/s",
        sizes: "5.4, 4.9, 4.4 rad/s (250 deg/s and up met); Doggy turns at up to 6.5",
    }],
    confounded_with: &["current_limit", "gyro_scale"],
    about: "A gyro set to a smaller range than its description says puts out its full scale while the robot turns faster. \
            Peaks are flat, and everything below them is as it should be.",
    make,
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
    let gyros: Vec<usize> = (0..full_scale.len()).collect();
    let values = draw::of_joints(EFFECT.id, "fs", "rad/s", &gyros, &full_scale).collect();
    Ok(Hidden { id: EFFECT.id, values, physics: Box::new(GyroClipping { full_scale }) })
}
