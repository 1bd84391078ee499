//! From raw codes to SI: here the samples of a device become rows of a recording.

use std::f64::consts::TAU;

use protocol::{Flags, Hello, Sample, Side};

use crate::recording::{Row, Tick};
use crate::robot::{ChannelKind, InputUnit, Robot};

/// Why the device is not the robot of the description.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ScaleError {
    /// Other numbers of joints or sensors.
    #[error("the device has {device} {what}, the description of {robot} has {description}")]
    Count {
        /// Joints, encoders or gyros.
        what: &'static str,
        /// By the handshake.
        device: usize,
        /// By the description.
        description: usize,
        /// The robot described.
        robot: String,
    },
    /// A described sensor that the device does not have.
    #[error("the description has the channel {channel}, which the device does not send")]
    Missing {
        /// Its name in results.
        channel: String,
    },
    /// A number that both sides know and that is not the same.
    #[error("{what} of {of} is {device} on the device and {description} in the description")]
    Differs {
        /// Which number, with its unit.
        what: &'static str,
        /// Which sensor or part.
        of: String,
        /// By the handshake.
        device: f64,
        /// By the description.
        description: f64,
    },
    /// The description wants another input than a duty.
    #[error("the device takes duties, the description of {robot} has inputs in another unit")]
    Input {
        /// The robot described.
        robot: String,
    },
    /// The encoders have no zero yet.
    #[error("the device has no zero positions")]
    NotZeroed,
}

impl ScaleError {
    /// What the user can do about it.
    pub fn advice(&self) -> &'static str {
        match self {
            Self::NotZeroed => "hold the robot in its marked pose and add --set-zero",
            Self::Input { .. } | Self::Missing { .. } | Self::Count { .. } => {
                "name the description of the robot that is connected with --robot"
            }
            Self::Differs { .. } => {
                "correct the description (--robot), or store it on the device (`host robot push`): both must tell the truth"
            }
        }
    }
}

/// Where a channel's value comes from.
#[derive(Debug, Clone, Copy)]
enum Origin {
    Encoder { index: usize, zero: i32, per_count: f64 },
    Gyro { index: usize, axis: usize, rad_s_per_lsb: f64, saturated_at: u16 },
}

/// Turns samples of one device into rows for one robot.
#[derive(Debug)]
pub struct Scales {
    origins: Vec<Origin>,
    zero: Vec<f64>,
    duty: Vec<f64>,
    values: Vec<f64>,
}

impl Scales {
    /// Puts handshake and description side by side.
    ///
    /// # Errors
    /// [`ScaleError`] if they do not tell of the same robot, or the zero positions are not known.
    pub fn new(hello: &Hello, robot: &Robot) -> Result<Self, ScaleError> {
        let name = || robot.name.clone();
        if robot.input.unit != InputUnit::Duty {
            return Err(ScaleError::Input { robot: name() });
        }
        let zero = hello.zero.as_ref().ok_or(ScaleError::NotZeroed)?;
        let channels = robot.channels();
        let is_position = |kind| matches!(kind, ChannelKind::MotorPosition { .. } | ChannelKind::LinkPosition { .. });
        for (what, device, description) in [
            ("joints", hello.layout.joints(), robot.joints.len()),
            ("encoders", hello.layout.encoders(), channels.iter().filter(|c| is_position(c.kind)).count()),
            ("gyros", hello.layout.gyros(), robot.gyros().count()),
        ] {
            if device != description {
                return Err(ScaleError::Count { what, device, description, robot: name() });
            }
        }
        agree("the period (s)", "the tick", f64::from(hello.tick_us) * 1e-6, robot.sample_period_s)?;
        let mut origins = Vec::new();
        let mut zero_rad = Vec::new();
        for channel in channels {
            let missing = || ScaleError::Missing { channel: channel.name.clone() };
            let origin = match channel.kind {
                ChannelKind::MotorPosition { joint } | ChannelKind::LinkPosition { joint } => {
                    let motor = matches!(channel.kind, ChannelKind::MotorPosition { .. });
                    let side = if motor { Side::Motor } else { Side::Link };
                    let wanted = |e: &protocol::EncoderInfo| usize::from(e.joint) == joint && e.side == side;
                    let index = hello.encoders.iter().position(wanted).ok_or_else(missing)?;
                    let encoder = &hello.encoders[index];
                    if motor {
                        agree("the gear", &channel.name, encoder.gear, robot.joints[joint].gear)?;
                    }
                    if let Some(counts) = counts_per_turn(robot, joint, motor) {
                        let device = f64::from(encoder.counts_per_turn.unsigned_abs());
                        agree("the counts per turn", &channel.name, device, f64::from(counts))?;
                    }
                    agree_offset(&channel, encoder.offset_us)?;
                    let per_count = TAU / (f64::from(encoder.counts_per_turn) * encoder.gear);
                    // Hello::validate has held the lists to one length.
                    let zero = zero.get(index).copied().ok_or_else(missing)?;
                    zero_rad.push(f64::from(zero) * per_count);
                    Origin::Encoder { index, zero, per_count }
                }
                ChannelKind::GyroAxis { gyro: index, body, axis } => {
                    let gyro = hello.gyros.get(index).ok_or_else(missing)?;
                    agree("the body (from 0)", &channel.name, f64::from(gyro.body), body as f64)?;
                    agree_offset(&channel, gyro.offset_us)?;
                    Origin::Gyro { index, axis, rad_s_per_lsb: gyro.rad_s_per_lsb, saturated_at: gyro.saturated_at }
                }
                ChannelKind::MotorSpeed { .. } | ChannelKind::LinkSpeed { .. } => return Err(missing()),
            };
            origins.push(origin);
        }
        Ok(Self { duty: vec![0.0; robot.joints.len()], values: vec![f64::NAN; origins.len()], zero: zero_rad, origins })
    }

