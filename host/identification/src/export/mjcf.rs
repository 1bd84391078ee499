//! The model for MuJoCo: rotor and link of a joint as two coaxial hinges of one body, bearing and structure as passive joints.
//!
//! ```text
//! elastic joint   <joint NAME_motor armature=b damping frictionloss>   θ
//!                 <joint NAME_belt  stiffness=k_s damping=d_s>         q − θ
//!                 <tendon NAME>  motor + belt: q, its limits, what rubs on the link
//! rigid joint     <joint NAME armature=b damping frictionloss>         q
//! ```

use std::fmt::Write;

use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};

use super::loss::{Loss, title, xml_head};
use super::machine::{JointValues, Moments};
use super::{ExportError, Exported};
use crate::model::law::PassiveJoint;
use crate::robot::{ChannelKind, GravityLoad, InputUnit, Joint, JointKind, Transmission};

/// The file, and what it keeps.
///
/// # Errors
/// None so far; as the other formats.
pub fn mjcf(exported: &Exported<'_>) -> Result<(String, Vec<Loss>), ExportError> {
    let losses = losses(exported);
    let mut text = String::from("<!--\n");
    text += &xml_head(exported, &losses);
    let robot = exported.calibrated.robot();
    let timestep = robot.sample_period_s / exported.parts() as f64;
    let gravity = if robot.chain().has_gravity() || has_passive(exported) { robot.gravity_m_s2 } else { [0.0; 3] };
    let _ = write!(
        text,
        "-->\n<mujoco model=\"{}\">\n  <compiler angle=\"radian\" autolimits=\"true\"{}/>\n  <option timestep=\"{timestep}\" integrator=\"RK4\" gravity=\"{}\"/>\n  <worldbody>\n",
        robot.name,
        if all_physical(exported) { "" } else { " balanceinertia=\"true\"" },
        numbers(&gravity),
    );
    bodies(&mut text, exported);
    text += "  </worldbody>\n";
    tendons(&mut text, exported);
    actuators(&mut text, exported);
    sensors(&mut text, exported);
    text += "</mujoco>\n";
    Ok((text, losses))
}

fn numbers(values: &[f64]) -> String {
    values.iter().map(|value| format!("{value}")).collect::<Vec<_>>().join(" ")
}

/// The rotation of axes whose vectors `to_them` takes into them.
fn quaternion(to_them: &Matrix3<f64>) -> String {
    let q = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(to_them.transpose()));
    numbers(&[q.w, q.i, q.j, q.k])
}

fn matrix(rows: &[[f64; 3]; 3]) -> Matrix3<f64> {
    Matrix3::from_fn(|i, j| rows[i][j])
}

fn is_elastic(joint: &Joint) -> bool {
    joint.transmission == Transmission::Elastic
}

fn has_passive(exported: &Exported<'_>) -> bool {
    exported.calibrated.model().layout().passive().next().is_some()
}

fn all_physical(exported: &Exported<'_>) -> bool {
    let (bodies, outer) = exported.bodies();
    bodies.iter().chain(&outer).all(|body| body.inertial().is_physical())
}

/// Bodies that counter-springs carry, where other joints bear gravity: MuJoCo lifts them off everything.
fn is_lifted(exported: &Exported<'_>, joint: usize) -> bool {
    let robot = exported.calibrated.robot();
    let loaded = robot.chain().has_gravity() || has_passive(exported);
    loaded && robot.joints[..=joint].iter().any(|joint| joint.gravity == GravityLoad::Compensated)
}

fn inertial(text: &mut String, indent: &str, moments: &Moments) {
    let body = moments.inertial();
    let i = body.inertia;
    let full = [i[(0, 0)], i[(1, 1)], i[(2, 2)], i[(0, 1)], i[(0, 2)], i[(1, 2)]];
    let centre = numbers(body.centre_m.as_slice());
    let _ = writeln!(
        text,
        "{indent}<inertial pos=\"{centre}\" mass=\"{}\" fullinertia=\"{}\"/>",
        body.mass_kg,
        numbers(&full)
    );
}

