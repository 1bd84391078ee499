//! The measured columns of a recording, named once for files and results.

use super::{JointKind, Robot, Sensor, Side};

/// One measured column.
#[derive(Debug, Clone, PartialEq)]
pub struct Channel {
    /// What it measures.
    pub kind: ChannelKind,
    /// Column name in a CSV table, as `theta1` or `g2x`.
    pub column: String,
    /// Name in results, as `encoder1` or `gyro2.x`.
    pub name: String,
    /// Unit of its values.
    pub unit: &'static str,
    /// Standard deviation of one value, in `unit`.
    pub sigma: f64,
    /// When it is read after the start of the tick, s.
    pub offset_s: f64,
}

/// What a channel measures. Joints, bodies, gyros and axes are 0-based.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ChannelKind {
    /// Motor position θ on the link side of the gear.
    MotorPosition {
        /// The joint.
        joint: usize,
    },
    /// Link position q.
    LinkPosition {
        /// The joint.
        joint: usize,
    },
    /// One axis of a gyro.
    GyroAxis {
        /// Which gyro.
        gyro: usize,
        /// The body it sits on.
        body: usize,
        /// Sensor axis: 0 x, 1 y, 2 z.
        axis: usize,
    },
    /// Motor speed θ̇ on the link side of the gear.
    MotorSpeed {
        /// The joint.
        joint: usize,
    },
    /// Link speed q̇.
    LinkSpeed {
        /// The joint.
        joint: usize,
    },
}

impl Channel {
    fn of_joint(robot: &Robot, kind: ChannelKind, sigma: f64, offset_s: f64) -> Self {
        let (joint, column, name, is_speed) = match kind {
            ChannelKind::MotorPosition { joint } => (joint, "theta", "encoder", false),
            ChannelKind::LinkPosition { joint } => (joint, "q", "link_encoder", false),
            ChannelKind::MotorSpeed { joint } => (joint, "thd", "tachometer", true),
            ChannelKind::LinkSpeed { joint } => (joint, "qd", "link_tachometer", true),
            ChannelKind::GyroAxis { .. } => unreachable!("gyro axes are named by the gyro"),
        };
        let unit = match (robot.joints[joint].kind, is_speed) {
            (JointKind::Revolute, false) => "rad",
            (JointKind::Revolute, true) => "rad/s",
            (JointKind::Prismatic, false) => "m",
            (JointKind::Prismatic, true) => "m/s",
        };
        let number = joint + 1;
        Self { kind, column: format!("{column}{number}"), name: format!("{name}{number}"), unit, sigma, offset_s }
    }
}

/// Motor encoders by joint, link encoders by joint, gyros in file order, tachometers by joint (motor side first).
pub(super) fn channels(robot: &Robot) -> Vec<Channel> {
    let mut motor = Vec::new();
    let mut link = Vec::new();
    let mut gyros = Vec::new();
    let mut motor_speed = Vec::new();
    let mut link_speed = Vec::new();
    for sensor in &robot.sensors {
        match sensor {
            Sensor::MotorEncoder(e) => {
                let kind = ChannelKind::MotorPosition { joint: e.joint };
                motor.push((e.joint, Channel::of_joint(robot, kind, e.sigma, e.offset_s)));
            }
            Sensor::LinkEncoder(e) => {
                let kind = ChannelKind::LinkPosition { joint: e.joint };
                link.push((e.joint, Channel::of_joint(robot, kind, e.sigma, e.offset_s)));
            }
            Sensor::Tachometer(t) if t.side == Side::Motor => {
                let kind = ChannelKind::MotorSpeed { joint: t.joint };
                motor_speed.push((t.joint, Channel::of_joint(robot, kind, t.sigma, t.offset_s)));
            }
            Sensor::Tachometer(t) => {
                let kind = ChannelKind::LinkSpeed { joint: t.joint };
                link_speed.push((t.joint, Channel::of_joint(robot, kind, t.sigma, t.offset_s)));
            }
            Sensor::Gyro(_) => {}
        }
    }
    for (gyro, g) in robot.gyros().enumerate() {
        for (axis, letter) in ["x", "y", "z"].into_iter().enumerate() {
            gyros.push(Channel {
                kind: ChannelKind::GyroAxis { gyro, body: g.body, axis },
                column: format!("g{}{letter}", gyro + 1),
                name: format!("gyro{}.{letter}", gyro + 1),
                unit: "rad/s",
                sigma: g.sigma_rad_s,
                offset_s: g.offset_s,
            });
        }
    }
    let by_joint = |mut columns: Vec<(usize, Channel)>| {
        columns.sort_by_key(|(joint, _)| *joint);
        columns.into_iter().map(|(_, channel)| channel)
    };
    by_joint(motor)
        .chain(by_joint(link))
        .chain(gyros)
        .chain(by_joint(motor_speed))
        .chain(by_joint(link_speed))
        .collect()
}
