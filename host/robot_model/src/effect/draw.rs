//! Sizes for plants: which joints an effect acts on, what its numbers are there, and their names.
//!
//! Named sizes are shares of what the robot has (its friction, its stiffness, its motors' torque), so that they mean the
//! same on robots of any size; the catalogue quotes what that is on Doggy.

use std::f64::consts::PI;

use rand::{Rng, RngExt};

use super::{EffectError, Size, TrueValue};
use crate::model::law::unit_at;
use crate::robot::{Friction, JointKind, Robot, Side, Symbol, Transmission, Vector3};

/// What a robot lacks that has no elastic joint.
pub(super) const NO_BELT: &str = "no joint moves through an elastic transmission";
/// What a robot without friction lacks.
pub(super) const NO_FRICTION: &str = "no joint has friction";
/// What a robot lacks whose motors are not driven by a voltage.
pub(super) const NO_VOLTAGE: &str = "no joint is driven by a voltage";

/// The joints that an effect acts on; a robot without any cannot have it, for this reason.
pub(super) fn some(effect: &'static str, joints: Vec<usize>, reason: &'static str) -> Result<Vec<usize>, EffectError> {
    if joints.is_empty() { Err(EffectError::Unsuited { effect, reason }) } else { Ok(joints) }
}

/// Joints that turn.
pub(super) fn turning(robot: &Robot) -> Vec<usize> {
    (0..robot.joints.len()).filter(|joint| robot.joints[*joint].kind == JointKind::Revolute).collect()
}

/// All joints.
pub(super) fn all(robot: &Robot) -> Vec<usize> {
    (0..robot.joints.len()).collect()
}

/// Joints that move through an elastic transmission.
pub(super) fn elastic(robot: &Robot) -> Vec<usize> {
    let mut joints = all(robot);
    joints.retain(|joint| robot.joints[*joint].transmission == Transmission::Elastic);
    joints
}

/// Joints that have friction.
pub(super) fn rubbing(robot: &Robot) -> Vec<usize> {
    let mut joints = all(robot);
    joints.retain(|joint| nominal(robot, Symbol::Mu, *joint) > 0.0);
    joints
}

/// Joints that turn and have friction.
pub(super) fn rubbing_by_turns(robot: &Robot) -> Vec<usize> {
    let mut joints = turning(robot);
    joints.retain(|joint| nominal(robot, Symbol::Mu, *joint) > 0.0);
    joints
}

/// Whether the description has a constant torque on this joint already, known or not.
pub(super) fn has_offset(robot: &Robot, joint: usize) -> bool {
    robot.joint_parameter(Symbol::O, joint).is_some()
}

/// Whether that torque is one of the joint's link: of a rigid joint, or where friction is the link's. Others turn the motor, and wind the transmission.
pub(super) fn has_offset_at_link(robot: &Robot, joint: usize) -> bool {
    let of = &robot.joints[joint];
    let at_link = matches!(of.friction, Friction::Coulomb { acts: Side::Link, .. });
    has_offset(robot, joint) && (of.transmission == Transmission::Rigid || at_link)
}

/// What a parameter is on the average simulated robot of this description; zero if it has none.
pub(super) fn nominal(robot: &Robot, symbol: Symbol, joint: usize) -> f64 {
    robot.joint_parameter(symbol, joint).map_or(0.0, |spec| spec.value.simulated)
}

/// Torque of a motor at full voltage, N m; zero if the description does not say.
pub(super) fn full_torque(robot: &Robot, joint: usize) -> f64 {
    nominal(robot, Symbol::KPwm, joint) * robot.input.scale
}

/// What torques at a joint are measured by: the motor's at full voltage, or ten times its friction where that is not known, N m.
pub(super) fn torque_scale(robot: &Robot, joint: usize) -> f64 {
    full_torque(robot, joint).max(10.0 * nominal(robot, Symbol::Mu, joint))
}

/// Of a rigid joint, for what is measured by the stiffness of a belt elsewhere: its torque scale bends it by so much, rad; of one that slides, in halves of its travel. On
/// Doggy the belts' windup at full voltage is as large.
const BENT: f64 = 0.28;