/// Passive joints with their stiffness and damping: name, axis, k, d.
fn passive(
    exported: &Exported<'_>,
    of: impl Fn(&dyn crate::model::law::Law) -> Vec<PassiveJoint>,
) -> Vec<(String, Vector3<f64>, [f64; 2])> {
    let model = exported.calibrated.model();
    let mut found = Vec::new();
    for (index, law) in model.laws().iter().enumerate() {
        let own = model.coordinates().of_law(index, exported.calibrated.z());
        for joint in of(&**law) {
            let values = [own[joint.stiffness].exp(), own[joint.damping].exp()];
            found.push((format!("passive{}", found.len() + 1), Vector3::from(joint.axis), values));
        }
    }
    found
}

fn bodies(text: &mut String, exported: &Exported<'_>) {
    let robot = exported.calibrated.robot();
    let (moments, outer) = exported.bodies();
    let bearing = passive(exported, |law| law.base_joints().to_vec());
    let structure = passive(exported, |law| law.structure().map_or(Vec::new(), |(_, joints)| joints.to_vec()));
    let last = robot.joints.len() - 1;
    for (i, joint) in robot.joints.iter().enumerate() {
        let indent = "  ".repeat(i + 2);
        let to_joint = matrix(&joint.rotation);
        let lift = if is_lifted(exported, i) { " gravcomp=\"1\"" } else { "" };
        let _ = writeln!(
            text,
            "{indent}<body name=\"{}\" pos=\"{}\" quat=\"{}\"{lift}>",
            joint.name,
            numbers(&joint.origin_m),
            quaternion(&to_joint)
        );
        let indent = format!("{indent}  ");
        if i == 0 {
            // Through the origin of the base, in the axes of this body.
            let (pivot, rest) = (-to_joint * Vector3::from(joint.origin_m), &bearing);
            for (number, (_, axis, [k, d])) in rest.iter().enumerate() {
                let axis = to_joint * axis;
                let _ = writeln!(
                    text,
                    "{indent}<joint name=\"bearing{}\" pos=\"{}\" axis=\"{}\" stiffness=\"{k}\" damping=\"{d}\"/>",
                    number + 1,
                    numbers(pivot.as_slice()),
                    numbers(axis.as_slice())
                );
            }
        }
        joints(text, &indent, joint, &exported.joint_values(i));
        inertial(text, &indent, &moments[i]);
        let on_outer = i == last && outer.is_some();
        if !on_outer {
            sites(text, &indent, exported, i);
        }
        if let Some(outer) = outer.filter(|_| on_outer) {
            let _ = writeln!(text, "{indent}<body name=\"{}_outer\">", joint.name);
            for (number, (_, axis, [k, d])) in structure.iter().enumerate() {
                let axis = numbers(axis.as_slice());
                let _ = writeln!(
                    text,
                    "{indent}  <joint name=\"structure{}\" axis=\"{axis}\" stiffness=\"{k}\" damping=\"{d}\"/>",
                    number + 1
                );
            }
            let inner = format!("{indent}  ");
            inertial(text, &inner, &outer);
            sites(text, &inner, exported, i);
            let _ = writeln!(text, "{indent}</body>");
        }
    }
    for i in (0..robot.joints.len()).rev() {
        let _ = writeln!(text, "{}</body>", "  ".repeat(i + 2));
    }
}

/// An attribute, left out where it is zero.
fn attribute(name: &str, value: f64) -> String {
    if value == 0.0 { String::new() } else { format!(" {name}=\"{value}\"") }
}

/// Viscous damping with drag: a polynomial of the speed, where there is drag.
fn damping(viscous: f64, drag: f64) -> String {
    if drag == 0.0 { attribute("damping", viscous) } else { format!(" damping=\"{viscous} {drag}\"") }
}

