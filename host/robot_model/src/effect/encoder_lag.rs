//! Encoder lag: one encoder reads late; early where T is negative.
//!
//! ```text
//! reading(t) = θ(t − T), or q(t − T) where the encoder sits on the link      true dead time, on one joint
//! ```

use rand::{Rng, RngExt};

use super::surrogate::{Law, Laws, Of, Parameters, Quantity, only, reads_positions};
use super::{Effect, EffectError, EffectParameter, Hidden, Past, Physics, Row, Scale, Size, draw};
use crate::model::law::PositionAt;
use crate::robot::{Robot, Sensor, Side};

pub(super) const EFFECT: Effect = Effect {
    id: "encoder_lag",
    row: Row::Sensor,
    title: "an encoder that reads at another time than the other sensors",
    equation: "θ(t − T), or q(t − T) on the link",
    parameters: &[EffectParameter::size("T[i]", "s")
        .typically(1.3, 0.45, Scale::SamplePeriod)
        .sizes("0.4, 1.3, 4.3 ms (0.3 to 5 met), on one joint")],
    nuisances: &[],
    confounded_with: &["d_s", "k_s", "gyro_lag", "input_delay"],
    about: "An encoder on a bus, or one whose driver filters, tells where the joint was some milliseconds ago. Against \
            the gyros its motor lags, which a softer belt or a weaker damper does as well. A T below \
            zero says that it reads before the others, or that they are late.",
    make,
    laws,
};

const DEAD_TIME_S: [f64; 3] = [0.4e-3, 1.3e-3, 4.3e-3];

#[derive(Debug)]
struct EncoderLag {
    joint: usize,
    side: Side,
    dead_time_s: f64,
}

impl Physics for EncoderLag {
    fn memory_s(&self) -> f64 {
        self.dead_time_s
    }

    fn encoder(&self, side: Side, joint: usize, past: &Past, now: f64, reading: f64) -> f64 {
        if (side, joint) != (self.side, self.joint) {
            return reading;
        }
        past.position(side, joint, self.dead_time_s, now)
    }
}

fn make(robot: &Robot, size: Size, rng: &mut dyn Rng) -> Result<Hidden, EffectError> {
    let encoders: Vec<_> = encoders_of(robot).collect();
    if encoders.is_empty() {
        return Err(EffectError::Unsuited { effect: EFFECT.id, reason: "the robot has no encoder" });
    }
    let (side, joint) = encoders[rng.random_range(0..encoders.len())];
    let dead_time_s = size.draw(DEAD_TIME_S, rng);
    let values = vec![draw::single(EFFECT.id, &format!("T[{}]", joint + 1), "s", dead_time_s)];
    Ok(Hidden { id: EFFECT.id, values, physics: Box::new(EncoderLag { joint, side, dead_time_s }) })
}

/// A search does not look further, samples.
const MOST_SAMPLES: f64 = 50.0;

/// Readings are compared whole samples later, and the rest of T by the speed.
///
/// One T a joint. Where motor and link both have an encoder it is the link's: against the other one both show, and a T below zero means
/// that the motor's is the late one.
#[derive(Debug)]
struct LateLaw {
    parameters: Parameters,
    encoders: Vec<(Side, usize)>,
}

impl Law for LateLaw {
    fn parameters(&self) -> &Parameters {
        &self.parameters
    }

    fn sees_position(&self, side: Side, joint: usize) -> bool {
        self.encoders.contains(&(side, joint))
    }

    reads_positions!();

    fn shift(&self, side: Side, joint: usize, z: &[f64], period_s: f64) -> i32 {
        let which = self.encoders.iter().position(|encoder| *encoder == (side, joint));
        which.map_or(0, |which| (z[which] / period_s).round().clamp(-MOST_SAMPLES, MOST_SAMPLES) as i32)
    }
}

impl LateLaw {
    fn read<T: Quantity>(&self, at: &PositionAt<'_, T>, position: T) -> T {
        position + (T::from(at.shifted_s) - at.parameters[0]) * at.speed
    }
}

fn laws(robot: &Robot) -> Laws {
    let mut encoders: Vec<(Side, usize)> = encoders_of(robot).collect();
    encoders.sort_by_key(|(side, joint)| (*joint, *side == Side::Motor));
    encoders.dedup_by_key(|(_, joint)| *joint);
    if encoders.is_empty() {
        return Err(EffectError::Unsuited { effect: EFFECT.id, reason: "the robot has no encoder" });
    }
    let mut parameters = Parameters::on(EFFECT.id, robot);
    for (_, joint) in &encoders {
        parameters.plain("T", "s", Of::Joint(*joint), 0.0);
    }
    parameters.within("T", [-0.02, 0.02]);
    only(LateLaw { parameters, encoders })
}

fn encoders_of(robot: &Robot) -> impl Iterator<Item = (Side, usize)> + '_ {
    robot.sensors.iter().filter_map(|sensor| match sensor {
        Sensor::MotorEncoder(encoder) => Some((Side::Motor, encoder.joint)),
        Sensor::LinkEncoder(encoder) => Some((Side::Link, encoder.joint)),
        _ => None,
    })
}
