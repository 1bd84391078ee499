//! The exchange of a tick.

use protocol::Duty;

use super::bytes::{Reader, Writer};
use super::{Answer, GYROS, MAX_HOST_BYTES, MAX_MESSAGE, MOTORS, Malformed, Transfer};

/// Bit of [`Sensors::pins`]: the emergency stop is pressed.
pub const PINS_EMERGENCY_STOP: u8 = 1 << 0;
/// Bit of [`Sensors::pins`]: the supply is too low.
pub const PINS_BROWN_OUT: u8 = 1 << 1;

/// Bytes of the burst that reads the gyro on SPI, both ways.
pub const SPI_BURST: usize = 10;
/// Bytes of the burst that reads the gyro on I²C.
pub const I2C_BURST: usize = 16;

/// What the board says at t_k.
///
/// ```text
///    6      12    13     14              18              22             24     25         35     36       37
///   │duty  │fed  │armed │cycles of the  │cycles of the  │deepest stack│SPI   │SPI burst │I²C   │address │register
///   │3×i16 │bool │bool  │last begin u32 │last tick u32  │bytes u16    │bool  │10 bytes  │bool  │        │
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Tick {
    /// Duty in force from t_k on.
    pub duty: [Duty; MOTORS],
    /// The watchdog was fed since the last period.
    pub fed: bool,
    /// The drivers are enabled.
    pub armed: bool,
    /// Cycles of the period before: of its first phase, without the exchange.
    pub begin_cycles: u32,
    /// Of its second phase.
    pub tick_cycles: u32,
    /// High-water mark of the stack, bytes.
    pub stack_bytes: u16,
    /// What the firmware shifts out to read the gyro on SPI; none while the tick does not have this bus.
    pub spi: Option<[u8; SPI_BURST]>,
    /// Address of the gyro on I²C, and the register from which [`I2C_BURST`] bytes are read; none as above.
    pub i2c: Option<[u8; 2]>,
}

/// What the world answers: everything that the pins show in this period. Places count from behind the length.
///
/// ```text
///    0         6       7         17      18        34         40    41      42       44     45
///   │counters │SPI ok │answer   │I²C ok │answer   │ready     │pins │inject│by      │count │bytes from the host …
///   │3×u16    │bool   │10 bytes │bool   │16 bytes │2×bool,u16│     │      │u16     │      │
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Sensors {
    /// Hardware counters of the encoders at t_k.
    pub counters: [u16; MOTORS],
    /// Answer of the gyro on SPI; none if the transfer did not begin or end.
    pub spi: Option<[u8; SPI_BURST]>,
    /// Answer of the gyro on I²C; none if nobody acknowledged or the transfer did not begin or end.
    pub i2c: Option<[u8; I2C_BURST]>,
    /// How long before t_k each gyro's "data ready" rose last, µs, as a capture channel would have kept it; none if it did not rise
    /// since the period before.
    pub ready_us: [Option<u16>; GYROS],
    /// [`PINS_EMERGENCY_STOP`], [`PINS_BROWN_OUT`].
    pub pins: u8,
    /// What is done to the processor.
    pub injected: InjectedFault,
    /// What the host sent in the period before.
    pub host: heapless::Vec<u8, MAX_HOST_BYTES>,
}

/// What is done to the processor in this tick. A real board has nothing like it; it is how tests bring about what the
/// firmware must survive.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum InjectedFault {
    /// Nothing.
    #[default]
    None,
    /// The tick takes so much longer, µs.
    Delay(u16),
    /// The next call for received bytes panics.
    PanicInCommands,
    /// The next call for received bytes takes more stack than there is.
    StackOverflows,
    /// The next bytes to be sent never leave: the telemetry task hangs.
    TelemetryHangs,
    /// The watchdog has bitten: the processor does nothing until its reset.
    Halt,
}