fn joints(text: &mut String, indent: &str, joint: &Joint, values: &JointValues) {
    let kind = match joint.kind {
        JointKind::Revolute => "hinge",
        JointKind::Prismatic => "slide",
    };
    let axis = numbers(&joint.axis);
    let head = |name: String| format!("{indent}<joint name=\"{name}\" type=\"{kind}\" axis=\"{axis}\"");
    let armature = attribute("armature", values.inertia);
    if is_elastic(joint) {
        let rotor = [armature, damping(values.viscous, 0.0), attribute("frictionloss", values.coulomb)].concat();
        let _ = writeln!(text, "{}{rotor}/>", head(format!("{}_motor", joint.name)));
        let spring = if values.half_gap != 0.0 {
            String::new()
        } else if values.cubic != 0.0 {
            format!(" stiffness=\"{} 0 {}\"{}", values.stiffness, values.cubic, attribute("damping", values.damping))
        } else {
            attribute("stiffness", values.stiffness) + &attribute("damping", values.damping)
        };
        let _ = writeln!(text, "{}{spring}/>", head(format!("{}_belt", joint.name)));
    } else {
        let [low, high] = joint.limits;
        let friction = attribute("frictionloss", values.coulomb + values.link_coulomb);
        let all = [armature, damping(values.viscous + values.link_viscous, values.drag), friction].concat();
        let spring = match values.link_spring_rest() {
            Some(rest) => attribute("stiffness", values.link_spring) + &attribute("springref", rest),
            None => String::new(),
        };
        let _ = writeln!(text, "{}{all}{spring} range=\"{low} {high}\"/>", head(joint.name.clone()));
    }
}

/// The gyros on a body, in their own axes.
fn sites(text: &mut String, indent: &str, exported: &Exported<'_>, body: usize) {
    for (i, gyro) in exported.calibrated.robot().gyros().enumerate() {
        if gyro.body == body {
            let orientation = quaternion(&exported.calibrated.rotations()[i]);
            let _ = writeln!(text, "{indent}<site name=\"gyro{}\" quat=\"{orientation}\"/>", i + 1);
        }
    }
}

fn tendons(text: &mut String, exported: &Exported<'_>) {
    let robot = exported.calibrated.robot();
    if !robot.joints.iter().any(is_elastic) {
        return;
    }
    text.push_str("  <tendon>\n");
    for (i, joint) in robot.joints.iter().enumerate().filter(|(_, joint)| is_elastic(joint)) {
        let (values, [low, high], name) = (exported.joint_values(i), joint.limits, &joint.name);
        let mut rest = attribute("frictionloss", values.link_coulomb) + &damping(values.link_viscous, values.drag);
        if let Some(at) = values.link_spring_rest() {
            rest += &format!(" stiffness=\"{}\" springlength=\"{at}\"", values.link_spring);
        }
        let _ = writeln!(text, "    <fixed name=\"{name}\" range=\"{low} {high}\"{rest}>");
        let _ = writeln!(
            text,
            "      <joint joint=\"{name}_motor\" coef=\"1\"/>\n      <joint joint=\"{name}_belt\" coef=\"1\"/>\n    </fixed>"
        );
        if values.half_gap != 0.0 {
            let h = values.half_gap.abs();
            let _ = writeln!(
                text,
                "    <fixed name=\"{name}_gap\" stiffness=\"{}\"{} springlength=\"{} {h}\">\n      <joint joint=\"{name}_belt\" coef=\"1\"/>\n    </fixed>",
                values.stiffness,
                attribute("damping", values.damping),
                -h
            );
        }
    }
    text.push_str("  </tendon>\n");
}

