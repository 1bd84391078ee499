//! The numbers of the control core, each with its derivation.
//!
//! What belongs to a robot (limits, scales) comes with its [`Config`](crate::Config); what belongs to the wire is in
//! `protocol`. Doggy's figures stand for the derivations: k_pwm·U = 150 N m at full duty, k_mi = 31 N m s/rad,
//! b = 2.4 kg m², 6860 counts per radian of a joint, gyro noise 0.1 °/s.

use crate::safety::GyroBounds;

/// Period of the tick, µs: the estimator's T_s.
pub const TICK_US: u32 = 1000;

/// Samples that wait for the line: at one a millisecond, 10 ms; the longest frame, a handshake, takes 5.5 ms.
pub const SAMPLE_QUEUE: usize = 10;
/// Answers and events that wait for the line. The host has one request under way at a time (two answers at most) and a
/// heartbeat every 20 ms; a fault makes three events at most.
pub const REPLY_QUEUE: usize = 12;
/// Messages from the host that wait for the tick, which takes one a millisecond. The host sends a request only after the
/// last answer, so a request and three heartbeats can wait.
pub const COMMAND_QUEUE: usize = 4;

/// Duty above which a joint surely moves: 15 N m on Doggy, three times its largest friction.
pub const MOVING_DUTY: i16 = 1000;
/// Ticks at such a duty without a count after which an encoder is stuck. A joint that reverses at 10 Hz under full
/// duty stands for a few ticks; 15 N m against 3 kg m² make the first count within 8 ms.
pub const ENCODER_STUCK_TICKS: u16 = 150;
/// Ticks without a reading after which an encoder on a bus does not answer.
pub const ENCODER_STALE_TICKS: u16 = 3;
/// Highest believable speed of a joint, rad/s or m/s: six times the no-load speed of Doggy's motors
/// (150 / 31 = 4.8 rad/s), and 206 counts in a tick.
pub const MAX_SPEED_PER_S: f32 = 30.0;

/// Bounds of the gyro watches. Stale: a motion of 3 ms is not yet anywhere. Stuck: with a noise of 3.3 steps all
/// three words repeat by chance once in a thousand ticks, and fifty times running never. Saturated: the estimator
/// leaves such ticks out, but 50 ms of them are a motion the range was not made for.
pub const GYRO_BOUNDS: GyroBounds =
    GyroBounds { stale_ticks: 3, stuck_ticks: 50, saturated_ticks: 50, max_word: i16::MAX };

/// Speed below which a robot held by hand is quiet enough to take its zero, rad/s or m/s.
pub const QUIET_SPEED_PER_S: f32 = 0.1;

/// A joint may overshoot its limit by this part of its range before the motion is stopped: 0.1 rad on Doggy's yaw.
/// Its recordings overshoot ±1.0 rad by 0.06.
pub const OVERTRAVEL_OF_RANGE: f32 = 0.05;
/// The outward duty fades over this part of the range before a limit: 0.1 rad on Doggy's yaw.
pub const FADE_OF_RANGE: f32 = 0.05;
/// Time constant of the speed at zero duty, s: (b + link inertia) / k_mi = 2.9 / 31.
pub const COAST_S: f32 = 0.094;
/// Largest duty of the paper's fast stage.
pub const MAX_DUTY: i16 = 9000;
/// Largest rise of the duty in a tick: from zero to full in 10 ms, a fifteenth of the fastest chirp's period.
pub const MAX_RISE: i16 = 1000;

/// A move has arrived when its joints stay within its tolerance for so long, µs: at 4 rad/s a joint crosses 0.08 rad
/// in that time, more than any tolerance used.
pub const SETTLE_US: u32 = 20_000;
