//! The emulated board's exchange with the simulated world: one request and one reply a tick, in lock-step.
//!
//! The image runs in an emulator that has no sensors and no motors. What the real board does at its pins, the emulated
//! one writes into a FIFO as a [`Request`]; the world reads it, answers in a second FIFO, and meanwhile
//! the emulator's clock stands still, however long that takes:
//!
//! ```text
//!   device   ─ period k ─▶ Tick ─┐                  ┌─▶ collect · compute · apply ─▶ idle ─▶ period k+1 ─▶ Tick …
//!   time     ····················│· stands still ···│·············· runs ··················│
//!   world                        ╰─▶ sense, reply ──╯        (Stop ─▶ zero duty from here on)
//! ```
//!
//! Every request begins with its length, its kind and the device's time:
//!
//! ```text
//!    0     1      2        6
//!   │len  │kind  │time µs │ body …                len: bytes that follow it
//!   │     │ 0    │        │                       Start:  the processor was reset                          ▶ Started
//!   │     │ 1    │        │ wait µs u32           Delay:  a driver waits, before the first tick
//!   │     │ 2    │        │ bytes …               Spi:    shifted out on the SPI, to set a gyro up         ▶ Answer
//!   │     │ 3    │        │ address read bytes …  I2c:    written on the I²C, then so many read            ▶ Answer
//!   │     │ 4    │        │ see Tick              Tick:   a period began                                   ▶ Sensors
//!   │     │ 5    │        │                       Stop:   zero duty at the pins, now
//! ```
//!
//! A reply follows where one is shown: its length, then its bytes ([`Started`], [`Answer`], [`Sensors`]). Numbers are
//! little-endian. Nothing is ever lost or damaged on a FIFO, so there is no checksum; what does not decode is a version
//! of the other side, and both sides stop.

mod bytes;
mod tick;

use bytes::{Reader, Writer};
pub use tick::{I2C_BURST, InjectedFault, PINS_BROWN_OUT, PINS_EMERGENCY_STOP, SPI_BURST, Sensors, Tick};

/// The FIFO from the board to the world, in the emulator's working folder.
pub const TO_WORLD: &str = "to_world";
/// The FIFO from the world to the board.
pub const FROM_WORLD: &str = "from_world";
/// Motors with an encoder each.
pub const MOTORS: usize = 3;
/// Gyros: one on SPI, one on I²C.
pub const GYROS: usize = 2;
/// Longest message, its length included.
pub const MAX_MESSAGE: usize = 192;
/// Most bytes of one bus transfer.
pub const MAX_TRANSFER: usize = 32;
/// Most bytes from the host in one tick: what 921,600 baud carry in a millisecond, rounded up.
pub const MAX_HOST_BYTES: usize = 96;

/// Bytes of a bus transfer.
pub type Transfer = heapless::Vec<u8, MAX_TRANSFER>;

/// Bytes that are no message of this version.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Malformed;

/// What the board says, with the device time, µs.
#[derive(Clone, Debug, PartialEq)]
pub struct Request {
    /// Device time, µs; 0 before the first tick.
    pub t_us: u32,
    /// What it says.
    pub kind: Kind,
}

/// What the board says.
#[derive(Clone, Debug, PartialEq)]
#[allow(clippy::large_enum_variant, reason = "no allocator to put the large one behind")]
pub enum Kind {
    /// The processor was reset; duty is zero. Answered by [`Started`].
    Start,
    /// A driver lets time pass, before the first tick.
    Delay {
        /// So long.
        us: u32,
    },
    /// A transfer on the SPI. Answered by an [`Answer`] of the same length.
    Spi(Transfer),
    /// A transfer on the I²C. Answered by an [`Answer`] of `read` bytes.
    I2c {
        /// Of the part.
        address: u8,
        /// Bytes to read after those written.
        read: u8,
        /// Bytes to write.
        written: Transfer,
    },
    /// A period began. Answered by [`Sensors`].
    Tick(Tick),
    /// Zero duty at the pins from now on.
    Stop,
}

