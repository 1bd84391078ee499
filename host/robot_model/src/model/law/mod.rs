//! What an effect adds to the base model, written for an estimator: smooth, with exact derivatives, few parameters.
//!
//! A law changes quantities of one joint on their way from the input to the accelerations ([`Hook`]); it reads that joint alone, so that
//! derivatives are taken by a dozen local variables and scattered from there. What couples joints or the chain's inertia is said by the
//! other methods of [`Law`], and the model does it.
//!
//! ```text
//! u ─Input▶ supply ▶ driving torque ─MotorTorque▶ ─Transmission▶ ─Friction▶ ─LinkLoad▶ (M) q̈, ─MotorInertia▶ b θ̈ ─▶ Gyro, Position
//! ```

mod clues;
mod parameters;

pub use clues::{Clues, JointClues, Readings};
pub use parameters::{Form, LawCoordinate, LawResult, Of, Parameters, unit_at};
// What the macros of this file expand to, also in other crates.
#[doc(hidden)]
pub use solve::simd::compiled_for_this_machine;

use std::sync::Arc;

use super::number::expression::Expression;
use super::number::quantity::Quantity;
use crate::robot::chain::Lanes;
use crate::robot::{Body, Side, Vector3};

/// Few local variables: with its value such a number has 128 bytes, the most that compilers move without a call.
pub(super) const FEW: usize = 15;
/// As many as two laws at one joint have, or a curve beside one: six vectors with the value.
pub(super) const SOME: usize = 23;
/// Many local variables.
pub(super) const MANY: usize = 32;
/// Derivatives of few local variables …
pub type Narrow = Lanes<FEW>;
/// … of some …
pub type Middling = Lanes<SOME>;
/// … and of many.
pub type Broad = Lanes<MANY>;

/// A quantity of one joint that a law may change.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Hook {
    /// u, in the unit of the robot's input.
    Input,
    /// τ_m, N m.
    MotorTorque,
    /// b, kg m².
    MotorInertia,
    /// τ_c, positive when it pulls the motor forwards.
    Transmission,
    /// τ_f, positive when it holds the motor back. [`At::transmitted`] is known here.
    Friction,
    /// What loads the link, positive when it holds the link back.
    LinkLoad,
    /// Rate of the law's own state at this joint.
    StateRate,
}

/// The low-pass of a gyro, `(1 − g T s) / (1 + T s)` of its body's rate: the reading is ω_f + g (ω_f − ω) of a state T ω̇_f = ω − ω_f.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LowPass {
    /// Which of the law's coordinates is ln T, T in s.
    pub coordinate: usize,
    /// g; 0 of a filter of first order.
    pub beyond: f64,
}

/// One joint as a law sees it. A rigid joint has θ = q.
#[derive(Debug, Clone, Copy)]
pub struct At<'a, T> {
    /// Which joint.
    pub joint: usize,
    /// Time since the start of the motion, s.
    pub time_s: T,
    /// Position and speed of the link.
    pub q: T,
    /// See q.
    pub qd: T,
    /// Position and speed of the motor.
    pub theta: T,
    /// See θ.
    pub thetad: T,
    /// Torque of the motor at standstill, N m: k_pwm U u.
    pub driving: T,
    /// Back-EMF, N m s/rad.
    pub k_mi: T,
    /// Coulomb friction, N m.
    pub mu: T,
    /// Stiffness of the transmission, N m/rad.
    pub k_s: T,
    /// Its damping, N m s/rad.
    pub d_s: T,
    /// The speed that friction takes, θ̇ or q̇.
    pub friction_speed: T,
    /// Its smooth sign as in equation (12).
    pub friction_sign: T,
    /// Torque of the transmission after all laws, of a rigid joint that of its motor, turned; zero as long as it is not known.
    pub transmitted: T,
    /// The law's parameters at this joint, in the order of [`Law::local`].
    pub parameters: &'a [T],
    /// The law's own state at this joint; zero where it has none.
    pub own: T,
}

