//! A serial chain of rigid bodies: recursive Newton–Euler in body axes, and the mass matrix from unit accelerations.
//!
//! It shares no code with `host::robot::chain`. Conventions of a description file: a joint's `rotation` takes vectors from the previous body's axes
//! into the joint's, and `origin_m` is in the previous body's axes.

use host::robot::{Joint, JointKind};
use nalgebra::{Matrix3, Rotation3, SMatrix, SVector, Unit, Vector3};

/// Most joints of a chain, passive ones included.
pub const MOST: usize = 6;
/// One value a joint; those beyond the chain are zero.
pub type Values = SVector<f64, MOST>;
/// M(q); beyond the chain it is the identity.
pub type MassMatrix = SMatrix<f64, MOST, MOST>;

/// A joint and the body that it moves.
#[derive(Debug, Clone)]
pub struct Link {
    slides: bool,
    axis: Vector3<f64>,
    origin: Vector3<f64>,
    rotation: Matrix3<f64>,
    /// Whether counter-springs bear this joint's share of gravity.
    pub is_compensated: bool,
    /// kg.
    pub mass: f64,
    /// Centre of mass in body axes, m.
    pub centre: Vector3<f64>,
    /// About the centre, kg m².
    pub inertia: Matrix3<f64>,
}

impl Link {
    /// As a description file has it.
    pub fn of(joint: &Joint) -> Self {
        let matrix = |m: &[[f64; 3]; 3]| Matrix3::from_fn(|i, j| m[i][j]);
        Self {
            slides: joint.kind == JointKind::Prismatic,
            axis: Vector3::from(joint.axis),
            origin: Vector3::from(joint.origin_m),
            rotation: matrix(&joint.rotation),
            is_compensated: joint.gravity == host::robot::GravityLoad::Compensated,
            mass: joint.body.mass_kg,
            centre: Vector3::from(joint.body.centre_m),
            inertia: matrix(&joint.body.inertia_kg_m2),
        }
    }

    /// A revolute joint about `axis` through the previous origin, which moves no mass of its own.
    pub fn massless(axis: Vector3<f64>) -> Self {
        Self {
            slides: false,
            axis,
            origin: Vector3::zeros(),
            rotation: Matrix3::identity(),
            is_compensated: false,
            mass: 0.0,
            centre: Vector3::zeros(),
            inertia: Matrix3::zeros(),
        }
    }

    /// Fixes a point mass to the body, kg and m in body axes.
    pub fn add_point_mass(&mut self, mass: f64, at: Vector3<f64>) {
        let total = self.mass + mass;
        let centre = (self.mass * self.centre + mass * at) / total;
        let about =
            |mass: f64, arm: Vector3<f64>| mass * (arm.norm_squared() * Matrix3::identity() - arm * arm.transpose());
        self.inertia += about(self.mass, self.centre - centre) + about(mass, at - centre);
        (self.mass, self.centre) = (total, centre);
    }
}

/// The chain, from the base outwards.
#[derive(Debug, Clone)]
pub struct Chain {
    /// Joints and bodies.
    pub links: Vec<Link>,
    /// Acceleration of free fall in base axes, m/s².
    pub gravity: Vector3<f64>,
}

/// Where the chain stands: what depends on q alone.
#[derive(Debug, Clone, Copy)]
pub struct Pose {
    /// Previous body's axes → this body's.
    inwards: [Matrix3<f64>; MOST],
    /// Origins in the previous body's axes, m.
    origins: [Vector3<f64>; MOST],
}

impl Chain {
    /// The pose at positions `q`.
    pub fn pose(&self, q: &Values) -> Pose {
        let mut pose = Pose { inwards: [Matrix3::zeros(); MOST], origins: [Vector3::zeros(); MOST] };
        for (i, link) in self.links.iter().enumerate() {
            if link.slides {
                pose.inwards[i] = link.rotation;
                pose.origins[i] = link.origin + link.rotation.tr_mul(&link.axis) * q[i];
            } else {
                let turn = Rotation3::from_axis_angle(&Unit::new_unchecked(link.axis), -q[i]);
                pose.inwards[i] = turn.matrix() * link.rotation;
                pose.origins[i] = link.origin;
            }
        }
        pose
    }