fn actuators(text: &mut String, exported: &Exported<'_>) {
    let robot = exported.calibrated.robot();
    let range = if robot.input.unit == InputUnit::Duty { " ctrlrange=\"-1 1\"" } else { "" };
    let limit = exported.result("current_limit.T").map_or(String::new(), |t| format!(" forcerange=\"{} {t}\"", -t));
    let late_s = exported.result("input_delay.T").filter(|late_s| *late_s > 0.0);
    let timestep = robot.sample_period_s / exported.parts() as f64;
    let late = late_s.map_or(String::new(), |late_s| {
        format!(" delay=\"{late_s}\" nsample=\"{}\" interp=\"linear\"", (late_s / timestep).ceil() as usize + 2)
    });
    text.push_str("  <actuator>\n");
    for (i, joint) in robot.joints.iter().enumerate() {
        let values = exported.joint_values(i);
        let target = if is_elastic(joint) { format!("{}_motor", joint.name) } else { joint.name.clone() };
        let offset = values.offset + if is_elastic(joint) { 0.0 } else { values.link_offset };
        let bias =
            if offset == 0.0 { String::new() } else { format!(" biastype=\"affine\" biasprm=\"{} 0 0\"", -offset) };
        let _ = writeln!(
            text,
            "    <general name=\"{}\" joint=\"{target}\" gainprm=\"{}\"{bias}{range}{limit}{late}/>",
            joint.name, values.gain
        );
    }
    text.push_str("  </actuator>\n");
}

fn sensors(text: &mut String, exported: &Exported<'_>) {
    let joints = &exported.calibrated.robot().joints;
    text.push_str("  <sensor>\n");
    for (channel, sigma) in exported.readings.iter().zip(exported.sigmas()) {
        let (of, motor) = match channel.kind {
            ChannelKind::MotorPosition { joint } => ((joint, "pos"), true),
            ChannelKind::MotorSpeed { joint } => ((joint, "vel"), true),
            ChannelKind::LinkPosition { joint } => ((joint, "pos"), false),
            ChannelKind::LinkSpeed { joint } => ((joint, "vel"), false),
            ChannelKind::GyroAxis { gyro, axis, .. } => {
                if axis == 0 {
                    let _ = writeln!(text, "    <gyro name=\"gyro{0}\" site=\"gyro{0}\" noise=\"{sigma}\"/>", gyro + 1);
                }
                continue;
            }
        };
        let ((joint, what), name) = (of, &joints[of.0].name);
        let element = match (is_elastic(&joints[joint]), motor) {
            (true, true) => format!("joint{what} joint=\"{name}_motor\""),
            (true, false) => format!("tendon{what} tendon=\"{name}\""),
            (false, _) => format!("joint{what} joint=\"{name}\""),
        };
        let (of, rest) = element.split_once(' ').unwrap_or((&element, ""));
        let _ = writeln!(text, "    <{of} name=\"{}\" {rest} noise=\"{sigma}\"/>", channel.name);
    }
    text.push_str("  </sensor>\n");
}

