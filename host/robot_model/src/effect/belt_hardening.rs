//! Stiffening belt: the spring gets stiffer the more it is wound.
//!
//! ```text
//! τ_c + k₃ (q − θ)³
//! ```

use rand::Rng;

use super::surrogate::{At, Hook, Law, Laws, Of, Parameters, Quantity, acts_on_joints, only};
use super::{Effect, EffectError, EffectParameter, Hidden, Moment, Physics, Row, Scale, Size, draw};
use crate::robot::{Robot, Symbol};

pub(super) const EFFECT: Effect = Effect {
    id: "belt_hardening",
    row: Row::Link,
    title: "belt that stiffens",
    equation: "τ_c + k₃ (q − θ)³",
    parameters: &[EffectParameter::size("k3[i]", "N m/rad^3")
        .typically(0.25, 0.5, Scale::StiffnessPerWindupSquared)
        .sizes("10, 30, 90 % of k_s at a windup of 0.1 rad (10 to 100 met): 4000 to 36000 where k_s is 400")],
    nuisances: &[],
    confounded_with: &["backlash", "load_friction", "k_s"],
    about: "Fibres of a belt straighten, rubber is compressed: the last tenth of a degree costs more torque than the \
            first. Free play stiffens as well, but all at once and at a small windup.",
    make,
    laws,
};

/// k₃ (0.1 rad)² as a share of k_s.
const SHARE: [f64; 3] = [0.1, 0.3, 0.87];
/// Where the shares are meant, rad.
const WINDUP_RAD: f64 = 0.1;

#[derive(Debug)]
struct BeltHardening {
    /// k₃, N m/rad³.
    k3: Vec<f64>,
}

impl Physics for BeltHardening {
    fn transmission_torque(&self, at: &Moment<'_>, torque: f64) -> f64 {
        torque + self.k3[at.joint] * at.wind().powi(3)
    }
}

fn make(robot: &Robot, size: Size, rng: &mut dyn Rng) -> Result<Hidden, EffectError> {
    let joints = draw::some(EFFECT.id, draw::elastic(robot), draw::NO_BELT)?;
    let unit = |joint| draw::nominal(robot, Symbol::KS, joint) / WINDUP_RAD.powi(2);
    let k3 = draw::per_joint(robot, &joints, size, SHARE, unit, rng);
    let values = draw::of_joints((EFFECT.id, robot), "k3", "N m/rad^3", &joints, &k3).collect();
    Ok(Hidden { id: EFFECT.id, values, physics: Box::new(BeltHardening { k3 }) })
}

/// Linear in k₃.
#[derive(Debug)]
struct HardeningLaw {
    parameters: Parameters,
}

impl Law for HardeningLaw {
    fn parameters(&self) -> &Parameters {
        &self.parameters
    }

    fn hooks(&self) -> &'static [Hook] {
        &[Hook::Transmission]
    }

    acts_on_joints!();
}

impl HardeningLaw {
    #[inline(always)]
    fn act<T: Quantity>(&self, _hook: Hook, at: &At<'_, T>, torque: T) -> T {
        let [k3] = *at.parameters else { return torque };
        let wind = at.wind();
        torque + k3 * wind * wind * wind
    }
}

fn laws(robot: &Robot) -> Laws {
    let joints = draw::some(EFFECT.id, draw::elastic(robot), draw::NO_BELT)?;
    let mut parameters = Parameters::on(EFFECT.id, robot);
    for joint in joints {
        parameters.plain("k3", "N m/rad^3", Of::Joint(joint), 0.0);
    }
    parameters.within("k3", [0.0, f64::INFINITY]);
    only(HardeningLaw { parameters })
}
