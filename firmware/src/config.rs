//! What the control core must know of the robot it runs: scales, limits, sensors.
//!
//! The same facts go into the handshake, so host and device cannot disagree about a scale.

use heapless::Vec;
pub use protocol::description::DescriptionError as ConfigError;
use protocol::description::{Descriptions, Stamp};
use protocol::hello::PanicPlace;
use protocol::motion::Limits;
use protocol::sample::Layout;
use protocol::units::text;
use protocol::{Duty, EncoderInfo, GyroInfo, Hello, Identity, MAX_ENCODERS, MAX_GYROS, MAX_JOINTS, ResetReason};

use crate::check::{check, motor_encoder};
use crate::constants;
use crate::safety::{Axis, DriveBounds, EncoderBounds, GyroBounds, JointLimits, RotationWatch, STILL_COUNTS, Turn};

/// What the description file says of a joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointSetup {
    /// Range, rad or m from the zero position.
    pub limits: Limits,
    /// How it moves the bodies that it carries.
    pub axis: Axis,
    /// Largest duty at which it may stand: friction holds it, and what gravity loads it with.
    pub standing_duty: Duty,
    /// Largest duty that safety lets pass.
    pub max_duty: Duty,
    /// Time constant of the speed at zero duty, s: (motor + link inertia) / back-EMF constant.
    pub coast_s: f32,
    /// Time for which its belt, at the top of a swing, may hold the motor at a standstill against full duty, s:
    /// 4 √(friction / torque at full duty) / rate of the swing. The largest over all poses.
    pub held_s: f32,
    /// By joint: torque that an acceleration of the joint's link puts on this joint, over this joint's torque at full
    /// duty, s². The largest over all poses.
    pub carried_s2: [f32; MAX_JOINTS],
}

impl JointSetup {
    /// A joint with this range and axis, the dynamics of Doggy's motors, and nothing that it carries.
    pub const fn new(limits: Limits, axis: Axis) -> Self {
        JointSetup {
            limits,
            axis,
            max_duty: Duty(constants::MAX_DUTY),
            standing_duty: Duty(constants::STANDING_DUTY),
            coast_s: constants::COAST_S,
            held_s: 0.0,
            carried_s2: [0.0; MAX_JOINTS],
        }
    }
}

/// What the description file says of a gyro.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GyroSetup {
    /// Its place and scale, as the handshake tells them.
    pub info: GyroInfo,
    /// Rotation that takes vectors in axes of the base, all joints at zero, to the gyro's own axes. A few degrees do not
    /// matter.
    pub mount: [[f32; 3]; 3],
    /// Angle by which the belts before it give way together while full duty accelerates the robot, rad. The largest over
    /// all poses.
    pub give_rad: f32,
    /// The same under gravity, from one pose to another, rad.
    pub sag_rad: f32,
}

/// A joint in the loop's raw codes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Joint {
    /// Range, rad or m.
    pub limits: Limits,
    /// Counts per rad or m, positive.
    pub counts_per_unit: f32,
    /// Index of its motor encoder.
    pub encoder: usize,
    /// The encoder counts down when the joint moves up.
    pub reversed: bool,
    /// What safety lets pass.
    pub envelope: JointLimits,
    /// Speed below which it is at rest, counts/s.
    pub quiet_counts_per_s: i32,
    /// Whether it goes the way in which it is driven.
    pub drive: DriveBounds,
    /// How it turns what it carries.
    pub turn: Turn,
}

/// A robot as the core runs it.
#[derive(Clone, Debug, PartialEq)]
pub struct Config {
    pub(crate) hello: Hello,
    pub(crate) joints: Vec<Joint, MAX_JOINTS>,
    pub(crate) encoder_bounds: [EncoderBounds; MAX_ENCODERS],
    pub(crate) gyro_bounds: GyroBounds,
    /// The emergency stop must be seen pressed before anything moves.
    pub(crate) stop_test: bool,
    /// One a gyro, which has seen nothing yet.
    pub(crate) rotations: Vec<RotationWatch, MAX_GYROS>,
}

impl Config {
    /// A robot of this name with its joints and sensors, encoders and gyros in the sample's order.
    ///
    /// # Errors
    /// [`ConfigError`] if they do not fit together.
    #[inline(never)]
    pub fn new(
        robot: &str,
        joints: &[JointSetup],
        encoders: &[EncoderInfo],
        gyros: &[GyroSetup],
    ) -> Result<Self, ConfigError> {
        let mut config = Self::empty();
        config.put(robot, joints, encoders, gyros)?;
        Ok(config)
    }