    /// The torques that the accelerations `qdd` take at speeds `qd` in a field of gravity.
    fn torques(&self, pose: &Pose, qd: &Values, qdd: &Values, gravity: Vector3<f64>) -> Values {
        let n = self.links.len();
        let (mut forces, mut moments) = ([Vector3::zeros(); MOST], [Vector3::zeros(); MOST]);
        let (mut omega, mut alpha, mut acceleration) = (Vector3::zeros(), Vector3::zeros(), -gravity);
        for (i, link) in self.links.iter().enumerate() {
            let (r, p) = (&pose.inwards[i], &pose.origins[i]);
            let carried = r * (acceleration + alpha.cross(p) + omega.cross(&omega.cross(p)));
            let (turned, turning) = (r * omega, r * alpha);
            let (speed, change) = (link.axis * qd[i], link.axis * qdd[i]);
            if link.slides {
                (omega, alpha) = (turned, turning);
                acceleration = carried + 2.0 * omega.cross(&speed) + change;
            } else {
                omega = turned + speed;
                alpha = turning + turned.cross(&speed) + change;
                acceleration = carried;
            }
            let c = &link.centre;
            forces[i] = link.mass * (acceleration + alpha.cross(c) + omega.cross(&omega.cross(c)));
            moments[i] = link.inertia * alpha + omega.cross(&(link.inertia * omega)) + c.cross(&forces[i]);
        }
        let mut torques = Values::zeros();
        for i in (0..n).rev() {
            let link = &self.links[i];
            torques[i] = link.axis.dot(if link.slides { &forces[i] } else { &moments[i] });
            if i > 0 {
                let (force, moment) = (pose.inwards[i].tr_mul(&forces[i]), pose.inwards[i].tr_mul(&moments[i]));
                moments[i - 1] += moment + pose.origins[i].cross(&force);
                forces[i - 1] += force;
            }
        }
        torques
    }

    /// M(q).
    pub fn mass_matrix(&self, pose: &Pose) -> MassMatrix {
        let mut mass = MassMatrix::identity();
        for i in 0..self.links.len() {
            let column = self.torques(pose, &Values::zeros(), &unit(i), Vector3::zeros());
            mass.set_column(i, &column);
        }
        for i in self.links.len()..MOST {
            mass[(i, i)] = 1.0;
        }
        mass
    }

    /// g(q): what gravity asks of the joints that bear it.
    pub fn gravity_torques(&self, pose: &Pose) -> Values {
        let mut torques = self.torques(pose, &Values::zeros(), &Values::zeros(), self.gravity);
        for (i, _) in self.links.iter().enumerate().filter(|(_, link)| link.is_compensated) {
            torques[i] = 0.0;
        }
        torques
    }

    /// c(q, q̇): Coriolis and centrifugal torques.
    pub fn coriolis_torques(&self, pose: &Pose, qd: &Values) -> Values {
        self.torques(pose, qd, &Values::zeros(), Vector3::zeros())
    }

    /// Angular velocity of every body in its own axes, rad/s.
    pub fn body_rates(&self, pose: &Pose, qd: &Values) -> [Vector3<f64>; MOST] {
        let (mut rates, mut omega) = ([Vector3::zeros(); MOST], Vector3::zeros());
        for (i, link) in self.links.iter().enumerate() {
            omega = pose.inwards[i] * omega + if link.slides { Vector3::zeros() } else { link.axis * qd[i] };
            rates[i] = omega;
        }
        rates
    }

    /// Potential energy of the masses, J. Counter-springs are not part of it.
    pub fn potential_energy(&self, pose: &Pose) -> f64 {
        let mut energy = 0.0;
        for (i, link) in self.links.iter().enumerate() {
            let mut point = link.centre;
            for k in (0..=i).rev() {
                point = pose.inwards[k].tr_mul(&point) + pose.origins[k];
            }
            energy -= link.mass * self.gravity.dot(&point);
        }
        energy
    }
}

fn unit(i: usize) -> Values {
    let mut unit = Values::zeros();
    unit[i] = 1.0;
    unit
}
