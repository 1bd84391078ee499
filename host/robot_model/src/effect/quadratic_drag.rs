//! Quadratic drag: air, or a costume.
//!
//! ```text
//! M q̈ = −τ_c − c q̇ |q̇|
//! ```

use rand::Rng;

use super::surrogate::{At, Hook, Law, Laws, Of, Parameters, Quantity, acts_on_joints, only};
use super::{Effect, EffectError, EffectParameter, Hidden, Moment, Physics, Row, Scale, Size, draw};
use crate::robot::{Robot, Symbol};

pub(super) const EFFECT: Effect = Effect {
    id: "quadratic_drag",
    row: Row::Link,
    title: "air drag of the links",
    equation: "c q̇ |q̇| on the link's row",
    parameters: &[EffectParameter::size("c[i]", "N m s^2/rad^2")
        .typically(2.2e-3, 0.6, Scale::TorqueRmsPerSpeedSquared)
        .sizes("0.06, 0.16, 0.43 (0.05 to 0.5 met)")],
    nuisances: &[],
    confounded_with: &["voltage_sag", "viscous_friction", "link_friction"],
    about: "Air resists with the square of the speed, a costume catches more of it. At the speeds of one stage it is \
            viscous friction; two stages of different speed separate them.",
    make,
    laws,
};

/// Shares of (torque at full voltage) / (speed without load)².
const SHARE: [f64; 3] = [0.009, 0.025, 0.066];

#[derive(Debug)]
struct QuadraticDrag {
    /// c, N m s²/rad².
    c: Vec<f64>,
}

impl Physics for QuadraticDrag {
    fn link_load(&self, at: &Moment<'_>, load: f64) -> f64 {
        load + self.c[at.joint] * at.qd * at.qd.abs()
    }
}

fn make(robot: &Robot, size: Size, rng: &mut dyn Rng) -> Result<Hidden, EffectError> {
    // Torque T and speed T / k_mi.
    let unit = |joint| match draw::full_torque(robot, joint) {
        0.0 => 0.0,
        torque => draw::nominal(robot, Symbol::KMi, joint).powi(2) / torque,
    };
    let mut joints = draw::all(robot);
    joints.retain(|joint| unit(*joint) > 0.0);
    let joints = draw::some(EFFECT.id, joints, draw::NO_VOLTAGE)?;
    let c = draw::per_joint(robot, &joints, size, SHARE, unit, rng);
    let values = draw::of_joints((EFFECT.id, robot), "c", "N m s^2/rad^2", &joints, &c).collect();
    Ok(Hidden { id: EFFECT.id, values, physics: Box::new(QuadraticDrag { c }) })
}

/// Linear in c.
#[derive(Debug)]
struct DragLaw {
    parameters: Parameters,
}

impl Law for DragLaw {
    fn parameters(&self) -> &Parameters {
        &self.parameters
    }

    fn hooks(&self) -> &'static [Hook] {
        &[Hook::LinkLoad]
    }

    acts_on_joints!();
}

impl DragLaw {
    #[inline(always)]
    fn act<T: Quantity>(&self, _hook: Hook, at: &At<'_, T>, load: T) -> T {
        let [c] = *at.parameters else { return load };
        load + c * at.qd * at.qd.abs()
    }
}

fn laws(robot: &Robot) -> Laws {
    let joints = draw::all(robot);
    let mut parameters = Parameters::on(EFFECT.id, robot);
    for joint in joints {
        parameters.plain("c", "N m s^2/rad^2", Of::Joint(joint), 0.0);
    }
    parameters.within("c", [0.0, f64::INFINITY]);
    only(DragLaw { parameters })
}
