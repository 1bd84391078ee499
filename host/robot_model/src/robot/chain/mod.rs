//! A serial chain of rigid bodies: kinematics and dynamics over any scalar, without allocation.
//!
//! ```text
//! M(q) q̈ + c(q, q̇) + g(q) = τ      M by composite rigid bodies, the left side by recursive Newton–Euler
//! ```
//! (Featherstone, Rigid Body Dynamics Algorithms, 2008, chapters 5 and 6.) Positions are rad or m by the kind of joint.
//!
//! Inside, every joint moves about or along its own z: a constant rotation between neighbours takes that up, and what
//! depends on q is a rotation in a plane. Results are in the axes of the description.

use super::vector::{
    self, IDENTITY, add, apply, apply_transposed, axes_with_z_along, constant, cross, product, transpose,
};
use super::{Body, GravityLoad, JointKind, Matrix3, Robot, RobotError, Symbol, Vector3};

mod derivative;
mod dynamics;
mod frames;
mod kinematics;
mod lanes;

pub use super::vector::{Arithmetic, Scalar};
pub use frames::LinkFrame;
pub use lanes::Lanes;

/// The most joints a chain holds: a robot of seven and passive joints before or after it.
pub const MAX_JOINTS: usize = 10;

/// A serial chain of rigid bodies, one a joint.
#[derive(Debug, Clone, PartialEq)]
pub struct Chain {
    links: Vec<Link>,
    /// Acceleration of free fall in base axes.
    gravity_m_s2: Vector3,
    coriolis: bool,
}

/// A joint and its body, in axes whose z is the joint's axis.
#[derive(Debug, Clone, PartialEq)]
struct Link {
    kind: JointKind,
    /// Previous link's axes → this link's at position 0.
    from_previous: Matrix3,
    /// Origin at position 0 in the previous link's axes, m.
    origin_m: Vector3,
    /// This link's axes → the body's axes in the description.
    to_body: Matrix3,
    gravity: GravityLoad,
    mass_kg: f64,
    /// Mass times centre, kg m.
    first_moment: Vector3,
    /// About the frame's origin, kg m².
    inertia: Symmetric<f64>,
}

/// A symmetric 3×3 matrix.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Symmetric<T> {
    xx: T,
    yy: T,
    zz: T,
    xy: T,
    xz: T,
    yz: T,
}

impl Symmetric<f64> {
    fn add(&mut self, weight: f64, other: &Self) {
        self.xx += weight * other.xx;
        self.yy += weight * other.yy;
        self.zz += weight * other.zz;
        self.xy += weight * other.xy;
        self.xz += weight * other.xz;
        self.yz += weight * other.yz;
    }
}

impl Chain {
    pub(super) fn of(robot: &Robot) -> Self {
        let mut previous_to_body = IDENTITY;
        let links = robot.joints.iter().map(|joint| {
            let to_body = axes_with_z_along(joint.axis);
            let from_body = transpose(&to_body);
            let from_previous = product(&from_body, &product(&joint.rotation, &previous_to_body));
            let origin_m = apply_transposed(&previous_to_body, joint.origin_m);
            previous_to_body = to_body;
            let mut link =
                Link { kind: joint.kind, from_previous, origin_m, gravity: joint.gravity, ..Link::massless(to_body) };
            link.carry(&joint.body, 1.0);
            link
        });
        Self { links: links.collect(), gravity_m_s2: robot.gravity_m_s2, coriolis: robot.coriolis }
    }

    /// The same chain on passive revolute joints: massless bodies that turn about `axes` (unit vectors in base axes,
    /// one after the other), all through `origin_m`. Gravity acts on them. Their positions come first in q.
    ///
    /// # Errors
    /// [`RobotError::TooManyJoints`] beyond [`MAX_JOINTS`].
    pub fn with_base_joints(&self, origin_m: Vector3, axes: &[Vector3]) -> Result<Self, RobotError> {
        let joints = self.links.len() + axes.len();
        if joints > MAX_JOINTS {
            return Err(RobotError::TooManyJoints { got: joints, max: MAX_JOINTS });
        }
        let mut links = Vec::with_capacity(joints);
        let mut previous_to_base = IDENTITY;
        for (index, &axis) in axes.iter().enumerate() {
            let to_base = axes_with_z_along(axis);
            links.push(Link {
                from_previous: product(&transpose(&to_base), &previous_to_base),
                origin_m: if index == 0 { origin_m } else { [0.0; 3] },
                ..Link::massless(to_base)
            });
            previous_to_base = to_base;
        }
        let mut rest = self.links.iter().cloned();
        if let Some(mut first) = rest.next().filter(|_| !axes.is_empty()) {
            let from_pivot = add(first.origin_m, vector::scale(origin_m, -1.0));
            first.origin_m = apply_transposed(&previous_to_base, from_pivot);
            first.from_previous = product(&first.from_previous, &previous_to_base);
            links.push(first);
            links.extend(rest);
        } else {
            links = self.links.clone();
        }
        Ok(Self { links, gravity_m_s2: self.gravity_m_s2, coriolis: self.coriolis })
    }

