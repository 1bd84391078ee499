//! The parameters of the plant, and a random draw of them around a description file.
//!
//! An effect is a change of some of these parameters.

use host::robot::{Friction, InputUnit, Robot, Sensor, Side, Symbol, Transmission};
use nalgebra::{Matrix3, Rotation3, Vector3};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::chain::{Chain, Link};
use super::memory::{Onset, SlipStack};
use super::outsider::Outsider;
use super::sensors::{EncoderTruth, GyroTruth};

/// Free parameters of a drawn machine lie within this share of what the file calls usual.
const FREE_SPREAD: f64 = 0.15;
/// Fixed parameters of the file are wrong by up to this share.
const FIXED_SPREAD: f64 = 0.2;
/// Usual bending of bristles times the file's slope: 0.1 mrad at 400 s/rad.
const BENDING: f64 = 0.04;
/// Speed above which presliding is not damped any more, times the file's slope: 3 mrad/s at 400 s/rad.
const MICRO_SPEED: f64 = 1.2;

/// All parameters of the plant.
#[derive(Debug, Clone)]
pub struct Machine {
    /// Bodies; the first [`bearings`](Self::bearings) joints are passive.
    pub chain: Chain,
    /// Springs and dampers of the passive joints.
    pub bearings: Vec<Bearing>,
    /// Scale of the Coriolis torques: 1, or 0 where a controller cancels them.
    pub coriolis: f64,
    /// Drives, one a joint.
    pub joints: Vec<Drive>,
    /// What one unit of input is in the unit of the torque constants.
    pub supply: f64,
    /// Sag of the supply, per N m of motor torque times duty.
    pub sag: f64,
    /// Time constant of the sag, s.
    pub sag_lag_s: f64,
    /// Dead time of the input, s.
    pub input_delay_s: f64,
    /// Time constant of the windings' current, s; zero is none.
    pub current_lag_s: f64,
    /// Largest motor torque, N m.
    pub torque_limit: f64,
    /// Encoders in the order of the robot's channels.
    pub encoders: Vec<EncoderTruth>,
    /// Gyros in the order of the file.
    pub gyros: Vec<GyroTruth>,
    /// A law that the catalogue does not contain.
    pub outsider: Option<Outsider>,
}

/// A passive joint: k φ (1 + h (φ/0.02)²) + d φ̇.
#[derive(Debug, Clone, Copy)]
pub struct Bearing {
    /// N m/rad.
    pub stiffness: f64,
    /// N m s/rad.
    pub damping: f64,
    /// h: what 0.02 rad add to the stiffness, as a share.
    pub hardening: f64,
}

/// One drive; torques on the link side of the gear.
#[derive(Debug, Clone)]
pub struct Drive {
    /// Motor radians per radian (or metre) of the link.
    pub gear: f64,
    /// Torque per unit of [`Machine::supply`] times input.
    pub gain: f64,
    /// Torque per speed lost in the winding, N m s/rad.
    pub back_emf: f64,
    /// Motor inertia, kg m².
    pub inertia: f64,
    /// Constant torque, N m.
    pub offset: f64,
    /// A sin(p n θ + φ) with a second harmonic: A in N m, p n in 1/rad, φ in rad.
    pub ripple: [f64; 3],
    /// Duty that moves nothing.
    pub dead_zone: f64,
    /// Friction of the motor.
    pub friction: Rubbing,
    /// The elastic transmission; none where the joint is rigid.
    pub belt: Option<Belt>,
    /// What loads the link.
    pub load: Load,
}

/// Friction of a motor.
#[derive(Debug, Clone)]
pub struct Rubbing {
    /// μ, N m.
    pub coulomb: f64,
    /// Viscous, N m s/rad.
    pub viscous: f64,
    /// How it builds up.
    pub onset: Onset,
    /// Speed above which presliding is not damped any more, rad/s.
    pub micro_speed: f64,
    /// What sticking adds to μ, N m; the speed over which that is lost, rad/s; the exponent of the loss.
    pub stiction: [f64; 3],
    /// Half differences by direction: N m and N m s/rad.
    pub asymmetry: [f64; 2],
    /// Share that a N m of transmitted torque adds, 1/(N m).
    pub per_load: f64,
    /// a cos(θ − φ) with a second harmonic: a as a share, φ in rad.
    pub wave: [f64; 2],
    /// Share that a cold machine adds, and the time constant, s.
    pub warm_up: [f64; 2],
}

