//! The chain's constants, for kernels that walk it in their own way.

use super::{Chain, JointKind};
use crate::robot::{GravityLoad, Matrix3, Vector3};

/// One link: its axes have z along the joint.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LinkFrame {
    /// How the joint moves.
    pub kind: JointKind,
    /// Whether gravity loads the joint.
    pub gravity: GravityLoad,
    /// The previous link's axes → this link's, at position zero.
    pub from_previous: Matrix3,
    /// This link's origin in the previous link's axes, at position zero.
    pub origin_m: Vector3,
    /// This link's axes → the body's axes in the description.
    pub to_body: Matrix3,
    /// Mass, kg.
    pub mass_kg: f64,
    /// Mass times centre, kg m.
    pub first_moment: Vector3,
    /// About the link's origin, kg m².
    pub inertia: Matrix3,
}

impl Chain {
    /// The links from the base outwards.
    pub fn frames(&self) -> impl Iterator<Item = LinkFrame> + '_ {
        self.links.iter().map(|link| {
            let i = &link.inertia;
            LinkFrame {
                kind: link.kind,
                gravity: link.gravity,
                from_previous: link.from_previous,
                origin_m: link.origin_m,
                to_body: link.to_body,
                mass_kg: link.mass_kg,
                first_moment: link.first_moment,
                inertia: [[i.xx, i.xy, i.xz], [i.xy, i.yy, i.yz], [i.xz, i.yz, i.zz]],
            }
        })
    }

    /// Acceleration of free fall in base axes, m/s².
    pub fn gravity_m_s2(&self) -> Vector3 {
        self.gravity_m_s2
    }

    /// Whether the description wants Coriolis and centrifugal terms.
    pub fn has_coriolis(&self) -> bool {
        self.coriolis
    }
}
