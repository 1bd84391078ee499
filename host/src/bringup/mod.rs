//! Bring-up of a robot: what is connected to what, found by moves too small to do harm.
//!
//! ```text
//!   each joint:  jogs there and back, a little more duty each time, until a few counts or a turn are seen (break-away)
//!                and on until the way is long enough to be measured
//!     ├─ which encoder counts?            order of encoders and motors, open phases
//!     ├─ along the duty?                  phases, leads
//!     ├─ which gyros turn?                which body each sits on
//!     └─ as far as the gyros turn?        gear, counts per turn
//!   each gyro:   the directions in which it saw the joints turn ──▶ its mounting
//! ```
//!
//! It ends at the first [`Contradiction`], or with [`Findings`] that a robot file is written from. A jog is ended by this
//! side once a joint has gone 0.04 rad, and by the firmware after its time, by its watches, or without heartbeats.

mod contradiction;
mod jog;
mod judge;
mod mounting;
mod robot_file;

use protocol::Hello;
use serde::Serialize;

pub use contradiction::Contradiction;
use jog::{Jogger, Response, length};
use judge::{Jogged, MOVED_RAD};
pub use mounting::Turn;
use mounting::{Mounting, Seen, axes, product, turn};
pub use robot_file::{filled_in, written};

use crate::link::{Device, LinkError, ScaleError, Scales};
use crate::robot::{Matrix3, Robot, RobotError};

/// First duty of a joint, and what it grows by until something moves.
const FIRST_DUTY: f64 = 0.01;
const STEP_DUTY: f64 = 0.005;
/// The largest.
const MAX_DUTY: f64 = 0.15;
/// Length of a jog, and of the last one of a joint that does not move, ms.
const JOG_MS: u8 = 100;
const LAST_JOG_MS: u8 = 200;
/// A way that is long enough to be measured, rad.
const ENOUGH_RAD: f64 = 0.015;
/// Fewest counts in that way.
const FEWEST_COUNTS: f64 = 8.0;

