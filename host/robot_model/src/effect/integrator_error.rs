//! Integrator error: the step is too coarse for the equations.
//!
//! ```text
//! x(t + T_s) = x(t) + T_s f(x, u)      explicit Euler at the sample period, in place of the plant's integration
//! ```
//!
//! Nothing that a robot has: a recording made by such a simulation, for which a better integration in the model is wrong.
//! An estimator that itself steps too coarsely finds it on every robot, with the other sign.

use rand::Rng;

use super::surrogate::{Law, Laws, Parameters, only};
use super::{Effect, EffectError, Hidden, Physics, Row, Size};
use crate::robot::Robot;

pub(super) const EFFECT: Effect = Effect {
    id: "integrator_error",
    row: Row::Timing,
    title: "integration in too coarse steps",
    equation: "x + T_s f(x, u): explicit Euler at the sample period",
    parameters: &[],
    nuisances: &[],
    confounded_with: &["d_s", "stribeck", "input_delay"],
    about: "Explicit Euler is a damper of −k_s T_s on every belt, and at reversals of friction it looks like a Stribeck \
            bump or half a sample of delay. A simulator with a coarse step makes such recordings, whatever the size.",
    make,
    laws,
};

#[derive(Debug)]
struct IntegratorError {
    period_s: f64,
}

impl Physics for IntegratorError {
    fn euler_step_s(&self) -> Option<f64> {
        Some(self.period_s)
    }
}

fn make(robot: &Robot, _size: Size, _rng: &mut dyn Rng) -> Result<Hidden, EffectError> {
    Ok(Hidden {
        id: EFFECT.id,
        values: Vec::new(),
        physics: Box::new(IntegratorError { period_s: robot.sample_period_s }),
    })
}

/// The model takes the same steps.
#[derive(Debug)]
struct EulerLaw {
    parameters: Parameters,
}

impl Law for EulerLaw {
    fn parameters(&self) -> &Parameters {
        &self.parameters
    }

    fn euler(&self) -> bool {
        true
    }
}

fn laws(_robot: &Robot) -> Laws {
    only(EulerLaw { parameters: Parameters::new(EFFECT.id) })
}
