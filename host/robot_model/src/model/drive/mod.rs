//! What drives one joint: input → motor torque → friction → transmission, generic over the scalar.
//!
//! ```text
//! u ─▶ τ_m = G U u − k_mi θ̇ ─▶ − τ_f = 2 μ (1/(1+exp(−κ v)) − ½) + o ─▶ b θ̈ = τ_c + τ_m − τ_f  (7), (11), (12)
//!                                                                    τ_c = k_s (q − θ) + d_s (q̇ − θ̇)  (6)
//! ```
//! Where the input is no voltage, viscous friction v stands in the place of k_mi. o is a constant torque, zero unless the robot has one.
//! Laws of effects are asked at the quantities that they may change, on the same way.

pub(super) mod lanes;
mod local;

use crate::model::law::{Asked, At, Hook, Law};
use crate::model::number::quantity::Quantity;
use crate::model::parameters::{Coordinates, Source};
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
    offset: Source,
    stiffness: Source,
    damping: Source,
    /// The viscous term is friction, and holds the link back.
    viscous_at_link: bool,
    /// What its speed takes is back-EMF, not viscous friction.
    by_voltage: bool,
}

/// Positions and speeds of both sides of one transmission, and the input.
#[derive(Debug, Clone, Copy)]
pub(super) struct Sides<T> {
    pub q: T,
    pub qd: T,
    pub theta: T,
    pub thetad: T,
    /// In the unit of the robot's input.
    pub u: T,
}

/// What a drive does: (M) q̈ + … = torque on its link, and beside it, for elastic joints θ̈, for rigid ones b, which moves with the link.
#[derive(Debug, Clone, Copy)]
pub(super) struct Action<T> {
    /// −τ_c of elastic joints, τ_m − τ_f of rigid ones.
    pub link_torque: T,
    /// θ̈ of elastic joints, b of rigid ones.
    pub motor: T,
}

/// The coefficients of a drive that its equations are linear in.
#[derive(Debug, Clone, Copy)]
pub(super) struct Coefficients<T> {
    /// 1/b for elastic drives, b for rigid ones.
    pub(super) inertia: T,
    /// G, k_mi (or v), μ, o: divided by b for elastic drives.
    pub(super) torque_constant: T,
    pub(super) back_emf: T,
    pub(super) coulomb: T,
    pub(super) stiffness: T,
    pub(super) damping: T,
    /// See G.
    pub(super) offset: T,
}

impl<T: Copy> Coefficients<T> {
    /// Number of coefficients.
    pub(super) const COUNT: usize = 7;

    /// As a list.
    pub(super) fn to_array(self) -> [T; 7] {
        [self.inertia, self.torque_constant, self.back_emf, self.coulomb, self.stiffness, self.damping, self.offset]
    }

    /// From a list.
    pub(super) fn from_array(
        [inertia, torque_constant, back_emf, coulomb, stiffness, damping, offset]: [T; 7],
    ) -> Self {
        Coefficients { inertia, torque_constant, back_emf, coulomb, stiffness, damping, offset }
    }
}

impl Drive {
    pub(super) fn of(robot: &Robot, coordinates: &Coordinates, joint: usize) -> Self {
        let source = |symbol| coordinates.source(robot, symbol, joint);
        let friction = robot.joints[joint].friction;
        let by_voltage = matches!(robot.input.unit, InputUnit::Duty | InputUnit::Volt);
        Drive {
            input_scale: robot.input.scale,
            by_voltage,
            viscous_at_link: !by_voltage && matches!(friction, Friction::Coulomb { acts: Side::Link, .. }),
            friction,
            torque_constant: match robot.input.unit {
                InputUnit::Duty | InputUnit::Volt => source(Symbol::KPwm),
                InputUnit::Ampere => source(Symbol::KT),
                InputUnit::NewtonMetre | InputUnit::Newton => Source::Known(1.0),
            },
            back_emf: match robot.input.unit {
                InputUnit::Duty | InputUnit::Volt => source(Symbol::KMi),
                InputUnit::Ampere | InputUnit::NewtonMetre | InputUnit::Newton => source(Symbol::V),
            },
            inertia: source(Symbol::B),
            coulomb: source(Symbol::Mu),
            offset: source(Symbol::O),
            stiffness: source(Symbol::KS),
            damping: source(Symbol::DS),
        }
    }

