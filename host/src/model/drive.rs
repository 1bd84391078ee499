//! What drives one joint: input → motor torque → friction → transmission, generic over the scalar.
//!
//! ```text
//! u ─▶ τ_m = G U u − k_mi θ̇ ─▶ − τ_f = 2 μ (1/(1+exp(−κ v)) − ½) ─▶ b θ̈ = τ_c + τ_m − τ_f      (7), (11), (12)
//!                                                                    τ_c = k_s (q − θ) + d_s (q̇ − θ̇)  (6)
//! ```

use super::parameters::{Coordinates, Source};
use crate::robot::chain::Scalar;
use crate::robot::{Friction, InputUnit, Robot, Side, Symbol, Transmission};

/// The drive of one joint: its laws and where its parameters come from.
#[derive(Debug, Clone)]
pub(super) struct Drive {
    /// Volts (or what the torque constant multiplies) of one unit of input.
    pub(super) input_scale: f64,
    pub(super) friction: Friction,
    torque_constant: Source,
    back_emf: Source,
    inertia: Source,
    coulomb: Source,
    stiffness: Source,
    damping: Source,
}

/// Positions and speeds of both sides of one transmission, and the input.
#[derive(Debug, Clone, Copy)]
pub(super) struct Sides<T> {
    pub q: T,
    pub qd: T,
    pub theta: T,
    pub thetad: T,
    pub u: f64,
}

/// What an elastic drive does: the torque its belt takes from the link, and the motor's acceleration.
#[derive(Debug, Clone, Copy)]
pub(super) struct ElasticAction<T> {
    /// τ_c, N m: the link equation is M q̈ + … = −τ_c.
    pub transmission_torque: T,
    /// θ̈.
    pub motor_acceleration: T,
}

/// What a rigid drive does to its link: (M + b) q̈ + … = torque.
#[derive(Debug, Clone, Copy)]
pub(super) struct RigidAction<T> {
    /// τ_m − τ_f.
    pub torque: T,
    /// b.
    pub inertia: T,
}

/// The coefficients of a drive that its equations are linear in.
#[derive(Debug, Clone, Copy)]
pub(super) struct Coefficients<T> {
    /// 1/b for elastic drives, b for rigid ones.
    pub(super) inertia: T,
    /// G, k_mi, μ: divided by b for elastic drives.
    pub(super) torque_constant: T,
    pub(super) back_emf: T,
    pub(super) coulomb: T,
    pub(super) stiffness: T,
    pub(super) damping: T,
}

impl<T: Copy> Coefficients<T> {
    /// Number of coefficients.
    pub(super) const COUNT: usize = 6;

    /// As a list.
    pub(super) fn to_array(self) -> [T; 6] {
        [self.inertia, self.torque_constant, self.back_emf, self.coulomb, self.stiffness, self.damping]
    }

    /// From a list.
    pub(super) fn from_array([inertia, torque_constant, back_emf, coulomb, stiffness, damping]: [T; 6]) -> Self {
        Coefficients { inertia, torque_constant, back_emf, coulomb, stiffness, damping }
    }
}

impl Drive {
    pub(super) fn of(robot: &Robot, coordinates: &Coordinates, joint: usize) -> Self {
        let source = |symbol| coordinates.source(robot, symbol, joint);
        Drive {
            input_scale: robot.input.scale,
            friction: robot.joints[joint].friction,
            torque_constant: match robot.input.unit {
                InputUnit::Duty | InputUnit::Volt => source(Symbol::KPwm),
                InputUnit::Ampere => source(Symbol::KT),
                InputUnit::NewtonMetre | InputUnit::Newton => Source::Known(1.0),
            },
            back_emf: source(Symbol::KMi),
            inertia: source(Symbol::B),
            coulomb: source(Symbol::Mu),
            stiffness: source(Symbol::KS),
            damping: source(Symbol::DS),
        }
    }

    /// The coefficients of this drive at the solver coordinates `z`.
    pub(super) fn coefficients<T: Scalar>(&self, z: &[T], transmission: Transmission) -> Coefficients<T> {
        match transmission {
            Transmission::Elastic => {
                let inverse = self.inertia.inverse(z);
                Coefficients {
                    inertia: inverse,
                    torque_constant: self.torque_constant.over_inertia(z, inverse),
                    back_emf: self.back_emf.over_inertia(z, inverse),
                    coulomb: self.coulomb.over_inertia(z, inverse),
                    stiffness: self.stiffness.value(z),
                    damping: self.damping.value(z),
                }
            }
            Transmission::Rigid => Coefficients {
                inertia: self.inertia.value(z),
                torque_constant: self.torque_constant.value(z),
                back_emf: self.back_emf.value(z),
                coulomb: self.coulomb.value(z),
                stiffness: T::from(0.0),
                damping: T::from(0.0),
            },
        }
    }

    /// τ_f / μ, equation (12).
    fn coulomb_sign<T: Scalar>(&self, s: &Sides<T>) -> T {
        match self.friction {
            Friction::None => T::from(0.0),
            Friction::Coulomb { speed: Side::Motor, slope_s } => sigmoid(s.thetad * slope_s),
            Friction::Coulomb { speed: Side::Link, slope_s } => sigmoid(s.qd * slope_s),
        }
    }

    /// Equations (6), (7), (11), (12) of an elastic joint.
    pub(super) fn elastic<T: Scalar>(&self, c: &Coefficients<T>, s: &Sides<T>) -> ElasticAction<T> {
        let transmission_torque = c.stiffness * (s.q - s.theta) + c.damping * (s.qd - s.thetad);
        let motor_acceleration = c.inertia * transmission_torque + c.torque_constant * (self.input_scale * s.u)
            - c.back_emf * s.thetad
            - c.coulomb * self.coulomb_sign(s);
        ElasticAction { transmission_torque, motor_acceleration }
    }

    /// Equations (11), (12) of a rigid joint, where θ = q.
    pub(super) fn rigid<T: Scalar>(&self, c: &Coefficients<T>, s: &Sides<T>) -> RigidAction<T> {
        let torque =
            c.torque_constant * (self.input_scale * s.u) - c.back_emf * s.thetad - c.coulomb * self.coulomb_sign(s);
        RigidAction { torque, inertia: c.inertia }
    }
}

/// 2 (1/(1+exp(−a)) − ½), with an exponential that never overflows: at 4 rad/s the printed one does, and its derivative is not a number.
fn sigmoid<T: Scalar>(a: T) -> T {
    let one = T::from(1.0);
    if a.re() >= 0.0 {
        let e = (-a).exp();
        (one - e) / (one + e)
    } else {
        let e = a.exp();
        (e - one) / (one + e)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use num_dual::Dual64;

    #[test]
    fn the_sigmoid_and_its_slope_are_finite_at_any_speed() {
        for a in [-1e6, -1500.0, -3.0, -1e-9, 0.0, 1e-9, 0.7, 1500.0, 1e6] {
            let value = sigmoid(Dual64::new(a, 1.0));
            let slope = 0.5 / (0.5 * a).cosh().powi(2);
            // rtol 1e-12 with atol 1e-14 for what underflows
            assert!((value.re - (0.5 * a).tanh()).abs() <= 1e-14, "{a}: {value}");
            assert!((value.eps - slope).abs() <= 1e-14 + 1e-12 * slope, "{a}: {value} against slope {slope}");
        }
    }
}