impl Tick {
    pub(super) fn write(&self, w: &mut Writer<'_>) -> Result<(), Malformed> {
        for duty in self.duty {
            w.put(duty.0.to_le_bytes())?;
        }
        w.put([u8::from(self.fed), u8::from(self.armed)])?;
        w.put(self.begin_cycles.to_le_bytes())?;
        w.put(self.tick_cycles.to_le_bytes())?;
        w.put(self.stack_bytes.to_le_bytes())?;
        w.optional(self.spi)?;
        w.optional(self.i2c)
    }

    pub(super) fn read(r: &mut Reader<'_>) -> Result<Self, Malformed> {
        let mut duty = [Duty::ZERO; MOTORS];
        for duty in &mut duty {
            *duty = Duty(i16::from_le_bytes(r.take()?));
        }
        Ok(Self {
            duty,
            fed: r.flag()?,
            armed: r.flag()?,
            begin_cycles: r.u32()?,
            tick_cycles: r.u32()?,
            stack_bytes: u16::from_le_bytes(r.take()?),
            spi: r.optional()?,
            i2c: r.optional()?,
        })
    }
}

impl Sensors {
    /// Writes the message; returns its length. `out` of [`MAX_MESSAGE`] bytes is always enough.
    ///
    /// # Errors
    /// [`Malformed`] if `out` is too small.
    pub fn write(&self, out: &mut [u8]) -> Result<usize, Malformed> {
        const { assert!(1 + 45 + MAX_HOST_BYTES <= MAX_MESSAGE) };
        let mut w = Writer::after_length(out);
        for counter in self.counters {
            w.put(counter.to_le_bytes())?;
        }
        w.optional(self.spi)?;
        w.optional(self.i2c)?;
        for ready in self.ready_us {
            w.optional(ready.map(u16::to_le_bytes))?;
        }
        let (injected, by) = match self.injected {
            InjectedFault::None => (0, 0),
            InjectedFault::Delay(us) => (1, us),
            InjectedFault::PanicInCommands => (2, 0),
            InjectedFault::TelemetryHangs => (3, 0),
            InjectedFault::Halt => (4, 0),
            InjectedFault::StackOverflows => (5, 0),
        };
        w.put([self.pins, injected])?;
        w.put(u16::to_le_bytes(by))?;
        // At most MAX_HOST_BYTES.
        w.put([self.host.len() as u8])?;
        w.slice(&self.host)?;
        w.finish()
    }

    /// Reads a message without its length.
    ///
    /// # Errors
    /// [`Malformed`] if it is none of this version.
    pub fn read(message: &[u8]) -> Result<Self, Malformed> {
        let mut r = Reader(message);
        let mut sensors = Self::default();
        for counter in &mut sensors.counters {
            *counter = u16::from_le_bytes(r.take()?);
        }
        sensors.spi = r.optional()?;
        sensors.i2c = r.optional()?;
        for ready in &mut sensors.ready_us {
            *ready = r.optional()?.map(u16::from_le_bytes);
        }
        let [pins, injected] = r.take()?;
        let by = u16::from_le_bytes(r.take()?);
        sensors.pins = pins;
        sensors.injected = match injected {
            0 => InjectedFault::None,
            1 => InjectedFault::Delay(by),
            2 => InjectedFault::PanicInCommands,
            3 => InjectedFault::TelemetryHangs,
            4 => InjectedFault::Halt,
            5 => InjectedFault::StackOverflows,
            _ => return Err(Malformed),
        };
        let [count] = r.take()?;
        if r.0.len() != usize::from(count) {
            return Err(Malformed);
        }
        sensors.host = heapless::Vec::from_slice(r.0).map_err(|_| Malformed)?;
        Ok(sensors)
    }
}

impl Answer {
    /// The answer as an array, if it came and has this length.
    pub fn burst<const N: usize>(&self) -> Option<[u8; N]> {
        match self {
            Self::Bytes(bytes) => bytes.as_slice().try_into().ok(),
            Self::Nothing => None,
        }
    }
}

impl From<Option<Transfer>> for Answer {
    fn from(answer: Option<Transfer>) -> Self {
        answer.map_or(Self::Nothing, Self::Bytes)
    }
}
