//! Flexible rod: the outermost body is two bodies, and the outer one swings.
//!
//! ```text
//! last joint ──┬── inner half, at 2/3 of the way to the centre of mass
//!              └─ k_x, d_x ─ k_y, d_y ── outer half, at 4/3, with the sensors
//! ```
//!
//! Two passive joints through the origin of the robot's last joint, about what are x and then y of the base frame while
//! the robot stands in its marked pose. Together the halves have the mass, the centre and the inertia of the body that
//! the description gives, so that a stiff rod is the base model.

use std::f64::consts::TAU;

use rand::{Rng, RngExt};

use super::surrogate::{Law, Laws, Parameters, each, swinging};
use super::{Effect, EffectError, EffectParameter, Hidden, PassiveJoint, Physics, Row, Scale, Size, Structure, draw};
use crate::model::law;
use crate::robot::{Body, Matrix3, Robot, Vector3};

pub(super) const EFFECT: Effect = Effect {
    id: "structure_mode",
    row: Row::Link,
    title: "flexible rod or structure",
    equation: "passive joints about x, y after the last link: τ = −k φ − d φ̇",
    parameters: &[
        EffectParameter::inverse_size("k[x,y]", "N m/rad")
            .typically(4500.0, 0.5, Scale::OuterInertia)
            .sizes("17, 11, 6 Hz of the outer half on a rod held still"),
        EffectParameter::shape("d[x,y]", "N m s/rad")
            .typically(5.0, 0.5, Scale::OuterInertia)
            .sizes("1 to 8 % of critical"),
    ],
    nuisances: &[],
    confounded_with: &["base_bearing", "k_s"],
    about: "A rod of acrylic or a thin column bends when its head is accelerated. The gyro on the head sees it swing \
            after every step, the gyro below sees nothing of it: that tells it from a bearing under the robot.",
    make,
    laws,
};

/// Natural frequency of the outer half, Hz.
const FREQUENCY_HZ: [f64; 3] = [17.0, 11.0, 6.0];
/// Of critical.
const DAMPING_RATIO: std::ops::Range<f64> = 0.01..0.08;
/// Where the search for the damping starts.
const USUAL_RATIO: f64 = 0.04;
const NAMES: [&str; 2] = ["x", "y"];

#[derive(Debug)]
struct StructureMode {
    structure: Structure,
}

impl Physics for StructureMode {
    fn structure(&self) -> Option<&Structure> {
        Some(&self.structure)
    }
}

fn make(robot: &Robot, size: Size, rng: &mut dyn Rng) -> Result<Hidden, EffectError> {
    let (outer, axes, inertia) = outer_part(robot)?;
    let mut joints = axes.map(|axis| PassiveJoint { axis, stiffness: 0.0, damping: 0.0 });
    for (joint, inertia) in joints.iter_mut().zip(inertia) {
        // k = (2π f)² I
        joint.stiffness = size.draw(FREQUENCY_HZ.map(|hz| (TAU * hz).powi(2) * inertia), rng);
        joint.damping = 2.0 * rng.random_range(DAMPING_RATIO) * (joint.stiffness * inertia).sqrt();
    }
    let mut values = Vec::new();
    for (symbol, unit) in [("k", "N m/rad"), ("d", "N m s/rad")] {
        for (name, joint) in NAMES.iter().zip(&joints) {
            let value = if symbol == "k" { joint.stiffness } else { joint.damping };
            values.push(draw::single(EFFECT.id, &format!("{symbol}[{name}]"), unit, value));
        }
    }
    Ok(Hidden { id: EFFECT.id, values, physics: Box::new(StructureMode { structure: Structure { outer, joints } }) })
}

/// The part that gives way, the axes of its joints in the axes of the body, and its inertia about them, kg m².
pub(super) fn outer_part(robot: &Robot) -> Result<(Body, [Vector3; 2], [f64; 2]), EffectError> {
    let unsuited = |reason| EffectError::Unsuited { effect: EFFECT.id, reason };
    let last = robot.joints.last().ok_or_else(|| unsuited("the robot has no joint"))?;
    let outer = outer_half(&last.body);
    // Base axes → axes of each body in the marked pose.
    let mut bodies = vec![[[0.0; 3]; 3]; robot.joints.len()];
    robot.chain().body_rotations(&vec![0.0; robot.joints.len()], &mut bodies);
    let to_body = bodies[robot.joints.len() - 1];
    let axes: [Vector3; 2] = [0, 1].map(|base_axis| [0, 1, 2].map(|i| to_body[i][base_axis]));
    let inertia = axes.map(|axis| about(&outer, axis));
    if inertia.iter().any(|inertia| *inertia <= 0.0) {
        return Err(unsuited("the outermost body has no inertia about x and y"));
    }
    Ok((outer, axes, inertia))
}

/// Half of the mass, a third farther out than the whole body's centre, with half of the inertia that this distance
/// leaves; compact bodies are parted less far, so that a quarter of their least inertia is left.
fn outer_half(body: &Body) -> Body {
    let c = body.centre_m;
    let square: f64 = c.iter().map(|c| c * c).sum();
    // J − s² m (c·c 1 − c cᵀ): two halves at (1 ± s) c about the centre.
    let left = |share: f64| -> Matrix3 {
        std::array::from_fn(|row| {
            std::array::from_fn(|column| {
                let steiner = if row == column { square } else { 0.0 } - c[row] * c[column];
                body.inertia_kg_m2[row][column] - share * share * body.mass_kg * steiner
            })
        })
    };
    let least = |j: Matrix3| nalgebra::Matrix3::from(j).symmetric_eigenvalues().min();
    let mut share = 1.0 / 3.0;
    while share > 1e-3 && least(left(share)) < 0.25 * least(body.inertia_kg_m2) {
        share *= 0.8;
    }
    Body {
        mass_kg: 0.5 * body.mass_kg,
        centre_m: c.map(|c| (1.0 + share) * c),
        inertia_kg_m2: left(share).map(|row| row.map(|element| 0.5 * element)),
    }
}

/// Inertia about an axis through the origin, kg m².
fn about(body: &Body, axis: Vector3) -> f64 {
    let c = body.centre_m;
    let along: f64 = (0..3).map(|i| c[i] * axis[i]).sum();
    let steiner = body.mass_kg * (c.iter().map(|c| c * c).sum::<f64>() - along * along);
    let own: f64 = (0..3).flat_map(|r| (0..3).map(move |k| axis[r] * body.inertia_kg_m2[r][k] * axis[k])).sum();
    own + steiner
}

/// The same joints; k and d by their logarithms.
#[derive(Debug)]
struct ModeLaw {
    parameters: Parameters,
    outer: Body,
    joints: [law::PassiveJoint; 2],
}

impl Law for ModeLaw {
    fn parameters(&self) -> &Parameters {
        &self.parameters
    }

    fn structure(&self) -> Option<(Body, &[law::PassiveJoint])> {
        Some((self.outer, &self.joints))
    }
}

fn laws(robot: &Robot) -> Laws {
    let (outer, axes, inertia) = outer_part(robot)?;
    let with = |hz: f64| {
        let mut parameters = Parameters::on(EFFECT.id, robot);
        let joints = swinging(&mut parameters, axes, inertia, (hz, USUAL_RATIO));
        ModeLaw { parameters, outer, joints }
    };
    each([FREQUENCY_HZ[1], FREQUENCY_HZ[0], FREQUENCY_HZ[2]].map(with))
}