impl<T: Quantity> At<'_, T> {
    /// q − θ.
    #[inline(always)]
    pub fn wind(&self) -> T {
        self.q - self.theta
    }

    /// q̇ − θ̇.
    #[inline(always)]
    pub fn wind_rate(&self) -> T {
        self.qd - self.thetad
    }

    /// μ sgn, the base law's friction.
    #[inline(always)]
    pub fn coulomb(&self) -> T {
        self.mu * self.friction_sign
    }
}

/// A joint without motor whose spring and damper are the law's parameters.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PassiveJoint {
    /// Unit vector, in base axes or in those of the outermost body.
    pub axis: Vector3,
    /// Which of the law's coordinates is ln k, N m/rad.
    pub stiffness: usize,
    /// Which is ln d, N m s/rad.
    pub damping: usize,
}

/// A point mass on a body whose mass is a parameter of the law.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Payload {
    /// The body that carries it: that of this joint.
    pub joint: usize,
    /// Where, in that body's axes, m.
    pub at_m: Vector3,
    /// Which of the law's coordinates is its mass, kg.
    pub mass: usize,
}

/// A gyro as a law sees it.
#[derive(Debug, Clone, Copy)]
pub struct GyroAt<'a, T> {
    /// Which gyro.
    pub gyro: usize,
    /// Time since the start of the motion, s.
    pub time_s: T,
    /// The law's parameters at this gyro, in their order.
    pub parameters: &'a [T],
}

/// A position sensor as a law sees it.
#[derive(Debug, Clone, Copy)]
pub struct PositionAt<'a, T> {
    /// Of which joint.
    pub joint: usize,
    /// On which side of its transmission.
    pub side: Side,
    /// How fast that side moves.
    pub speed: T,
    /// By how much of time the compared reading is late already, s: readings are shifted by whole samples.
    pub shifted_s: f64,
    /// The law's parameters at this joint, in their order.
    pub parameters: &'a [T],
}

/// An effect's law. Methods with a default change nothing.
pub trait Law: std::fmt::Debug + Send + Sync {
    /// What is estimated, and how it is told.
    fn parameters(&self) -> &Parameters;

    /// Whether it is nothing most of the time, so that clues show where to start it.
    fn is_event(&self) -> bool {
        false
    }

    /// The same law started from what a recording shows, best first; none where that shows nothing of it.
    fn starts(&self, _clues: &Clues) -> Vec<Arc<dyn Law>> {
        Vec::new()
    }

    /// The same law started from what readings show without any fit, likeliest first; none where it starts from the robot's description.
    fn starts_by_readings(&self, _readings: &Readings) -> Vec<Arc<dyn Law>> {
        Vec::new()
    }

    /// When its event is where it starts, s after the start of the motion; none of laws that have no time.
    fn event_s(&self) -> Option<f64> {
        None
    }

    /// The same law started from an event so much later, s.
    fn later(&self, _by_s: f64) -> Option<Arc<dyn Law>> {
        None
    }

    /// Another shape of the same law with the same results, which a search tries from where this one ends: one with the corners of
    /// [`starts`](Self::starts), which a search from afar would not get over, or a filter of another order. None where there is none.
    fn other_shape(&self) -> Option<Arc<dyn Law>> {
        None
    }

    // Joints.

