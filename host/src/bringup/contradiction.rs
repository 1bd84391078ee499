//! What does not fit together, in a sentence, with what to do and a picture of the wire.

use std::fmt;

use protocol::Fault;

use super::mounting::Turn;

/// A contradiction between the robot that stands there and what firmware and description say. Indices are from 0.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Contradiction {
    /// Nothing moves.
    #[error("motor {joint} does not move at a duty of {duty:.2}: no encoder counts, no gyro turns", joint = joint + 1)]
    NothingMoves {
        /// The joint that was jogged.
        joint: usize,
        /// The largest duty tried.
        duty: f64,
    },
    /// The joint turns, and its encoder dithers by a count.
    #[error(
        "one phase of encoder {joint} is open: the joint turns by {turned_rad:.3} rad, its count goes to and fro by {span}",
        joint = joint + 1
    )]
    OpenPhase {
        /// The joint.
        joint: usize,
        /// By the gyros, rad.
        turned_rad: f64,
        /// Counts.
        span: i32,
    },
    /// The joint turns, and its encoder does not count.
    #[error("encoder {joint} does not count: the joint turns by {turned_rad:.3} rad, its count stands", joint = joint + 1)]
    NoCounts {
        /// The joint.
        joint: usize,
        /// By the gyros, rad.
        turned_rad: f64,
    },
    /// Another encoder counts.
    #[error(
        "encoders {} and {} are swapped: motor {joint} turns joint {joint}, and encoder {} counts", low(*joint, *other), high(*joint, *other),
        other + 1, joint = joint + 1
    )]
    EncodersSwapped {
        /// The joint that was jogged.
        joint: usize,
        /// The encoder that counts.
        other: usize,
    },
    /// Another joint turns.
    #[error(
        "motors {} and {} are swapped: the driver of motor {joint} turns joint {}", low(*joint, *other), high(*joint, *other), other + 1,
        joint = joint + 1
    )]
    MotorsSwapped {
        /// The joint that was jogged.
        joint: usize,
        /// The one that turns.
        other: usize,
    },
    /// Another encoder counts, and no gyro tells which joint turns.
    #[error(
        "encoders or motors {} and {} are swapped: a jog of motor {joint} makes encoder {} count, and no gyro tells which joint turns",
        low(*joint, *other), high(*joint, *other), other + 1, joint = joint + 1
    )]
    Swapped {
        /// The joint that was jogged.
        joint: usize,
        /// The encoder that counts.
        other: usize,
    },
    /// The encoder counts the wrong way.
    #[error("encoder {joint} counts backwards: its phases are swapped, or its counts per turn need the other sign", joint = joint + 1)]
    EncoderReversed {
        /// The joint.
        joint: usize,
    },
    /// The motor turns the wrong way.
    #[error("motor {joint} turns backwards: its leads are swapped", joint = joint + 1)]
    LeadsReversed {
        /// The joint.
        joint: usize,
    },
    /// One of the two, and no gyro tells which.
    #[error(
        "joint {joint} goes against its duty: the leads of motor {joint} or the phases of encoder {joint} are swapped",
        joint = joint + 1
    )]
    WrongWay {
        /// The joint.
        joint: usize,
    },
    /// The counts are by a factor of edges off.
    #[error(
        "encoder {joint} has {factor} times the counts per turn that firmware and description say ({said}): {}; measured {measured:.3} times",
        counts_cause(*factor), joint = joint + 1
    )]
    Counts {
        /// The joint.
        joint: usize,
        /// The nearest factor of edges.
        factor: f64,
        /// What was measured.
        measured: f64,
        /// Counts per turn by the handshake.
        said: u32,
    },
    /// The gear is another one.
    #[error(
        "the gear of joint {joint} is about {gear:.2}, and firmware and description say {said}: encoder and gyro differ by a factor of {measured:.3}",
        joint = joint + 1
    )]
    Gear {
        /// The joint.
        joint: usize,
        /// What encoder and gyro make of it.
        gear: f64,
        /// By the handshake.
        said: f64,
        /// The encoder's way over the gyro's.
        measured: f64,
    },
    /// A gyro feels joints that do not carry it, or does not feel those that do.
    #[error(
        "gyro {gyro} does not sit on the body behind joint {body}: it {} when joint {joint} does",
        if *turns { "turns" } else { "stands still" }, gyro = gyro + 1, body = body + 1, joint = joint + 1
    )]
    GyroElsewhere {
        /// The gyro.
        gyro: usize,
        /// The body that it should sit on.
        body: usize,
        /// The joint that was jogged.
        joint: usize,
        /// Whether it turns.
        turns: bool,
    },
    /// A gyro is turned.
    #[error("gyro {gyro} is turned by {turn}{}", if *or_mirrored { ", or mirrored: one axis tells no more" } else { "" }, gyro = gyro + 1)]
    GyroTurned {
        /// The gyro.
        gyro: usize,
        /// From where the description has it.
        turn: Turn,
        /// A wrong sign of one axis would look the same.
        or_mirrored: bool,
    },
    /// A gyro's axes are no rotation of what they should be.
    #[error("gyro {gyro} is mirrored: its axes have the signs and places {axes}, which no rotation gives", gyro = gyro + 1)]
    GyroMirrored {
        /// The gyro.
        gyro: usize,
        /// What stands on its axes x, y, z.
        axes: String,
    },
    /// A gyro stands askew.
    #[error("gyro {gyro} stands askew: the axis of joint {joint} is {degrees:.0}° away from where the description has it", gyro = gyro + 1, joint = joint + 1)]
    GyroAskew {
        /// The gyro.
        gyro: usize,
        /// The joint that differs most.
        joint: usize,
        /// By how much, degrees.
        degrees: f64,
    },
    /// The device stopped a jog, and the sensors do not tell why.
    #[error("the device stopped a jog of joint {joint}: {fault}", joint = joint + 1)]
    Fault {
        /// The joint.
        joint: usize,
        /// Why.
        fault: Fault,
    },
}

