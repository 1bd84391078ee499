//! The rules of a robot: what holds of every robot that the control core runs, built in or sent by a host.

use protocol::motion::Limits;
use protocol::sample::Layout;
use protocol::{Duty, EncoderInfo, Side};

use crate::config::{ConfigError, GyroSetup, JointSetup, counts_per_unit};
use crate::safety::Axis;

/// Looks whether joints and sensors fit together and the figures can be reckoned with; gives how many there are of each.
///
/// # Errors
/// [`ConfigError`] with the first that does not.
pub fn check(joints: &[JointSetup], encoders: &[EncoderInfo], gyros: &[GyroSetup]) -> Result<Layout, ConfigError> {
    let count = |n: usize| u8::try_from(n).unwrap_or(u8::MAX);
    let layout =
        Layout::new(count(joints.len()), count(encoders.len()), count(gyros.len())).map_err(ConfigError::Layout)?;
    for (index, encoder) in (0..).zip(encoders) {
        if !COUNTS_PER_UNIT.contains(&counts_per_unit(encoder)) {
            return Err(ConfigError::Scale { encoder: index });
        }
        if usize::from(encoder.joint) >= joints.len() {
            return Err(ConfigError::NoSuchJoint { encoder: index });
        }
    }
    for (index, gyro) in (0..).zip(gyros) {
        let GyroSetup { info, mount, give_rad, sag_rad } = gyro;
        if !(info.rad_s_per_lsb.is_normal() && (0.0..1.0).contains(&info.rad_s_per_lsb)) {
            return Err(ConfigError::GyroScale { gyro: index });
        }
        if usize::from(info.body) >= joints.len() {
            return Err(ConfigError::NoSuchBody { gyro: index });
        }
        if !mount.iter().all(is_unit) {
            return Err(ConfigError::Mount { gyro: index });
        }
        if ![give_rad, sag_rad].iter().all(|rad| (0.0..=core::f32::consts::TAU).contains(*rad)) {
            return Err(ConfigError::Belts { gyro: index });
        }
    }
    for (index, setup) in (0..).zip(joints) {
        check_joint(index, setup, encoders)?;
    }
    Ok(layout)
}

/// Counts for a rad or m with which everything can be reckoned.
const COUNTS_PER_UNIT: core::ops::RangeInclusive<f32> = 1.0..=1e8;
/// Largest limit, counts: positions beyond it still fit 32 bits.
const MAX_LIMIT_COUNTS: f32 = (1 << 29) as f32;

fn check_joint(index: u8, setup: &JointSetup, encoders: &[EncoderInfo]) -> Result<(), ConfigError> {
    let scale = counts_per_unit(&encoders[motor_encoder(index.into(), encoders)?]);
    let Limits { min, max } = setup.limits;
    // Not-a-number and infinity are beyond it, too.
    let countable = |limit: f32| (limit * scale).abs() <= MAX_LIMIT_COUNTS;
    if !(countable(min) && countable(max) && min < max) {
        return Err(ConfigError::Limits { joint: index });
    }
    if !(0.0..=10.0).contains(&setup.coast_s) {
        return Err(ConfigError::Coast { joint: index });
    }
    if matches!(setup.axis, Axis::Turns(axis) if !is_unit(&axis)) {
        return Err(ConfigError::Axis { joint: index });
    }
    if ![setup.standing_duty, setup.max_duty].iter().all(|duty| (0..=Duty::FULL).contains(&duty.0)) {
        return Err(ConfigError::Duty { joint: index });
    }
    if !setup.carried_s2.iter().chain([&setup.held_s]).all(|number| (0.0..f32::INFINITY).contains(number)) {
        return Err(ConfigError::Carried { joint: index });
    }
    Ok(())
}

/// Index of the encoder on a joint's motor.
pub(crate) fn motor_encoder(joint: usize, encoders: &[EncoderInfo]) -> Result<usize, ConfigError> {
    let on_motor = |e: &EncoderInfo| usize::from(e.joint) == joint && e.side == Side::Motor;
    encoders.iter().position(on_motor).ok_or(ConfigError::NoMotorEncoder { joint: joint as u8 })
}

fn is_unit(vector: &[f32; 3]) -> bool {
    (0.99..1.01).contains(&vector.iter().map(|part| part * part).sum::<f32>())
}
