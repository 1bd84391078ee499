//! Flexible base bearing: the whole robot tilts on its mounting.
//!
//! Two passive joints about x and then y of the base frame, through its origin, before the robot's first joint:
//!
//! ```text
//! k_x φ_x + d_x φ̇_x,  k_y φ_y + d_y φ̇_y     against the 5×5 mass matrix and gravity of the chain on them
//! ```
//!
//! The stiffness does not include gravity, which topples the base as the chain's masses say.

use std::f64::consts::TAU;

use rand::{Rng, RngExt};

use super::surrogate::{Law, Laws, Parameters, each, swinging};
use super::{Effect, EffectError, EffectParameter, Hidden, PassiveJoint, Physics, Row, Scale, Size, TrueValue};
use crate::model::law;
use crate::robot::{Robot, Vector3};

pub(super) const EFFECT: Effect = Effect {
    id: "base_bearing",
    row: Row::Link,
    title: "flexible base bearing",
    equation: "passive joints about x, y of the base: τ = −k φ − d φ̇",
    parameters: &[
        EffectParameter::inverse_size("k[x,y]", "N m/rad")
            .typically(650.0, 0.5, Scale::BaseInertia)
            .sizes("5.8, 4.4, 2.6 Hz of the robot on its bearing"),
        EffectParameter::shape("d[x,y]", "N m s/rad")
            .typically(3.5, 0.5, Scale::BaseInertia)
            .sizes("5 to 9 % of critical"),
    ],
    nuisances: &[],
    confounded_with: &["k_s", "structure_mode"],
    about: "The bearing between base and robot gives way, so that the robot tilts when it accelerates sideways. Gyros \
            see the tilt as rates that no joint makes; a model with a rigid base packs it into the belts' stiffness.",
    make,
    laws,
};

/// Natural frequency of the robot on its bearing, Hz: 12000, 7000 and 2500 N m/rad on Doggy.
const FREQUENCY_HZ: [f64; 3] = [5.78, 4.41, 2.64];
/// Damping ratio.
const DAMPING_RATIO: f64 = 0.07;
const AXES: [Vector3; 2] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];

#[derive(Debug)]
struct BaseBearing {
    joints: [PassiveJoint; 2],
}

impl Physics for BaseBearing {
    fn base_joints(&self) -> &[PassiveJoint] {
        &self.joints
    }
}

fn make(robot: &Robot, size: Size, rng: &mut dyn Rng) -> Result<Hidden, EffectError> {
    let inertia = inertia(robot)?;
    let (mut k, mut d) = ([0.0; 2], [0.0; 2]);
    for axis in 0..2 {
        // k = (2π f)² I
        let nominal = FREQUENCY_HZ.map(|hz| (TAU * hz).powi(2) * inertia[axis]);
        k[axis] = size.draw(nominal, rng);
        let ratio = match size {
            Size::Exact(_) => DAMPING_RATIO,
            _ => DAMPING_RATIO * rng.random_range(0.75..1.25),
        };
        d[axis] = 2.0 * ratio * (k[axis] * inertia[axis]).sqrt();
    }
    Ok(bearing(k, d))
}

/// Inertia of the whole robot about x and y of the base, kg m².
pub(super) fn inertia(robot: &Robot) -> Result<[f64; 2], EffectError> {
    let unsuited = |reason| EffectError::Unsuited { effect: EFFECT.id, reason };
    let tilting = robot
        .chain()
        .with_base_joints([0.0; 3], &AXES)
        .map_err(|_| unsuited("the robot has no room for two more joints"))?;
    let n = tilting.joints();
    let mut m = vec![0.0; n * n];
    tilting.mass_matrix(&vec![0.0; n], &mut m);
    let inertia = [m[0], m[n + 1]];
    if inertia.iter().any(|i| *i <= 0.0) {
        return Err(unsuited("the bodies have no inertia about x and y of the base"));
    }
    Ok(inertia)
}

/// A bearing of stiffness `k` N m/rad and damping `d` N m s/rad about x and y.
pub fn bearing(k: [f64; 2], d: [f64; 2]) -> Hidden {
    let joints = [0, 1].map(|axis| PassiveJoint { axis: AXES[axis], stiffness: k[axis], damping: d[axis] });
    let name = |symbol: &str, axis: usize| format!("{}.{symbol}[{}]", EFFECT.id, ["x", "y"][axis]);
    let mut values = Vec::new();
    for axis in 0..2 {
        values.push(TrueValue { name: name("k", axis), unit: "N m/rad", value: k[axis] });
    }
    for axis in 0..2 {
        values.push(TrueValue { name: name("d", axis), unit: "N m s/rad", value: d[axis] });
    }
    Hidden { id: EFFECT.id, values, physics: Box::new(BaseBearing { joints }) }
}

/// The same joints; k and d by their logarithms.
#[derive(Debug)]
struct BearingLaw {
    parameters: Parameters,
    joints: [law::PassiveJoint; 2],
}

impl Law for BearingLaw {
    fn parameters(&self) -> &Parameters {
        &self.parameters
    }

    fn base_joints(&self) -> &[law::PassiveJoint] {
        &self.joints
    }
}

fn laws(robot: &Robot) -> Laws {
    let inertia = inertia(robot)?;
    let with = |hz: f64| {
        let mut parameters = Parameters::on(EFFECT.id, robot);
        let joints = swinging(&mut parameters, AXES, inertia, (hz, DAMPING_RATIO));
        BearingLaw { parameters, joints }
    };
    each([FREQUENCY_HZ[1], FREQUENCY_HZ[0], FREQUENCY_HZ[2]].map(with))
}