/// What stiffnesses at a joint are measured by: that of its transmission; where it is rigid, see [`BENT`], N m/rad or N/m.
pub(super) fn stiffness_scale(robot: &Robot, joint: usize) -> f64 {
    let [low, high] = robot.joints[joint].limits;
    match (robot.joints[joint].transmission, robot.joints[joint].kind) {
        (Transmission::Elastic, _) => nominal(robot, Symbol::KS, joint),
        (Transmission::Rigid, JointKind::Revolute) => torque_scale(robot, joint) / BENT,
        (Transmission::Rigid, JointKind::Prismatic) => torque_scale(robot, joint) / (BENT * 0.5 * (high - low)),
    }
}

/// Joints of `effect` whose motor is driven by a voltage.
///
/// # Errors
/// [`EffectError::Unsuited`] where there is none.
pub(super) fn driven(effect: &'static str, robot: &Robot) -> Result<Vec<usize>, EffectError> {
    let mut joints = all(robot);
    joints.retain(|joint| full_torque(robot, *joint) > 0.0);
    some(effect, joints, NO_VOLTAGE)
}

/// One value for every joint of the robot: drawn on `joints`, where `unit` is the scale of the shares; zero elsewhere.
pub(super) fn per_joint(
    robot: &Robot,
    joints: &[usize],
    size: Size,
    shares: [f64; 3],
    unit: impl Fn(usize) -> f64,
    rng: &mut dyn Rng,
) -> Vec<f64> {
    let mut values = vec![0.0; robot.joints.len()];
    for &joint in joints {
        values[joint] = size.draw(shares.map(|share| share * unit(joint)), rng);
    }
    values
}

/// The shortest time constant of a first-order lag that a plant's step can follow, s.
const LEAST_LAG_S: f64 = 1e-4;

/// The time constant of a first-order lag, s.
pub(super) fn lag(
    effect: &'static str,
    size: Size,
    nominal_s: [f64; 3],
    rng: &mut dyn Rng,
) -> Result<f64, EffectError> {
    let time_constant_s = size.draw(nominal_s, rng);
    if time_constant_s < LEAST_LAG_S {
        return Err(EffectError::TooShort { effect, time_constant_s, least_s: LEAST_LAG_S });
    }
    Ok(time_constant_s)
}

/// Turns the sign of each value by a coin. An exact size is meant as it was given.
pub(super) fn either_sign(values: &mut [f64], size: Size, rng: &mut dyn Rng) {
    if !matches!(size, Size::Exact(_)) {
        for value in values {
            if rng.random() {
                *value = -*value;
            }
        }
    }
}

/// One angle a joint, anywhere on the circle.
pub(super) fn phases(robot: &Robot, rng: &mut dyn Rng) -> Vec<f64> {
    robot.joints.iter().map(|_| rng.random_range(-PI..PI)).collect()
}

/// The truth about a value that joints have each for themselves; `unit` is that of a joint that turns.
pub(super) fn of_joints<'a>(
    (id, robot): (&'static str, &'a Robot),
    symbol: &'a str,
    unit: &'static str,
    joints: &'a [usize],
    values: &'a [f64],
) -> impl Iterator<Item = TrueValue> + 'a {
    joints.iter().map(move |joint| TrueValue {
        name: format!("{id}.{symbol}[{}]", joint + 1),
        unit: if symbol == "phi" { unit } else { unit_at(robot.joints[*joint].kind, unit) },
        value: values[*joint],
    })
}

/// The truth about a value that gyros have each for themselves.
pub(super) fn of_gyros(id: &'static str, symbol: &str, unit: &'static str, values: &[f64]) -> Vec<TrueValue> {
    let value =
        |(gyro, value): (usize, &f64)| TrueValue { name: format!("{id}.{symbol}[{}]", gyro + 1), unit, value: *value };
    values.iter().enumerate().map(value).collect()
}

/// The truth about a value that gyros have on each axis.
pub(super) fn of_gyro_axes(id: &'static str, symbol: &str, unit: &'static str, values: &[Vector3]) -> Vec<TrueValue> {
    let axes = values.iter().enumerate().flat_map(|(gyro, v)| (0..3).map(move |axis| (gyro, axis, v[axis])));
    axes.map(|(gyro, axis, value)| TrueValue {
        name: format!("{id}.{symbol}[{}.{}]", gyro + 1, ["x", "y", "z"][axis]),
        unit,
        value,
    })
    .collect()
}

/// The truth about a value that there is once.
pub(super) fn single(id: &'static str, symbol: &str, unit: &'static str, value: f64) -> TrueValue {
    TrueValue { name: format!("{id}.{symbol}"), unit, value }
}