fn low(a: usize, b: usize) -> usize {
    a.min(b) + 1
}

fn high(a: usize, b: usize) -> usize {
    a.max(b) + 1
}

fn counts_cause(factor: f64) -> &'static str {
    if factor < 1.0 {
        "not all four edges are counted, or the encoder is another one"
    } else {
        "edges are counted that the figure leaves out, or the encoder is another one"
    }
}

impl Contradiction {
    /// What the user can do about it.
    pub fn advice(&self) -> &'static str {
        match self {
            Self::NothingMoves { .. } => {
                "is the motors' supply on, the driver enabled, and the joint free? Check the leads from driver to motor"
            }
            Self::OpenPhase { .. } => {
                "measure both phases from the plug to the counter while the joint is turned by hand"
            }
            Self::NoCounts { .. } => "check plug, supply and both phases of that encoder, and whether its pulley turns",
            Self::EncodersSwapped { .. } => "plug the two encoders into each other's place",
            Self::MotorsSwapped { .. } => "connect the two motors to each other's driver",
            Self::Swapped { .. } => {
                "turn each joint by hand under `host watch`: if its own encoder counts, swap the motors, else the encoders"
            }
            Self::EncoderReversed { .. } => "swap phases A and B of that encoder",
            Self::LeadsReversed { .. } => "swap the two leads of that motor",
            Self::WrongWay { .. } => {
                "turn the joint in its positive direction by hand under `host watch`: if the angle falls, swap the phases, else the leads"
            }
            Self::Counts { .. } => {
                "give firmware and description the counts of all four edges in one turn of the motor"
            }
            Self::Gear { .. } => "count teeth and pulleys, and give firmware and description that gear",
            Self::GyroElsewhere { .. } => {
                "are the two gyros swapped? Connect each to its bus, or correct the firmware's robot"
            }
            Self::GyroTurned { .. } => {
                "turn the chip, or give that mounting to the firmware's robot and the description; --blank takes the mounting as it is"
            }
            Self::GyroMirrored { .. } => "correct order and signs of its axes in the firmware's driver",
            Self::GyroAskew { .. } => {
                "give the chip's mounting to the firmware's robot and the description as a rotation"
            }
            Self::Fault { .. } => "remove the cause; the firmware's README lists what each fault means",
        }
    }

    /// A picture of the wires that it is about; empty if it is about none.
    pub fn picture(&self) -> String {
        let picture = Picture(self);
        picture.to_string()
    }
}

/// The wires of a contradiction.
struct Picture<'a>(&'a Contradiction);

impl fmt::Display for Picture<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self.0 {
            Contradiction::NothingMoves { joint, .. } => {
                let n = joint + 1;
                write!(f, "  driver {n} ──x?──▶ motor {n} ──▶ joint {n} ──▶ encoder {n} ──▶ counter {n}: stands")
            }
            Contradiction::OpenPhase { joint, .. } => {
                let n = joint + 1;
                write!(
                    f,
                    "  encoder {n}  A ────▶ counter {n}: n, n+1, n, n+1 …\n             B ─x x▶ one of the two is open"
                )
            }
            Contradiction::NoCounts { joint, .. } => {
                let n = joint + 1;
                write!(f, "  encoder {n}  A ─x x▶ counter {n}: stands\n             B ─x x▶")
            }
            Contradiction::EncodersSwapped { joint, other } | Contradiction::Swapped { joint, other } => {
                let (a, b) = (low(joint, other), high(joint, other));
                write!(f, "  encoder {a} ──╲ ╱──▶ counter {a}\n             ╳\n  encoder {b} ──╱ ╲──▶ counter {b}")
            }
            Contradiction::MotorsSwapped { joint, other } => {
                let (a, b) = (low(joint, other), high(joint, other));
                write!(f, "  driver {a} ──╲ ╱──▶ motor {a}\n            ╳\n  driver {b} ──╱ ╲──▶ motor {b}")
            }
            Contradiction::EncoderReversed { joint } => {
                let n = joint + 1;
                write!(f, "  encoder {n}  A ──╲ ╱──▶ A  counter {n}\n               ╳\n             B ──╱ ╲──▶ B")
            }
            Contradiction::LeadsReversed { joint } | Contradiction::WrongWay { joint } => {
                let n = joint + 1;
                write!(f, "  driver {n}  + ──╲ ╱──▶ +  motor {n}\n              ╳\n            − ──╱ ╲──▶ −")
            }
            Contradiction::Counts { joint, .. } | Contradiction::Gear { joint, .. } => {
                let n = joint + 1;
                write!(
                    f,
                    "  motor {n} ──▶ encoder {n} ──▶ counter {n}   ? counts per turn\n     └──▶ gear {n} ──▶ joint {n} ──▶ gyro       ? gear"
                )
            }
            Contradiction::GyroTurned { gyro, .. }
            | Contradiction::GyroMirrored { gyro, .. }
            | Contradiction::GyroAskew { gyro, .. } => {
                let n = gyro + 1;
                write!(
                    f,
                    "        z │  y\n  gyro {n}  │ ╱   ? which way do its axes point on the body\n          └── x"
                )
            }
            Contradiction::GyroElsewhere { .. } => {
                write!(f, "  gyro 1 ──╲ ╱──▶ bus 1\n            ╳\n  gyro 2 ──╱ ╲──▶ bus 2")
            }
            Contradiction::Fault { .. } => Ok(()),
        }
    }
}