    /// The same chain with its last body in two parts: `outer`, a part of it, moves on two or more passive revolute joints
    /// about `axes` (unit vectors), all through the last joint's origin; both in the axes of the last body. Gravity acts
    /// on them. Their positions come last in q.
    ///
    /// # Errors
    /// [`RobotError::TooManyJoints`] beyond [`MAX_JOINTS`].
    pub fn with_structure(&self, outer: &Body, axes: &[Vector3]) -> Result<Self, RobotError> {
        let joints = self.links.len() + axes.len();
        if joints > MAX_JOINTS {
            return Err(RobotError::TooManyJoints { got: joints, max: MAX_JOINTS });
        }
        let mut chain = self.clone();
        let Some(last) = chain.links.last_mut().filter(|_| !axes.is_empty()) else { return Ok(chain) };
        last.carry(outer, -1.0);
        let mut previous_to_body = last.to_body;
        for &axis in axes {
            let to_body = axes_with_z_along(axis);
            chain.links.push(Link {
                from_previous: product(&transpose(&to_body), &previous_to_body),
                origin_m: [0.0; 3],
                ..Link::massless(to_body)
            });
            previous_to_body = to_body;
        }
        if let Some(tip) = chain.links.last_mut() {
            tip.carry(outer, 1.0);
        }
        Ok(chain)
    }

    /// The same chain whose body `joint` has more inertia about its axis (mass, where it slides) or more of a first moment, as `symbol` says, in
    /// its unit. Any other symbol changes nothing.
    #[must_use]
    pub fn with_moment(mut self, joint: usize, symbol: Symbol, value: f64) -> Self {
        let link = &mut self.links[joint];
        match (symbol, link.kind) {
            (Symbol::J, JointKind::Revolute) => link.inertia.zz += value,
            (Symbol::J, JointKind::Prismatic) => link.mass_kg += value,
            (Symbol::FirstMoment { axis }, _) => {
                let moment: Vector3 = std::array::from_fn(|i| if i == axis { value } else { 0.0 });
                link.first_moment = add(link.first_moment, apply_transposed(&link.to_body, moment));
            }
            _ => {}
        }
        self
    }

    /// The same joints without any mass.
    #[must_use]
    pub fn massless(&self) -> Self {
        let links = self.links.iter().map(|link| Link {
            kind: link.kind,
            from_previous: link.from_previous,
            origin_m: link.origin_m,
            gravity: link.gravity,
            ..Link::massless(link.to_body)
        });
        Self { links: links.collect(), ..*self }
    }

    /// The same joints with the bodies of these chains together, each so many times: its torques are the weighted sum of theirs. They are alike but for their
    /// bodies.
    #[must_use]
    pub fn with_bodies_of<'c>(&self, chains: impl Iterator<Item = (f64, &'c Chain)>) -> Self {
        let mut sum = self.massless();
        for (weight, chain) in chains {
            for (to, from) in sum.links.iter_mut().zip(&chain.links) {
                to.mass_kg += weight * from.mass_kg;
                to.first_moment = add(to.first_moment, vector::scale(from.first_moment, weight));
                to.inertia.add(weight, &from.inertia);
            }
        }
        sum
    }

    /// The same chain with or without Coriolis and centrifugal torques.
    #[must_use]
    pub fn with_coriolis(self, coriolis: bool) -> Self {
        Self { coriolis, ..self }
    }

    /// Number of joints, passive ones included.
    pub fn joints(&self) -> usize {
        self.links.len()
    }

    /// Whether M, c and g are the same at every position and speed: of slides alone, and of one joint that gravity does not load.
    pub fn is_constant(&self) -> bool {
        let slides = self.links.iter().all(|link| link.kind == JointKind::Prismatic);
        slides || self.links.len() == 1 && !self.has_gravity()
    }

    /// Whether every joint bears what gravity does to it.
    fn bears_gravity(&self) -> bool {
        self.links.iter().all(|link| link.gravity == GravityLoad::Acts)
    }

    /// Whether gravity loads any joint. A first joint that turns about the vertical feels nothing of it.
    pub fn has_gravity(&self) -> bool {
        let feels = |(i, link): (usize, &Link)| {
            let turns_about_vertical = i == 0
                && link.kind == JointKind::Revolute
                && cross(link.from_previous[2], self.gravity_m_s2) == [0.0; 3];
            link.gravity == GravityLoad::Acts && !turns_about_vertical
        };
        self.gravity_m_s2 != [0.0; 3] && self.links.iter().enumerate().any(feels)
    }
}