    /// No robot yet.
    #[inline(never)]
    pub(crate) fn empty() -> Self {
        let hello = Hello {
            identity: Identity::ours(env!("CARGO_PKG_VERSION"), ""),
            layout: Layout::DOGGY,
            tick_us: constants::TICK_US as u16,
            encoders: Vec::new(),
            gyros: Vec::new(),
            zero: None,
            reset: ResetReason::Unknown,
            panic: None,
            description: Descriptions::default(),
            code_crc: None,
        };
        Config {
            hello,
            joints: Vec::new(),
            encoder_bounds: [NO_BOUNDS; MAX_ENCODERS],
            gyro_bounds: constants::GYRO_BOUNDS,
            stop_test: false,
            rotations: Vec::new(),
        }
    }

    /// Puts this robot in the place of the one that is here, which takes less stack than another [`Config`].
    ///
    /// # Errors
    /// [`ConfigError`] if it does not fit together; nothing has changed then.
    #[inline(never)]
    pub fn put(
        &mut self,
        robot: &str,
        joints: &[JointSetup],
        encoders: &[EncoderInfo],
        gyros: &[GyroSetup],
    ) -> Result<(), ConfigError> {
        let Config { hello, joints: loop_joints, encoder_bounds, rotations, .. } = self;
        hello.layout = check(joints, encoders, gyros)?;
        hello.identity.robot = text(robot);
        hello.encoders.clear();
        hello.gyros.clear();
        loop_joints.clear();
        rotations.clear();
        *encoder_bounds = [NO_BOUNDS; MAX_ENCODERS];
        // The check has bounded joints, encoders and gyros by their capacities, so that every push fits.
        for (encoder, bounds) in encoders.iter().zip(encoder_bounds) {
            let scale = counts_per_unit(encoder);
            let step = constants::MAX_SPEED_PER_S * scale * constants::TICK_US as f32 * 1e-6;
            let setup = joints.get(usize::from(encoder.joint));
            *bounds = EncoderBounds {
                max_step_counts: (step as i32).max(2),
                standing_duty: setup.map_or(i16::MAX, |setup| setup.standing_duty.0),
                stuck_push: setup.map_or(0, |setup| stuck_push(scale, setup.coast_s)),
                held_push_squared: setup.map_or(0, |setup| held_push_squared(setup.held_s)),
                stale_ticks: constants::ENCODER_STALE_TICKS,
            };
            let _ = hello.encoders.push(*encoder);
        }
        for (index, setup) in joints.iter().enumerate() {
            let _ = loop_joints.push(joint(motor_encoder(index, encoders)?, setup, encoders));
        }
        let mut scales = [f32::INFINITY; MAX_JOINTS];
        for (scale, joint) in scales.iter_mut().zip(loop_joints.iter()) {
            *scale = joint.counts_per_unit;
        }
        for (joint, setup) in loop_joints.iter_mut().zip(joints) {
            joint.drive.carry(&setup.carried_s2, &scales);
        }
        for gyro in gyros {
            let _ = hello.gyros.push(gyro.info);
            let _ = rotations.push(RotationWatch::new(gyro));
        }
        Ok(())
    }

    /// Why the device started, for the handshake and the first event.
    pub fn started_by(&mut self, reset: ResetReason, panic: Option<PanicPlace>) -> &mut Self {
        self.hello.reset = reset;
        self.hello.panic = panic;
        self
    }

    /// The board has a place for a description; which stored one runs, if it is not the one that is built in, and which one
    /// is stored.
    pub fn stores(&mut self, running: Option<Stamp>, stored: Option<Stamp>) -> &mut Self {
        self.hello.description = Descriptions { running, stored, can_store: true };
        self
    }

    /// CRC-32 over the program's code, for the handshake: see [`Hello::code_crc`].
    pub fn code_crc(&mut self, crc: u32) -> &mut Self {
        self.hello.code_crc = Some(crc);
        self
    }

    /// Nothing moves before the emergency stop was seen pressed once: a contact that is short-circuited, or a wire that
    /// touches ground, looks like a stop that is not pressed, and only pressing it tells.
    pub fn stop_test(&mut self, needed: bool) -> &mut Self {
        self.stop_test = needed;
        self
    }

