//! The numbers of the control core, each with its derivation.
//!
//! What belongs to a robot (limits, scales) comes with its [`Config`](crate::Config); what belongs to the wire is in
//! `protocol`. Doggy's figures stand for the derivations: k_pwm·U = 150 N m at full duty, k_mi = 31 N m s/rad,
//! b = 2.4 kg m², 6860 counts per radian of a joint, gyro noise 0.1 °/s.

use crate::safety::GyroBounds;

/// Period of the tick, µs: the estimator's T_s.
pub const TICK_US: u32 = 1000;

/// Samples that wait for the line: at one a millisecond, 10 ms; the longest frame, a handshake, takes 5.7 ms.
pub const SAMPLE_QUEUE: usize = 10;
/// Answers and events that wait for the line. The host has one request under way at a time (two answers at most) and a
/// heartbeat every 20 ms; a fault makes three events at most.
pub const REPLY_QUEUE: usize = 12;
/// Messages from the host that wait for the tick, which takes one a millisecond. The host sends a request only after the
/// last answer, so a request and three heartbeats can wait.
pub const COMMAND_QUEUE: usize = 4;

/// Largest duty at which a joint may stand, unless its robot says otherwise: 7 N m on Doggy, and its largest friction is
/// 4.9 N m. A joint that bears a load needs the duty that holds it on top.
pub const STANDING_DUTY: i16 = 450;
/// Push (duty beyond the standing duty, summed over ticks in one direction) that moves every joint, steps · ticks: 19 ms
/// at a duty of 0.90, 150 ms at 0.15. An encoder whose count has not moved under it is stuck; a joint that goes against
/// it, and has not slowed down under it, goes the wrong way. Where belts may hold a motor for longer, or links pull it, the
/// bound is larger by the robot's own figures. How near healthy robots come the program `healthy` of the crate `tests`
/// prints.
pub const MOVING_PUSH: u32 = 157_500;
/// Where an encoder is so coarse that a healthy joint needs longer for [`STILL_COUNTS`](crate::safety::STILL_COUNTS): the
/// push gets so many times that which moves it by them from rest without friction. Doggy's encoders would get 14 ms.
pub const PUSH_OF_COARSE: f32 = 3.0;
/// Angle by which the rotation that a gyro has summed up over 4 s may differ from that of the encoders with stiff belts,
/// rad: what the drift of its zero adds up to in that time while it warms up, 0.5°/s after 10 s, and 0.005 rad for noise.
/// What belts give way by comes on top. How near healthy robots come the program `healthy` of the crate `tests` prints.
pub const ROTATION_DIFFERS_RAD: f32 = 0.04;
/// Belts give way by so many times the angle that a steady duty gives: a spring without damping swings to twice of it.
pub const SWING_OF_GIVE: f32 = 2.0;
/// How far a gyro's zero may be, in a pause of a motion, from where it was before, rad/s: 3°/s, a robot's drift over many
/// pauses and thirty times the noise. A joint whose encoder stands, and which creeps more slowly, makes 0.07 rad in the
/// longest pause; with twice that twice as much; with half a fast drift is lost sight of. A body that swings faster is not
/// at rest: its words are no zero.
pub const ZERO_DRIFT_RAD_S: f64 = 0.05;
/// The part of the gyro's way there and back by which it may differ more, 10⁻⁴. A gyro's scale is right to 0.5 % by the
/// data sheets, and 1° of its mount makes as much again; of the way, which sums all axes, the half goes in one direction.
pub const ROTATION_DIFFERS_OF_WAY: u32 = 200;
/// What is added to that part at full duty, 10⁻⁴: the belts' swings about several axes. Healthy robots differ by 4 % of the
/// way in a chirp of all joints at a duty of 0.9, and belts give way by more on top. How near they come the program `healthy`
/// prints.
pub const ROTATION_DIFFERS_AT_FULL_DUTY: u32 = 250;
/// Ticks without a reading after which an encoder on a bus does not answer.
pub const ENCODER_STALE_TICKS: u16 = 3;
/// Highest believable speed of a joint, rad/s or m/s: six times the no-load speed of Doggy's motors
/// (150 / 31 = 4.8 rad/s), and 206 counts in a tick.
pub const MAX_SPEED_PER_S: f32 = 30.0;

/// Bounds of the gyro watches. Stale: a motion of 3 ms is not yet anywhere. Stuck: with a noise of 3.3 steps all
/// three words repeat by chance once in a thousand ticks, and fifty times running never. Saturated: the estimator
/// leaves such ticks out, but 50 ms of them are a motion the range was not made for.
pub const GYRO_BOUNDS: GyroBounds =
    GyroBounds { stale_ticks: 3, stuck_ticks: 50, saturated_ticks: 50, max_word: GYRO_SATURATED_AT as i16 };
/// A word of this size is at the end of the range: the ICM-42688-P's most negative one is −32,767 or −32,766 (−32,768 is no
/// measurement), and what a filter makes of clipped conversions lies below. 0.2 % of the range are given away.
pub const GYRO_SATURATED_AT: u16 = 32_700;

/// No-load speed of a joint at full duty, rad/s or m/s: 150 / 31 on Doggy.
pub const NO_LOAD_SPEED_PER_S: f32 = MAX_SPEED_PER_S / 6.0;

/// Speed below which a robot held by hand is quiet enough to take its zero, rad/s or m/s.
pub const QUIET_SPEED_PER_S: f32 = 0.1;

/// A joint may overshoot its limit by this part of its range before the motion is stopped: 0.1 rad on Doggy's yaw.
/// Its recordings overshoot ±1.0 rad by 0.06.
pub const OVERTRAVEL_OF_RANGE: f32 = 0.05;
/// The outward duty fades over this part of the range before a limit: 0.1 rad on Doggy's yaw.
pub const FADE_OF_RANGE: f32 = 0.05;
/// Time constant of the speed at zero duty, s: (b + link inertia) / k_mi = 2.9 / 31.
pub const COAST_S: f32 = 0.094;
/// Ticks after a motion for which the drivers stay enabled, so that shorted motors brake: five times the coasting time,
/// after which a speed of 4 rad/s is 0.02. With half of it a joint still turns at 0.3 rad/s when it is let go.
pub const ARMED_TICKS: u16 = 500;
/// Largest duty of the paper's fast stage.
pub const MAX_DUTY: i16 = 9000;
/// Largest rise of the duty in a tick: from zero to full in 10 ms, a fifteenth of the fastest chirp's period.
pub const MAX_RISE: i16 = 1000;

/// A move has arrived when its joints stay within its tolerance for so long, µs: at 4 rad/s a joint crosses 0.08 rad
/// in that time, more than any tolerance used.
pub const SETTLE_US: u32 = 20_000;