fn losses(exported: &Exported<'_>) -> Vec<Loss> {
    let robot = exported.calibrated.robot();
    let joints = || robot.joints.iter().enumerate().map(|(i, joint)| (joint, exported.joint_values(i)));
    let mut losses = vec![Loss::exact("chain, motors, transmissions", "as bodies, armature, spring and damper")];
    let [speeds, gravity] = exported.largest_torques();
    let scale = exported.result("coriolis.scale").unwrap_or(if robot.coriolis { 1.0 } else { 0.0 });
    if scale == 1.0 || speeds == 0.0 {
        losses.push(Loss::exact("torques of the speeds", "Coriolis and centrifugal, as MuJoCo has them"));
    } else {
        let most = (1.0 - scale).abs() * speeds;
        let share = if scale == 0.0 { "none of them".to_owned() } else { format!("{scale} of them") };
        losses.push(Loss::approximate(
            "torques of the speeds",
            format!("MuJoCo has them whole, the model {share}: up to {most:.3} N m apart at 1 rad/s on all joints"),
        ));
    }
    let compensated = robot.joints.iter().any(|joint| joint.gravity == GravityLoad::Compensated);
    if robot.chain().has_gravity() || has_passive(exported) {
        if compensated {
            losses.push(Loss::approximate(
                "gravity",
                format!("bodies behind a compensated joint weigh nothing for the joints before it either, which bear up to {gravity:.3} N m"),
            ));
        } else {
            losses.push(Loss::exact("gravity", "on every joint"));
        }
    } else {
        losses.push(Loss::exact("gravity", "no joint bears any: it is switched off"));
    }
    if let Some((most, at)) = joints()
        .map(|(_, v)| (v.coulomb + v.link_coulomb, v.slides_at))
        .filter(|(mu, _)| *mu > 0.0)
        .reduce(|a, b| (a.0.max(b.0), a.1.max(b.1)))
    {
        losses.push(Loss::approximate(
            "Coulomb friction",
            format!("MuJoCo's sticks; the model's sign is smooth below {at:.2e} rad/s: up to {most:.3} N m apart there, one above"),
        ));
    }
    if !all_physical(exported) {
        losses.push(Loss::approximate(
            "inertia",
            "a body with these moments does not exist: MuJoCo raises the least of them",
        ));
    }
    if exported.bodies().0.iter().any(Moments::has_no_mass) {
        losses.push(Loss::lost("mass times centre", "of a body without a mass: give the description its mass"));
    }
    if joints().any(|(joint, v)| is_elastic(joint) && v.link_offset != 0.0) {
        losses.push(Loss::lost("constant torque on a link", "an actuator acts on the motor"));
    }
    losses.push(Loss::exact("limits", "as the description has them: soft stops, which the model does not have"));
    losses.push(Loss::exact("mountings of gyros", "as sites at the origins of their bodies, where a rate is the same"));
    losses.push(Loss::lost(
        "biases of gyros, zeros and scales of encoders",
        "MuJoCo's sensors read the truth; values stand in the calibration",
    ));
    if exported.readings.iter().any(|channel| channel.offset_s != 0.0) {
        losses.push(Loss::lost("late readings", "all sensors are read with the state"));
    }
    losses.push(Loss::lost("noise", "standard deviations stand as `noise` at the sensors; MuJoCo adds none"));
    losses.extend(exported.calibration.extensions.iter().map(|id| of_effect(exported, id)));
    losses
}

fn of_effect(exported: &Exported<'_>, id: &str) -> Loss {
    let polynomial = "as a polynomial, which MuJoCo 4 reads";
    match id {
        "viscous_friction" | "motor_mismatch" | "torque_offset" => Loss::exact(id, "in the joint's own numbers"),
        "base_bearing" => Loss::exact(id, "as two hinges before the first joint"),
        "structure_mode" => Loss::exact(id, "as two hinges of an outer part of the last body"),
        "link_inertia" => Loss::exact(id, "in the body's mass"),
        "coriolis" => Loss::exact(id, "see the torques of the speeds"),
        "cable_spring" => Loss::exact(id, "as a spring of the link"),
        "belt_hardening" | "quadratic_drag" => Loss::exact(id, polynomial),
        "link_friction" => Loss::approximate(id, "as friction and damping of the link; see Coulomb friction"),
        "current_limit" => Loss::approximate(id, "of the driving torque, the back-EMF left out"),
        "input_delay" => Loss::approximate(
            id,
            "as the actuators' delay, linear between steps, which MuJoCo 4 reads: half a step apart at most",
        ),
        "backlash" => Loss::approximate(id, "a spring that rests in the gap; the damper acts there as well"),
        "integrator_error" => Loss::lost(id, "MuJoCo integrates by a better method"),
        "pwm_dead_zone" => {
            let most = (0..exported.inputs()).map(|i| {
                let dead = exported.result(&format!("{id}.d[{}]", i + 1)).unwrap_or(0.0);
                dead * exported.joint_values(i).gain
            });
            let most = most.fold(0.0, f64::max);
            Loss::lost(id, format!("up to {most:.3} N m: take it off the inputs before you give them"))
        }
        _ => Loss::lost(id, format!("{}: MuJoCo has no such law", title(id))),
    }
}
