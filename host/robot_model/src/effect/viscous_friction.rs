//! Viscous friction of the motors, another one a joint.
//!
//! ```text
//! τ_f + v_i θ̇_i
//! ```
//!
//! The part that all joints have in common is the back-EMF's k_mi by another name: only differences between joints show.
//! Named sizes differ between joints; an exact size is the same on all, and no recording can tell it.

use rand::{Rng, RngExt};

use super::surrogate::{At, Differences, Hook, Law, Laws, Parameters, Quantity, acts_on_joints, only};
use super::{Effect, EffectError, EffectParameter, Hidden, Moment, Physics, Row, Scale, Size, draw};
use crate::robot::{Robot, Symbol};

pub(super) const EFFECT: Effect = Effect {
    id: "viscous_friction",
    row: Row::Motor,
    title: "viscous friction of the motors",
    equation: "τ_f + v θ̇",
    parameters: &[EffectParameter::size("v[i]", "N m s/rad")
        .typically(0.04, 0.6, Scale::TorqueRmsPerSpeed)
        .sizes("about 0.6, 2.2, 7, from a quarter to seven quarters of it by joint (0.3 to 14 met)")],
    nuisances: &[],
    confounded_with: &["k_mi", "motor_mismatch", "quadratic_drag"],
    about: "Grease and seals resist in proportion to speed, as the back-EMF does. What is common to all joints cannot be \
            told from k_mi by any motion; a joint whose grease is stiffer than the others' can.",
    make,
    laws,
};

/// Shares of k_mi.
const SHARE: [f64; 3] = [0.02, 0.07, 0.22];
/// How much joints differ, share of the size.
const SPREAD: std::ops::Range<f64> = 0.25..1.75;

#[derive(Debug)]
struct ViscousFriction {
    /// v, N m s/rad.
    v: Vec<f64>,
}

impl Physics for ViscousFriction {
    fn friction_torque(&self, at: &Moment<'_>, torque: f64) -> f64 {
        torque + self.v[at.joint] * at.thetad
    }
}

fn make(robot: &Robot, size: Size, rng: &mut dyn Rng) -> Result<Hidden, EffectError> {
    let mut joints = draw::all(robot);
    joints.retain(|joint| draw::nominal(robot, Symbol::KMi, *joint) > 0.0);
    let joints = draw::some(EFFECT.id, joints, "no joint has a back-EMF to compare with")?;
    let mut v = draw::per_joint(robot, &joints, size, SHARE, |j| draw::nominal(robot, Symbol::KMi, j), rng);
    if !matches!(size, Size::Exact(_)) {
        v.iter_mut().for_each(|v| *v *= rng.random_range(SPREAD));
    }
    let values = draw::of_joints((EFFECT.id, robot), "v", "N m s/rad", &joints, &v).collect();
    Ok(Hidden { id: EFFECT.id, values, physics: Box::new(ViscousFriction { v }) })
}

/// The same, in differences where the back-EMF that the joints share is free.
#[derive(Debug)]
struct ViscousLaw {
    parameters: Parameters,
    differences: Differences,
}

impl Law for ViscousLaw {
    fn parameters(&self) -> &Parameters {
        &self.parameters
    }

    fn hooks(&self) -> &'static [Hook] {
        &[Hook::Friction]
    }

    fn local(&self, joint: usize) -> Vec<usize> {
        self.differences.local(joint).collect()
    }

    acts_on_joints!();
}

impl ViscousLaw {
    #[inline(always)]
    fn act<T: Quantity>(&self, _hook: Hook, at: &At<'_, T>, torque: T) -> T {
        torque + self.differences.value(at.joint, at.parameters) * at.thetad
    }
}

fn laws(robot: &Robot) -> Laws {
    let mut parameters = Parameters::on(EFFECT.id, robot);
    let compared = |symbol| robot.parameters().iter().any(|spec| spec.symbol == symbol);
    let symbol = if compared(Symbol::V) { Symbol::V } else { Symbol::KMi };
    let differences = if compared(symbol) {
        Differences::of(robot, &mut parameters, (symbol, "v", "N m s/rad"), &draw::all(robot))
    } else {
        Differences::own(robot, &mut parameters, ("v", "N m s/rad"))
    };
    if differences.is_empty() {
        let reason = "every joint has a back-EMF or viscous friction of its own in the description";
        return Err(EffectError::Unsuited { effect: EFFECT.id, reason });
    }
    only(ViscousLaw { parameters, differences })
}
