//! Descriptions of robots: whether a device can run one, sending it, and which one runs.

use std::time::Duration;

use firmware::description::{EncoderPlace, GyroPlace, Hardware};
use protocol::description::{DESCRIPTION_PIECE, MAX_DESCRIPTION_BYTES};
use protocol::{Command, Description, DescriptionError, GyroInfo, Hello, Refusal};

use super::{Device, LinkError};

/// How long the drivers stay enabled after a motion, and somewhat more.
const DRIVERS_OFF: Duration = Duration::from_millis(700);

/// Which description a device runs, in words, and what a person should know of it.
#[derive(Debug, Clone, PartialEq)]
pub struct Runs {
    /// Which one runs.
    pub which: String,
    /// Why another one is stored than the one that runs, if one is.
    pub other: Option<String>,
}

/// What the handshake tells of descriptions.
pub fn runs(hello: &Hello) -> Runs {
    let known = &hello.description;
    let which = match known.running {
        Some(stamp) => format!("the stored description {} (CRC-32 {:08x})", stamp.sequence, stamp.crc()),
        None => "the description that is built in".to_owned(),
    };
    let other = known.stored.filter(|stored| known.running != Some(*stored)).map(|stored| {
        format!("description {} (CRC-32 {:08x}) is stored and does not run", stored.sequence, stored.crc())
    });
    Runs { which, other }
}

/// Whether the firmware at the other end of a handshake can run this robot, as far as the handshake tells: it does not
/// name the parts of the gyros, and of those only the ones that the present description has.
///
/// # Errors
/// [`DescriptionError`] with the first thing that does not fit.
pub fn fits(hello: &Hello, description: &Description) -> Result<(), DescriptionError> {
    let encoders: Vec<EncoderPlace> = hello
        .encoders
        .iter()
        .map(|encoder| EncoderPlace { joint: encoder.joint, side: encoder.side, offset_us: encoder.offset_us })
        .collect();
    let gyros: Vec<GyroPlace> = description
        .gyros
        .iter()
        .map(|gyro| {
            let info = GyroInfo {
                body: gyro.body,
                rad_s_per_lsb: f64::from(gyro.range_dps).to_radians() / 32_768.0,
                saturated_at: u16::MAX,
                offset_us: 0,
                filter_delay_us: None,
                output_rate_hz: None,
            };
            GyroPlace { part: gyro.part, range_dps: gyro.range_dps, info }
        })
        .collect();
    Hardware { motors: hello.layout.joints(), encoders: &encoders, gyros: &gyros }.check(description)
}

impl Device {
    /// Sends a description and waits until the device has stored it; then reads the handshake anew, which tells what is
    /// stored. It runs from the device's next start on.
    ///
    /// # Errors
    /// [`LinkError::Refused`] with the reason: what was stored before is there still.
    pub fn push(&mut self, description: &Description) -> Result<(), LinkError> {
        let mut room = [0; MAX_DESCRIPTION_BYTES];
        // Every description fits.
        let n = description.encode(&mut room).unwrap_or(0);
        let bytes = &room[..n];
        let pieces = bytes.chunks(DESCRIPTION_PIECE);
        // At most MAX_DESCRIPTION_PIECES, which fits a byte.
        let begin = Command::DescriptionBegin { pieces: pieces.len() as u8 };
        let wish = "take a description";
        if !self.hello().description.can_store {
            return Err(LinkError::Refused { what: wish, refusal: Box::new(Refusal::NoStore) });
        }
        match self.ask(wish, begin.clone()) {
            Err(LinkError::Refused { refusal, .. }) if *refusal == Refusal::Armed => {
                std::thread::sleep(DRIVERS_OFF);
                self.ask(wish, begin)?;
            }
            outcome => outcome?,
        }
        for (index, piece) in (0u8..).zip(pieces) {
            let bytes = piece.iter().copied().collect();
            self.ask("take a part of a description", Command::DescriptionPiece { index, bytes })?;
        }
        self.ask("store the description", Command::DescriptionEnd { checksum: description.crc() })?;
        self.greet()
    }
}
