//! Setting a gyro up, with what goes wrong in the log: at the start, and again from `idle` while it is missing.
//!
//! ```text
//!   power-up ─ 20 ms ─▶ attempt ─ 10 ms ─▶ attempt ─ 10 ms ─▶ attempt ──▶ found: its burst belongs to the tick
//!                                                                   ╰──▶ missing: `idle` tries every half second
//!   tick: no reading for a second ──▶ given back to `idle`                       found ──▶ queue ──▶ tick
//! ```
//!
//! A motion is refused while a gyro is missing, and stopped three ticks after it went silent: nothing moves meanwhile.

use embedded_hal::delay::DelayNs;
use firmware::driver::GyroError;
use heapless::spsc::{Consumer, Producer, Queue};

/// From the start of the processor to the first access, ms: the parts need 1 ms after their own supply is up, which ramps
/// for 3 ms and longer behind a cable or a regulator of its own.
pub const POWER_UP_MS: u32 = 20;
/// Attempts at the start.
const ATTEMPTS: u8 = 3;
/// Between two of them, ms.
const PAUSE_MS: u32 = 10;
/// Between two attempts from `idle`, µs of device time.
const RETRY_US: u32 = 500_000;

/// Tries to set gyro `number` (from 1) up; `address` gives a register's. Whether it is there.
pub fn set_up<R, E, T>(
    number: u8,
    delay: &mut impl DelayNs,
    mut attempt: impl FnMut() -> Result<T, GyroError<R, E>>,
    address: impl Fn(R) -> u8,
) -> bool {
    for n in 0..ATTEMPTS {
        if n > 0 {
            delay.delay_ms(PAUSE_MS);
        }
        match attempt() {
            Ok(_) => {
                defmt::info!("gyro {=u8}: set up", number);
                return true;
            }
            Err(error) => tell(number, error, &address),
        }
    }
    defmt::error!("gyro {=u8}: missing; nothing will move before it answers", number);
    false
}

fn tell<R, E>(number: u8, error: GyroError<R, E>, address: impl Fn(R) -> u8) {
    match error {
        GyroError::Bus { register, .. } => {
            defmt::error!("gyro {=u8}: no answer at register {=u8:#04x}", number, address(register));
        }
        GyroError::WrongId { register, expected, got } => defmt::error!(
            "gyro {=u8}: another part, register {=u8:#04x} is {=u16:#06x} instead of {=u16:#06x}",
            number,
            address(register),
            got,
            expected
        ),
        GyroError::Unexpected { register, mask, expected, got } => defmt::error!(
            "gyro {=u8}: register {=u8:#04x} is {=u16:#06x} instead of {=u16:#06x} under {=u16:#06x}",
            number,
            address(register),
            got,
            expected,
            mask
        ),
    }
}

/// A bus whose part can be set up.
pub trait Part: Sized {
    /// Gyro of the part, from 1.
    fn number(&self) -> u8;

    /// Sets the part up; whether it is there. Blocks for 65 ms or less, with interrupts on. What is wrong was logged at the
    /// start, and is not again twice a second.
    fn attempt(&mut self) -> bool;
}

/// Buses on their way between the tick and `idle`; each way has room for both.
pub type Way<B> = Queue<B, 3>;

/// The tick's ends.
pub struct Exchange<B: 'static> {
    /// Found again.
    pub found: Consumer<'static, B>,
    /// Silent.
    pub lost: Producer<'static, B>,
}

/// What `idle` does with the parts that are missing.
pub struct Search<B: 'static> {
    missing: heapless::Vec<B, 2>,
    lost: Consumer<'static, B>,
    found: Producer<'static, B>,
    last_us: u32,
}

impl<B: Part> Search<B> {
    /// Both ends of two ways; nothing is missing.
    pub fn new(lost: &'static mut Way<B>, found: &'static mut Way<B>) -> (Exchange<B>, Self) {
        let ((lost, lost_here), (found_here, found)) = (lost.split(), found.split());
        let search = Search { missing: heapless::Vec::new(), lost: lost_here, found: found_here, last_us: 0 };
        (Exchange { found, lost }, search)
    }

    /// A part could not be set up at the start.
    pub fn miss(&mut self, bus: B) {
        // There are two parts.
        let _ = self.missing.push(bus);
    }

    /// To be called from `idle`, again and again: tries what is missing when it is time.
    pub fn step(&mut self, now_us: u32) {
        while let Some(bus) = self.lost.dequeue() {
            self.miss(bus);
        }
        if self.missing.is_empty() || now_us.wrapping_sub(self.last_us) < RETRY_US {
            return;
        }
        self.last_us = now_us;
        for mut bus in core::mem::take(&mut self.missing) {
            let back = if bus.attempt() {
                defmt::info!("gyro {=u8}: set up", bus.number());
                self.found.enqueue(bus).err()
            } else {
                Some(bus)
            };
            if let Some(bus) = back {
                self.miss(bus);
            }
        }
    }
}