    /// Other bounds for the gyros, for a sensor without noise or with another range of words.
    pub fn gyro_bounds(mut self, bounds: GyroBounds) -> Self {
        self.gyro_bounds = bounds;
        self
    }

    /// Which description runs, and which one is stored.
    pub fn descriptions(&self) -> Descriptions {
        self.hello.description
    }

    /// Numbers of joints, encoders and gyros.
    pub fn layout(&self) -> Layout {
        self.hello.layout
    }

    /// The joints in the loop's raw codes.
    pub fn joints(&self) -> &[Joint] {
        &self.joints
    }
}

/// Those of encoders that are not there.
const NO_BOUNDS: EncoderBounds =
    EncoderBounds { max_step_counts: i32::MAX, standing_duty: 0, stuck_push: 0, held_push_squared: 0, stale_ticks: 0 };

/// Counts per rad or m of the joint, without sign.
pub(crate) fn counts_per_unit(encoder: &EncoderInfo) -> f32 {
    (f64::from(encoder.counts_per_turn.unsigned_abs()) * encoder.gear / core::f64::consts::TAU) as f32
}

/// The push after which a count that stands is stuck, for an encoder of this scale (counts per rad or m) on a joint that
/// coasts for `coast_s`: at least what the constant says, and more where the encoder is coarse.
fn stuck_push(counts_per_unit: f32, coast_s: f32) -> u32 {
    // From rest at full duty: acceleration = no-load speed / coast time; way = acceleration t² / 2. Under a lower duty u
    // the push u t for the same way is the smaller one, by √u.
    let way = (2 * STILL_COUNTS) as f32 / counts_per_unit;
    let squared_ms = 2.0e6 * way * coast_s / constants::NO_LOAD_SPEED_PER_S;
    // Below 2³², so the cast and the root keep their digits.
    let ms = constants::PUSH_OF_COARSE * (squared_ms as u32).isqrt() as f32;
    constants::MOVING_PUSH.max((ms * f32::from(Duty::FULL)) as u32)
}

/// The square of the push for which a belt may hold its motor, for each step of the duty: (time · full duty)² / full duty.
fn held_push_squared(held_s: f32) -> u64 {
    let ticks = held_s * 1e6 / constants::TICK_US as f32;
    // The cast ends at the largest number.
    (ticks * ticks * f32::from(Duty::FULL)) as u64
}

/// A joint that was checked, with the index of its motor encoder.
fn joint(encoder: usize, setup: &JointSetup, encoders: &[EncoderInfo]) -> Joint {
    let Limits { min, max } = setup.limits;
    let scale = counts_per_unit(&encoders[encoder]);
    let range = (max - min) * scale;
    Joint {
        limits: setup.limits,
        counts_per_unit: scale,
        encoder,
        reversed: encoders[encoder].counts_per_turn < 0,
        envelope: JointLimits {
            lower_counts: (min * scale) as i32,
            upper_counts: (max * scale) as i32,
            overtravel_counts: (constants::OVERTRAVEL_OF_RANGE * range) as i32,
            fade_counts: ((constants::FADE_OF_RANGE * range) as i32).max(1),
            coast_q16_s: (setup.coast_s * 65_536.0) as u32,
            max_duty: setup.max_duty,
            max_rise: Duty(constants::MAX_RISE),
        },
        quiet_counts_per_s: (constants::QUIET_SPEED_PER_S * scale) as i32,
        drive: DriveBounds {
            standing_duty: setup.standing_duty.0,
            moving_counts_per_s: (constants::QUIET_SPEED_PER_S * scale) as u32,
            wrong_way_push: constants::MOVING_PUSH,
            carried: [0; MAX_JOINTS],
        },
        turn: Turn::new(setup.axis, scale),
    }
}

#[cfg(test)]
mod tests {
    use protocol::Side;

    use super::*;

    #[test]
    fn doggys_ranges_become_counts() {
        // 1024 counts a motor turn, gear 42.092, ranges ±1.0, ±0.6, ±0.6 rad.
        let config = crate::robot::doggy();
        let yaw = config.joints()[0];
        assert!((yaw.counts_per_unit - 6859.93).abs() < 0.01, "1024 · 42.092 / 2π, is {}", yaw.counts_per_unit);
        assert_eq!(yaw.envelope.upper_counts, 6859);
        assert_eq!(yaw.envelope.overtravel_counts, 685);
        assert_eq!(config.encoder_bounds[0].max_step_counts, 205);
        assert!(config.hello.validate().is_ok());
    }

