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
//!   tick's task follows the period's without a pause.
//! * **Received bytes** come with the exchange and not through the emulated USART. QEMU hands those in whenever the PC
//!   finds time, so the tick that hears a heartbeat would depend on the load of the PC.
//! * **Sent bytes** go through the USART's data register. QEMU 7.2 never raises "transmitter empty", so the time on the
//!   line is kept by the board: the next bytes wait as long as the last ones take at 921,600 baud.
//! * **Device time** is a thousand microseconds for every period, and what SysTick shows beyond.
//! * **Execution time** in a sample is told in whole periods: 0 while every tick ends in its own. How long a tick takes
//!   depends on when the host's bytes arrive, and a recording of the emulator must not. The exact cycles go to the world
//!   with the exchange.
//! * **The watchdog** is the world's: it is told whether it was fed, and resets the machine.
//! * **Reset flags** are the world's too; the place of a panic survives in RAM as on the real board.

mod buses;
mod clock;
mod exchange;
mod line;
mod pins;
mod stack;

use cortex_m::Peripherals as Core;
use cortex_m::asm;
use firmware::driver::{Bmi323, Icm42688p};
use firmware::lockstep::{Kind, Started};
use firmware::robot::GYRO_RANGE;
use firmware::wiring::{self, reset};
use stm32f4xx_hal::pac::Peripherals as Device;

use super::{Board, gyro};
use buses::{BMI323_ADDRESS, I2cBus, SpiBus, Wait};
pub use line::{LineIn, LineOut};
pub use pins::Pins;

/// The watchdog.
pub struct Watchdog;

/// Starts the board: the gyros are set up, the first period begins a millisecond later.
pub fn start(mut core: Core, device: Device) -> Board {
    exchange::open();
    let flags = exchange::ask(&exchange::request(Kind::Start), Started::read).0;
    let place = super::panic::take();
    let reason = reset::reason(flags, place.is_some());

    let icm42688p = || Icm42688p::new(SpiBus, GYRO_RANGE, &mut Wait);
    let bmi323 = || Bmi323::new(I2cBus, BMI323_ADDRESS, GYRO_RANGE, &mut Wait);
    let there =
        [gyro::set_up(1, icm42688p, |register| register as u8), gyro::set_up(2, bmi323, |register| register as u8)];
    let (arrived, line_in) = line::received();
    let line_out = LineOut::new(device.USART1);
    clock::start(&mut core.SYST);
    Board { pins: Pins::new(there, arrived), line_out, line_in, watchdog: Watchdog, started: (reason, place) }
}

/// Motors off, from anywhere.
pub fn motors_off() {
    exchange::tell(&exchange::request(Kind::Stop));
}

impl wiring::Watchdog for Watchdog {
    fn feed(&mut self) {
        pins::feed();
    }
}

/// Nothing more happens until the machine is reset.
fn halt() -> ! {
    cortex_m::interrupt::disable();
    loop {
        asm::nop();
    }
}