/// An elastic transmission.
#[derive(Debug, Clone, Copy)]
pub struct Belt {
    /// N m/rad.
    pub stiffness: f64,
    /// N m s/rad.
    pub damping: f64,
    /// Cubic part at small windup, N m/rad³.
    pub hardening: f64,
    /// Windup at which half of the cubic part is lost, rad.
    pub saturation: f64,
    /// Half gap, rad.
    pub half_gap: f64,
    /// Share by which the two sides differ in stiffness.
    pub slack: f64,
    /// Slipping springs beside it.
    pub slip: SlipStack,
}

/// What loads a link.
#[derive(Debug, Clone)]
pub struct Load {
    /// N m.
    pub coulomb: f64,
    /// N m s/rad.
    pub viscous: f64,
    /// How its friction builds up.
    pub onset: Onset,
    /// N m s²/rad².
    pub drag: f64,
    /// G sin(q + q₀): N m and rad.
    pub gravity: [f64; 2],
    /// N m/rad.
    pub spring: f64,
}

/// Agreement of a drawn machine with its file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Fidelity {
    /// Only free parameters differ. Friction has the file's law.
    TrueToFile,
    /// Fixed parameters are wrong as well, and friction has another law.
    WrongWorld,
}

/// True values of parameters of the file, by their names.
pub type BaseTruth = Vec<(String, f64)>;

impl Machine {
    /// A machine without effects, drawn around a description.
    pub fn draw(robot: &Robot, fidelity: Fidelity, rng: &mut ChaCha8Rng) -> (Self, BaseTruth) {
        let is_wrong = fidelity == Fidelity::WrongWorld;
        let mut around = |value: f64, spread: f64| value * (1.0 + rng.random_range(-spread..spread));
        let mut truth: BaseTruth = Vec::new();
        for spec in robot.parameters() {
            let value = match spec.symbol {
                Symbol::Bias { .. } => spec.value.simulated + around(0.003, 1.0),
                Symbol::Misalignment { .. } => around(0.03, 1.0) - 0.03,
                Symbol::Zero => around(2e-3, 1.0) - 2e-3,
                _ if spec.value.free => around(spec.value.simulated, FREE_SPREAD),
                _ if is_wrong => around(spec.value.start, FIXED_SPREAD),
                _ => spec.value.start,
            };
            truth.push((spec.name.clone(), value));
        }
        let mut links: Vec<Link> = robot.joints.iter().map(Link::of).collect();
        for link in links.iter_mut().filter(|_| is_wrong) {
            let (mass, inertia) = (around(1.0, FIXED_SPREAD), around(1.0, FIXED_SPREAD));
            (link.mass, link.inertia) = (mass * link.mass, inertia * link.inertia);
        }
        let value = |symbol: Symbol, joint: usize| {
            let name = robot.joint_parameter(symbol, joint).map(|spec| &spec.name);
            name.and_then(|name| truth.iter().find(|(known, _)| known == name)).map_or(0.0, |(_, value)| *value)
        };
        let joints = robot.joints.iter().enumerate().map(|(j, joint)| {
            let by_voltage = matches!(robot.input.unit, InputUnit::Duty | InputUnit::Volt);
            let file_slope = match joint.friction {
                Friction::Coulomb { slope_s, .. } => slope_s,
                Friction::None => 400.0,
            };
            let onset = if is_wrong { draw_onset(file_slope, rng) } else { Onset::Smooth { slope: file_slope } };
            let stiffness = value(Symbol::KS, j);
            Drive {
                gear: joint.gear,
                gain: match robot.input.unit {
                    InputUnit::Duty | InputUnit::Volt => value(Symbol::KPwm, j),
                    InputUnit::Ampere => value(Symbol::KT, j),
                    InputUnit::NewtonMetre | InputUnit::Newton => 1.0,
                },
                back_emf: if by_voltage { value(Symbol::KMi, j) } else { 0.0 },
                inertia: value(Symbol::B, j),
                offset: -value(Symbol::O, j),
                ripple: [0.0; 3],
                dead_zone: 0.0,
                friction: Rubbing {
                    coulomb: value(Symbol::Mu, j),
                    viscous: value(Symbol::V, j),
                    onset,
                    micro_speed: MICRO_SPEED / file_slope,
                    stiction: [0.0, 0.1, 1.0],
                    asymmetry: [0.0; 2],
                    per_load: 0.0,
                    wave: [0.0; 2],
                    warm_up: [0.0, 30.0],
                },
                belt: (joint.transmission == Transmission::Elastic).then_some(Belt {
                    stiffness,
                    damping: value(Symbol::DS, j),
                    hardening: 0.0,
                    saturation: 1.0,
                    half_gap: 0.0,
                    slack: 0.0,
                    slip: SlipStack::default(),
                }),
                load: Load {
                    coulomb: 0.0,
                    viscous: 0.0,
                    onset: Onset::Bristles { bending: BENDING / file_slope },
                    drag: 0.0,
                    gravity: [0.0; 2],
                    spring: 0.0,
                },
            }
        });
        let machine = Self {
            joints: joints.collect(),
            chain: Chain { links, gravity: Vector3::from(robot.gravity_m_s2) },
            bearings: Vec::new(),
            coriolis: if robot.coriolis { 1.0 } else { 0.0 },
            supply: robot.input.scale,
            sag: 0.0,
            sag_lag_s: 2e-3,
            input_delay_s: 0.0,
            current_lag_s: 0.0,
            torque_limit: f64::INFINITY,
            encoders: encoders(robot, &truth),
            gyros: gyros(robot, &truth),
            outsider: None,
        };
        (machine, truth)
    }

