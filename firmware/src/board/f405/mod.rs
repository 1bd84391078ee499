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
mod store;
mod supply;
mod watchdog;

use cortex_m::Peripherals as Core;
use cortex_m::singleton;
use embedded_hal::delay::DelayNs;
use firmware::driver::register::{Bmi323Register, Icm42688pRegister};
use firmware::driver::{
    BMI323_RATE_HZ, BMI323_READ_US, Bmi323, GyroError, ICM42688P_RATE_HZ, ICM42688P_READ_US, Icm42688p,
};
use firmware::robot;
use firmware::wiring::BUS_BOUND_US;
use firmware::wiring::absence::Absence;
use firmware::wiring::data_ready::DataReady;
use firmware::{GyroInput, Inputs, Outputs, wiring};
use protocol::{Duty, GyroAge, MAX_GYROS};
use stm32f4xx_hal::gpio::GpioExt;
use stm32f4xx_hal::pac::Peripherals as Device;
use stm32f4xx_hal::rcc::RccExt;

use super::gyro::{Exchange, Search, Way};
use super::{Board, gyro};
use clock::{Clock, CycleDelay, Source, Stopwatch};
use encoders::Encoders;
pub use line::{LineIn, LineOut};
use motors::Motors;
pub use motors::motors_off;
pub use store::Store;
use supply::Supply;
pub use supply::fell as supply_fell;
pub use watchdog::Watchdog;

/// The gyros of the board.
type Imu1 = Icm42688p<spi::Spi>;
type Imu2 = Bmi323<i2c::Blocking<'static>>;

// More joints than motors would build, and the last ones never be driven.
const _: () =
    assert!(robot::JOINTS == motors::MOTORS, "the robot has another number of joints than the board of motors");
const _: () = assert!(robot::GYROS == 2, "the robot has another number of gyros than the board");

/// The emergency stop is a contact that can be short-circuited: it must be pressed once before anything moves.
pub const STOP_TEST: bool = true;

/// A bus with its gyro, on its way between the tick and `idle`.
pub enum Bus {
    /// Gyro 1.
    Spi(spi::Spi),
    /// Gyro 2.
    I2c(i2c::Bus),
}

impl gyro::Part for Bus {
    fn number(&self) -> u8 {
        match self {
            Bus::Spi(_) => 1,
            Bus::I2c(_) => 2,
        }
    }

    fn attempt(&mut self) -> bool {
        match self {
            Bus::Spi(spi) => imu1(spi).is_ok(),
            Bus::I2c(bus) => imu2(&mut i2c::Blocking::new(bus, CycleDelay)).is_ok(),
        }
    }
}

type Failed<R, E> = GyroError<R, E>;

fn imu1(spi: &mut spi::Spi) -> Result<(), Failed<Icm42688pRegister, spi::Stuck>> {
    Icm42688p::new(spi, robot::GYRO_RANGE, &mut CycleDelay).map(drop)
}

fn imu2(i2c: &mut i2c::Blocking<'_>) -> Result<(), Failed<Bmi323Register, i2c::Failure>> {
    Bmi323::new(i2c, Imu2::ADDRESS_SDO_LOW, robot::GYRO_RANGE, &mut CycleDelay).map(drop)
}

/// Starts the board: motors off first, then the watchdog, clocks, pins, gyros, and last the period.
///
/// Takes at most half a second, whatever is broken: a gyro is tried three times, and later again from `idle`. Without its
/// crystal the board runs on its internal oscillator and says so; nothing moves then.
#[inline(never)]
pub fn start(core: Core, device: Device) -> Board {
    let mut rcc = device.RCC.constrain();
    let (port_a, port_b, port_c) =
        (device.GPIOA.split(&mut rcc), device.GPIOB.split(&mut rcc), device.GPIOC.split(&mut rcc));
    let pins = motors::pins(port_c.pc1, (port_c.pc6, port_c.pc7, port_c.pc8), (port_c.pc9, port_c.pc10, port_c.pc11));
    let watchdog = Watchdog::start(device.IWDG, &device.DBGMCU);
    let started = reset::reason(&rcc);

    let source = clock::start(&device.FLASH, &mut rcc, &device.TIM11);
    if let Source::Internal { crystal_khz } = source {
        defmt::error!(
            "the crystal has {=u32} kHz (0: it does not swing) instead of 8000; nothing will move",
            crystal_khz
        );
    }
    if !supply::resets_in_time(&device.FLASH) {
        defmt::warn!("the option byte BOR_LEV is not at level 3: a supply that collapses is not caught in time");
    }
    let supply = Supply::new(device.PWR, port_c.pc0, &device.EXTI, &mut rcc);
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
    let mut i2c = i2c::Bus::new(device.I2C1, port_b.pb8, port_b.pb9, &mut rcc);
    let ways = (singleton!(: Way<Bus> = Way::new()), singleton!(: Way<Bus> = Way::new()));
    let (Some(lost), Some(found)) = ways else { unreachable!("`start` runs once") };
    let (exchange, mut search) = Search::new(lost, found);
    delay.delay_ms(gyro::POWER_UP_MS);
    let found = gyro::set_up(1, &mut delay, || imu1(&mut spi), |register| register as u8);
    let spi = if found {
        Some(spi::Burst::new(spi))
    } else {
        search.miss(Bus::Spi(spi));
        None
    };
    let found = {
        let mut blocking = i2c::Blocking::new(&mut i2c, delay);
        gyro::set_up(2, &mut delay, || imu2(&mut blocking), |register| register as u8)
    };
    let i2c = if found {
        Some(i2c::Burst::new(i2c))
    } else {
        search.miss(Bus::I2c(i2c));
        None
    };

    let (line_out, line_in) = line::start(device.USART1, port_a.pa9, port_a.pa10, &mut rcc);
    let clock = Clock::start(device.TIM5, core.SYST, (port_a.pa2, port_a.pa3), &mut rcc);
    let pins = Pins {
        clock,
        motors,
        encoders,
        spi,
        i2c,
        absence: Default::default(),
        data_ready: [
            DataReady::new(ICM42688P_RATE_HZ, ICM42688P_READ_US),
            DataReady::new(BMI323_RATE_HZ, BMI323_READ_US),
        ],
        gyro_ages: Default::default(),
        exchange,
        supply,
        wrong_clock: source != Source::Crystal,
        dropped: false,
        running: false,
        preloaded: None,
        stopwatch: Stopwatch::default(),
    };
    let store = Store::new(device.FLASH);
    Board { pins, line_out, line_in, watchdog, search, store, started }
}

