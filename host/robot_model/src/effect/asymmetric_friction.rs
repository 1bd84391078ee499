//! Asymmetric friction: turning one way costs more than turning the other way.
//!
//! ```text
//! τ_f + Δμ |sgn θ̇| + Δv |θ̇|      that is, μ ± Δμ and v ± Δv by direction; sgn as smooth as in equation (12)
//! ```
//!
//! Half differences. Δμ stays below μ, and Δv far below k_mi, so that all the drive does together still takes energy out.

use rand::Rng;

use super::surrogate::{At, Hook, Law, Laws, Of, Parameters, Quantity, acts_on_joints, only};
use super::{Effect, EffectError, EffectParameter, Hidden, Moment, Physics, Row, Scale, Size, draw};
use crate::robot::{Robot, Symbol};

pub(super) const EFFECT: Effect = Effect {
    id: "asymmetric_friction",
    row: Row::Motor,
    title: "friction that differs by direction",
    equation: "μ ± Δμ, v ± Δv by the sign of θ̇",
    parameters: &[
        EffectParameter::size("dmu[i]", "N m")
            .typically(0.2, 0.45, Scale::Friction)
            .sizes("8, 23, 60 % of μ (5 to 70 met), either sign"),
        EffectParameter::size("dv[i]", "N m s/rad")
            .typically(0.01, 0.6, Scale::TorqueRmsPerSpeed)
            .sizes("0.4, 1.2, 3 % of k_mi, either sign"),
    ],
    nuisances: &[],
    confounded_with: &["torque_offset", "gravity_residual", "belt_slack_side"],
    about: "Worm gears, brushes that lean, a seal with a lip. As long as the motor turns one way it is a constant torque; \
            at rest and at reversals it is not.",
    make,
    laws,
};

/// Δμ, shares of μ.
const SHARE_OF_MU: [f64; 3] = [0.08, 0.23, 0.60];
/// Δv, shares of k_mi.
const SHARE_OF_KMI: [f64; 3] = [0.004, 0.012, 0.03];

#[derive(Debug)]
struct AsymmetricFriction {
    /// Δμ, N m.
    dmu: Vec<f64>,
    /// Δv, N m s/rad.
    dv: Vec<f64>,
}

impl Physics for AsymmetricFriction {
    fn friction_torque(&self, at: &Moment<'_>, torque: f64) -> f64 {
        torque + self.dmu[at.joint] * at.friction_sign.abs() + self.dv[at.joint] * at.friction_speed.abs()
    }
}

fn make(robot: &Robot, size: Size, rng: &mut dyn Rng) -> Result<Hidden, EffectError> {
    let joints = draw::some(EFFECT.id, draw::rubbing(robot), draw::NO_FRICTION)?;
    let mut dmu = draw::per_joint(robot, &joints, size, SHARE_OF_MU, |j| draw::nominal(robot, Symbol::Mu, j), rng);
    // An exact size is that of Δμ; Δv goes with it as medium with medium.
    let k_mi = |joint| draw::nominal(robot, Symbol::KMi, joint).max(draw::nominal(robot, Symbol::V, joint));
    let mut dv = draw::per_joint(robot, &joints, size, SHARE_OF_KMI, k_mi, rng);
    if let Size::Exact(exact) = size {
        for &joint in &joints {
            let times_medium = exact / (SHARE_OF_MU[1] * draw::nominal(robot, Symbol::Mu, joint));
            dv[joint] = times_medium * SHARE_OF_KMI[1] * k_mi(joint);
        }
    }
    draw::either_sign(&mut dmu, size, rng);
    draw::either_sign(&mut dv, size, rng);
    let mut values: Vec<_> = draw::of_joints((EFFECT.id, robot), "dmu", "N m", &joints, &dmu).collect();
    values.extend(draw::of_joints((EFFECT.id, robot), "dv", "N m s/rad", &joints, &dv));
    Ok(Hidden { id: EFFECT.id, values, physics: Box::new(AsymmetricFriction { dmu, dv }) })
}

/// Linear in both. A joint whose description has a constant torque has no Δμ besides: only at rest would they differ.
#[derive(Debug)]
struct AsymmetryLaw {
    parameters: Parameters,
}

impl Law for AsymmetryLaw {
    fn parameters(&self) -> &Parameters {
        &self.parameters
    }

    fn hooks(&self) -> &'static [Hook] {
        &[Hook::Friction]
    }

    acts_on_joints!();
}

impl AsymmetryLaw {
    #[inline(always)]
    fn act<T: Quantity>(&self, _hook: Hook, at: &At<'_, T>, torque: T) -> T {
        match *at.parameters {
            [dmu, dv] => torque + dmu * at.friction_sign.abs() + dv * at.friction_speed.abs(),
            [dv] => torque + dv * at.friction_speed.abs(),
            _ => torque,
        }
    }
}

fn laws(robot: &Robot) -> Laws {
    let joints = draw::some(EFFECT.id, draw::rubbing(robot), draw::NO_FRICTION)?;
    let mut parameters = Parameters::on(EFFECT.id, robot);
    for &joint in joints.iter().filter(|&&joint| !draw::has_offset(robot, joint)) {
        parameters.plain("dmu", "N m", Of::Joint(joint), 0.0);
    }
    for joint in joints {
        parameters.plain("dv", "N m s/rad", Of::Joint(joint), 0.0);
    }
    only(AsymmetryLaw { parameters })
}
