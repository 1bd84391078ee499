//! Load-dependent friction: bearings and gears rub more the more they carry.
//!
//! ```text
//! μ (1 + a |τ_c|) sgn θ̇        τ_c: torque of the transmission; of a rigid joint, whose gear carries nearly all of it, that of the motor
//! ```

use rand::Rng;

use super::surrogate::{At, Hook, Law, Laws, Of, Parameters, Quantity, acts_on_joints, only};
use super::{Effect, EffectError, EffectParameter, Hidden, Moment, Physics, Row, Scale, Size, draw};
use crate::robot::Robot;

pub(super) const EFFECT: Effect = Effect {
    id: "load_friction",
    row: Row::Motor,
    title: "friction that grows with the load",
    equation: "μ (1 + a |τ_c|) sgn θ̇",
    parameters: &[EffectParameter::size("a[i]", "1/(N m)")
        .typically(0.6, 0.45, Scale::PerTorqueRms)
        .sizes("0.6, 1.6, 4.3 % per N m (0.5 to 5 met)")],
    nuisances: &[],
    confounded_with: &["k_pwm", "d_s", "belt_hardening"],
    about: "The torque that a belt carries also presses its pulleys into their bearings. An efficiency below one is this \
            effect; at constant acceleration it looks like a weaker motor.",
    make,
    laws,
};

/// a times the torque of a windup of 0.1 rad; where the joint is rigid, of what stands for it.
const SHARE: [f64; 3] = [0.24, 0.65, 1.7];
/// Where the shares are meant, rad.
const WINDUP_RAD: f64 = 0.1;

#[derive(Debug)]
struct LoadFriction {
    /// a, 1/(N m).
    a: Vec<f64>,
}

impl Physics for LoadFriction {
    fn friction_torque(&self, at: &Moment<'_>, torque: f64) -> f64 {
        torque + at.coulomb() * self.a[at.joint] * at.transmitted.abs()
    }
}

fn make(robot: &Robot, size: Size, rng: &mut dyn Rng) -> Result<Hidden, EffectError> {
    let joints = draw::some(EFFECT.id, draw::rubbing(robot), draw::NO_FRICTION)?;
    let unit = |joint| 1.0 / (draw::stiffness_scale(robot, joint) * WINDUP_RAD);
    let a = draw::per_joint(robot, &joints, size, SHARE, unit, rng);
    let values = draw::of_joints((EFFECT.id, robot), "a", "1/(N m)", &joints, &a).collect();
    Ok(Hidden { id: EFFECT.id, values, physics: Box::new(LoadFriction { a }) })
}

/// Linear in a.
#[derive(Debug)]
struct LoadLaw {
    parameters: Parameters,
}

impl Law for LoadLaw {
    fn parameters(&self) -> &Parameters {
        &self.parameters
    }

    fn hooks(&self) -> &'static [Hook] {
        &[Hook::Friction]
    }

    acts_on_joints!();
}

impl LoadLaw {
    #[inline(always)]
    fn act<T: Quantity>(&self, _hook: Hook, at: &At<'_, T>, torque: T) -> T {
        let [a] = *at.parameters else { return torque };
        torque + at.coulomb() * a * at.transmitted.abs()
    }
}

fn laws(robot: &Robot) -> Laws {
    let joints = draw::some(EFFECT.id, draw::rubbing(robot), draw::NO_FRICTION)?;
    let mut parameters = Parameters::on(EFFECT.id, robot);
    for joint in joints {
        parameters.plain("a", "1/(N m)", Of::Joint(joint), 0.0);
    }
    parameters.within("a", [0.0, f64::INFINITY]);
    only(LoadLaw { parameters })
}
