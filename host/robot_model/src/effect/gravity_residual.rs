//! Gravity residual: counter-springs do not cancel gravity.
//!
//! ```text
//! M q̈ = −τ_c − G sin(q + q₀)      on joints whose gravity the description calls compensated
//! ```
//!
//! A positive G pulls the link back to −q₀ (springs too strong); a negative one lets it fall over.

use rand::{Rng, RngExt};

use super::surrogate::{At, Hook, Law, Laws, Of, Parameters, Quantity, acts_on_joints, only};
use super::{Effect, EffectError, EffectParameter, Hidden, Moment, Physics, Row, Scale, Size, draw};
use crate::robot::{GravityLoad, Robot};

pub(super) const EFFECT: Effect = Effect {
    id: "gravity_residual",
    row: Row::Link,
    title: "gravity that the counter-springs leave over",
    equation: "G sin(q + q₀) on the link's row",
    parameters: &[
        EffectParameter::size("G[i]", "N m")
            .typically(0.02, 0.5, Scale::TorqueRms)
            .sizes("0.23, 0.75, 2.5 N m (0.2 to 3 met), either sign"),
        EffectParameter::shape("q0[i]", "rad").sizes("within 0.3 rad"),
    ],
    nuisances: &[],
    confounded_with: &["cable_spring", "torque_offset"],
    about: "Springs that balance a link are set by hand, and a costume or a new head changes what they have to hold. \
            Within half a radian it is a spring; only the cubic term tells it from a cable's.",
    make,
    laws,
};

/// Shares of the torque at full voltage.
const SHARE: [f64; 3] = [0.0015, 0.005, 0.0165];
/// q₀, rad.
const ANGLE_RAD: std::ops::Range<f64> = -0.3..0.3;

#[derive(Debug)]
struct GravityResidual {
    /// G, N m.
    torque: Vec<f64>,
    /// q₀, rad.
    angle: Vec<f64>,
}

impl Physics for GravityResidual {
    fn link_load(&self, at: &Moment<'_>, load: f64) -> f64 {
        load + self.torque[at.joint] * (at.q + self.angle[at.joint]).sin()
    }
}

fn make(robot: &Robot, size: Size, rng: &mut dyn Rng) -> Result<Hidden, EffectError> {
    let mut joints = draw::turning(robot);
    joints.retain(|j| robot.joints[*j].gravity == GravityLoad::Compensated && draw::full_torque(robot, *j) > 0.0);
    let joints = draw::some(EFFECT.id, joints, "no joint's gravity is compensated")?;
    let mut torque = draw::per_joint(robot, &joints, size, SHARE, |j| draw::full_torque(robot, j), rng);
    draw::either_sign(&mut torque, size, rng);
    let angle: Vec<f64> = torque.iter().map(|_| rng.random_range(ANGLE_RAD)).collect();
    let mut values: Vec<_> = draw::of_joints((EFFECT.id, robot), "G", "N m", &joints, &torque).collect();
    values.extend(draw::of_joints((EFFECT.id, robot), "q0", "rad", &joints, &angle));
    Ok(Hidden { id: EFFECT.id, values, physics: Box::new(GravityResidual { torque, angle }) })
}

/// Linear in G cos q₀ and G sin q₀.
#[derive(Debug)]
struct GravityLaw {
    parameters: Parameters,
}

impl Law for GravityLaw {
    fn parameters(&self) -> &Parameters {
        &self.parameters
    }

    fn hooks(&self) -> &'static [Hook] {
        &[Hook::LinkLoad]
    }

    acts_on_joints!();
}

impl GravityLaw {
    #[inline(always)]
    fn act<T: Quantity>(&self, _hook: Hook, at: &At<'_, T>, load: T) -> T {
        let [along, across] = *at.parameters else { return load };
        let (sin, cos) = at.q.sin_cos();
        load + along * sin + across * cos
    }
}

fn laws(robot: &Robot) -> Laws {
    let mut joints = draw::turning(robot);
    joints.retain(|j| robot.joints[*j].gravity == GravityLoad::Compensated);
    let joints = draw::some(EFFECT.id, joints, "no joint's gravity is compensated")?;
    let mut parameters = Parameters::on(EFFECT.id, robot);
    for joint in joints {
        parameters.signed_wave(("G", "N m"), "q0", Of::Joint(joint), [0.0; 2]);
    }
    only(GravityLaw { parameters })
}
