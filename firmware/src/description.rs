//! A description of a robot on the hardware of a board.
//!
//! The description says what the robot is; when an encoder is read and what a gyro's words mean is the board's to know.
//! Both together give the [`Config`] that the control core runs.

use embedded_storage::nor_flash::ReadNorFlash;
use heapless::Vec;
use protocol::description::{GyroDescription, GyroPart};
use protocol::{Description, EncoderInfo, GyroInfo, MAX_ENCODERS, MAX_GYROS, MAX_JOINTS, Side};

use crate::check::check;
use crate::config::{Config, ConfigError, GyroSetup, JointSetup};
use crate::store::{self, Bytes};

/// What a board drives and reads.
#[derive(Clone, Copy, Debug)]
pub struct Hardware<'a> {
    /// Motors that it drives: a robot has as many joints.
    pub motors: usize,
    /// Encoders that it reads, in the sample's order: a robot has all of them.
    pub encoders: &'a [EncoderPlace],
    /// Gyros that it reads, in the sample's order: a robot has the first ones.
    pub gyros: &'a [GyroPlace],
}

/// An encoder that a board reads.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct EncoderPlace {
    /// Index of the joint, from 0.
    pub joint: u8,
    /// Where it is mounted.
    pub side: Side,
    /// When it is read, µs after the tick's time.
    pub offset_us: u16,
}

/// A gyro that a board reads.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GyroPlace {
    /// The part there.
    pub part: GyroPart,
    /// The full scale that it is set to, °/s.
    pub range_dps: u16,
    /// What its words mean; the body is the description's to say.
    pub info: GyroInfo,
}

/// A description in the form in which it is checked.
#[derive(Default)]
struct Fitted {
    joints: Vec<JointSetup, MAX_JOINTS>,
    encoders: Vec<EncoderInfo, MAX_ENCODERS>,
    gyros: Vec<GyroSetup, MAX_GYROS>,
}

impl Hardware<'_> {
    /// Whether the core can run this robot on this board.
    ///
    /// # Errors
    /// [`ConfigError`] with the first thing that does not fit.
    #[inline(never)]
    pub fn check(&self, description: &Description) -> Result<(), ConfigError> {
        let mut fitted = Fitted::default();
        self.fit(description, &mut fitted)?;
        check(&fitted.joints, &fitted.encoders, &fitted.gyros).map(drop)
    }

    /// This robot on this board.
    ///
    /// # Errors
    /// [`ConfigError`] as of [`Hardware::check`].
    pub fn config(&self, description: &Description) -> Result<Config, ConfigError> {
        let mut fitted = Fitted::default();
        self.fit(description, &mut fitted)?;
        Config::new(&description.robot, &fitted.joints, &fitted.encoders, &fitted.gyros)
    }

    /// What a start runs: the description in the flash in the place of the built-in robot, which stays if there is none or
    /// this board cannot run it. [`Config::descriptions`] tells which it is, and that nothing can be stored where the flash
    /// has no room. `room` is free afterwards.
    #[inline(never)]
    pub fn start<F: ReadNorFlash>(&self, config: &mut Config, flash: &mut F, room: &mut Bytes) {
        let stored = store::load(flash, room);
        let running = stored.filter(|_| self.put(room, config).is_some());
        room.clear();
        if flash.capacity() >= 2 * store::MIN_AREA_BYTES {
            config.stores(running, stored);
        }
    }

    /// Puts the robot of these bytes in the place of another; none if it does not run on this board.
    // At the start of an image the stack is deepest about here: each value stands where it is used.
    #[inline(never)]
    fn put(&self, bytes: &[u8], config: &mut Config) -> Option<()> {
        let (mut description, mut fitted) = (Description::default(), Fitted::default());
        description.read(bytes).ok()?;
        self.fit(&description, &mut fitted).ok()?;
        config.put(&description.robot, &fitted.joints, &fitted.encoders, &fitted.gyros).ok()
    }

    /// The description with what the board knows.
    #[inline(never)]
    fn fit(&self, description: &Description, fitted: &mut Fitted) -> Result<(), ConfigError> {
        let Description { robot: _, joints, encoders, gyros } = description;
        let count = |n: usize| u8::try_from(n).unwrap_or(u8::MAX);
        if joints.len() != self.motors {
            return Err(ConfigError::Motors { described: count(joints.len()), board: count(self.motors) });
        }
        if encoders.len() != self.encoders.len() {
            let board = count(self.encoders.len());
            return Err(ConfigError::Encoders { described: count(encoders.len()), board });
        }
        if gyros.len() > self.gyros.len() {
            return Err(ConfigError::Gyros { described: count(gyros.len()), board: count(self.gyros.len()) });
        }
        // The same capacities on both sides: everything fits.
        *fitted = Fitted::default();
        for (index, joint) in (0..).zip(joints) {
            if joint.carried_s2.len() != joints.len() {
                return Err(ConfigError::Carried { joint: index });
            }
            let mut carried_s2 = [0.0; MAX_JOINTS];
            carried_s2.iter_mut().zip(&joint.carried_s2).for_each(|(carried, s2)| *carried = *s2);
            let _ = fitted.joints.push(JointSetup {
                limits: joint.limits,
                axis: joint.axis,
                standing_duty: joint.standing_duty,
                max_duty: joint.max_duty,
                coast_s: joint.coast_s,
                held_s: joint.held_s,
                carried_s2,
            });
        }
        for (index, (encoder, place)) in (0..).zip(encoders.iter().zip(self.encoders)) {
            if (encoder.joint, encoder.side) != (place.joint, place.side) {
                return Err(ConfigError::EncoderPlace { encoder: index });
            }
            let EncoderPlace { joint, side, offset_us } = *place;
            let (counts_per_turn, gear) = (encoder.counts_per_turn, encoder.gear);
            let _ = fitted.encoders.push(EncoderInfo { joint, side, counts_per_turn, gear, offset_us });
        }
        for (index, (gyro, place)) in (0..).zip(gyros.iter().zip(self.gyros)) {
            let GyroDescription { part, range_dps, body, mount, give_rad, sag_rad } = *gyro;
            if part != place.part {
                return Err(ConfigError::GyroPart { gyro: index, described: part, board: place.part });
            }
            if range_dps != place.range_dps {
                return Err(ConfigError::GyroRange { gyro: index, described: range_dps, board: place.range_dps });
            }
            let info = GyroInfo { body, ..place.info };
            let _ = fitted.gyros.push(GyroSetup { info, mount, give_rad, sag_rad });
        }
        Ok(())
    }
}