    /// Whether nothing but back-EMF and Coulomb friction holds it back, and both the motor.
    pub(super) fn is_plain(&self) -> bool {
        self.offset == Source::Known(0.0) && !self.rubs_at_link()
    }

    /// Whether friction holds the link back.
    fn rubs_at_link(&self) -> bool {
        matches!(self.friction, Friction::Coulomb { acts: Side::Link, .. })
    }

    /// What is lost at a speed by back-EMF or viscous friction, on the motor and on the link, over b for elastic drives.
    #[inline(always)]
    fn viscous<T: Quantity>(&self, back_emf: T, s: &Sides<T>) -> (T, T) {
        let zero = T::from(0.0);
        if self.viscous_at_link { (zero, back_emf * s.qd) } else { (back_emf * s.thetad, zero) }
    }

    /// The coefficients of this drive at the solver coordinates `z`.
    pub(super) fn coefficients<T: Quantity>(&self, z: &[T], transmission: Transmission) -> Coefficients<T> {
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
                    offset: self.offset.over_inertia(z, inverse),
                }
            }
            Transmission::Rigid => Coefficients {
                inertia: self.inertia.value(z),
                torque_constant: self.torque_constant.value(z),
                back_emf: self.back_emf.value(z),
                coulomb: self.coulomb.value(z),
                stiffness: T::from(0.0),
                damping: T::from(0.0),
                offset: self.offset.value(z),
            },
        }
    }

    /// The speed that friction takes, and τ_f / μ, equation (12).
    #[inline(always)]
    fn slip<T: Quantity>(&self, s: &Sides<T>) -> (T, T) {
        match self.friction {
            Friction::None => (s.thetad, T::from(0.0)),
            Friction::Coulomb { speed: Side::Motor, slope_s, .. } => (s.thetad, sigmoid(s.thetad * slope_s)),
            Friction::Coulomb { speed: Side::Link, slope_s, .. } => (s.qd, sigmoid(s.qd * slope_s)),
        }
    }

    /// Equations (6), (7), (11), (12) of an elastic joint.
    #[inline(always)]
    pub(super) fn elastic<T: Quantity>(&self, c: &Coefficients<T>, s: &Sides<T>) -> Action<T> {
        let torque = c.stiffness * (s.q - s.theta) + c.damping * (s.qd - s.thetad);
        let driven = c.inertia * torque + c.torque_constant * (s.u * self.input_scale);
        let friction = c.coulomb * self.slip(s).1 + c.offset;
        let (at_motor, at_link) = self.viscous(c.back_emf, s);
        if self.rubs_at_link() {
            let load = (friction + at_link) * c.inertia.recip();
            return Action { link_torque: -(torque + load), motor: driven - at_motor };
        }
        Action { link_torque: -torque, motor: driven - at_motor - friction }
    }

    /// Equations (11), (12) of a rigid joint, where θ = q.
    #[inline(always)]
    pub(super) fn rigid<T: Quantity>(&self, c: &Coefficients<T>, s: &Sides<T>) -> Action<T> {
        let torque = c.torque_constant * (s.u * self.input_scale)
            - c.back_emf * s.thetad
            - c.coulomb * self.slip(s).1
            - c.offset;
        Action { link_torque: torque, motor: c.inertia }
    }

    /// The same with laws: `volts` is what one unit of input is worth, and the laws' own states get their rates in `rates`.
    #[inline(always)]
    pub(super) fn with_laws<T: Asked>(
        &self,
        transmission: Transmission,
        c: &Coefficients<T>,
        s: &Sides<T>,
        volts: T,
        joint: &JointLaws<'_, T>,
        rates: &mut [T],
    ) -> Action<T> {
        let elastic = transmission == Transmission::Elastic;
        // Laws are told physical parameters; an elastic drive's are divided by b.
        let b = if elastic { c.inertia.recip() } else { c.inertia };
        let physical = |value: T| if elastic { value * b } else { value };
        let zero = T::from(0.0);
        let (friction_speed, friction_sign) = self.slip(s);
        let mut at = At {
            joint: joint.joint,
            time_s: joint.time_s,
            q: s.q,
            qd: s.qd,
            theta: s.theta,
            thetad: s.thetad,
            driving: zero,
            k_mi: physical(c.back_emf),
            mu: physical(c.coulomb),
            k_s: c.stiffness,
            d_s: c.damping,
            friction_speed,
            friction_sign,
            transmitted: zero,
            parameters: &[],
            own: zero,
        };
        let u = joint.ask(Hook::Input, &mut at, s.u);
        at.driving = physical(c.torque_constant) * (u * volts);
        let (viscous, viscous_load) = self.viscous(at.k_mi, s);
        let by_voltage = at.driving - viscous;
        let motor = joint.ask(Hook::MotorTorque, &mut at, by_voltage);
        if elastic {
            let spring = at.k_s * at.wind() + at.d_s * at.wind_rate();
            at.transmitted = joint.ask(Hook::Transmission, &mut at, spring);
        } else {
            // Its gear carries what the motor gives, but for what turns the rotor. Viscous friction is none of what it gives, back-EMF is.
            at.transmitted = if self.by_voltage { -motor } else { -(motor + viscous) };
        }
        let coulomb = at.coulomb();
        let friction = joint.ask(Hook::Friction, &mut at, coulomb) + physical(c.offset);
        let load = joint.ask(Hook::LinkLoad, &mut at, zero);
        let b = joint.ask(Hook::MotorInertia, &mut at, b);
        joint.rates(&mut at, rates);
        if elastic {
            let (friction, load) =
                if self.rubs_at_link() { (zero, load + friction + viscous_load) } else { (friction, load) };
            let motor = (at.transmitted + motor - friction) * b.recip();
            Action { link_torque: -(at.transmitted + load), motor }
        } else {
            Action { link_torque: motor - friction - viscous_load - load, motor: b }
        }
    }
}

