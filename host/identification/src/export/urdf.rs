//! The model as URDF: chain, bodies, limits, and of the drives what URDF has, damping and friction.

use std::fmt::Write;

use nalgebra::{Matrix3, Rotation3};

use super::loss::{Loss, title, xml_head};
use super::machine::Moments;
use super::{ExportError, Exported};
use crate::robot::{InputUnit, JointKind, Transmission};

/// The file, and what it keeps.
///
/// # Errors
/// None so far; as the other formats.
pub fn urdf(exported: &Exported<'_>) -> Result<(String, Vec<Loss>), ExportError> {
    let losses = losses(exported);
    let robot = exported.calibrated.robot();
    let mut text = String::from("<?xml version=\"1.0\"?>\n<!--\n");
    text += &xml_head(exported, &losses);
    let _ = write!(text, "-->\n<robot name=\"{}\">\n  <link name=\"base\"/>\n", robot.name);
    let (moments, _) = exported.bodies();
    let mut parent = "base".to_owned();
    for (i, joint) in robot.joints.iter().enumerate() {
        let values = exported.joint_values(i);
        let kind = match joint.kind {
            JointKind::Revolute => "revolute",
            JointKind::Prismatic => "prismatic",
        };
        let link = format!("{}_link", joint.name);
        let to_joint = Matrix3::from_fn(|i, j| joint.rotation[i][j]);
        let most = if robot.input.unit == InputUnit::Duty { values.gain } else { 0.0 };
        let fastest = if values.viscous > 0.0 { most / values.viscous } else { 0.0 };
        let [low, high] = joint.limits;
        let _ = write!(
            text,
            "  <joint name=\"{}\" type=\"{kind}\">\n    <parent link=\"{parent}\"/>\n    <child link=\"{link}\"/>\n    {}\n    <axis xyz=\"{}\"/>\n    \
             <limit lower=\"{low}\" upper=\"{high}\" effort=\"{most}\" velocity=\"{fastest}\"/>\n    \
             <dynamics damping=\"{}\" friction=\"{}\"/>\n  </joint>\n",
            joint.name,
            origin(&joint.origin_m, &to_joint),
            numbers(&joint.axis),
            values.viscous + values.link_viscous,
            values.coulomb + values.link_coulomb,
        );
        link_of(&mut text, &link, &moments[i]);
        parent = link;
    }
    for (i, gyro) in robot.gyros().enumerate() {
        let (name, body) = (format!("gyro{}", i + 1), &robot.joints[gyro.body].name);
        let _ = write!(
            text,
            "  <link name=\"{name}\"/>\n  <joint name=\"{name}_mounting\" type=\"fixed\">\n    <parent link=\"{body}_link\"/>\n    <child link=\"{name}\"/>\n    {}\n  </joint>\n",
            origin(&[0.0; 3], &exported.calibrated.rotations()[i]),
        );
    }
    text += "</robot>\n";
    Ok((text, losses))
}

fn numbers(values: &[f64]) -> String {
    values.iter().map(|value| format!("{value}")).collect::<Vec<_>>().join(" ")
}

/// Where axes stand whose vectors `to_them` takes into them.
fn origin(at_m: &[f64; 3], to_them: &Matrix3<f64>) -> String {
    let (roll, pitch, yaw) = Rotation3::from_matrix_unchecked(to_them.transpose()).euler_angles();
    format!("<origin xyz=\"{}\" rpy=\"{}\"/>", numbers(at_m), numbers(&[roll, pitch, yaw]))
}

fn link_of(text: &mut String, name: &str, moments: &Moments) {
    let body = moments.inertial();
    let i = body.inertia;
    let _ = write!(
        text,
        "  <link name=\"{name}\">\n    <inertial>\n      <origin xyz=\"{}\"/>\n      <mass value=\"{}\"/>\n      \
         <inertia ixx=\"{}\" ixy=\"{}\" ixz=\"{}\" iyy=\"{}\" iyz=\"{}\" izz=\"{}\"/>\n    </inertial>\n  </link>\n",
        numbers(body.centre_m.as_slice()),
        body.mass_kg,
        i[(0, 0)],
        i[(0, 1)],
        i[(0, 2)],
        i[(1, 1)],
        i[(1, 2)],
        i[(2, 2)],
    );
}

fn losses(exported: &Exported<'_>) -> Vec<Loss> {
    let robot = exported.calibrated.robot();
    let mut losses = vec![
        Loss::exact("chain, bodies, limits of positions", "with what parameters add to the bodies"),
        Loss::exact("mountings of gyros", "as fixed frames at the origins of their bodies"),
        Loss::exact("viscous friction and back-EMF", "as damping"),
        Loss::approximate("Coulomb friction", "as friction, which each reader of URDF takes in its own way"),
    ];
    let mut lost = |part: &str, how: &str| losses.push(Loss::lost(part, how));
    if robot.input.unit == InputUnit::Duty {
        lost("supply", "effort and velocity are those of full duty, at standstill and without load");
    } else {
        lost("limits of effort and velocity", "not known: 0 stands there, which some readers take as a limit");
    }
    if robot.joints.iter().any(|joint| joint.transmission == Transmission::Elastic) {
        lost("transmissions", "stiffness and damping: joints are rigid here");
    }
    lost("inertia of motors", "b of each joint: a reader that knows armature needs it from the calibration");
    lost("gravity compensation", "a URDF has no gravity");
    lost("sensors, noise, covariance", "a URDF has none");
    for id in &exported.calibration.extensions {
        let loss = match id.as_str() {
            "viscous_friction" | "motor_mismatch" | "link_friction" => Loss::approximate(id, "in damping and friction"),
            "link_inertia" => Loss::exact(id, "in the body's mass"),
            "structure_mode" => Loss::lost(id, "the last body is told without the part that moves on it"),
            _ => Loss::lost(id, title(id)),
        };
        losses.push(loss);
    }
    losses
}
