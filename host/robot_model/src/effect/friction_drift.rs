//! Friction drift: a cold robot warms up.
//!
//! ```text
//! μ (1 + a e^(−t/T)) sgn θ̇      t from the start of the motion
//! ```

use rand::{Rng, RngExt};

use super::surrogate::{At, Hook, Law, Laws, Of, Parameters, Quantity, acts_on_joints, only};
use super::{Effect, EffectError, EffectParameter, Hidden, Moment, Physics, Row, Scale, Size, draw};
use crate::robot::Robot;

pub(super) const EFFECT: Effect = Effect {
    id: "friction_drift",
    row: Row::Motor,
    title: "friction falls as the robot warms up",
    equation: "μ (1 + a e^(−t/T)) sgn θ̇",
    parameters: &[
        EffectParameter::size("a[i]", "1").typically(0.2, 0.3, Scale::Si).sizes("12, 22, 35 % (10 to 40 met)"),
        EffectParameter::own_to_recording("T", "s").typically(35.0, 0.3, Scale::Si).sizes("20 to 60 s"),
    ],
    nuisances: &[],
    confounded_with: &["mu", "gyro_bias_drift"],
    about: "Cold grease is stiff. Over the first minute the friction falls towards what it is in a warm robot, the μ of \
            the base model. A motion that does the same thing early and late shows it.",
    make,
    laws,
};

const RATIO: [f64; 3] = [0.12, 0.22, 0.35];
const TIME_CONSTANT_S: std::ops::Range<f64> = 20.0..60.0;

#[derive(Debug)]
struct FrictionDrift {
    /// a of every joint.
    ratio: Vec<f64>,
    /// T, s.
    time_constant_s: f64,
}

impl Physics for FrictionDrift {
    fn friction_torque(&self, at: &Moment<'_>, torque: f64) -> f64 {
        torque + at.coulomb() * self.ratio[at.joint] * (-at.time_s / self.time_constant_s).exp()
    }
}

fn make(robot: &Robot, size: Size, rng: &mut dyn Rng) -> Result<Hidden, EffectError> {
    let joints = draw::some(EFFECT.id, draw::rubbing(robot), draw::NO_FRICTION)?;
    let ratio = draw::per_joint(robot, &joints, size, RATIO, |_| 1.0, rng);
    let time_constant_s = rng.random_range(TIME_CONSTANT_S);
    let mut values: Vec<_> = draw::of_joints((EFFECT.id, robot), "a", "1", &joints, &ratio).collect();
    values.push(draw::single(EFFECT.id, "T", "s", time_constant_s));
    Ok(Hidden { id: EFFECT.id, values, physics: Box::new(FrictionDrift { ratio, time_constant_s }) })
}

/// Where the search for T starts, s.
const START_S: f64 = 35.0;

/// Linear in a; T by its logarithm.
#[derive(Debug)]
struct DriftLaw {
    parameters: Parameters,
}

impl Law for DriftLaw {
    fn parameters(&self) -> &Parameters {
        &self.parameters
    }

    fn hooks(&self) -> &'static [Hook] {
        &[Hook::Friction]
    }

    acts_on_joints!();
}

impl DriftLaw {
    #[inline(always)]
    fn act<T: Quantity>(&self, _hook: Hook, at: &At<'_, T>, torque: T) -> T {
        let [ratio, time_constant] = *at.parameters else { return torque };
        let decay = (-((-time_constant).exp() * at.time_s)).exp();
        torque + at.coulomb() * ratio * decay
    }
}

fn laws(robot: &Robot) -> Laws {
    let joints = draw::some(EFFECT.id, draw::rubbing(robot), draw::NO_FRICTION)?;
    let mut parameters = Parameters::on(EFFECT.id, robot);
    for joint in joints {
        parameters.plain("a", "1", Of::Joint(joint), 0.0);
    }
    parameters.positive("T", "s", Of::All, START_S);
    parameters.within("T", [1.0, 1e3]);
    only(DriftLaw { parameters })
}
