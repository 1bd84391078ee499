//! Encoder eccentricity: the disc sits beside the shaft's centre.
//!
//! ```text
//! reading = θ + e sin(θ + φ)      once a turn of the joint; motor encoders, on the link side of the gear
//! ```

use rand::Rng;

use super::surrogate::{Law, Laws, Of, Parameters, Quantity, only, reads_positions};
use super::{Effect, EffectError, EffectParameter, Hidden, Past, Physics, Row, Scale, Size, draw};
use crate::model::law::PositionAt;
use crate::robot::{Robot, Sensor, Side};

pub(super) const EFFECT: Effect = Effect {
    id: "encoder_eccentricity",
    row: Row::Sensor,
    title: "once-per-turn error of the encoders",
    equation: "θ + e sin(θ + φ)",
    parameters: &[
        EffectParameter::size("e[i]", "rad")
            .typically(0.65e-3, 0.5, Scale::Radian)
            .sizes("0.25, 0.7, 1.7 mrad (0.2 to 2 met)"),
        EffectParameter::own_to_recording("phi[i]", "rad").sizes("anywhere"),
    ],
    nuisances: &[],
    confounded_with: &["cogging", "gyro_scale", "belt_tooth_skip"],
    about: "A disc that is not centred, or a pulley that is not round, makes the encoder run ahead on one half of the turn \
            and behind on the other. The gyros do not take part.",
    make,
    laws,
};

const ERROR_RAD: [f64; 3] = [0.25e-3, 0.7e-3, 1.7e-3];

#[derive(Debug)]
struct EncoderEccentricity {
    /// e, rad; zero where there is no motor encoder.
    error: Vec<f64>,
    /// φ, rad.
    phase: Vec<f64>,
}

impl Physics for EncoderEccentricity {
    fn encoder(&self, side: Side, joint: usize, _past: &Past, _now: f64, reading: f64) -> f64 {
        match side {
            Side::Motor => reading + self.error[joint] * (reading + self.phase[joint]).sin(),
            Side::Link => reading,
        }
    }
}

fn make(robot: &Robot, size: Size, rng: &mut dyn Rng) -> Result<Hidden, EffectError> {
    let joints = joints(robot)?;
    let error = draw::per_joint(robot, &joints, size, ERROR_RAD, |_| 1.0, rng);
    let phase = draw::phases(robot, rng);
    let mut values: Vec<_> = draw::of_joints((EFFECT.id, robot), "e", "rad", &joints, &error).collect();
    values.extend(draw::of_joints((EFFECT.id, robot), "phi", "rad", &joints, &phase));
    Ok(Hidden { id: EFFECT.id, values, physics: Box::new(EncoderEccentricity { error, phase }) })
}

/// Linear in e cos φ and e sin φ.
#[derive(Debug)]
struct EccentricityLaw {
    parameters: Parameters,
    joints: Vec<usize>,
}

impl Law for EccentricityLaw {
    fn parameters(&self) -> &Parameters {
        &self.parameters
    }

    fn sees_position(&self, side: Side, joint: usize) -> bool {
        side == Side::Motor && self.joints.contains(&joint)
    }

    reads_positions!();
}

impl EccentricityLaw {
    fn read<T: Quantity>(&self, at: &PositionAt<'_, T>, position: T) -> T {
        let (sin, cos) = position.sin_cos();
        position + at.parameters[0] * sin + at.parameters[1] * cos
    }
}

fn laws(robot: &Robot) -> Laws {
    let joints = joints(robot)?;
    let mut parameters = Parameters::on(EFFECT.id, robot);
    for &joint in &joints {
        parameters.wave(("e", "rad"), "phi", Of::Joint(joint), [0.0; 2]);
    }
    only(EccentricityLaw { parameters, joints })
}

/// Joints that turn and have a motor encoder.
fn joints(robot: &Robot) -> Result<Vec<usize>, EffectError> {
    let has_encoder =
        |joint| robot.sensors.iter().any(|sensor| matches!(sensor, Sensor::MotorEncoder(e) if e.joint == joint));
    let mut joints = draw::turning(robot);
    joints.retain(|joint| has_encoder(*joint));
    draw::some(EFFECT.id, joints, "no turning joint has a motor encoder")
}
