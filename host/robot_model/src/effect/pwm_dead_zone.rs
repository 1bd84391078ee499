//! Dead zone of the driver: small duties move nothing, larger ones are short by as much.
//!
//! ```text
//! u_motor = sgn u · max(|u| − d, 0)      true dead band
//! ```

use rand::Rng;

use super::surrogate::{At, Hook, Law, Laws, Of, Parameters, Quantity, acts_on_joints, only};
use super::{Effect, EffectError, EffectParameter, Hidden, Past, Physics, Row, Scale, Size, draw};
use crate::robot::{InputUnit, Robot};

pub(super) const EFFECT: Effect = Effect {
    id: "pwm_dead_zone",
    row: Row::Motor,
    title: "dead zone of the motor driver",
    equation: "sgn u · max(|u| − d, 0)",
    parameters: &[EffectParameter::size("d[i]", "1")
        .typically(0.012, 0.5, Scale::Si)
        .sizes("0.004, 0.012, 0.04 of full duty (0.003 to 0.05 met)")],
    nuisances: &[],
    confounded_with: &["mu", "k_pwm"],
    about: "The half bridges wait between switching one transistor off and the other on, and the shortest pulses vanish. \
            While a motor turns the way it is driven, this is Coulomb friction; only where it is driven against its \
            turning do the two have different signs.",
    make,
    laws,
};

const DEAD_DUTY: [f64; 3] = [0.004, 0.012, 0.04];

#[derive(Debug)]
struct PwmDeadZone {
    /// d of every joint.
    dead_duty: Vec<f64>,
}

impl Physics for PwmDeadZone {
    fn duty(&self, joint: usize, _past: &Past, duty: f64) -> f64 {
        duty.signum() * (duty.abs() - self.dead_duty[joint]).max(0.0)
    }
}

fn make(robot: &Robot, size: Size, rng: &mut dyn Rng) -> Result<Hidden, EffectError> {
    if robot.input.unit != InputUnit::Duty {
        return Err(EffectError::Unsuited { effect: EFFECT.id, reason: "the motors are not driven by a duty" });
    }
    let joints: Vec<usize> = (0..robot.joints.len()).collect();
    let dead_duty = draw::per_joint(robot, &joints, size, DEAD_DUTY, |_| 1.0, rng);
    let values = draw::of_joints((EFFECT.id, robot), "d", "1", &joints, &dead_duty).collect();
    Ok(Hidden { id: EFFECT.id, values, physics: Box::new(PwmDeadZone { dead_duty }) })
}

/// The same equation; at d = 0 its slope is −sgn u.
#[derive(Debug)]
struct DeadZoneLaw {
    parameters: Parameters,
}

impl Law for DeadZoneLaw {
    fn parameters(&self) -> &Parameters {
        &self.parameters
    }

    fn hooks(&self) -> &'static [Hook] {
        &[Hook::Input]
    }

    acts_on_joints!();
}

impl DeadZoneLaw {
    #[inline(always)]
    fn act<T: Quantity>(&self, _hook: Hook, at: &At<'_, T>, duty: T) -> T {
        let [dead_duty] = *at.parameters else { return duty };
        let beyond = duty.abs() - dead_duty.where_positive(dead_duty, T::from(0.0));
        let short = duty.where_positive(dead_duty, -dead_duty);
        beyond.where_positive(duty - short, T::from(0.0))
    }
}

fn laws(robot: &Robot) -> Laws {
    if robot.input.unit != InputUnit::Duty {
        return Err(EffectError::Unsuited { effect: EFFECT.id, reason: "the motors are not driven by a duty" });
    }
    let mut parameters = Parameters::on(EFFECT.id, robot);
    for joint in 0..robot.joints.len() {
        parameters.plain("d", "1", Of::Joint(joint), 0.0);
    }
    parameters.within("d", [0.0, 0.5]);
    only(DeadZoneLaw { parameters })
}
