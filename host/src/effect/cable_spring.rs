//! Cable spring: a cable harness or a costume pulls the link back.
//!
//! ```text
//! M q̈ = −τ_c − k_c q
//! ```

use rand::Rng;

use super::surrogate::{At, Hook, Law, Laws, Of, Parameters, Quantity, acts_on_joints, only};
use super::{Effect, EffectError, EffectParameter, Hidden, Moment, Physics, Row, Scale, Size, draw};
use crate::robot::Robot;

pub(super) const EFFECT: Effect = Effect {
    id: "cable_spring",
    row: Row::Link,
    title: "spring of cables or costume",
    equation: "k_c q on the link's row",
    parameters: &[EffectParameter::size("k_c[i]", "N m/rad")
        .typically(0.04, 0.5, Scale::TorqueRmsPerRadian)
        .sizes("0.6, 1.6, 4.4 where k_s is 400 (0.5 to 5 met)")],
    nuisances: &[],
    confounded_with: &["gravity_residual"],
    about: "Cables that cross a joint are bent by it and push back, a costume is stretched. The robot is drawn to its \
            middle pose, on joints that feel no gravity as well.",
    make,
    laws,
};

/// Shares of k_s; where the joint is rigid, of what stands for it.
const SHARE: [f64; 3] = [0.0015, 0.004, 0.011];

#[derive(Debug)]
struct CableSpring {
    /// k_c, N m/rad.
    k_c: Vec<f64>,
}

impl Physics for CableSpring {
    fn link_load(&self, at: &Moment<'_>, load: f64) -> f64 {
        load + self.k_c[at.joint] * at.q
    }
}

fn make(robot: &Robot, size: Size, rng: &mut dyn Rng) -> Result<Hidden, EffectError> {
    let joints = draw::all(robot);
    let k_c = draw::per_joint(robot, &joints, size, SHARE, |j| draw::stiffness_scale(robot, j), rng);
    let values = draw::of_joints((EFFECT.id, robot), "k_c", "N m/rad", &joints, &k_c).collect();
    Ok(Hidden { id: EFFECT.id, values, physics: Box::new(CableSpring { k_c }) })
}

/// Linear in k_c.
#[derive(Debug)]
struct CableLaw {
    parameters: Parameters,
}

impl Law for CableLaw {
    fn parameters(&self) -> &Parameters {
        &self.parameters
    }

    fn hooks(&self) -> &'static [Hook] {
        &[Hook::LinkLoad]
    }

    acts_on_joints!();
}

impl CableLaw {
    #[inline(always)]
    fn act<T: Quantity>(&self, _hook: Hook, at: &At<'_, T>, load: T) -> T {
        let [k_c] = *at.parameters else { return load };
        load + k_c * at.q
    }
}

fn laws(robot: &Robot) -> Laws {
    let mut parameters = Parameters::on(EFFECT.id, robot);
    for joint in draw::all(robot) {
        parameters.plain("k_c", "N m/rad", Of::Joint(joint), 0.0);
    }
    only(CableLaw { parameters })
}
