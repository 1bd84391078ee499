//! The robot as simulators of rigid bodies know it: bodies with their masses, drives with their numbers.

use nalgebra::{Matrix3, Vector3};

use super::Exported;
use crate::robot::{Body, Friction, InputUnit, JointKind, Side, Symbol};

/// Mass, mass times centre, and inertia about the origin of the body's axes.
#[derive(Debug, Clone, Copy)]
pub(super) struct Moments {
    pub mass_kg: f64,
    first: Vector3<f64>,
    about_origin: Matrix3<f64>,
}

/// A body by its centre.
#[derive(Debug, Clone, Copy)]
pub(super) struct Inertial {
    pub mass_kg: f64,
    pub centre_m: Vector3<f64>,
    /// About the centre.
    pub inertia: Matrix3<f64>,
}

/// A simulator wants some mass in every body, kg and kg m².
const LEAST_MASS: f64 = 1e-9;

impl Moments {
    fn of(body: &Body) -> Self {
        let (mass_kg, c) = (body.mass_kg, Vector3::from(body.centre_m));
        let inertia = Matrix3::from_fn(|i, j| body.inertia_kg_m2[i][j]);
        Moments { mass_kg, first: c * mass_kg, about_origin: inertia + steiner(mass_kg, c) }
    }

    fn plus(mut self, other: &Moments, sign: f64) -> Self {
        self.mass_kg += sign * other.mass_kg;
        self.first += other.first * sign;
        self.about_origin += other.about_origin * sign;
        self
    }

    /// Whether mass times centre has no mass to go with.
    pub(super) fn has_no_mass(&self) -> bool {
        self.mass_kg <= LEAST_MASS && self.first.norm() > 0.0
    }

    /// By its centre.
    pub(super) fn inertial(&self) -> Inertial {
        let mass_kg = self.mass_kg.max(LEAST_MASS);
        let centre_m = if self.mass_kg > LEAST_MASS { self.first / self.mass_kg } else { Vector3::zeros() };
        let inertia = self.about_origin - steiner(mass_kg, centre_m);
        let least = inertia.symmetric_eigenvalues().min();
        let more = if least > 0.0 { 0.0 } else { LEAST_MASS };
        Inertial { mass_kg, centre_m, inertia: inertia + Matrix3::identity() * more }
    }
}

impl Inertial {
    /// Whether there is a body with these moments: each principal moment lies between zero and the sum of the others.
    pub(super) fn is_physical(&self) -> bool {
        let moments = self.inertia.symmetric_eigenvalues();
        moments.min() > 0.0 && 2.0 * moments.max() - moments.sum() <= 1e-9 * moments.max()
    }
}

/// m (c·c 1 − c cᵀ).
fn steiner(mass_kg: f64, c: Vector3<f64>) -> Matrix3<f64> {
    (Matrix3::identity() * c.dot(&c) - c * c.transpose()) * mass_kg
}

/// The numbers of one joint, those of effects among them.
#[derive(Debug, Clone, Copy)]
pub(super) struct JointValues {
    /// Torque per unit of input.
    pub gain: f64,
    /// Motor inertia b.
    pub inertia: f64,
    pub coulomb: f64,
    /// Back-EMF and viscous friction on the motor.
    pub viscous: f64,
    /// Constant torque that holds the motor back.
    pub offset: f64,
    pub stiffness: f64,
    pub damping: f64,
    /// Coulomb and viscous friction on the link, constant torque, a spring and its torque at zero, drag.
    pub link_coulomb: f64,
    pub link_viscous: f64,
    pub link_offset: f64,
    pub link_spring: f64,
    pub link_preload: f64,
    pub drag: f64,
    /// Cubic stiffness.
    pub cubic: f64,
    pub half_gap: f64,
    /// Speed above which friction is that of sliding to a hundredth.
    pub slides_at: f64,
}

impl JointValues {
    /// Where the spring on the link is at rest; none without one.
    pub(super) fn link_spring_rest(&self) -> Option<f64> {
        (self.link_spring != 0.0).then(|| (0.0 - self.link_preload) / self.link_spring)
    }
}

