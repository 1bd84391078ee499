//! Current limit: the driver cuts the current, and with it the torque.
//!
//! ```text
//! τ_m = clip(k_pwm U u − k_mi θ̇, ±T)      one T for all motors
//! ```

use rand::Rng;

use super::surrogate::{At, Hook, Law, Laws, Of, Parameters, Quantity, acts_on_joints, each};
use super::{Effect, EffectError, EffectParameter, Hidden, Moment, Physics, Row, Scale, Size, draw};
use crate::robot::Robot;

pub(super) const EFFECT: Effect = Effect {
    id: "current_limit",
    row: Row::Motor,
    title: "the motors' torque saturates",
    equation: "clip(τ_m, ±T)",
    parameters: &[EffectParameter::inverse_size("T", "N m")
        .typically(2.0, 0.25, Scale::TorqueRms)
        .sizes("120, 90, 65 N m (60 to 130 met)")],
    nuisances: &[],
    confounded_with: &["voltage_sag", "k_pwm"],
    about: "Drivers protect themselves and the motor by a ceiling on the current. It acts where a motor starts or turns \
            round at full duty, and nowhere else; a sagging supply gives way everywhere in proportion.",
    make,
    laws,
};

/// Shares of the torque at full voltage and standstill. The stronger the effect, the lower the ceiling.
const CEILING: [f64; 3] = [0.80, 0.60, 0.43];

#[derive(Debug)]
struct CurrentLimit {
    /// T, N m.
    ceiling: f64,
}

impl Physics for CurrentLimit {
    fn motor_torque(&self, _at: &Moment<'_>, torque: f64) -> f64 {
        torque.clamp(-self.ceiling, self.ceiling)
    }
}

fn make(robot: &Robot, size: Size, rng: &mut dyn Rng) -> Result<Hidden, EffectError> {
    let full = (0..robot.joints.len()).map(|joint| draw::full_torque(robot, joint)).fold(0.0, f64::max);
    if full == 0.0 {
        return Err(EffectError::Unsuited { effect: EFFECT.id, reason: "no motor is driven by a voltage" });
    }
    let ceiling = size.draw(CEILING.map(|share| share * full), rng);
    let values = vec![draw::single(EFFECT.id, "T", "N m", ceiling)];
    Ok(Hidden { id: EFFECT.id, values, physics: Box::new(CurrentLimit { ceiling }) })
}

/// Over what the law's corner is rounded, share of the torque at full voltage.
const CORNER: f64 = 0.002;

/// The ceiling's corner is rounded; T by its logarithm.
#[derive(Debug)]
struct LimitLaw {
    parameters: Parameters,
    /// N m.
    corner: f64,
}

impl Law for LimitLaw {
    fn parameters(&self) -> &Parameters {
        &self.parameters
    }

    fn hooks(&self) -> &'static [Hook] {
        &[Hook::MotorTorque]
    }

    acts_on_joints!();
}

impl LimitLaw {
    #[inline(always)]
    fn act<T: Quantity>(&self, _hook: Hook, at: &At<'_, T>, torque: T) -> T {
        let [ceiling] = *at.parameters else { return torque };
        let ceiling = ceiling.exp();
        torque - (torque - ceiling).ramp(self.corner) + (-torque - ceiling).ramp(self.corner)
    }
}

fn laws(robot: &Robot) -> Laws {
    let full = (0..robot.joints.len()).map(|joint| draw::full_torque(robot, joint)).fold(0.0, f64::max);
    if full == 0.0 {
        return Err(EffectError::Unsuited { effect: EFFECT.id, reason: "no motor is driven by a voltage" });
    }
    let with = |share: f64| {
        let mut parameters = Parameters::on(EFFECT.id, robot);
        parameters.positive("T", "N m", Of::All, share * full);
        parameters.within("T", [0.0, f64::INFINITY]);
        LimitLaw { parameters, corner: CORNER * full }
    };
    each([0.6, 0.8, 0.43].map(with))
}