    /// Angle of each encoder that is taken off to give absolute angles, rad or m, in channel order.
    pub fn zero(&self) -> &[f64] {
        &self.zero
    }

    /// A sample in SI. What has no valid reading in this tick is NaN: stale sensors, saturated axes.
    pub fn row(&mut self, seq: u64, t_us: u64, sample: &Sample) -> Row<'_> {
        for (duty, raw) in self.duty.iter_mut().zip(&sample.duty) {
            // Through the decimal fraction, so that 0.15 is the nearest double to 0.15.
            *duty = f64::from(raw.0) / f64::from(protocol::Duty::FULL);
        }
        for (value, origin) in self.values.iter_mut().zip(&self.origins) {
            *value = origin.value(sample);
        }
        let tick = Tick {
            flags: sample.flags.bits(),
            execution_us: f64::from(sample.execution_us()),
            jitter_us: f64::from(sample.jitter_us),
            gyro_ages_us: sample.gyro_ages.map(|age| age.us().map_or(f64::NAN, f64::from)),
        };
        Row { t_us, seq, phase: sample.phase, tick, duty: &self.duty, values: &self.values }
    }
}

impl Origin {
    fn value(&self, sample: &Sample) -> f64 {
        match *self {
            Self::Encoder { index, zero, per_count } => {
                if sample.flags.contains(Flags::ENCODER_STALE) {
                    return f64::NAN;
                }
                // The count wraps, its distance from zero does not.
                f64::from(sample.encoders[index].wrapping_sub(zero)) * per_count
            }
            Self::Gyro { index, axis, rad_s_per_lsb, saturated_at } => {
                let word = sample.gyros[index][axis];
                let saturated = word.unsigned_abs() >= saturated_at;
                if saturated || sample.flags.contains(Flags::gyro_stale(index)) {
                    return f64::NAN;
                }
                f64::from(word) * rad_s_per_lsb
            }
        }
    }
}

fn counts_per_turn(robot: &Robot, joint: usize, motor: bool) -> Option<u32> {
    use crate::robot::Sensor;
    robot.sensors.iter().find_map(|sensor| match sensor {
        Sensor::MotorEncoder(e) if motor && e.joint == joint => e.counts_per_turn,
        Sensor::LinkEncoder(e) if !motor && e.joint == joint => e.counts_per_turn,
        _ => None,
    })
}

fn agree_offset(channel: &crate::robot::Channel, offset_us: u16) -> Result<(), ScaleError> {
    // A microsecond is the handshake's step.
    if (f64::from(offset_us) * 1e-6 - channel.offset_s).abs() < 1e-6 {
        return Ok(());
    }
    agree("the sampling offset (s)", &channel.name, f64::from(offset_us) * 1e-6, channel.offset_s)
}

/// The same number on both sides, within 10⁻⁶ of it.
fn agree(what: &'static str, of: &str, device: f64, description: f64) -> Result<(), ScaleError> {
    if (device - description).abs() <= 1e-6 * description.abs() {
        return Ok(());
    }
    Err(ScaleError::Differs { what, of: of.to_owned(), device, description })
}
