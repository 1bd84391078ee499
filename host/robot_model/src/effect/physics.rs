//! What an effect does inside a plant: the hooks along the line of quantities, and what they are told.

use super::Past;
use crate::robot::{Body, Side, Symbol, Vector3};

/// What an effect does to the quantities of the equations. Each method's default leaves them as they are.
///
/// Torques are on the link side of the gear, N m (N on a sliding joint).
pub trait Physics: Send + std::fmt::Debug {
    // What the robot is made of.

    /// Passive joints through the origin of the base frame, before the robot's first.
    fn base_joints(&self) -> &[PassiveJoint] {
        &[]
    }

    /// The part of the outermost body that gives way.
    fn structure(&self) -> Option<&Structure> {
        None
    }

    /// The body that joint `joint` moves.
    fn body(&self, _joint: usize, body: Body) -> Body {
        body
    }

    /// The true value of a parameter of joint `joint`.
    fn parameter(&self, _symbol: Symbol, _joint: usize, value: f64) -> f64 {
        value
    }

    /// By what the Coriolis and centrifugal torques are scaled: 0 without them, 1 with them.
    fn coriolis(&self, scale: f64) -> f64 {
        scale
    }

    // Time and memory.

    /// The step of an explicit Euler integration that takes the place of the plant's own, s.
    fn euler_step_s(&self) -> Option<f64> {
        None
    }

    /// How far back it wants to look into the [`Past`], s.
    fn memory_s(&self) -> f64 {
        0.0
    }

    /// How many states of its own it has; they are zero while the robot rests.
    fn states(&self) -> usize {
        0
    }

    /// Rates of its own states.
    fn state_rates(&self, _own: &[f64], _line: &Line<'_>, _out: &mut [f64]) {}

    /// What jumps at a moment in `(from_s, to_s]` after the start of the motion.
    fn jump(&self, _own: &mut [f64], _from_s: f64, _to_s: f64) {}

    // The line.

    /// Input of joint `joint` in the unit of the robot's, mean of the step that begins.
    fn duty(&self, _joint: usize, _past: &Past, duty: f64) -> f64 {
        duty
    }

    /// Supply voltage, V; `supply_v` is what it is without this effect.
    fn supply_v(&self, _drive: &Drive<'_>, supply_v: f64) -> f64 {
        supply_v
    }

    /// Torque of a motor, back-EMF included.
    fn motor_torque(&self, _at: &Moment<'_>, torque: f64) -> f64 {
        torque
    }

    /// Torque of a transmission, positive when it pulls the motor forwards.
    fn transmission_torque(&self, _at: &Moment<'_>, torque: f64) -> f64 {
        torque
    }

    /// Friction of a drive, positive when it holds the motor back. [`Moment::transmitted`] is known here.
    fn friction_torque(&self, _at: &Moment<'_>, torque: f64) -> f64 {
        torque
    }

    /// What loads a link besides inertia, gravity and transmission, positive when it holds the link back.
    fn link_load(&self, _at: &Moment<'_>, load: f64) -> f64 {
        load
    }

    // Sensors.

    /// What an encoder reads, rad or m; `now` is where its side of the joint really stands.
    fn encoder(&self, _side: Side, _joint: usize, _past: &Past, _now: f64, reading: f64) -> f64 {
        reading
    }

    /// What gyro `gyro` sees, rad/s in sensor axes, before bias and noise.
    fn gyro_rate(&self, _own: &[f64], _gyro: usize, rate: Vector3) -> Vector3 {
        rate
    }

    /// What gyro `gyro` puts out, rad/s in sensor axes, bias and noise included. `time_s`: since the start of the motion.
    fn gyro_reading(&self, _time_s: f64, _gyro: usize, reading: Vector3) -> Vector3 {
        reading
    }
}

/// A joint without motor: a spring and a damper.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PassiveJoint {
    /// Unit vector: in base axes for joints of the base, in the body's for those of a structure.
    pub axis: Vector3,
    /// Stiffness, N m/rad.
    pub stiffness: f64,
    /// Damping, N m s/rad.
    pub damping: f64,
}

/// The outermost body in two parts: `outer` moves on passive joints through the origin of the robot's last joint, and
/// carries the sensors.
#[derive(Debug, Clone, PartialEq)]
pub struct Structure {
    /// The part that gives way, in the axes of the whole body, and a part of it.
    pub outer: Body,
    /// The joints on which it does, axes in those of the body.
    pub joints: [PassiveJoint; 2],
}

/// Motors at one moment; one value a joint.
#[derive(Debug, Clone, Copy)]
pub struct Drive<'a> {
    /// Duty, −1 … 1.
    pub duty: &'a [f64],
    /// Motor speed θ̇ on the link side of the gear, rad/s.
    pub speed: &'a [f64],
    /// Torque per volt, N m/V.
    pub k_pwm: &'a [f64],
    /// Torque per speed, N m s/rad.
    pub k_mi: &'a [f64],
}

/// One joint at one moment. A rigid joint has θ = q.
#[derive(Debug, Clone, Copy, Default)]
pub struct Moment<'a> {
    /// Which joint.
    pub joint: usize,
    /// Time since the start of the motion, s.
    pub time_s: f64,
    /// Position of the link, rad or m.
    pub q: f64,
    /// Speed of the link.
    pub qd: f64,
    /// Position of the motor.
    pub theta: f64,
    /// Speed of the motor.
    pub thetad: f64,
    /// Stiffness of the transmission, N m/rad.
    pub k_s: f64,
    /// Damping of the transmission, N m s/rad.
    pub d_s: f64,
    /// Coulomb friction μ of the drive, N m.
    pub mu: f64,
    /// The speed that friction takes, θ̇ or q̇.
    pub friction_speed: f64,
    /// Its sign, smoothed as in equation (12): the base law is μ times this.
    pub friction_sign: f64,
    /// Torque of the transmission with all effects, N m; zero as long as it is not known.
    pub transmitted: f64,
    /// The effect's own states.
    pub own: &'a [f64],
}

/// All joints at one moment.
#[derive(Debug, Clone, Copy)]
pub struct Line<'a> {
    /// Each joint; `own` is empty here.
    pub joints: &'a [Moment<'a>],
    /// Motor torques by equation (11), N m.
    pub motor_torque: &'a [f64],
    /// Angular rate at every gyro in sensor axes, rad/s.
    pub gyro_rates: &'a [Vector3],
}

impl Moment<'_> {
    /// q − θ, rad or m.
    pub fn wind(&self) -> f64 {
        self.q - self.theta
    }

    /// q̇ − θ̇, rad/s or m/s.
    pub fn wind_rate(&self) -> f64 {
        self.qd - self.thetad
    }

    /// Friction of the base law, N m.
    pub fn coulomb(&self) -> f64 {
        self.mu * self.friction_sign
    }
}
