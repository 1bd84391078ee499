//! Sensors and motors: one exchange a period.

use core::sync::atomic::{AtomicBool, Ordering::Relaxed};

use cortex_m::peripheral::NVIC;
use firmware::constants::TICK_US;
use firmware::driver::{
    BMI323_RATE_HZ, BMI323_READ_US, Bmi323, ICM42688P_RATE_HZ, ICM42688P_READ_US, Icm42688p, QuadratureCounter,
};
use firmware::lockstep::{InjectedFault, Kind, MOTORS, PINS_BROWN_OUT, PINS_EMERGENCY_STOP, Request, Sensors, Tick};
use firmware::wiring::absence::Absence;
use firmware::wiring::data_ready::DataReady;
use firmware::{GyroInput, Inputs, Outputs, wiring};
use protocol::Duty;
use stm32f4xx_hal::pac::Interrupt;

use crate::board::gyro::{Exchange, Part};

use super::buses::{BMI323_ADDRESS, I2cBus, SpiBus};
use super::line::{self, Arrived};
use super::{Bus, clock, exchange, halt, motors_off, stack};

/// The watchdog was fed since the last exchange.
static FED: AtomicBool = AtomicBool::new(false);

/// Sensors and motors.
pub struct Pins {
    counters: [QuadratureCounter; MOTORS],
    /// Whether each gyro is set up; if not, its bus is with `idle`.
    there: [bool; 2],
    absence: [Absence; 2],
    data_ready: [DataReady; 2],
    t_us: u32,
    exchange: Exchange<Bus>,
    armed: bool,
    sensors: Sensors,
    /// Duties for the next period, if there was a tick.
    preloaded: Option<[Duty; MOTORS]>,
    /// Periods that the last tick ran beyond its own.
    overrun_periods: u32,
    begin_cycles: u32,
    tick_began: clock::Moment,
    tick_cycles: u32,
    stack_bytes: u16,
    arrived: Arrived,
}

/// Feeds the watchdog with the next exchange.
pub fn feed() {
    FED.store(true, Relaxed);
}

impl Pins {
    /// Motors off. A gyro that is not `there` is a bus error in every tick until `idle` finds it.
    pub fn new(there: [bool; 2], exchange: Exchange<Bus>, arrived: Arrived) -> Self {
        Pins {
            counters: [const { QuadratureCounter::new(0) }; MOTORS],
            there,
            absence: Default::default(),
            data_ready: [
                DataReady::new(ICM42688P_RATE_HZ, ICM42688P_READ_US),
                DataReady::new(BMI323_RATE_HZ, BMI323_READ_US),
            ],
            t_us: 0,
            exchange,
            armed: false,
            sensors: Sensors::default(),
            preloaded: None,
            overrun_periods: 0,
            begin_cycles: 0,
            tick_began: clock::now(),
            tick_cycles: 0,
            stack_bytes: 0,
            arrived,
        }
    }

    fn gyros(&self) -> [GyroInput; 2] {
        let Sensors { spi, i2c, .. } = self.sensors;
        [
            spi.map(|answer| Icm42688p::<SpiBus>::decode(&answer)).ok_or(()).into(),
            i2c.map(|answer| Bmi323::<I2cBus>::decode(&answer)).ok_or(()).into(),
        ]
    }
}

impl wiring::Pins for Pins {
    fn begin(&mut self) -> u32 {
        let began = clock::now();
        let t_us = clock::begin_period();
        self.t_us = t_us;
        if let Some(bus) = self.exchange.found.dequeue() {
            self.there[usize::from(bus.number() - 1)] = true;
        }
        let [spi_is_there, i2c_is_there] = self.there;
        let [register] = Bmi323::<I2cBus>::READ_REQUEST;
        let tick = Tick {
            duty: self.preloaded.take().unwrap_or_default(),
            fed: FED.swap(false, Relaxed),
            armed: self.armed,
            begin_cycles: self.begin_cycles,
            tick_cycles: self.tick_cycles,
            stack_bytes: self.stack_bytes,
            // The bus of a gyro that is missing belongs to `idle`: a burst would read the status that its set-up waits for.
            spi: spi_is_there.then_some(Icm42688p::<SpiBus>::READ_REQUEST),
            i2c: i2c_is_there.then_some([BMI323_ADDRESS, register]),
        };
        let exchange_began = clock::now();
        self.sensors = exchange::ask(&Request { t_us, kind: Kind::Tick(tick) }, Sensors::read);
        // All of this a real board does not do, or its DMA does it: it does not count.
        self.arrived.put(&self.sensors.host);
        self.stack_bytes = stack::deepest_bytes();
        let exchange_cycles = exchange_began.cycles();
        match self.sensors.injected {
            InjectedFault::None | InjectedFault::Delay(_) => {}
            InjectedFault::PanicInCommands => line::panic_in_commands(),
            InjectedFault::StackOverflows => line::overflow_in_commands(),
            InjectedFault::TelemetryHangs => line::hang_in_telemetry(),
            InjectedFault::Halt => halt(),
        }
        NVIC::pend(Interrupt::TIM5);
        self.begin_cycles = began.cycles().saturating_sub(exchange_cycles);
        t_us
    }

    fn collect(&mut self) -> Inputs {
        self.tick_began = clock::now();
        let mut inputs = Inputs {
            emergency_stop: self.sensors.pins & PINS_EMERGENCY_STOP != 0,
            brown_out: self.sensors.pins & PINS_BROWN_OUT != 0,
            last_execution_us: if self.overrun_periods == 0 { 0 } else { (1 + self.overrun_periods) * TICK_US },
            ..Inputs::default()
        };
        for ((input, counter), hardware) in
            inputs.encoders.iter_mut().zip(&mut self.counters).zip(self.sensors.counters)
        {
            *input = Some(counter.update(hardware));
        }
        for (input, gyro) in inputs.gyros.iter_mut().zip(self.gyros()) {
            *input = gyro;
        }
        for (index, ready) in self.data_ready.iter_mut().enumerate() {
            let edge_us = self.sensors.ready_us[index].map(|since_us| self.t_us.wrapping_sub(since_us.into()));
            inputs.gyro_ages[index] = ready.age(self.t_us, edge_us);
        }
        for (index, bus) in [Bus::Spi, Bus::I2c].into_iter().enumerate() {
            let has_reading = matches!(inputs.gyros[index], GyroInput::Words(_));
            if self.absence[index].lasts(has_reading) && core::mem::take(&mut self.there[index]) {
                // The way has room for both buses.
                let _ = self.exchange.lost.enqueue(bus);
            }
        }
        if let InjectedFault::Delay(us) = self.sensors.injected {
            clock::spin_us(us);
        }
        inputs
    }

    fn apply(&mut self, outputs: &Outputs) {
        let mut duty = [Duty::ZERO; MOTORS];
        duty.iter_mut().zip(outputs.duty).for_each(|(motor, duty)| *motor = duty);
        self.preloaded = Some(duty);
        self.armed = outputs.armed;
        self.tick_cycles = self.tick_began.cycles();
        if outputs.stop {
            motors_off();
        }
        self.overrun_periods = u32::from(clock::next_is_due());
    }
}
