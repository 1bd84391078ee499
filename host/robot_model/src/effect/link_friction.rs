//! Friction on the link's side: bearings behind the belt.
//!
//! ```text
//! M q̈ = −τ_c − μ_l sgn q̇ − v_l q̇      sgn as smooth as in equation (12), κ = 400 s/rad
//! ```

use rand::Rng;

use super::surrogate::{At, Hook, Law, Laws, Of, Parameters, Quantity, acts_on_joints, only};
use super::{Effect, EffectError, EffectParameter, Hidden, Moment, Physics, Row, Scale, Size, draw};
use crate::robot::{Robot, Symbol};

pub(super) const EFFECT: Effect = Effect {
    id: "link_friction",
    row: Row::Link,
    title: "friction on the link's side",
    equation: "μ_l sgn q̇ + v_l q̇ on the link's row",
    parameters: &[
        EffectParameter::size("mu_l[i]", "N m")
            .typically(0.01, 0.5, Scale::TorqueRms)
            .sizes("0.12, 0.4, 1.3 N m (0.1 to 1.6 met)"),
        EffectParameter::size("v_l[i]", "N m s/rad")
            .typically(7.5e-3, 0.6, Scale::TorqueRmsPerSpeed)
            .sizes("0.12, 0.4, 1.3 N m s/rad (0.1 to 1.6 met)"),
    ],
    nuisances: &[],
    confounded_with: &["mu", "d_s", "quadratic_drag"],
    about: "The link turns in bearings of its own, behind the spring. In slow motion the motor feels them through the \
            belt as its own friction; when the belt swings, only the link's part damps the link.",
    make,
    laws,
};

/// μ_l, shares of the torque at full voltage.
const SHARE_OF_TORQUE: [f64; 3] = [0.0008, 0.0027, 0.0085];
/// v_l, shares of k_mi.
const SHARE_OF_KMI: [f64; 3] = [0.004, 0.013, 0.041];
/// κ, s/rad.
const SLOPE_S: f64 = 400.0;

#[derive(Debug)]
struct LinkFriction {
    /// μ_l, N m.
    mu: Vec<f64>,
    /// v_l, N m s/rad.
    v: Vec<f64>,
}

impl Physics for LinkFriction {
    fn link_load(&self, at: &Moment<'_>, load: f64) -> f64 {
        load + self.mu[at.joint] * (0.5 * SLOPE_S * at.qd).tanh() + self.v[at.joint] * at.qd
    }
}

/// Joints that a voltage turns through a transmission.
fn joints(robot: &Robot) -> Result<Vec<usize>, EffectError> {
    let mut joints = draw::elastic(robot);
    joints.retain(|joint| draw::full_torque(robot, *joint) > 0.0);
    draw::some(EFFECT.id, joints, "no joint is turned by a voltage through an elastic transmission")
}

fn make(robot: &Robot, size: Size, rng: &mut dyn Rng) -> Result<Hidden, EffectError> {
    let joints = joints(robot)?;
    let mu = draw::per_joint(robot, &joints, size, SHARE_OF_TORQUE, |j| draw::full_torque(robot, j), rng);
    // An exact size is that of μ_l; v_l goes with it as medium with medium.
    let k_mi = |joint| draw::nominal(robot, Symbol::KMi, joint);
    let mut v = draw::per_joint(robot, &joints, size, SHARE_OF_KMI, k_mi, rng);
    if let Size::Exact(exact) = size {
        for &joint in &joints {
            let times_medium = exact / (SHARE_OF_TORQUE[1] * draw::full_torque(robot, joint));
            v[joint] = times_medium * SHARE_OF_KMI[1] * k_mi(joint);
        }
    }
    let mut values: Vec<_> = draw::of_joints((EFFECT.id, robot), "mu_l", "N m", &joints, &mu).collect();
    values.extend(draw::of_joints((EFFECT.id, robot), "v_l", "N m s/rad", &joints, &v));
    Ok(Hidden { id: EFFECT.id, values, physics: Box::new(LinkFriction { mu, v }) })
}

/// Linear in both.
#[derive(Debug)]
struct LinkFrictionLaw {
    parameters: Parameters,
}

impl Law for LinkFrictionLaw {
    fn parameters(&self) -> &Parameters {
        &self.parameters
    }

    fn hooks(&self) -> &'static [Hook] {
        &[Hook::LinkLoad]
    }

    acts_on_joints!();
}

impl LinkFrictionLaw {
    #[inline(always)]
    fn act<T: Quantity>(&self, _hook: Hook, at: &At<'_, T>, load: T) -> T {
        let [mu, v] = *at.parameters else { return load };
        load + mu * (at.qd * (0.5 * SLOPE_S)).tanh() + v * at.qd
    }
}

fn laws(robot: &Robot) -> Laws {
    let joints = draw::some(EFFECT.id, draw::elastic(robot), draw::NO_BELT)?;
    let mut parameters = Parameters::on(EFFECT.id, robot);
    for &joint in &joints {
        parameters.plain("mu_l", "N m", Of::Joint(joint), 0.0);
    }
    parameters.within("mu_l", [0.0, f64::INFINITY]);
    for joint in joints {
        parameters.plain("v_l", "N m s/rad", Of::Joint(joint), 0.0);
    }
    only(LinkFrictionLaw { parameters })
}
