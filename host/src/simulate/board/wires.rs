//! From the readings at the pins to the robot's channels: which encoder and which gyro is which, and their scales.

use std::f64::consts::TAU;

use firmware::motion::Positions;
use firmware::{GyroInput, Inputs};
use protocol::{EncoderInfo, GyroInfo, MAX_JOINTS, Side};

use super::Board;
use crate::robot::{ChannelKind, Robot};

/// From the pins to the robot's channels.
pub(in crate::simulate) struct Wires {
    /// Motor encoder of each joint.
    motor_encoders: Vec<usize>,
    /// Scale of each of them, counts per rad or m.
    pub counts_per_unit: [f32; MAX_JOINTS],
    channels: Vec<Wire>,
}

/// One channel's scale.
enum Wire {
    Encoder { index: usize, per_count: f64 },
    Gyro { index: usize, axis: usize, info: GyroInfo },
}

impl Wires {
    /// The wires of a robot on its board.
    pub fn new(robot: &Robot, board: &Board) -> Self {
        let encoders = board.world().encoder_infos();
        let find = |joint: usize, side| {
            encoders.iter().position(|encoder| usize::from(encoder.joint) == joint && encoder.side == side)
        };
        let counts = |encoder: &EncoderInfo| f64::from(encoder.counts_per_turn) * encoder.gear / TAU;
        let motor_encoders: Vec<usize> = (0..robot.joints.len()).filter_map(|joint| find(joint, Side::Motor)).collect();
        let mut counts_per_unit = [1.0; MAX_JOINTS];
        for (scale, &encoder) in counts_per_unit.iter_mut().zip(&motor_encoders) {
            *scale = counts(&encoders[encoder]) as f32;
        }
        let encoder = |joint, side| find(joint, side).map(|index| (index, 1.0 / counts(&encoders[index])));
        // The world has refused robots with other sensors.
        let wire = |kind| match kind {
            ChannelKind::MotorPosition { joint } => encoder(joint, Side::Motor),
            ChannelKind::LinkPosition { joint } => encoder(joint, Side::Link),
            _ => None,
        };
        let channels = robot.channels().into_iter().filter_map(|channel| match channel.kind {
            ChannelKind::GyroAxis { gyro, axis, .. } => {
                Some(Wire::Gyro { index: gyro, axis, info: board.world().gyro_infos()[gyro] })
            }
            kind => wire(kind).map(|(index, per_count)| Wire::Encoder { index, per_count }),
        });
        Self { channels: channels.collect(), motor_encoders, counts_per_unit }
    }

    /// Counts of each joint from the marked pose, in which the robot was switched on.
    pub fn positions(&self, inputs: &Inputs) -> Positions {
        let mut positions = [0; MAX_JOINTS];
        for (position, &encoder) in positions.iter_mut().zip(&self.motor_encoders) {
            *position = inputs.encoders[encoder].unwrap_or(0);
        }
        positions
    }

    /// Every channel in SI; NaN without a valid reading.
    pub fn values(&self, inputs: &Inputs) -> Vec<f64> {
        let value = |wire: &Wire| match wire {
            Wire::Encoder { index, per_count } => {
                inputs.encoders[*index].map_or(f64::NAN, |counts| f64::from(counts) * per_count)
            }
            Wire::Gyro { index, axis, info } => match inputs.gyros[*index] {
                GyroInput::Words(words) if words[*axis].unsigned_abs() < info.saturated_at => {
                    f64::from(words[*axis]) * info.rad_s_per_lsb
                }
                _ => f64::NAN,
            },
        };
        self.channels.iter().map(value).collect()
    }
}
