//! The sensors a robot can carry.

use protocol::description::GyroPart;

use super::{Matrix3, Parameter, Side, Vector3};

/// A sensor. `offset_s` is when it is read after the start of the tick.
#[derive(Debug, Clone, PartialEq)]
pub enum Sensor {
    /// On a motor; its angle is told on the link side of the gear.
    MotorEncoder(Encoder),
    /// On a link.
    LinkEncoder(Encoder),
    /// Speed of a motor or a link.
    Tachometer(Tachometer),
    /// Angular rate of a body about three axes.
    Gyro(Gyro),
}

/// Position of a motor or a link.
#[derive(Debug, Clone, PartialEq)]
pub struct Encoder {
    /// Joint, 0-based.
    pub joint: usize,
    /// Counts per turn of what the encoder sits on (the motor, or the link), if known.
    pub counts_per_turn: Option<u32>,
    /// Standard deviation on the link side of the gear, quantisation included, rad or m.
    pub sigma: f64,
    /// What it reads where its side stands at zero, rad or m, if that is not zero itself; link encoders only.
    pub zero: Option<Parameter>,
    /// By what share of the position it tells too much; link encoders only.
    pub scale_error: Option<Parameter>,
    /// When it is read after the start of the tick, s.
    pub offset_s: f64,
}

/// Speed of a motor (link side of the gear) or a link.
#[derive(Debug, Clone, PartialEq)]
pub struct Tachometer {
    /// Joint, 0-based.
    pub joint: usize,
    /// Whose speed.
    pub side: Side,
    /// Standard deviation on the link side of the gear, rad/s or m/s.
    pub sigma: f64,
    /// When it is read after the start of the tick, s.
    pub offset_s: f64,
}

/// A gyro on a body: reading = R_imu ω_body + bias + noise, with R_imu = nominal · Rot(δ) as in equation (16).
#[derive(Debug, Clone, PartialEq)]
pub struct Gyro {
    /// The body it sits on, named by the joint that moves it, 0-based.
    pub body: usize,
    /// Nominal rotation, body axes → sensor axes.
    pub rotation: Matrix3,
    /// Whether the misalignment δ is estimated (else the nominal rotation is exact).
    pub rotation_free: bool,
    /// Start value of the bias in sensor axes, rad/s.
    pub bias_rad_s: Vector3,
    /// Whether the bias is estimated.
    pub bias_free: bool,
    /// Bias of a simulated gyro of this kind, on average, rad/s.
    pub bias_simulated_rad_s: Vector3,
    /// Standard deviation of one reading, rad/s.
    pub sigma_rad_s: f64,
    /// Full scale, if known, rad/s.
    pub range_rad_s: Option<f64>,
    /// The part that the firmware reads, if the file names it.
    pub part: Option<GyroPart>,
    /// How much later it reads than `offset_s`, its stamps and its known delay say, s, if that is not nothing.
    pub lag_s: Option<Parameter>,
    /// When it is read after the start of the tick, s.
    pub offset_s: f64,
}