impl Link {
    /// A revolute link without a body, its origin in that of the previous one.
    fn massless(to_body: Matrix3) -> Self {
        Self {
            kind: JointKind::Revolute,
            from_previous: IDENTITY,
            origin_m: [0.0; 3],
            to_body,
            gravity: GravityLoad::Acts,
            mass_kg: 0.0,
            first_moment: [0.0; 3],
            inertia: Symmetric { xx: 0.0, yy: 0.0, zz: 0.0, xy: 0.0, xz: 0.0, yz: 0.0 },
        }
    }

    /// Adds a body, given in body axes whose origin is the link's; with `sign` −1 takes it away.
    fn carry(&mut self, body: &Body, sign: f64) {
        let from_body = transpose(&self.to_body);
        let centre = apply(&from_body, body.centre_m);
        let about_centre = product(&from_body, &product(&body.inertia_kg_m2, &self.to_body));
        let inertia = Symmetric::of(&about_centre).about_origin(body.mass_kg, centre);
        self.mass_kg += sign * body.mass_kg;
        self.first_moment = add(self.first_moment, vector::scale(centre, sign * body.mass_kg));
        self.inertia.add(sign, &inertia);
    }

    /// Sine and cosine of the turn that position `q` makes.
    #[inline(always)]
    fn turn<T: Arithmetic>(&self, q: T) -> (T, T) {
        match self.kind {
            JointKind::Revolute => q.sin_cos(),
            JointKind::Prismatic => (T::from(0.0), T::from(1.0)),
        }
    }

    /// Where the origin stands at position `q`, in the previous link's axes.
    #[inline(always)]
    fn origin<T: Arithmetic>(&self, q: T) -> [T; 3] {
        let at_zero = constant(self.origin_m);
        match self.kind {
            JointKind::Revolute => at_zero,
            // The third row of previous → this is this link's z in the previous link's axes.
            JointKind::Prismatic => add(at_zero, self.from_previous[2].map(|z| q * z)),
        }
    }

    /// A vector from the previous link's axes into this link's.
    #[inline(always)]
    fn inwards<T: Arithmetic>(&self, (sin, cos): (T, T), v: [T; 3]) -> [T; 3] {
        let w = apply(&self.from_previous, v);
        [w[0] * cos + w[1] * sin, w[1] * cos - w[0] * sin, w[2]]
    }

    /// A vector from this link's axes into the previous link's.
    #[inline(always)]
    fn outwards<T: Arithmetic>(&self, (sin, cos): (T, T), v: [T; 3]) -> [T; 3] {
        apply_transposed(&self.from_previous, [v[0] * cos - v[1] * sin, v[0] * sin + v[1] * cos, v[2]])
    }
}

impl Symmetric<f64> {
    fn of(m: &Matrix3) -> Self {
        Self { xx: m[0][0], yy: m[1][1], zz: m[2][2], xy: m[0][1], xz: m[0][2], yz: m[1][2] }
    }

    /// Steiner: an inertia about the centre, about a point from which the centre is `c`.
    fn about_origin(self, mass: f64, c: Vector3) -> Self {
        Self {
            xx: self.xx + mass * (c[1] * c[1] + c[2] * c[2]),
            yy: self.yy + mass * (c[0] * c[0] + c[2] * c[2]),
            zz: self.zz + mass * (c[0] * c[0] + c[1] * c[1]),
            xy: self.xy - mass * c[0] * c[1],
            xz: self.xz - mass * c[0] * c[2],
            yz: self.yz - mass * c[1] * c[2],
        }
    }

    /// The constant matrix times a vector.
    #[inline(always)]
    fn apply<T: Arithmetic>(&self, v: [T; 3]) -> [T; 3] {
        [
            v[0] * self.xx + v[1] * self.xy + v[2] * self.xz,
            v[0] * self.xy + v[1] * self.yy + v[2] * self.yz,
            v[0] * self.xz + v[1] * self.yz + v[2] * self.zz,
        ]
    }

    #[inline(always)]
    fn constant<T: Arithmetic>(&self) -> Symmetric<T> {
        let Self { xx, yy, zz, xy, xz, yz } = *self;
        Symmetric {
            xx: T::from(xx),
            yy: T::from(yy),
            zz: T::from(zz),
            xy: T::from(xy),
            xz: T::from(xz),
            yz: T::from(yz),
        }
    }
}
