//! Input delay: the command reaches the motor late.
//!
//! ```text
//! u_motor(t) = u(t − T)      true dead time, one T for all motors
//! ```
//!
//! The plant remembers the commanded inputs; a step in which the late input changes gets both in their shares.

use rand::Rng;

use super::surrogate::{At, Hook, Law, Laws, Of, Parameters, Quantity, acts_on_joints, only};
use super::{Effect, EffectError, EffectParameter, Hidden, Past, Physics, Row, Scale, Size, draw};
use crate::robot::Robot;

pub(super) const EFFECT: Effect = Effect {
    id: "input_delay",
    row: Row::Timing,
    title: "the command reaches the motor late",
    equation: "u(t − T)",
    parameters: &[EffectParameter::size("T", "s")
        .typically(1.6, 0.45, Scale::SamplePeriod)
        .sizes("0.6, 1.8, 4.3 ms (0.5 to 5 met)")],
    nuisances: &[],
    confounded_with: &["electrical_lag", "encoder_lag", "gyro_lag", "integrator_error"],
    about: "A driver on a bus, a filtered PWM input or a second processor takes the command over only after some time. \
            Only the time between command and answer shows: sensors that all read late by as much look the same.",
    make,
    laws,
};

const DEAD_TIME_S: [f64; 3] = [0.6e-3, 1.8e-3, 4.3e-3];

#[derive(Debug)]
struct InputDelay {
    dead_time_s: f64,
}

impl Physics for InputDelay {
    fn memory_s(&self) -> f64 {
        self.dead_time_s
    }

    fn duty(&self, joint: usize, past: &Past, _duty: f64) -> f64 {
        past.input(joint, self.dead_time_s)
    }
}

fn make(_robot: &Robot, size: Size, rng: &mut dyn Rng) -> Result<Hidden, EffectError> {
    let dead_time_s = size.draw(DEAD_TIME_S, rng);
    let values = vec![draw::single(EFFECT.id, "T", "s", dead_time_s)];
    Ok(Hidden { id: EFFECT.id, values, physics: Box::new(InputDelay { dead_time_s }) })
}

/// The input over a step is that of two samples in their shares: piecewise linear in T.
#[derive(Debug)]
struct DelayLaw {
    parameters: Parameters,
}

impl Law for DelayLaw {
    fn parameters(&self) -> &Parameters {
        &self.parameters
    }

    fn hooks(&self) -> &'static [Hook] {
        &[Hook::Input]
    }

    fn input_delay(&self) -> Option<usize> {
        Some(0)
    }

    acts_on_joints!();
}

impl DelayLaw {
    #[inline(always)]
    fn act<T: Quantity>(&self, _hook: Hook, at: &At<'_, T>, duty: T) -> T {
        let _ = at;
        duty
    }
}

fn laws(_robot: &Robot) -> Laws {
    let mut parameters = Parameters::new(EFFECT.id);
    parameters.plain("T", "s", Of::All, 0.0);
    parameters.within("T", [0.0, 0.02]);
    only(DelayLaw { parameters })
}