/// Answers [`Kind::Start`]: the register RCC_CSR as a reset would have left it, for the emulator's shows no flags. See
/// [`reason`](crate::wiring::reset::reason).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Started(pub u32);

/// Answers a bus transfer.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Answer {
    /// The bytes read.
    Bytes(Transfer),
    /// Nobody acknowledged, or the transfer never ended.
    Nothing,
}

impl Request {
    /// Writes the message; returns its length. `out` of [`MAX_MESSAGE`] bytes is always enough.
    ///
    /// # Errors
    /// [`Malformed`] if `out` is too small.
    pub fn write(&self, out: &mut [u8]) -> Result<usize, Malformed> {
        let mut w = Writer::after_length(out);
        match &self.kind {
            Kind::Start => w.head(0, self.t_us)?,
            Kind::Delay { us } => {
                w.head(1, self.t_us)?;
                w.put(us.to_le_bytes())?;
            }
            Kind::Spi(sent) => {
                w.head(2, self.t_us)?;
                w.slice(sent)?;
            }
            Kind::I2c { address, read, written } => {
                w.head(3, self.t_us)?;
                w.put([*address, *read])?;
                w.slice(written)?;
            }
            Kind::Tick(tick) => {
                w.head(4, self.t_us)?;
                tick.write(&mut w)?;
            }
            Kind::Stop => w.head(5, self.t_us)?,
        }
        w.finish()
    }

    /// Reads a message without its length.
    ///
    /// # Errors
    /// [`Malformed`] if it is none of this version.
    pub fn read(message: &[u8]) -> Result<Self, Malformed> {
        let mut r = Reader(message);
        let [kind] = r.take()?;
        let t_us = r.u32()?;
        let kind = match kind {
            0 => Kind::Start,
            1 => Kind::Delay { us: r.u32()? },
            2 => Kind::Spi(r.rest()?),
            3 => {
                let [address, read] = r.take()?;
                Kind::I2c { address, read, written: r.rest()? }
            }
            4 => Kind::Tick(Tick::read(&mut r)?),
            5 => Kind::Stop,
            _ => return Err(Malformed),
        };
        r.end()?;
        Ok(Self { t_us, kind })
    }
}

impl Started {
    /// Writes the message; returns its length.
    ///
    /// # Errors
    /// [`Malformed`] if `out` is too small.
    pub fn write(&self, out: &mut [u8]) -> Result<usize, Malformed> {
        let mut w = Writer::after_length(out);
        w.put(self.0.to_le_bytes())?;
        w.finish()
    }

    /// Reads a message without its length.
    ///
    /// # Errors
    /// [`Malformed`] if it is none of this version.
    pub fn read(message: &[u8]) -> Result<Self, Malformed> {
        message.try_into().map(|bytes| Self(u32::from_le_bytes(bytes))).map_err(|_| Malformed)
    }
}

impl Answer {
    /// Writes the message; returns its length.
    ///
    /// # Errors
    /// [`Malformed`] if `out` is too small.
    pub fn write(&self, out: &mut [u8]) -> Result<usize, Malformed> {
        let mut w = Writer::after_length(out);
        match self {
            Self::Nothing => w.put([0])?,
            Self::Bytes(bytes) => {
                w.put([1])?;
                w.slice(bytes)?;
            }
        }
        w.finish()
    }

    /// Reads a message without its length.
    ///
    /// # Errors
    /// [`Malformed`] if it is none of this version.
    pub fn read(message: &[u8]) -> Result<Self, Malformed> {
        match message.split_first() {
            Some((0, [])) => Ok(Self::Nothing),
            Some((1, bytes)) => Transfer::from_slice(bytes).map(Self::Bytes).map_err(|_| Malformed),
            _ => Err(Malformed),
        }
    }
}

#[cfg(test)]
mod tests;