/// The laws that have something to say at one joint, with their parameters and states.
#[derive(Debug, Clone, Copy)]
pub(super) struct JointLaws<'a, T> {
    pub joint: usize,
    pub time_s: T,
    pub laws: &'a [JointLaw<'a>],
    /// Of all laws, one after the other.
    pub parameters: &'a [T],
    /// Own states of all laws that have one.
    pub states: &'a [T],
}

/// One law at one joint.
#[derive(Debug, Clone, Copy)]
pub(super) struct JointLaw<'a> {
    pub law: &'a dyn Law,
    /// Its parameters among those of the joint.
    pub first: usize,
    pub count: usize,
    /// Its state among those of the joint.
    pub state: Option<usize>,
}

impl<'a, T: Asked> JointLaws<'a, T> {
    /// A quantity after all laws.
    #[inline(always)]
    fn ask(&self, hook: Hook, at: &mut At<'a, T>, without: T) -> T {
        let mut quantity = without;
        for law in self.laws {
            if law.law.hooks().contains(&hook) {
                self.turn_to(law, at);
                quantity = T::ask(law.law, hook, at, quantity);
            }
        }
        quantity
    }

    #[inline(always)]
    fn rates(&self, at: &mut At<'a, T>, rates: &mut [T]) {
        for law in self.laws {
            if let Some(state) = law.state {
                self.turn_to(law, at);
                rates[state] = T::ask(law.law, Hook::StateRate, at, T::from(0.0));
            }
        }
    }

    /// Shows a law what is its own.
    #[inline(always)]
    fn turn_to(&self, law: &JointLaw<'_>, at: &mut At<'a, T>) {
        at.parameters = &self.parameters[law.first..law.first + law.count];
        if let Some(state) = law.state {
            at.own = self.states[state];
        }
    }
}

/// 2 (1/(1+exp(−a)) − ½) = tanh(a/2), which never overflows: at 4 rad/s the printed exponential does, and its derivative is not a number.
#[inline(always)]
fn sigmoid<T: Quantity>(a: T) -> T {
    (a * 0.5).tanh()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::number::quantity::variable;
    use crate::robot::chain::Lanes;

    #[test]
    fn the_sigmoid_and_its_slope_are_finite_at_any_speed() {
        for a in [-1e6, -1500.0, -3.0, -1e-9, 0.0, 1e-9, 0.7, 1500.0, 1e6] {
            let value: Lanes<1> = sigmoid(variable(a, 0));
            let slope = 0.5 / (0.5 * a).cosh().powi(2);
            // atol 1e-14 for what cancels far from zero
            assert!((value.re - (0.5 * a).tanh()).abs() <= 1e-14, "{a}: {value:?}");
            assert!((value.slope[0] - slope).abs() <= 1e-14, "{a}: {value:?} against slope {slope}");
        }
    }
}
