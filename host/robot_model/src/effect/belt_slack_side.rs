//! Slack side: the belt's two strands are not equally stiff.
//!
//! ```text
//! τ_c = k_s (1 + r sgn(q − θ)) (q − θ) + d_s (q̇ − θ̇)
//! ```

use rand::Rng;

use super::surrogate::{At, Hook, Law, Laws, Of, Parameters, Quantity, acts_on_joints, only};
use super::{Effect, EffectError, EffectParameter, Hidden, Moment, Physics, Row, Scale, Size, draw};
use crate::robot::Robot;

pub(super) const EFFECT: Effect = Effect {
    id: "belt_slack_side",
    row: Row::Link,
    title: "belt stiffness that differs by direction",
    equation: "k_s (1 ± r) (q − θ)",
    parameters: &[EffectParameter::size("r[i]", "1")
        .typically(0.13, 0.3, Scale::Si)
        .sizes("6, 13, 26 % (5 to 30 met), either sign")],
    nuisances: &[],
    confounded_with: &["asymmetric_friction", "belt_hardening"],
    about: "One strand of a belt is longer than the other, or its tensioner sits on one side: pulling one way meets a \
            stiffer spring than pulling the other way.",
    make,
    laws,
};

const RATIO: [f64; 3] = [0.06, 0.13, 0.26];

#[derive(Debug)]
struct BeltSlackSide {
    /// r of every joint.
    ratio: Vec<f64>,
}

impl Physics for BeltSlackSide {
    fn transmission_torque(&self, at: &Moment<'_>, torque: f64) -> f64 {
        torque + self.ratio[at.joint] * at.k_s * at.wind().abs()
    }
}

fn make(robot: &Robot, size: Size, rng: &mut dyn Rng) -> Result<Hidden, EffectError> {
    let joints = draw::some(EFFECT.id, draw::elastic(robot), draw::NO_BELT)?;
    let mut ratio = draw::per_joint(robot, &joints, size, RATIO, |_| 1.0, rng);
    draw::either_sign(&mut ratio, size, rng);
    let values = draw::of_joints((EFFECT.id, robot), "r", "1", &joints, &ratio).collect();
    Ok(Hidden { id: EFFECT.id, values, physics: Box::new(BeltSlackSide { ratio }) })
}

/// Linear in r.
#[derive(Debug)]
struct SlackSideLaw {
    parameters: Parameters,
}

impl Law for SlackSideLaw {
    fn parameters(&self) -> &Parameters {
        &self.parameters
    }

    fn hooks(&self) -> &'static [Hook] {
        &[Hook::Transmission]
    }

    acts_on_joints!();
}

impl SlackSideLaw {
    #[inline(always)]
    fn act<T: Quantity>(&self, _hook: Hook, at: &At<'_, T>, torque: T) -> T {
        let [ratio] = *at.parameters else { return torque };
        torque + ratio * at.k_s * at.wind().abs()
    }
}

fn laws(robot: &Robot) -> Laws {
    let joints = draw::some(EFFECT.id, draw::elastic(robot), draw::NO_BELT)?;
    let mut parameters = Parameters::on(EFFECT.id, robot);
    for joint in joints {
        parameters.plain("r", "1", Of::Joint(joint), 0.0);
    }
    parameters.within("r", [-0.9, 0.9]);
    only(SlackSideLaw { parameters })
}
