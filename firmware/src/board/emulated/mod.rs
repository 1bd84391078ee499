//! The emulated board: the same application in QEMU (machine netduinoplus2), in lock-step with a simulated robot.
//!
//! ```text
//!   application ─┬─ Pins ─────── exchange ── two FIFOs by semihosting ──▶ the simulated robot's counters, chips, motors
//!                ├─ LineIn ◀──── exchange ◀─ what the host sent in the period before
//!                └─ LineOut ──── USART1, the emulated one ─────────────▶ the simulated line to the host
//! ```
//!
//! What differs from the real board, and why:
//! * **Buses.** QEMU has no I²C and no DMA. A period's transfers are in its one exchange and complete at once, so the
//!   tick's task follows the period's without a pause. The set-up of a gyro, at the start or from `idle`, is an exchange a
//!   transfer.
//! * **Received bytes** come with the exchange and not through the emulated USART. QEMU hands those in whenever the PC
//!   finds time, so the tick that hears a heartbeat would depend on the load of the PC.
//! * **Sent bytes** go through the USART's data register. QEMU 7.2 never raises "transmitter empty", so the time on the
//!   line is kept by the board: the next bytes wait as long as the last ones take at 921,600 baud.
//! * **Device time** is a thousand microseconds for every period, and what SysTick shows beyond.
//! * **Execution time** in a sample is told in whole periods: 0 while every tick ends in its own. How long a tick takes
//!   depends on when the host's bytes arrive, and a recording of the emulator must not. The exact cycles go to the world
//!   with the exchange.
//! * **The watchdog** is the world's: it is told whether it was fed, and resets the machine.
//! * **The flash** that keeps a description is RAM, which a reset leaves alone. An erase takes no time.
//! * **Reset flags** are the world's too; the place of a panic survives in RAM as on the real board.

mod buses;
mod clock;
mod exchange;
mod line;
mod pins;
mod stack;
mod store;

use cortex_m::Peripherals as Core;
use cortex_m::{asm, singleton};
use embedded_hal::delay::DelayNs;
use firmware::driver::{Bmi323, Icm42688p};
use firmware::lockstep::{Kind, MOTORS, Started};
use firmware::robot::{self, GYRO_RANGE};
use firmware::wiring::{self, reset};
use stm32f4xx_hal::pac::Peripherals as Device;

use super::gyro::{Part, Search, Way};
use super::{Board, gyro};
use buses::{BMI323_ADDRESS, I2cBus, SpiBus, Spin, Wait};
pub use line::{LineIn, LineOut};
pub use pins::Pins;
pub use store::Store;

/// The emergency stop is a bit of the exchange, with nothing to be short-circuited.
pub const STOP_TEST: bool = false;

// More joints than motors would build, and the last ones never be driven.
const _: () = assert!(robot::JOINTS == MOTORS, "the robot has another number of joints than the board of motors");
const _: () = assert!(robot::GYROS == 2, "the robot has another number of gyros than the board");

/// The watchdog.
pub struct Watchdog;

/// A bus with its gyro, on its way between the tick and `idle`.
pub enum Bus {
    /// Gyro 1.
    Spi,
    /// Gyro 2.
    I2c,
}

impl Part for Bus {
    fn number(&self) -> u8 {
        match self {
            Bus::Spi => 1,
            Bus::I2c => 2,
        }
    }

    fn attempt(&mut self) -> bool {
        match self {
            Bus::Spi => Icm42688p::new(SpiBus, GYRO_RANGE, &mut Spin).is_ok(),
            Bus::I2c => Bmi323::new(I2cBus, BMI323_ADDRESS, GYRO_RANGE, &mut Spin).is_ok(),
        }
    }
}

/// Starts the board: the gyros are set up, the first period begins a millisecond later.
pub fn start(mut core: Core, device: Device) -> Board {
    exchange::open();
    let flags = exchange::ask(&exchange::request(Kind::Start), Started::read).0;
    let place = super::panic::take();
    let reason = reset::reason(flags, place.is_some());

    let icm42688p = || Icm42688p::new(SpiBus, GYRO_RANGE, &mut Wait);
    let bmi323 = || Bmi323::new(I2cBus, BMI323_ADDRESS, GYRO_RANGE, &mut Wait);
    let ways = (singleton!(: Way<Bus> = Way::new()), singleton!(: Way<Bus> = Way::new()));
    let (Some(lost), Some(found)) = ways else { unreachable!("`start` runs once") };
    let (exchange, mut search) = Search::new(lost, found);
    Wait.delay_ms(gyro::POWER_UP_MS);
    let there = [
        gyro::set_up(1, &mut Wait, icm42688p, |register| register as u8),
        gyro::set_up(2, &mut Wait, bmi323, |register| register as u8),
    ];
    for (there, bus) in there.into_iter().zip([Bus::Spi, Bus::I2c]) {
        if !there {
            search.miss(bus);
        }
    }
    let (arrived, line_in) = line::received();
    let line_out = LineOut::new(device.USART1);
    clock::start(&mut core.SYST);
    let pins = Pins::new(there, exchange, arrived);
    Board { pins, line_out, line_in, watchdog: Watchdog, search, store: store::take(), started: (reason, place) }
}

/// Never comes: the supply is a bit of the exchange.
pub fn supply_fell() {
    motors_off();
}

/// Motors off, from anywhere.
pub fn motors_off() {
    exchange::tell(&exchange::request(Kind::Stop));
}

impl wiring::Watchdog for Watchdog {
    fn feed(&mut self) {
        pins::feed();
    }

    /// The world counts periods, and the store takes no time.
    fn lengthen(&mut self) {}
}

/// Nothing more happens until the machine is reset.
fn halt() -> ! {
    cortex_m::interrupt::disable();
    loop {
        asm::nop();
    }
}
