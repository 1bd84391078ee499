//! Coriolis and centrifugal torques that the description leaves out.
//!
//! ```text
//! M q̈ + scale · c(q, q̇) = −τ_c      c from M(q), no free parameter; physics has scale 1
//! ```

use rand::Rng;

use super::surrogate::{Law, Laws, Of, Parameters, only};
use super::{Effect, EffectError, EffectParameter, Hidden, Physics, Row, Scale, Size, draw};
use crate::robot::Robot;

pub(super) const EFFECT: Effect = Effect {
    id: "coriolis",
    row: Row::Link,
    title: "Coriolis and centrifugal torques left out",
    equation: "scale · c(q, q̇) from M(q)",
    parameters: &[EffectParameter::size("scale", "1")
        .typically(1.0, 0.1, Scale::Si)
        .sizes("1 by physics, whatever the size's name")],
    nuisances: &[],
    confounded_with: &["link_inertia"],
    about: "Joints that turn at the same time push one another. The paper drops these torques as hardly noticeable; in \
            its fast stage they are far above a gyro's noise. They need no parameter, only the switch.",
    make,
    laws,
};

#[derive(Debug)]
struct Coriolis {
    scale: f64,
}

impl Physics for Coriolis {
    fn coriolis(&self, _scale: f64) -> f64 {
        self.scale
    }
}

fn make(robot: &Robot, size: Size, _rng: &mut dyn Rng) -> Result<Hidden, EffectError> {
    let unsuited = |reason| EffectError::Unsuited { effect: EFFECT.id, reason };
    if robot.coriolis {
        return Err(unsuited("the description has these torques already"));
    }
    if robot.joints.len() < 2 {
        return Err(unsuited("one joint alone has no such torques"));
    }
    let scale = if let Size::Exact(scale) = size { scale } else { 1.0 };
    let values = vec![draw::single(EFFECT.id, "scale", "1", scale)];
    Ok(Hidden { id: EFFECT.id, values, physics: Box::new(Coriolis { scale }) })
}

/// The same; 0 is the description's model.
#[derive(Debug)]
struct CoriolisLaw {
    parameters: Parameters,
}

impl Law for CoriolisLaw {
    fn parameters(&self) -> &Parameters {
        &self.parameters
    }

    fn coriolis(&self) -> Option<usize> {
        Some(0)
    }
}

fn laws(robot: &Robot) -> Laws {
    let unsuited = |reason| EffectError::Unsuited { effect: EFFECT.id, reason };
    if robot.coriolis {
        return Err(unsuited("the description has these torques already"));
    }
    if robot.joints.len() < 2 {
        return Err(unsuited("one joint alone has no such torques"));
    }
    let mut parameters = Parameters::on(EFFECT.id, robot);
    parameters.plain("scale", "1", Of::All, 0.0);
    parameters.within("scale", [0.0, 1.5]);
    only(CoriolisLaw { parameters })
}