impl Exported<'_> {
    /// A result of the dynamics by its name.
    pub(super) fn result(&self, name: &str) -> Option<f64> {
        let coordinates = self.calibrated.model().coordinates();
        let place = coordinates.names().position(|(own, _)| own == name)?;
        Some(coordinates.physical_and_slopes(self.calibrated.z(), place).0)
    }

    /// The value of a parameter of the description at a joint; zero where it has none.
    pub(super) fn value(&self, symbol: Symbol, joint: usize) -> f64 {
        let Some(spec) = self.calibrated.robot().joint_parameter(symbol, joint) else { return 0.0 };
        if spec.value.free { self.result(&spec.name).unwrap_or(spec.value.start) } else { spec.value.start }
    }

    /// A parameter of an effect at a joint; zero where the model has none.
    fn of_effect(&self, id: &str, symbol: &str, joint: usize) -> f64 {
        self.result(&format!("{id}.{symbol}[{}]", joint + 1)).unwrap_or(0.0)
    }

    /// The numbers of a joint.
    pub(super) fn joint_values(&self, joint: usize) -> JointValues {
        let robot = self.calibrated.robot();
        let of = &robot.joints[joint];
        let by_voltage = matches!(robot.input.unit, InputUnit::Duty | InputUnit::Volt);
        let gain =
            robot.input.unit.torque_constant().map_or(1.0, |symbol| self.value(symbol, joint)) * robot.input.scale;
        let back_emf = if by_voltage { self.value(Symbol::KMi, joint) } else { 0.0 };
        let rubbing = if by_voltage { 0.0 } else { self.value(Symbol::V, joint) };
        let (at_link, slope_s) = match of.friction {
            Friction::Coulomb { acts, slope_s, .. } => (acts == Side::Link, slope_s),
            Friction::None => (false, f64::INFINITY),
        };
        let (coulomb, offset) = (self.value(Symbol::Mu, joint), self.value(Symbol::O, joint));
        let on = |link: bool, value: f64| if link == at_link { value } else { 0.0 };
        let mismatch = |symbol: &str| 1.0 + self.of_effect("motor_mismatch", symbol, joint);
        JointValues {
            gain: gain * mismatch("dk_pwm"),
            inertia: self.value(Symbol::B, joint) * mismatch("db"),
            coulomb: on(false, coulomb),
            viscous: back_emf * mismatch("dk_mi") + on(false, rubbing) + self.of_effect("viscous_friction", "v", joint),
            offset: on(false, offset) - self.of_effect("torque_offset", "o", joint),
            stiffness: self.value(Symbol::KS, joint),
            damping: self.value(Symbol::DS, joint),
            link_coulomb: on(true, coulomb) + self.of_effect("link_friction", "mu_l", joint),
            link_viscous: on(true, rubbing) + self.of_effect("link_friction", "v_l", joint),
            link_offset: on(true, offset),
            link_spring: self.of_effect("cable_spring", "k_c", joint),
            link_preload: self.of_effect("cable_spring", "preload", joint),
            drag: self.of_effect("quadratic_drag", "c", joint),
            cubic: self.of_effect("belt_hardening", "k3", joint),
            half_gap: self.of_effect("backlash", "h", joint),
            // tanh(κ v / 2) = 0.99
            slides_at: 5.3 / slope_s,
        }
    }

    /// The bodies in the axes of their joints, with everything that parameters add to them; the last one without its outer part, where that moves.
    pub(super) fn bodies(&self) -> (Vec<Moments>, Option<Moments>) {
        let (robot, model) = (self.calibrated.robot(), self.calibrated.model());
        let mut bodies: Vec<Moments> = robot.joints.iter().map(|joint| Moments::of(&joint.body)).collect();
        for (joint, body) in bodies.iter_mut().enumerate() {
            let (axis, more) = (Vector3::from(robot.joints[joint].axis), self.value(Symbol::J, joint));
            match robot.joints[joint].kind {
                JointKind::Revolute => body.about_origin += axis * axis.transpose() * more,
                JointKind::Prismatic => body.mass_kg += more,
            }
            body.first += Vector3::from_fn(|axis, _| self.value(Symbol::FirstMoment { axis }, joint));
        }
        let mut outer = None;
        for law in model.laws() {
            if let Some((part, _)) = law.structure()
                && let Some(last) = bodies.last_mut()
            {
                let part = Moments::of(&part);
                *last = last.plus(&part, -1.0);
                outer = Some(part);
            }
        }
        for (index, law) in model.laws().iter().enumerate() {
            if let Some(payload) = law.payload() {
                let mass_kg = model.coordinates().of_law(index, self.calibrated.z())[payload.mass];
                let at = Vector3::from(payload.at_m);
                let mass = Moments { mass_kg, first: at * mass_kg, about_origin: steiner(mass_kg, at) };
                let outermost = payload.joint + 1 == bodies.len();
                match outer.as_mut().filter(|_| outermost) {
                    Some(outer) => *outer = outer.plus(&mass, 1.0),
                    None => bodies[payload.joint] = bodies[payload.joint].plus(&mass, 1.0),
                }
            }
        }
        (bodies, outer)
    }

    /// Largest torque of the speeds at 1 rad/s (m/s) on all joints, within their limits, N m (N); and of gravity.
    pub(super) fn largest_torques(&self) -> [f64; 2] {
        let robot = self.calibrated.robot();
        let n = robot.joints.len();
        let chain = robot.chain().with_coriolis(true);
        let (mut still, mut moving) = (vec![0.0; n], vec![0.0; n]);
        let mut largest = [0.0f64; 2];
        // Points that fill the joints' ranges evenly.
        for k in 0..500 {
            let share = |i: usize| (0.5 + f64::from(k) * (i as f64 + 2.0).sqrt()).fract();
            let within = |(i, joint): (usize, &crate::robot::Joint)| {
                joint.limits[0] + share(i) * (joint.limits[1] - joint.limits[0])
            };
            let q: Vec<f64> = robot.joints.iter().enumerate().map(within).collect();
            let qd: Vec<f64> = (0..n).map(|i| if (k + i as i32) % 3 == 0 { -1.0 } else { 1.0 }).collect();
            chain.gravity_torque(&q, &mut still);
            chain.bias_torque(&q, &qd, &mut moving);
            let has_gravity = chain.has_gravity();
            for (still, moving) in still.iter().zip(&moving) {
                let gravity = if has_gravity { *still } else { 0.0 };
                largest = [largest[0].max((moving - gravity).abs()), largest[1].max(gravity.abs())];
            }
        }
        largest
    }
}