    /// The quantities of joints that it changes.
    fn hooks(&self) -> &'static [Hook] {
        &[]
    }

    /// Which of its coordinates its hooks at a joint read.
    fn local(&self, joint: usize) -> Vec<usize> {
        self.parameters().of(|of| matches!(of, Of::All) || of == Of::Joint(joint))
    }

    /// Whether it has a state of its own at this joint.
    fn has_state(&self, _joint: usize) -> bool {
        false
    }

    /// How large that state may be, in its unit: what is assumed of one that nothing is known of yet.
    fn state_size(&self, _joint: usize) -> f64 {
        10.0
    }

    /// How far one step of that state may be wrong, in its unit, over 1 ms: as little as a push on the speeds that the process noise allows,
    /// but no less, or a search by linearisation must take small steps.
    fn state_sigma(&self, _joint: usize) -> f64 {
        1e-4
    }

    /// The quantity of a joint after this law.
    fn plain(&self, _hook: Hook, _at: &At<'_, f64>, quantity: f64) -> f64 {
        quantity
    }

    /// The same with derivatives.
    fn narrow(&self, _hook: Hook, _at: &At<'_, Narrow>, quantity: Narrow) -> Narrow {
        quantity
    }

    /// The same with more derivatives.
    fn middling(&self, _hook: Hook, _at: &At<'_, Middling>, quantity: Middling) -> Middling {
        quantity
    }

    /// The same with the most.
    fn broad(&self, _hook: Hook, _at: &At<'_, Broad>, quantity: Broad) -> Broad {
        quantity
    }

    /// The same written down; none of a law that looks at values.
    fn traced(&self, _hook: Hook, _at: &At<'_, Expression>, _quantity: Expression) -> Option<Expression> {
        None
    }

    // What couples joints.

    /// The supply voltage: `full_v` is what the description says, a = Σ k_pwm u² and e = Σ k_mi u θ̇ make the power drawn at a voltage U,
    /// U a − e; `p` is the law's first coordinate. Derivatives by (a, e, p).
    fn supply_v(&self, _full_v: f64, _a: Lanes<3>, _e: Lanes<3>, _p: Lanes<3>) -> Option<Lanes<3>> {
        None
    }

    /// The same written down; none where [`Self::supply_v`] is none.
    fn supply_traced(&self, _full_v: f64, _a: Expression, _e: Expression, _p: Expression) -> Option<Expression> {
        None
    }

    /// The own coordinate that is ln κ of the smoothed sign of Coulomb friction at this joint, where the law changes that.
    fn friction_slope(&self, _joint: usize) -> Option<usize> {
        None
    }

    /// Which of its coordinates is the time by which inputs are late, s.
    fn input_delay(&self) -> Option<usize> {
        None
    }

    /// Passive joints through the origin of the base frame, before the robot's first.
    fn base_joints(&self) -> &[PassiveJoint] {
        &[]
    }

    /// The outer part of the outermost body, and the passive joints on which it moves.
    fn structure(&self) -> Option<(Body, &[PassiveJoint])> {
        None
    }

    /// Which of its coordinates scales the torques of the speeds, Coriolis' and centrifugal.
    fn coriolis(&self) -> Option<usize> {
        None
    }

    /// A mass that the description does not know.
    fn payload(&self) -> Option<Payload> {
        None
    }

    /// Whether the recording was made by an integration in explicit Euler steps.
    fn euler(&self) -> bool {
        false
    }

    // Sensors.

    /// Whether it changes the readings of this gyro.
    fn sees_gyro(&self, _gyro: usize) -> bool {
        false
    }

    /// The low-pass of this gyro.
    fn gyro_lag(&self, _gyro: usize) -> Option<LowPass> {
        None
    }

    /// What a gyro reads, rad/s in sensor axes: from its rate and its bias.
    fn gyro(&self, _at: &GyroAt<'_, Broad>, rate: [Broad; 3], bias: [Broad; 3]) -> [Broad; 3] {
        std::array::from_fn(|axis| rate[axis] + bias[axis])
    }

    /// The same written down; none of a law that looks at values.
    fn gyro_traced(
        &self,
        _at: &GyroAt<'_, Expression>,
        _rate: [Expression; 3],
        _bias: [Expression; 3],
    ) -> Option<[Expression; 3]> {
        None
    }

    /// Whether it changes the readings of a position sensor.
    fn sees_position(&self, _side: Side, _joint: usize) -> bool {
        false
    }

    /// What a position sensor reads.
    fn position(&self, _at: &PositionAt<'_, Narrow>, position: Narrow) -> Narrow {
        position
    }

    /// The same written down; none of a law that looks at values.
    fn position_traced(&self, _at: &PositionAt<'_, Expression>, _position: Expression) -> Option<Expression> {
        None
    }

    /// By how many samples the readings of a position sensor are taken later, for these values of its coordinates.
    fn shift(&self, _side: Side, _joint: usize, _z: &[f64], _period_s: f64) -> i32 {
        0
    }
}

