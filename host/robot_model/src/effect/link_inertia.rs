//! Payload: a mass that the drawings do not know, at the head.
//!
//! ```text
//! J + m (p·p 1 − p pᵀ)      p: the head, 4/3 of the way from the last joint to its body's centre of mass
//! ```
//!
//! A rod of even mass has its two halves at 2/3 and 4/3 of the way to its centre; so has Doggy's rod with its head, to
//! within 2 %. Gravity of the mass is cancelled where the description says that gravity is compensated.

use rand::Rng;

use super::surrogate::{Law, Laws, Of, Parameters, only};
use super::{Effect, EffectError, EffectParameter, Hidden, Physics, Row, Scale, Size, draw};
use crate::model::law::Payload;
use crate::robot::{Body, JointKind, Robot, Vector3};

pub(super) const EFFECT: Effect = Effect {
    id: "link_inertia",
    row: Row::Link,
    title: "payload, or inertia other than in the drawings",
    equation: "J + m (p·p 1 − p pᵀ), a point mass at the head",
    parameters: &[EffectParameter::size("m", "kg")
        .typically(0.07, 0.6, Scale::BodyMass)
        .sizes("23, 78, 200 g: 3, 10, 26 % of the outermost inertia (2 to 30 met)")],
    nuisances: &[],
    confounded_with: &["k_s", "coriolis", "gyro_scale"],
    about: "A costume, a camera, a head that is heavier than in the drawings. A common factor on all inertias would be a \
            common factor on stiffness and motor: only a change of shape shows.",
    make,
    laws,
};

/// m p² as a share of the outermost body's inertia about its joint's origin, across the way to its centre.
const SHARE: [f64; 3] = [0.03, 0.10, 0.26];

#[derive(Debug)]
struct LinkInertia {
    /// Which joint moves it.
    outermost: usize,
    mass_kg: f64,
    at_m: Vector3,
}

impl Physics for LinkInertia {
    fn body(&self, joint: usize, body: Body) -> Body {
        if joint == self.outermost { with_point_mass(body, self.mass_kg, self.at_m) } else { body }
    }
}

fn make(robot: &Robot, size: Size, rng: &mut dyn Rng) -> Result<Hidden, EffectError> {
    let (outermost, at_m) = head(robot)?;
    let joint = &robot.joints[outermost];
    let arm_squared: f64 = at_m.iter().map(|p| p * p).sum();
    let inertia = joint.body.mass_kg * arm_squared * 9.0 / 16.0 + mean_across(&joint.body);
    let mass_kg = size.draw(SHARE.map(|share| share * inertia / arm_squared), rng);
    let values = vec![draw::single(EFFECT.id, "m", "kg", mass_kg)];
    Ok(Hidden { id: EFFECT.id, values, physics: Box::new(LinkInertia { outermost, mass_kg, at_m }) })
}

/// The outermost joint, and the head in its body's axes, m.
fn head(robot: &Robot) -> Result<(usize, Vector3), EffectError> {
    let outermost = robot.joints.len() - 1;
    let joint = &robot.joints[outermost];
    let at_m = joint.body.centre_m.map(|c| 4.0 / 3.0 * c);
    if joint.kind != JointKind::Revolute || at_m == [0.0; 3] {
        let reason = "the outermost body does not turn about a point beside its centre";
        return Err(EffectError::Unsuited { effect: EFFECT.id, reason });
    }
    Ok((outermost, at_m))
}

/// Inertia about the centre, mean of the two axes across the way to it, kg m².
fn mean_across(body: &Body) -> f64 {
    let length = body.centre_m.iter().map(|c| c * c).sum::<f64>().sqrt();
    let along = body.centre_m.map(|c| c / length);
    let j = &body.inertia_kg_m2;
    let about_along: f64 = (0..3).flat_map(|r| (0..3).map(move |c| along[r] * j[r][c] * along[c])).sum();
    0.5 * (j[0][0] + j[1][1] + j[2][2] - about_along)
}

/// The body and a point mass as one body.
fn with_point_mass(body: Body, mass_kg: f64, at_m: Vector3) -> Body {
    let total = body.mass_kg + mass_kg;
    let centre_m: Vector3 = std::array::from_fn(|i| (body.mass_kg * body.centre_m[i] + mass_kg * at_m[i]) / total);
    // Both parts about the common centre: reduced mass times the square of their distance.
    let reduced = body.mass_kg * mass_kg / total;
    let apart: Vector3 = std::array::from_fn(|i| at_m[i] - body.centre_m[i]);
    let square: f64 = apart.iter().map(|d| d * d).sum();
    let mut inertia_kg_m2 = body.inertia_kg_m2;
    for (i, row) in inertia_kg_m2.iter_mut().enumerate() {
        for (j, element) in row.iter_mut().enumerate() {
            *element += reduced * (if i == j { square } else { 0.0 } - apart[i] * apart[j]);
        }
    }
    Body { mass_kg: total, centre_m, inertia_kg_m2 }
}

/// The same mass; the chain's equations are linear in it.
#[derive(Debug)]
struct PayloadLaw {
    parameters: Parameters,
    payload: Payload,
}

impl Law for PayloadLaw {
    fn parameters(&self) -> &Parameters {
        &self.parameters
    }

    fn payload(&self) -> Option<Payload> {
        Some(self.payload)
    }
}

fn laws(robot: &Robot) -> Laws {
    let (joint, at_m) = head(robot)?;
    let mut parameters = Parameters::on(EFFECT.id, robot);
    let mass = parameters.plain("m", "kg", Of::All, 0.0);
    only(PayloadLaw { parameters, payload: Payload { joint, at_m, mass } })
}
