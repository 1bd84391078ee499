//! End stop: the link meets its stop inside the range it is moved through.
//!
//! ```text
//! depth δ = q − q_max beyond q_max, δ = q_min − q below q_min:   k δ max(1 + λ δ̇, 0),   λ = 0.3 s/rad
//! ```
//!
//! The contact of Hunt and Crossley (1975): damping grows with the depth, so that an impact makes no jump of torque; a stop
//! pushes and never holds the link back.

use rand::{Rng, RngExt};

use super::surrogate::{At, Hook, Law, Laws, Of, Parameters, Quantity, acts_on_joints, each};
use super::{Effect, EffectError, EffectParameter, Hidden, Moment, Physics, Row, Size, draw};
use crate::robot::{Robot, Symbol};

pub(super) const EFFECT: Effect = Effect {
    id: "end_stop",
    row: Row::Link,
    title: "contact at a joint's stop",
    equation: "k δ max(1 + λ δ̇, 0) at a depth of δ beyond q_max or q_min",
    parameters: &[
        EffectParameter { name: "q_max[i]", unit: "rad", sizes: "68, 58, 47 % of the described limit" },
        EffectParameter { name: "q_min[i]", unit: "rad", sizes: "as q_max, drawn for itself" },
        EffectParameter { name: "k", unit: "N m/rad", sizes: "3 to 10 times the stiffest k_s" },
    ],
    confounded_with: &["belt_hardening"],
    about: "A stop of rubber or steel stands nearer than the description says, or something stands in the way. Nothing \
            shows until the link gets there; then it is thrown back.",
    make,
    laws,
};

/// Shares of the described limits. The stronger the effect, the nearer the stop.
const SHARE: [f64; 3] = [0.68, 0.58, 0.47];
/// k, shares of the stiffest k_s.
const STIFFNESS: std::ops::Range<f64> = 3.0..10.0;
/// λ, s/rad.
const DAMPING_S_RAD: f64 = 0.3;

#[derive(Debug)]
struct EndStop {
    /// q_min and q_max, rad; infinite where there is no stop.
    q_min: Vec<f64>,
    q_max: Vec<f64>,
    /// N m/rad.
    k: f64,
}

impl Physics for EndStop {
    fn link_load(&self, at: &Moment<'_>, load: f64) -> f64 {
        let push = |depth: f64, rate: f64| self.k * depth * (1.0 + DAMPING_S_RAD * rate).max(0.0);
        let (above, below) = (at.q - self.q_max[at.joint], self.q_min[at.joint] - at.q);
        if above > 0.0 {
            load + push(above, at.qd)
        } else if below > 0.0 {
            load - push(below, -at.qd)
        } else {
            load
        }
    }
}

fn make(robot: &Robot, size: Size, rng: &mut dyn Rng) -> Result<Hidden, EffectError> {
    let mut joints = draw::elastic(robot);
    joints.retain(|j| robot.joints[*j].limits[0] < 0.0 && robot.joints[*j].limits[1] > 0.0);
    let joints = draw::some(EFFECT.id, joints, "no joint turns to both sides through an elastic transmission")?;
    let mut stops = [vec![f64::NEG_INFINITY; robot.joints.len()], vec![f64::INFINITY; robot.joints.len()]];
    for (side, stops) in stops.iter_mut().enumerate() {
        for &joint in &joints {
            let limit = robot.joints[joint].limits[side];
            stops[joint] = limit.signum() * size.draw(SHARE.map(|share| share * limit.abs()), rng);
        }
    }
    let stiffest = joints.iter().map(|joint| draw::nominal(robot, Symbol::KS, *joint)).fold(0.0, f64::max);
    let k = stiffest * rng.random_range(STIFFNESS);
    let [q_min, q_max] = stops;
    let mut values: Vec<_> = draw::of_joints((EFFECT.id, robot), "q_max", "rad", &joints, &q_max).collect();
    values.extend(draw::of_joints((EFFECT.id, robot), "q_min", "rad", &joints, &q_min));
    values.push(draw::single(EFFECT.id, "k", "N m/rad", k));
    Ok(Hidden { id: EFFECT.id, values, physics: Box::new(EndStop { q_min, q_max, k }) })
}

/// Over what the law's corners are rounded: rad, and of the contact's damping.
const CORNER_RAD: f64 = 1e-3;
const CORNER_RATE: f64 = 0.02;

/// The same contact with a rounded corner.
#[derive(Debug)]
struct StopLaw {
    parameters: Parameters,
}

impl Law for StopLaw {
    fn parameters(&self) -> &Parameters {
        &self.parameters
    }

    fn hooks(&self) -> &'static [Hook] {
        &[Hook::LinkLoad]
    }

    acts_on_joints!();
}

impl StopLaw {
    fn act<T: Quantity>(&self, _hook: Hook, at: &At<'_, T>, load: T) -> T {
        let [q_max, q_min, k] = *at.parameters else { return load };
        let k = k.exp();
        let push =
            |depth: T, rate: T| k * depth.ramp(CORNER_RAD) * (rate * DAMPING_S_RAD + T::from(1.0)).ramp(CORNER_RATE);
        load + push(at.q - q_max, at.qd) - push(q_min - at.q, -at.qd)
    }
}

fn laws(robot: &Robot) -> Laws {
    let mut joints = draw::elastic(robot);
    joints.retain(|j| robot.joints[*j].limits[0] < 0.0 && robot.joints[*j].limits[1] > 0.0);
    let joints = draw::some(EFFECT.id, joints, "no joint turns to both sides through an elastic transmission")?;
    let stiffest = joints.iter().map(|joint| draw::nominal(robot, Symbol::KS, *joint)).fold(0.0, f64::max);
    let with = |share: f64| {
        let mut parameters = Parameters::on(EFFECT.id, robot);
        for (side, name) in ["q_min", "q_max"].into_iter().enumerate().rev() {
            for &joint in &joints {
                parameters.plain(name, "rad", Of::Joint(joint), share * robot.joints[joint].limits[side]);
            }
        }
        parameters.positive("k", "N m/rad", Of::All, 5.0 * stiffest);
        StopLaw { parameters }
    };
    each([0.58, 0.68, 0.47].map(with))
}