/// Why a bring-up did not come to its end.
#[derive(Debug, thiserror::Error)]
pub enum BringUpError {
    /// The device or the line.
    #[error(transparent)]
    Link(#[from] LinkError),
    /// Device and description are not the same robot.
    #[error("device and robot description disagree")]
    Scale(#[from] ScaleError),
    /// The description cannot be used, or what was found cannot be written into it.
    #[error(transparent)]
    Robot(#[from] RobotError),
    /// An encoder that small moves do not show.
    #[error("encoder {} has {counts_per_rad:.0} counts a radian: too few for a bring-up by small moves", encoder + 1)]
    Coarse {
        /// Which, from 0.
        encoder: usize,
        /// What it has.
        counts_per_rad: f64,
    },
    /// The first thing that does not fit.
    #[error(transparent)]
    Contradiction(#[from] Contradiction),
}

/// What a bring-up has found.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Findings {
    /// Name of the robot by its description.
    pub robot: String,
    /// Joints, from the base outwards.
    pub joints: Vec<JointFound>,
    /// Gyros in the sample's order.
    pub gyros: Vec<GyroFound>,
}

/// What is known of a joint.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct JointFound {
    /// Its name.
    pub joint: String,
    /// Smallest duty at which it went on, −1 … 1.
    pub break_away_duty: f64,
    /// Way by the encoder over the turn by the gyros behind it; none where no gyro sees the joint.
    pub encoder_over_gyro: Option<f64>,
}

/// What is known of a gyro.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct GyroFound {
    /// Rotation from body axes to sensor axes.
    pub rotation: Matrix3,
    /// How it is turned from where the description had it, in words; none if it is not.
    pub turned: Option<String>,
    /// Words at rest, rad/s in the sensor's axes.
    pub bias_rad_s: [f64; 3],
    /// What the moves do not tell, in words.
    pub unknown: Option<String>,
}

/// What is told while a bring-up runs.
#[derive(Debug)]
pub enum News<'a> {
    /// A joint is jogged with a duty.
    Jog {
        /// From 0.
        joint: usize,
        /// −1 … 1.
        duty: f64,
    },
    /// A joint has no contradiction.
    Joint(&'a JointFound),
}

/// Brings a robot up that was [settled](Device::settle). `blank`: the description knows nothing of the gyros' mountings.
///
/// # Errors
/// [`BringUpError`]; no motor is driven any more.
pub fn bring_up(
    device: &mut Device,
    robot: &Robot,
    blank: bool,
    mut tell: impl FnMut(News<'_>),
) -> Result<Findings, BringUpError> {
    agrees(device.hello(), robot)?;
    let expected = mounting::expected(robot);
    let mut jogger = Jogger::new(device)?;
    let hello = jogger.hello().clone();
    let (mut joints, mut seen) = (Vec::new(), vec![Vec::new(); hello.gyros.len()]);
    for (index, joint) in robot.joints.iter().enumerate() {
        let (jogged, break_away_duty) = wiggle(&mut jogger, index, &mut tell)?;
        let judged = jogged.judge(robot, &hello, &expected, !blank)?;
        for (all, new) in seen.iter_mut().zip(judged.seen) {
            all.extend(new);
        }
        let encoder_over_gyro = judged.encoder_over_gyro;
        let found = JointFound { joint: joint.name.clone(), break_away_duty, encoder_over_gyro };
        tell(News::Joint(&found));
        joints.push(found);
    }
    let biases = jogger.biases_rad_s();
    let mut gyros = Vec::new();
    for (index, ((gyro, seen), bias_rad_s)) in robot.gyros().zip(&seen).zip(biases).enumerate() {
        let (rotation, turned) = mounted(index, gyro.rotation, seen, blank)?;
        gyros.push(GyroFound { rotation, turned, bias_rad_s, unknown: unknown(robot, seen) });
    }
    Ok(Findings { robot: robot.name.clone(), joints, gyros })
}

/// Whether device and description tell of the same robot, and small moves can be seen.
fn agrees(hello: &Hello, robot: &Robot) -> Result<(), BringUpError> {
    // Zero positions are not needed here.
    let zero = hello.encoders.iter().map(|_| 0).collect();
    Scales::new(&Hello { zero: Some(zero), ..hello.clone() }, robot)?;
    for (encoder, info) in hello.encoders.iter().enumerate() {
        let counts_per_rad = f64::from(info.counts_per_turn).abs() * info.gear.abs() / std::f64::consts::TAU;
        if counts_per_rad * ENOUGH_RAD < FEWEST_COUNTS {
            return Err(BringUpError::Coarse { encoder, counts_per_rad });
        }
    }
    Ok(())
}

/// Jogs a joint until its way can be measured, there and back; with the duty at which it broke away.
fn wiggle(jogger: &mut Jogger<'_>, joint: usize, tell: &mut impl FnMut(News<'_>)) -> Result<(Jogged, f64), LinkError> {
    let (mut duty, mut sign) = (FIRST_DUTY, 1.0);
    let mut break_away: Option<f64> = None;
    loop {
        let last = duty >= MAX_DUTY;
        tell(News::Jog { joint, duty: sign * duty });
        let response = jogger.jog(joint, sign * duty, if last { LAST_JOG_MS } else { JOG_MS })?;
        let reach = reach(&response);
        if reach >= ENOUGH_RAD {
            tell(News::Jog { joint, duty: -sign * duty });
            let back = jogger.jog(joint, -sign * duty, if last { LAST_JOG_MS } else { JOG_MS })?;
            let jogged = Jogged::new(joint, duty, &[(sign, response), (-sign, back)]);
            return Ok((jogged, break_away.unwrap_or(duty)));
        }
        if last || response.fault.is_some() {
            return Ok((Jogged::new(joint, duty, &[(sign, response)]), break_away.unwrap_or(duty)));
        }
        if reach >= MOVED_RAD {
            let from = *break_away.get_or_insert(duty) - STEP_DUTY;
            // What is beyond friction moves it; at most twice as much as last time.
            let growth = (1.2 * ENOUGH_RAD / reach).clamp(1.2, 2.0);
            duty = from + (duty - from) * growth;
        } else {
            duty += STEP_DUTY;
        }
        duty = duty.min(MAX_DUTY);
        sign = -sign;
    }
}

/// The farthest that any sensor tells of.
fn reach(response: &Response) -> f64 {
    let turned = response.turned.iter().map(|turned| length(*turned));
    response.moved.iter().map(|moved| moved.abs()).chain(turned).fold(0.0, f64::max)
}

/// The rotation of a gyro, and how it is turned from where it should be.
fn mounted(
    gyro: usize,
    described: Matrix3,
    seen: &[Seen],
    blank: bool,
) -> Result<(Matrix3, Option<String>), Contradiction> {
    match mounting::judge(seen) {
        Mounting::AsDescribed => Ok((described, None)),
        Mounting::Turned { by, .. } if blank => Ok((product(&by, &described), Some(turn(&by).to_string()))),
        Mounting::Turned { by, or_mirrored } => Err(Contradiction::GyroTurned { gyro, turn: turn(&by), or_mirrored }),
        Mounting::Mirrored { by } => Err(Contradiction::GyroMirrored { gyro, axes: axes(&by) }),
        Mounting::Askew { joint, degrees } => Err(Contradiction::GyroAskew { gyro, joint, degrees }),
    }
}

/// What the joints that a gyro saw do not tell of its mounting.
fn unknown(robot: &Robot, seen: &[Seen]) -> Option<String> {
    let Some(first) = seen.first() else { return Some("no joint turns it: its mounting is as described".to_owned()) };
    let name = &robot.joints[first.joint].name;
    let parallel = |other: &Seen| mounting::dot(first.expected, other.expected).abs() > 0.9;
    seen.iter().all(parallel).then(|| format!("only {name} turns it: how it is turned about that axis is as described"))
}
