//! The serial chain in a URDF's tree: frames from joint to joint, and bodies with all that is fixed to them.

use nalgebra::{Isometry3, Matrix3, Rotation3, Translation3, UnitQuaternion, Vector3};

use super::super::{Body, JointKind, RobotError};

/// A joint as the URDF has it, in the conventions of a description file.
#[derive(Debug)]
pub(super) struct UrdfJoint {
    pub kind: JointKind,
    pub axis: [f64; 3],
    /// From the joint before it, in that one's axes.
    pub origin_m: [f64; 3],
    /// The previous body's axes → the joint's.
    pub rotation: [[f64; 3]; 3],
    /// None where it turns for ever.
    pub limits: Option<[f64; 2]>,
    /// Name of the link that it moves.
    pub link: String,
    /// That link, with all that is fixed to it.
    pub body: Body,
}

/// A URDF as a tree of links.
pub(super) struct Tree<'a> {
    urdf: &'a urdf_rs::Robot,
}

impl<'a> Tree<'a> {
    pub(super) fn of(urdf: &'a urdf_rs::Robot) -> Self {
        Tree { urdf }
    }

    /// Names of the joints that are not fixed.
    pub(super) fn moving(&self) -> Vec<&'a str> {
        let moving = self.urdf.joints.iter().filter(|joint| joint.joint_type != urdf_rs::JointType::Fixed);
        moving.map(|joint| joint.name.as_str()).collect()
    }

    /// The joints of these names, which follow one another from the root outwards; `locked` ones stand still.
    pub(super) fn chain(&self, names: &[String], locked: &[String]) -> Result<Vec<UrdfJoint>, RobotError> {
        let moving = self.moving();
        for (field, name) in names.iter().map(|n| ("joint.name", n)).chain(locked.iter().map(|n| ("urdf.locked", n))) {
            if !moving.contains(&name.as_str()) {
                let advice = format!("the URDF has no such joint that moves; there are {}", moving.join(", "));
                return Err(RobotError::invalid(field, name, advice));
            }
        }
        if let Some(free) = moving.iter().find(|name| !names.iter().chain(locked).any(|known| known == *name)) {
            let advice = "moves in the URDF: give it a [[joint]] table, or name it in urdf.locked if it stands still";
            return Err(RobotError::invalid("urdf.joint", free, advice));
        }
        let mut before: Option<&urdf_rs::Joint> = None;
        let mut chain = Vec::with_capacity(names.len());
        for name in names {
            let joint = self.urdf.joints.iter().find(|joint| joint.name == *name).expect("looked up above");
            let frame = self.frame(joint, before, names)?;
            chain.push(self.described(joint, &frame, names)?);
            before = Some(joint);
        }
        Ok(chain)
    }

    /// The frame of `joint` at zero in that of the joint `before` it, or of the root.
    fn frame(
        &self,
        joint: &'a urdf_rs::Joint,
        before: Option<&urdf_rs::Joint>,
        names: &[String],
    ) -> Result<Isometry3<f64>, RobotError> {
        let mut frame = pose(&joint.origin);
        let mut link = &joint.parent.link;
        // A tree has no more steps than joints; a circle ends here.
        for _ in 0..self.urdf.joints.len() {
            if before.is_some_and(|before| before.child.link == *link) {
                return Ok(frame);
            }
            let Some(parent) = self.urdf.joints.iter().find(|parent| parent.child.link == *link) else {
                break;
            };
            if names.contains(&parent.name) {
                let advice = format!(
                    "follows {} in the URDF: a robot is one chain, list its joints from the base outwards",
                    parent.name
                );
                return Err(RobotError::invalid("joint.name", &joint.name, advice));
            }
            frame = pose(&parent.origin) * frame;
            link = &parent.parent.link;
        }
        match before {
            None => Ok(frame),
            Some(before) => {
                let advice = format!("does not follow {} in the URDF: a robot is one chain of joints", before.name);
                Err(RobotError::invalid("joint.name", &joint.name, advice))
            }
        }
    }

    fn described(
        &self,
        joint: &urdf_rs::Joint,
        frame: &Isometry3<f64>,
        names: &[String],
    ) -> Result<UrdfJoint, RobotError> {
        use urdf_rs::JointType;
        let range = Some([joint.limit.lower, joint.limit.upper]).filter(|[low, high]| low.is_finite() && low < high);
        let (kind, limits) = match joint.joint_type {
            JointType::Revolute => (JointKind::Revolute, range),
            JointType::Prismatic => (JointKind::Prismatic, range),
            JointType::Continuous => (JointKind::Revolute, None),
            _ => {
                let advice = "is neither revolute, continuous nor prismatic in the URDF; only such joints are driven";
                return Err(RobotError::invalid("joint.name", &joint.name, advice));
            }
        };
        let axis = Vector3::from(joint.axis.xyz.0);
        let Some(axis) = axis.try_normalize(1e-9) else {
            let advice = "has an axis of no length in the URDF";
            return Err(RobotError::invalid("joint.name", &joint.name, advice));
        };
        let mut parts = Vec::new();
        self.collect(&joint.child.link, Isometry3::identity(), names, self.urdf.joints.len(), &mut parts);
        // Takes vectors from the previous axes to the joint's: the inverse of how the joint's frame is turned.
        let rotation = frame.rotation.inverse().to_rotation_matrix();
        Ok(UrdfJoint {
            kind,
            axis: axis.into(),
            origin_m: frame.translation.vector.into(),
            rotation: rows(rotation.matrix()),
            limits: limits.filter(|range| range.iter().all(|limit| limit.is_finite())),
            link: joint.child.link.clone(),
            body: joined(&parts),
        })
    }

    /// Inertias of a link and of all that does not move against it, in the axes of the joint that moves them.
    fn collect(
        &self,
        link: &str,
        at: Isometry3<f64>,
        names: &[String],
        depth: usize,
        parts: &mut Vec<(f64, Vector3<f64>, Matrix3<f64>)>,
    ) {
        if let Some(link) = self.urdf.links.iter().find(|candidate| candidate.name == link) {
            let inertial = &link.inertial;
            let frame = at * pose(&inertial.origin);
            let i = &inertial.inertia;
            let own = Matrix3::new(i.ixx, i.ixy, i.ixz, i.ixy, i.iyy, i.iyz, i.ixz, i.iyz, i.izz);
            let turn = frame.rotation.to_rotation_matrix();
            parts.push((
                inertial.mass.value,
                frame.translation.vector,
                turn.matrix() * own * turn.matrix().transpose(),
            ));
        }
        if depth == 0 {
            return;
        }
        for joint in self.urdf.joints.iter().filter(|joint| joint.parent.link == link && !names.contains(&joint.name)) {
            self.collect(&joint.child.link, at * pose(&joint.origin), names, depth - 1, parts);
        }
    }
}

