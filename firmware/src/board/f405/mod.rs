//! The STM32F405RG board. Pins, peripherals and parts: the wiring table in `firmware/README.md`.
//!
//! ```text
//!   t_k            8 µs                      ~480 µs   600 µs                                  t_{k+1}
//!   │ begin: PWM restarts with the new duty  │         │ collect, tick, apply                  │ begin
//!   │ encoders latched                       │         │                                       │
//!   │ SPI1 by DMA ─┤                         │         │                                       │
//!   │ I²C1 by interrupts ────────────────────┤         │ what is not over is aborted           │
//!   ╰ SysTick                                          ╰ TIM5 compare 1
//! ```
//!
//! What lets go of the motors, the fastest first: a stop, zero duty within the tick; the PWM timer, which stops by
//! itself half a period after a restart that did not come; a fault or a panic, which shuts timer and drivers off and
//! resets; the watchdog, 11 to 30 ms after the last tick in which all tasks were well; a reset, which leaves every
//! pin open, so that the pull-downs on the drivers' enable and PWM inputs count.

mod clock;
mod dma;
mod encoders;
mod i2c;
mod line;
mod motors;
mod reset;
mod spi;
mod supply;
mod watchdog;

use cortex_m::Peripherals as Core;
use firmware::driver::{Bmi323, Icm42688p};
use firmware::robot;
use firmware::wiring::BUS_BOUND_US;
use firmware::{Inputs, Outputs, wiring};
use protocol::Duty;
use stm32f4xx_hal::gpio::GpioExt;
use stm32f4xx_hal::pac::Peripherals as Device;
use stm32f4xx_hal::rcc::RccExt;

use super::{Board, gyro};
use clock::{Clock, Stopwatch};
use encoders::Encoders;
pub use line::{LineIn, LineOut};
use motors::Motors;
pub use motors::motors_off;
use supply::Supply;
pub use watchdog::Watchdog;

/// The gyros of the board.
type Imu1 = Icm42688p<spi::Spi>;
type Imu2 = Bmi323<i2c::Blocking>;

/// Starts the board: motors off first, then the watchdog, clocks, pins, gyros, and last the period.
///
/// Takes at most half a second, whatever is broken: a gyro is tried three times. Without its crystal the board stays in
/// here until the watchdog resets it, again and again, with its motors off.
#[inline(never)]
pub fn start(core: Core, device: Device) -> Board {
    let mut rcc = device.RCC.constrain();
    let (port_a, port_b, port_c) =
        (device.GPIOA.split(&mut rcc), device.GPIOB.split(&mut rcc), device.GPIOC.split(&mut rcc));
    let pins = motors::pins(port_c.pc1, (port_c.pc6, port_c.pc7, port_c.pc8), (port_c.pc9, port_c.pc10, port_c.pc11));
    let watchdog = Watchdog::start(device.IWDG, &device.DBGMCU);
    let started = reset::reason(&rcc);

    clock::start(&device.FLASH, &mut rcc);
    let supply = Supply::new(device.PWR, port_c.pc0, &mut rcc);
    let motors = Motors::new(device.TIM8, pins, &mut rcc);
    let encoders = Encoders::new(
        (device.TIM2, port_a.pa0, port_a.pa1),
        (device.TIM3, port_b.pb4, port_b.pb5),
        (device.TIM4, port_b.pb6, port_b.pb7),
        &mut rcc,
    );
    let mut delay = clock::cycles(core.DCB, core.DWT);

    dma::enable(&device.DMA2, &mut rcc);
    let mut spi = spi::Spi::new(device.SPI1, (port_a.pa4, port_a.pa5, port_a.pa6, port_a.pa7), &mut rcc);
    let imu1 = gyro::set_up(
        1,
        || Icm42688p::new(&mut spi, robot::GYRO_RANGE, &mut delay).map(drop),
        |register| register as u8,
    );
    let mut i2c = i2c::Blocking::new(i2c::Bus::new(device.I2C1, port_b.pb8, port_b.pb9, &mut rcc), delay);
    let imu2 = gyro::set_up(
        2,
        || Bmi323::new(&mut i2c, Imu2::ADDRESS_SDO_LOW, robot::GYRO_RANGE, &mut delay).map(drop),
        |register| register as u8,
    );

    let (line_out, line_in) = line::start(device.USART1, port_a.pa9, port_a.pa10, &mut rcc);
    let clock = Clock::start(device.TIM5, core.SYST, &mut rcc);
    let pins = Pins {
        clock,
        motors,
        encoders,
        spi: spi::Burst::new(spi, imu1),
        i2c: i2c::Burst::new(i2c.release(), imu2),
        supply,
        preloaded: None,
        stopwatch: Stopwatch::default(),
    };
    Board { pins, line_out, line_in, watchdog: watchdog.shorten(), started }
}

/// Sensors and motors.
pub struct Pins {
    clock: Clock,
    motors: Motors,
    encoders: Encoders,
    spi: spi::Burst,
    i2c: i2c::Burst,
    supply: Supply,
    /// What the last tick decided; none if it did not come this far.
    preloaded: Option<[Duty; motors::MOTORS]>,
    stopwatch: Stopwatch,
}

impl wiring::Pins for Pins {
    fn begin(&mut self) -> u32 {
        self.stopwatch.go();
        // First of all, for the least jitter. If the timer has stopped, this period comes so late that what was meant
        // for it must not act any more; the tick will find the overrun.
        let driven = self.motors.driven();
        self.motors.drive(self.preloaded.take().filter(|_| driven).unwrap_or_default());
        let now_us = self.clock.begin(BUS_BOUND_US);
        self.encoders.latch();
        self.spi.begin();
        self.i2c.begin();
        self.stopwatch.halt();
        now_us
    }

    fn collect(&mut self) -> Inputs {
        self.clock.acknowledge();
        let last_execution_us = self.stopwatch.lap_us();
        self.stopwatch.go();
        let mut inputs = Inputs {
            emergency_stop: self.supply.emergency_stop(),
            brown_out: self.supply.brown_out(),
            last_execution_us,
            ..Inputs::default()
        };
        for (input, counts) in inputs.encoders.iter_mut().zip(self.encoders.counts()) {
            *input = Some(counts);
        }
        inputs.gyros = [self.spi.collect(), self.i2c.collect()];
        inputs
    }

    fn apply(&mut self, outputs: &Outputs) {
        if outputs.stop {
            self.motors.drive([Duty::ZERO; motors::MOTORS]);
        }
        let [a, b, c, ..] = outputs.duty;
        self.preloaded = Some([a, b, c]);
        self.stopwatch.halt();
    }

    fn bus_event(&mut self) {
        self.i2c.on_interrupt();
    }
}