    /// Adds two passive joints about x and y of the base before the first joint.
    pub fn stand_on(&mut self, bearings: [Bearing; 2]) {
        let axes = [Vector3::x(), Vector3::y()];
        self.chain.links.splice(0..0, axes.map(Link::massless));
        self.bearings = bearings.to_vec();
    }
}

/// An onset of friction that is not the file's: another slope, bristles, or slipping elements. Lengths follow from the file's slope, so that they
/// suit radians and metres.
fn draw_onset(file_slope: f64, rng: &mut ChaCha8Rng) -> Onset {
    let length = BENDING / file_slope * rng.random_range(-1.0_f64..1.0).exp();
    match rng.random_range(0..3) {
        0 => Onset::Smooth { slope: file_slope * rng.random_range(-1.2_f64..1.2).exp() },
        1 => Onset::Bristles { bending: length },
        _ => Onset::Slip { reach: 4.0 * length },
    }
}

fn find(truth: &BaseTruth, name: &str) -> f64 {
    truth.iter().find(|(known, _)| known == name).map_or(0.0, |(_, value)| *value)
}

fn encoders(robot: &Robot, truth: &BaseTruth) -> Vec<EncoderTruth> {
    let of_side = |side: Side| {
        let mut encoders: Vec<EncoderTruth> = robot
            .sensors
            .iter()
            .filter_map(|sensor| match sensor {
                Sensor::MotorEncoder(encoder) if side == Side::Motor => {
                    Some((encoder, robot.joints[encoder.joint].gear))
                }
                Sensor::LinkEncoder(encoder) if side == Side::Link => Some((encoder, 1.0)),
                _ => None,
            })
            .map(|(encoder, gear)| {
                EncoderTruth::new(side, encoder, gear, find(truth, &format!("zero[{}]", encoder.joint + 1)))
            })
            .collect();
        encoders.sort_by_key(|encoder| encoder.joint);
        encoders
    };
    [of_side(Side::Motor), of_side(Side::Link)].concat()
}

fn gyros(robot: &Robot, truth: &BaseTruth) -> Vec<GyroTruth> {
    let of_axes = |symbol: &str, gyro: usize| {
        Vector3::from(["x", "y", "z"].map(|axis| find(truth, &format!("{symbol}{}[{axis}]", gyro + 1))))
    };
    let gyro = |(index, gyro): (usize, &host::robot::Gyro)| {
        let nominal = Matrix3::from_fn(|i, j| gyro.rotation[i][j]);
        let turned = Rotation3::new(of_axes("R_imu", index));
        GyroTruth::new(gyro, nominal * turned.matrix(), of_axes("bias", index))
    };
    robot.gyros().enumerate().map(gyro).collect()
}