/// One body of several: masses add, tensors are moved to the common centre.
fn joined(parts: &[(f64, Vector3<f64>, Matrix3<f64>)]) -> Body {
    let mass_kg: f64 = parts.iter().map(|(mass, ..)| mass).sum();
    let moment: Vector3<f64> = parts.iter().map(|(mass, centre, _)| centre * *mass).sum();
    let centre = if mass_kg > 0.0 { moment / mass_kg } else { Vector3::zeros() };
    let inertia: Matrix3<f64> = parts
        .iter()
        .map(|(mass, at, own)| {
            let arm = at - centre;
            own + *mass * (Matrix3::identity() * arm.norm_squared() - arm * arm.transpose())
        })
        .sum();
    Body { mass_kg, centre_m: centre.into(), inertia_kg_m2: rows(&inertia) }
}

fn rows(matrix: &Matrix3<f64>) -> [[f64; 3]; 3] {
    std::array::from_fn(|i| std::array::from_fn(|j| matrix[(i, j)]))
}

/// Roll, pitch and yaw about fixed axes, in this order.
fn pose(pose: &urdf_rs::Pose) -> Isometry3<f64> {
    let [roll, pitch, yaw] = pose.rpy.0;
    let turn = UnitQuaternion::from_rotation_matrix(&Rotation3::from_euler_angles(roll, pitch, yaw));
    Isometry3::from_parts(Translation3::from(Vector3::from(pose.xyz.0)), turn)
}
