//! What goes wrong at the pins and in the processor.

use firmware::lockstep::{I2C_BURST, InjectedFault, PINS_BROWN_OUT, PINS_EMERGENCY_STOP, Sensors};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// What 921,600 baud carry in a tick.
const LINE_BYTES: usize = 92;

/// Something that goes wrong in a tick of the motion.
#[derive(Debug, Clone, Copy)]
pub struct TimedFault {
    /// Ticks after the first one of the motion.
    pub at: u32,
    /// Which one.
    pub kind: FaultKind,
}

/// What can go wrong.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FaultKind {
    /// The emergency stop is pressed, and stays so.
    EmergencyStop,
    /// The supply breaks down, for good.
    BrownOut,
    /// The first gyro loses its supply: zeros on SPI.
    Gyro1Dead,
    /// The second gyro converts no more, and says every time that it has.
    Gyro2Stuck,
    /// The I²C hangs: no transfer ends any more.
    I2cHangs,
    /// An encoder's counter jumps by so many counts.
    EncoderJumps {
        /// Of this motor, from 0.
        motor: usize,
        /// By so many counts.
        counts: u16,
    },
    /// A phase of an encoder is open: its counter goes to and fro by one.
    OpenPhase {
        /// Of this motor, from 0.
        motor: usize,
    },
    /// An encoder's counter counts so many of its steps from here on, in halves: −2 is backwards, 1 every other one.
    Counts {
        /// Of this motor, from 0.
        motor: usize,
        /// Halves.
        halves: i16,
    },
    /// One tick takes so much longer, µs.
    Overrun(u16),
    /// What the host says arrives as nonsense, as much as the line carries.
    Nonsense,
    /// The commands task panics.
    Panic,
    /// The telemetry task hangs.
    TelemetryHangs,
    /// The commands task takes more stack than there is.
    StackOverflows,
}

/// The faults of a recording, and what of them has begun.
#[derive(Debug)]
pub(super) struct FaultScript {
    script: Vec<TimedFault>,
    frozen: Option<[u8; I2C_BURST]>,
    /// Where the counter of a broken encoder stood.
    counter: Option<u16>,
    nonsense: ChaCha8Rng,
}

impl FaultScript {
    pub fn new(script: Vec<TimedFault>) -> Self {
        Self { script, frozen: None, counter: None, nonsense: ChaCha8Rng::seed_from_u64(0) }
    }

    /// Changes what the pins show `ticks` after the first tick of the motion.
    pub fn inject(&mut self, ticks: u32, sensors: &mut Sensors) {
        for TimedFault { at, kind } in &self.script {
            if ticks < *at {
                continue;
            }
            let once = |injected| if ticks == *at { injected } else { InjectedFault::None };
            match *kind {
                FaultKind::EmergencyStop => sensors.pins |= PINS_EMERGENCY_STOP,
                FaultKind::BrownOut => sensors.pins |= PINS_BROWN_OUT,
                FaultKind::Gyro1Dead => sensors.spi = sensors.spi.map(|_| Default::default()),
                FaultKind::Gyro2Stuck => {
                    self.frozen = self.frozen.or(sensors.i2c);
                    sensors.i2c = self.frozen;
                }
                FaultKind::I2cHangs => sensors.i2c = None,
                FaultKind::EncoderJumps { motor, counts } => {
                    sensors.counters[motor] = sensors.counters[motor].wrapping_add(counts);
                }
                FaultKind::OpenPhase { motor } => {
                    let counter = &mut sensors.counters[motor];
                    *counter = self.counter.get_or_insert(*counter).wrapping_add(*counter & 1);
                }
                FaultKind::Counts { motor, halves } => {
                    let counter = &mut sensors.counters[motor];
                    let base = *self.counter.get_or_insert(*counter);
                    let steps = i32::from(counter.wrapping_sub(base) as i16) * i32::from(halves) / 2;
                    *counter = base.wrapping_add(steps as u16);
                }
                FaultKind::Overrun(us) => sensors.injected = once(InjectedFault::Delay(us)),
                FaultKind::Nonsense => {
                    let mut bytes = [0; LINE_BYTES];
                    self.nonsense.fill(&mut bytes);
                    sensors.host = bytes.into_iter().collect();
                }
                FaultKind::Panic => sensors.injected = once(InjectedFault::PanicInCommands),
                FaultKind::StackOverflows => sensors.injected = once(InjectedFault::StackOverflows),
                FaultKind::TelemetryHangs => sensors.injected = once(InjectedFault::TelemetryHangs),
            }
        }
    }
}
