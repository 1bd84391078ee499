//! Doggy: three joints by yaw, pitch and roll, an encoder on each motor, a gyro on the first and on the last body.
//!
//! The same figures as in the host's description of the robot; a test across both crates holds them together.

use protocol::description::GyroPart;
use protocol::motion::Limits;
use protocol::{EncoderInfo, GyroInfo, Side};

use crate::config::{Config, GyroSetup, JointSetup};
use crate::constants::GYRO_SATURATED_AT;
use crate::description::{EncoderPlace, GyroPlace, Hardware};
use crate::driver::{BMI323_RATE_HZ, FILTER_DELAY_US, GyroRange, ICM42688P_RATE_HZ};
use crate::safety::Axis;

/// Range of both gyros.
pub const GYRO_RANGE: GyroRange = GyroRange::Dps1000;

/// Joints, each with a motor and an encoder on it.
pub const JOINTS: usize = 3;
/// Gyros.
pub const GYROS: usize = 2;

/// What the boards drive and read: three motors with an encoder each, and two gyros.
pub const HARDWARE: Hardware<'static> = Hardware { motors: JOINTS, encoders: &ENCODERS, gyros: &GYRO_PLACES };

const ENCODERS: [EncoderPlace; JOINTS] = [encoder(0), encoder(1), encoder(2)];
const GYRO_PLACES: [GyroPlace; GYROS] =
    [gyro(GyroPart::Icm42688p, ICM42688P_RATE_HZ), gyro(GyroPart::Bmi323, BMI323_RATE_HZ)];

const fn encoder(joint: u8) -> EncoderPlace {
    EncoderPlace { joint, side: Side::Motor, offset_us: 0 }
}

const fn gyro(part: GyroPart, output_rate_hz: u32) -> GyroPlace {
    let info = GyroInfo {
        body: 0,
        rad_s_per_lsb: GYRO_RANGE.lsb_rad_s(),
        saturated_at: GYRO_SATURATED_AT,
        offset_us: 0,
        filter_delay_us: Some(FILTER_DELAY_US),
        output_rate_hz: Some(output_rate_hz as u16),
    };
    GyroPlace { part, range_dps: GYRO_RANGE.full_scale_dps(), info }
}

/// By joint, then link: torque that an acceleration of the link puts on the joint, over the joint's 150 N m, s².
const CARRIED_S2: [[f32; JOINTS]; JOINTS] = [
    [0.007_005_655_7, 0.002_191_493, 0.002_614_985_5],
    [0.002_191_493, 0.004_895_957, 9.791_244e-7],
    [0.002_614_985_5, 9.791_244e-7, 0.004_629_715],
];

/// What the control core must know of Doggy.
#[inline(never)]
pub fn doggy() -> Config {
    let joint = |index: usize, axis, max: f32, coast_s: f32, held_s: f32| {
        let mut setup = JointSetup::new(Limits { min: -max, max }, Axis::Turns(axis));
        (setup.coast_s, setup.held_s) = (coast_s, held_s);
        setup.carried_s2[..JOINTS].copy_from_slice(&CARRIED_S2[index]);
        setup
    };
    // What belts and links bear is the largest over all poses, with all figures 15 % on the worse side.
    // (b + inertia of the links in the zero position) / k_mi, with b = 2.428 kg m² and k_mi = 31.328 N m s/rad.
    let joints: [_; JOINTS] = [
        joint(0, [0.0, 0.0, 1.0], 1.0, 0.093_661_83, 0.028_697_098),
        joint(1, [0.0, 1.0, 0.0], 0.6, 0.094_860_73, 0.026_095_929),
        joint(2, [-1.0, 0.0, 0.0], 0.6, 0.093_916_79, 0.034_540_802),
    ];
    let encoders = ENCODERS.map(|EncoderPlace { joint, side, offset_us }| EncoderInfo {
        joint,
        side,
        counts_per_turn: 1024,
        gear: 42.092,
        offset_us,
    });
    let gyro = |place: GyroPlace, body, mount, give_rad| {
        let info = GyroInfo { body, ..place.info };
        GyroSetup { info, mount, give_rad, sag_rad: 0.0 }
    };
    let gyros: [_; GYROS] = [
        gyro(GYRO_PLACES[0], 0, [[-1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, -1.0, 0.0]], 0.184_447_12),
        gyro(GYRO_PLACES[1], 2, [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]], 0.256_533_86),
    ];
    // In place: a second one would be on the stack where it is deepest.
    let mut config = Config::empty();
    match config.put("doggy", &joints, &encoders, &gyros) {
        Ok(()) => config,
        // Nothing here depends on an input: the test below builds it.
        Err(_) => unreachable!(),
    }
}

#[cfg(test)]
mod tests {
    use protocol::Layout;

    #[test]
    fn doggy_can_be_built() {
        assert_eq!(super::doggy().layout(), Layout::DOGGY);
    }
}