/// The methods of [`Law`] that ask its joints, from one generic `act`, which is `#[inline(always)]`. Of a law that looks at values, those for `numbers`.
#[macro_export]
macro_rules! acts_on_joints {
    () => {
        fn traced(
            &self,
            hook: $crate::model::law::Hook,
            at: &$crate::model::law::At<'_, $crate::model::Expression>,
            quantity: $crate::model::Expression,
        ) -> Option<$crate::model::Expression> {
            Some(self.act(hook, at, quantity))
        }

        $crate::acts_on_joints!(numbers);
    };
    (numbers) => {
        fn plain(&self, hook: $crate::model::law::Hook, at: &$crate::model::law::At<'_, f64>, quantity: f64) -> f64 {
            self.act(hook, at, quantity)
        }

        $crate::acts_on_joints!(narrow by Narrow);
        $crate::acts_on_joints!(middling by Middling);
        $crate::acts_on_joints!(broad by Broad);
    };
    ($method:ident by $scalar:ident) => {
        fn $method(
            &self,
            hook: $crate::model::law::Hook,
            at: &$crate::model::law::At<'_, $crate::model::law::$scalar>,
            quantity: $crate::model::law::$scalar,
        ) -> $crate::model::law::$scalar {
            $crate::model::law::compiled_for_this_machine(
                #[inline(always)]
                || self.act(hook, at, quantity),
            )
        }
    };
}

/// The methods of [`Law`] that ask its gyros, from one generic `read`.
#[macro_export]
macro_rules! reads_gyros {
    () => {
        fn gyro(
            &self,
            at: &$crate::model::law::GyroAt<'_, $crate::model::law::Broad>,
            rate: [$crate::model::law::Broad; 3],
            bias: [$crate::model::law::Broad; 3],
        ) -> [$crate::model::law::Broad; 3] {
            self.read(at, rate, bias)
        }

        fn gyro_traced(
            &self,
            at: &$crate::model::law::GyroAt<'_, $crate::model::Expression>,
            rate: [$crate::model::Expression; 3],
            bias: [$crate::model::Expression; 3],
        ) -> Option<[$crate::model::Expression; 3]> {
            Some(self.read(at, rate, bias))
        }
    };
}

/// The methods of [`Law`] that ask its position sensors, from one generic `read`.
#[macro_export]
macro_rules! reads_positions {
    () => {
        fn position(
            &self,
            at: &$crate::model::law::PositionAt<'_, $crate::model::law::Narrow>,
            position: $crate::model::law::Narrow,
        ) -> $crate::model::law::Narrow {
            self.read(at, position)
        }

        fn position_traced(
            &self,
            at: &$crate::model::law::PositionAt<'_, $crate::model::Expression>,
            position: $crate::model::Expression,
        ) -> Option<$crate::model::Expression> {
            Some(self.read(at, position))
        }
    };
}

/// A scalar that laws can be asked with.
pub(super) trait Asked: Quantity {
    fn ask(law: &dyn Law, hook: Hook, at: &At<'_, Self>, quantity: Self) -> Self;
}

impl Asked for f64 {
    fn ask(law: &dyn Law, hook: Hook, at: &At<'_, Self>, quantity: Self) -> Self {
        law.plain(hook, at, quantity)
    }
}

impl Asked for Expression {
    fn ask(law: &dyn Law, hook: Hook, at: &At<'_, Self>, quantity: Self) -> Self {
        law.traced(hook, at, quantity).unwrap_or_else(Expression::unknown)
    }
}

impl Asked for Narrow {
    fn ask(law: &dyn Law, hook: Hook, at: &At<'_, Self>, quantity: Self) -> Self {
        law.narrow(hook, at, quantity)
    }
}

impl Asked for Middling {
    fn ask(law: &dyn Law, hook: Hook, at: &At<'_, Self>, quantity: Self) -> Self {
        law.middling(hook, at, quantity)
    }
}

impl Asked for Broad {
    fn ask(law: &dyn Law, hook: Hook, at: &At<'_, Self>, quantity: Self) -> Self {
        law.broad(hook, at, quantity)
    }
}
