//! Torque offset: a constant torque on a motor.
//!
//! ```text
//! τ_m + o_i
//! ```

use rand::Rng;

use super::surrogate::{At, Hook, Law, Laws, Of, Parameters, Quantity, acts_on_joints, only};
use super::{Effect, EffectError, EffectParameter, Hidden, Moment, Physics, Row, Scale, Size, draw};
use crate::robot::Robot;

pub(super) const EFFECT: Effect = Effect {
    id: "torque_offset",
    row: Row::Motor,
    title: "constant torque on the motors",
    equation: "τ_m + o",
    parameters: &[EffectParameter::size("o[i]", "N m")
        .typically(0.008, 0.5, Scale::TorqueRms)
        .sizes("0.12, 0.3, 0.85 N m (0.1 to 1 met), either sign")],
    nuisances: &[],
    confounded_with: &["asymmetric_friction", "gravity_residual"],
    about: "A driver whose zero is off, or a spring that pulls on the motor's side. It pushes the same way whatever the \
            motor does: friction that differs by direction looks like it as long as the motor keeps turning.",
    make,
    laws,
};

/// Shares of the torque at full voltage.
const OFFSET: [f64; 3] = [0.0008, 0.002, 0.0057];

#[derive(Debug)]
struct TorqueOffset {
    /// o, N m.
    offset: Vec<f64>,
}

impl Physics for TorqueOffset {
    fn motor_torque(&self, at: &Moment<'_>, torque: f64) -> f64 {
        torque + self.offset[at.joint]
    }
}

fn make(robot: &Robot, size: Size, rng: &mut dyn Rng) -> Result<Hidden, EffectError> {
    let joints = draw::driven(EFFECT.id, robot)?;
    let mut offset = draw::per_joint(robot, &joints, size, OFFSET, |j| draw::full_torque(robot, j), rng);
    draw::either_sign(&mut offset, size, rng);
    let values = draw::of_joints((EFFECT.id, robot), "o", "N m", &joints, &offset).collect();
    Ok(Hidden { id: EFFECT.id, values, physics: Box::new(TorqueOffset { offset }) })
}

/// Linear in o.
#[derive(Debug)]
struct OffsetLaw {
    parameters: Parameters,
}

impl Law for OffsetLaw {
    fn parameters(&self) -> &Parameters {
        &self.parameters
    }

    fn hooks(&self) -> &'static [Hook] {
        &[Hook::MotorTorque]
    }

    acts_on_joints!();
}

impl OffsetLaw {
    #[inline(always)]
    fn act<T: Quantity>(&self, _hook: Hook, at: &At<'_, T>, torque: T) -> T {
        let [offset] = *at.parameters else { return torque };
        torque + offset
    }
}

fn laws(robot: &Robot) -> Laws {
    let mut joints = draw::all(robot);
    joints.retain(|joint| !draw::has_offset(robot, *joint));
    let joints = draw::some(EFFECT.id, joints, "the description has a constant torque on every joint")?;
    let mut parameters = Parameters::on(EFFECT.id, robot);
    for joint in joints {
        parameters.plain("o", "N m", Of::Joint(joint), 0.0);
    }
    only(OffsetLaw { parameters })
}