/// Sensors and motors.
pub struct Pins {
    clock: Clock,
    motors: Motors,
    encoders: Encoders,
    /// None while its gyro is missing.
    spi: Option<spi::Burst>,
    i2c: Option<i2c::Burst>,
    absence: [Absence; 2],
    data_ready: [DataReady; 2],
    /// Of the words that this period reads.
    gyro_ages: [GyroAge; MAX_GYROS],
    exchange: Exchange<Bus>,
    supply: Supply,
    wrong_clock: bool,
    /// What was preloaded for this period came too late.
    dropped: bool,
    /// The timer was started before.
    running: bool,
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
        let preloaded = self.preloaded.take();
        self.dropped = preloaded.is_some() && !driven && self.running;
        self.motors.drive(preloaded.filter(|_| driven).unwrap_or_default());
        self.running = true;
        let now_us = self.clock.begin(BUS_BOUND_US);
        self.encoders.latch();
        let edges_us = self.clock.edges_us();
        if let Some(bus) = self.exchange.found.dequeue() {
            match bus {
                Bus::Spi(spi) => self.spi = Some(spi::Burst::new(spi)),
                Bus::I2c(bus) => self.i2c = Some(i2c::Burst::new(bus)),
            }
        }
        self.spi.iter_mut().for_each(spi::Burst::begin);
        self.i2c.iter_mut().for_each(i2c::Burst::begin);
        for ((age, ready), edge_us) in self.gyro_ages.iter_mut().zip(&mut self.data_ready).zip(edges_us) {
            *age = ready.age(now_us, edge_us);
        }
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
            wrong_clock: self.wrong_clock,
            dropped: self.dropped,
            last_execution_us,
            gyro_ages: self.gyro_ages,
            ..Inputs::default()
        };
        for (input, counts) in inputs.encoders.iter_mut().zip(self.encoders.counts()) {
            *input = Some(counts);
        }
        inputs.gyros = [
            self.spi.as_mut().map_or(GyroInput::BusError, spi::Burst::collect),
            self.i2c.as_mut().map_or(GyroInput::BusError, i2c::Burst::collect),
        ];
        let [first, second] = inputs.gyros.map(|input| matches!(input, GyroInput::Words(_)));
        // Each way has room for both buses, so what is given back arrives.
        if self.absence[0].lasts(first)
            && let Some(burst) = self.spi.take()
        {
            let _ = self.exchange.lost.enqueue(Bus::Spi(burst.release()));
        }
        if self.absence[1].lasts(second)
            && let Some(burst) = self.i2c.take()
        {
            let _ = self.exchange.lost.enqueue(Bus::I2c(burst.release()));
        }
        inputs
    }

    fn apply(&mut self, outputs: &Outputs) {
        if outputs.stop {
            self.motors.drive([Duty::ZERO; motors::MOTORS]);
        }
        self.motors.arm(outputs.armed);
        let mut duty = [Duty::ZERO; motors::MOTORS];
        duty.iter_mut().zip(outputs.duty).for_each(|(motor, duty)| *motor = duty);
        self.preloaded = Some(duty);
        self.stopwatch.halt();
    }

    fn bus_event(&mut self) {
        self.i2c.iter_mut().for_each(i2c::Burst::on_interrupt);
    }

    fn burst_over(&mut self) {
        self.spi.iter_mut().for_each(spi::Burst::on_interrupt);
    }
}
