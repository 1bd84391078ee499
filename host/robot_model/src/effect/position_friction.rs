//! Friction that varies with the angle.
//!
//! ```text
//! μ (1 + a cos(θ − φ)) sgn θ̇
//! ```

use rand::Rng;

use super::surrogate::{At, Hook, Law, Laws, Of, Parameters, Quantity, acts_on_joints, only};
use super::{Effect, EffectError, EffectParameter, Hidden, Moment, Physics, Row, Scale, Size, draw};
use crate::robot::Robot;

pub(super) const EFFECT: Effect = Effect {
    id: "position_friction",
    row: Row::Motor,
    title: "friction that varies with the angle",
    equation: "μ (1 + a cos(θ − φ)) sgn θ̇",
    parameters: &[
        EffectParameter::size("a[i]", "1").typically(0.13, 0.3, Scale::Si).sizes("6, 14, 26 % (5 to 30 met)"),
        EffectParameter::own_to_recording("phi[i]", "rad").sizes("anywhere"),
    ],
    nuisances: &[],
    confounded_with: &["mu", "cogging"],
    about: "A bent shaft, a pulley that is not round or a cable that rubs in one pose: friction is higher on one side of \
            the circle than on the other. Over a small range of motion it is a slope, not a wave.",
    make,
    laws,
};

/// What a robot lacks whose turning joints have no friction.
const NO_TURNING_FRICTION: &str = "no turning joint has friction";

const RATIO: [f64; 3] = [0.06, 0.14, 0.26];

#[derive(Debug)]
struct PositionFriction {
    /// a of every joint.
    ratio: Vec<f64>,
    /// φ, rad.
    phase: Vec<f64>,
}

impl Physics for PositionFriction {
    fn friction_torque(&self, at: &Moment<'_>, torque: f64) -> f64 {
        torque + at.coulomb() * self.ratio[at.joint] * (at.theta - self.phase[at.joint]).cos()
    }
}

fn make(robot: &Robot, size: Size, rng: &mut dyn Rng) -> Result<Hidden, EffectError> {
    let joints = draw::some(EFFECT.id, draw::rubbing_by_turns(robot), NO_TURNING_FRICTION)?;
    let ratio = draw::per_joint(robot, &joints, size, RATIO, |_| 1.0, rng);
    let phase = draw::phases(robot, rng);
    let mut values: Vec<_> = draw::of_joints((EFFECT.id, robot), "a", "1", &joints, &ratio).collect();
    values.extend(draw::of_joints((EFFECT.id, robot), "phi", "rad", &joints, &phase));
    Ok(Hidden { id: EFFECT.id, values, physics: Box::new(PositionFriction { ratio, phase }) })
}

/// Linear in a cos φ and a sin φ.
#[derive(Debug)]
struct PositionLaw {
    parameters: Parameters,
}

impl Law for PositionLaw {
    fn parameters(&self) -> &Parameters {
        &self.parameters
    }

    fn hooks(&self) -> &'static [Hook] {
        &[Hook::Friction]
    }

    acts_on_joints!();
}

impl PositionLaw {
    #[inline(always)]
    fn act<T: Quantity>(&self, _hook: Hook, at: &At<'_, T>, torque: T) -> T {
        let [along, across] = *at.parameters else { return torque };
        let (sin, cos) = at.theta.sin_cos();
        torque + at.coulomb() * (along * cos + across * sin)
    }
}

fn laws(robot: &Robot) -> Laws {
    let joints = draw::some(EFFECT.id, draw::rubbing_by_turns(robot), NO_TURNING_FRICTION)?;
    let mut parameters = Parameters::on(EFFECT.id, robot);
    for joint in joints {
        parameters.wave(("a", "1"), "phi", Of::Joint(joint), [0.0; 2]);
    }
    only(PositionLaw { parameters })
}