    /// From rest at full duty a joint with Doggy's dynamics needs 4.7 ms for four of its counts, 83 ms for four of 22 a radian.
    #[test]
    fn a_coarse_encoder_has_more_time_to_move() {
        assert_eq!(stuck_push(6860.0, 0.094), constants::MOVING_PUSH);
        assert_eq!(stuck_push(600.0, 0.094), 450_000, "3 · 15 ms");
        assert_eq!(stuck_push(22.0, 0.094), 2_460_000, "3 · 82 ms");
        assert_eq!(stuck_push(22.0, 0.0), constants::MOVING_PUSH);
    }

    #[test]
    fn robots_that_do_not_fit_are_refused() {
        let joint = JointSetup::new(Limits { min: -1.0, max: 1.0 }, Axis::Slides);
        let encoder = EncoderInfo { joint: 0, side: Side::Link, counts_per_turn: 4096, gear: 1.0, offset_us: 0 };
        let refused = |joints: &[_], encoders: &[_]| Config::new("r", joints, encoders, &[]).err();
        assert_eq!(refused(&[joint], &[encoder]), Some(ConfigError::NoMotorEncoder { joint: 0 }));
        assert!(matches!(refused(&[], &[encoder]), Some(ConfigError::Layout(_))));
        assert!(matches!(refused(&[joint; 300], &[encoder]), Some(ConfigError::Layout(_))));
        let motor = EncoderInfo { side: Side::Motor, ..encoder };
        let flat = EncoderInfo { gear: f64::NAN, ..motor };
        assert_eq!(refused(&[joint], &[flat]), Some(ConfigError::Scale { encoder: 0 }));
        let empty = JointSetup { limits: Limits { min: 1.0, max: 1.0 }, ..joint };
        assert_eq!(refused(&[empty], &[motor]), Some(ConfigError::Limits { joint: 0 }));
        let gyro = GyroSetup {
            info: GyroInfo {
                body: 0,
                rad_s_per_lsb: 5e-4,
                saturated_at: 32_700,
                offset_us: 0,
                filter_delay_us: None,
                output_rate_hz: None,
            },
            mount: [[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
            give_rad: 0.1,
            sag_rad: 0.0,
        };
        let with = |gyro: GyroSetup| Config::new("r", &[joint], &[motor], &[gyro]).err();
        assert_eq!(with(gyro), None);
        assert_eq!(with(GyroSetup { mount: [[1.0; 3]; 3], ..gyro }), Some(ConfigError::Mount { gyro: 0 }));
        for rad_s_per_lsb in [0.0, -5e-4, f64::NAN, 1e300] {
            let info = GyroInfo { rad_s_per_lsb, ..gyro.info };
            assert_eq!(with(GyroSetup { info, ..gyro }), Some(ConfigError::GyroScale { gyro: 0 }));
        }
        for axis in [[0.0, 0.0, 0.98], [0.8, 0.8, 0.0], [f32::NAN, 0.0, 1.0]] {
            let bent = JointSetup { axis: Axis::Turns(axis), ..joint };
            assert_eq!(refused(&[bent], &[motor]), Some(ConfigError::Axis { joint: 0 }));
        }
        for rad in [-0.1, 7.0, f32::NAN] {
            assert_eq!(with(GyroSetup { give_rad: rad, ..gyro }), Some(ConfigError::Belts { gyro: 0 }));
            assert_eq!(with(GyroSetup { sag_rad: rad, ..gyro }), Some(ConfigError::Belts { gyro: 0 }));
        }
        for s2 in [-0.1, f32::INFINITY, f32::NAN] {
            let carries = JointSetup { carried_s2: [s2; MAX_JOINTS], ..joint };
            assert_eq!(refused(&[carries], &[motor]), Some(ConfigError::Carried { joint: 0 }));
        }
        let endless = JointSetup { coast_s: f32::INFINITY, ..joint };
        assert_eq!(refused(&[endless], &[motor]), Some(ConfigError::Coast { joint: 0 }));
    }
}
