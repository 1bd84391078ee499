//! The machine as a microcontroller at the world's pins: it answers the image's requests.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex};

use firmware::lockstep::{
    Answer, InjectedFault, Kind, MAX_HOST_BYTES, MAX_MESSAGE, MOTORS, Malformed, Request, Sensors, Started, Tick,
    Transfer,
};
use firmware::wiring::reset;
use host::simulate::{Microcontroller, SimulateError, World};
use protocol::{Duty, Layout, State};

use super::fault::FaultScript;
use super::line_monitor::LineMonitor;
use super::log::{Log, Period};
use super::qemu::Qemu;
use super::{Options, image};

/// Ticks without food after which the watchdog bites: the real one's nominal 16 ms.
const WATCHDOG_TICKS: u32 = 16;

/// What the emulator says of a processor that has locked up.
const LOCKUP: &str = "Lockup";

/// RCC_CSR after the resets that the world knows: every one pulls the pin, and power-on shows as a brown-out too.
const POWER_ON: u32 = 1 << 27 | 1 << 26 | 1 << 25;
const WATCHDOG: u32 = 1 << 29 | 1 << 26;
const SOFTWARE: u32 = 1 << 28 | 1 << 26;

/// QEMU, the world, and what lies between them.
pub(super) struct Machine {
    qemu: Qemu,
    world: World,
    line: LineMonitor,
    faults: FaultScript,
    log: Arc<Mutex<Log>>,
    start_tick: Option<u32>,
    /// The noise of the motion has begun.
    in_noise: bool,
    /// What the image asked and waits for.
    asked: Option<Asked>,
    /// Ticks since the processor started.
    seq: u32,
    /// Ticks since power-on.
    ticks: u32,
    gyro1_from_tick: u32,
    swapped_leads: Option<usize>,
    unfed: u32,
    bite: bool,
    /// What the next start will find in RCC_CSR.
    reset_flags: u32,
    from_host: VecDeque<u8>,
    to_host: VecDeque<u8>,
}

/// A tick that the image waits in.
struct Asked {
    t_us: u32,
    tick: Tick,
}

impl Machine {
    /// Starts the emulator; the robot is in its marked pose.
    pub fn start(world: World, options: &Options, log: Arc<Mutex<Log>>) -> Self {
        Self {
            qemu: Qemu::start(image()).expect("the emulator can be started"),
            world,
            line: LineMonitor::new(Layout::DOGGY),
            faults: FaultScript::new(options.machine_faults.clone()),
            log,
            start_tick: options.start_tick,
            in_noise: false,
            asked: None,
            seq: 0,
            ticks: 0,
            gyro1_from_tick: options.gyro1_from_tick,
            swapped_leads: options.swapped_leads,
            unfed: 0,
            bite: false,
            reset_flags: POWER_ON,
            from_host: VecDeque::new(),
            to_host: VecDeque::new(),
        }
    }

    fn run_tick(&mut self) -> Result<(), String> {
        let Asked { t_us, tick } = match self.asked.take() {
            Some(asked) => asked,
            None => self.start_up()?.0,
        };
        let mut duty = tick.duty.map(|duty| f64::from(duty.0) / f64::from(Duty::FULL));
        if let Some(motor) = self.swapped_leads {
            duty[motor] = -duty[motor];
        }
        self.begin_noise();
        let sensors = self.sense(&tick, &duty);
        self.reply(|out| sensors.write(out))?;
        self.note(Period {
            seq: self.seq,
            t_us,
            duty: tick.duty,
            armed: tick.armed,
            stopped: false,
            sensors,
            cycles: [tick.begin_cycles, tick.tick_cycles],
            stack_bytes: tick.stack_bytes,
        });
        self.seq += 1;
        self.ticks += 1;
        if std::mem::take(&mut self.bite) {
            self.reset_flags = WATCHDOG;
            self.qemu.reset()?;
        }
        self.rest_of_tick(duty)?;
        self.hear_usart()
    }

    /// What the image does until it asks for the next tick.
    fn rest_of_tick(&mut self, mut duty: [f64; MOTORS]) -> Result<(), String> {
        loop {
            let Request { t_us, kind } = match self.qemu.request() {
                Err(said) if said.contains(LOCKUP) => return self.watchdog_after_lockup(),
                request => request?,
            };
            match kind {
                Kind::Spi(_) | Kind::I2c { .. } => self.transfer(kind)?,
                Kind::Stop => {
                    duty = [0.0; MOTORS];
                    self.with_log(|log| log.periods.iter_mut().last().map(|period| period.stopped = true));
                }
                Kind::Tick(tick) => {
                    self.world.pass(&duty);
                    self.asked = Some(Asked { t_us, tick });
                    return Ok(());
                }
                Kind::Start => return self.begin_anew(),
                other => return Err(format!("{other:?} within a tick")),
            }
        }
    }

    /// The processor was reset, which lets go of the pins.
    fn begin_anew(&mut self) -> Result<(), String> {
        self.with_log(|log| log.periods.iter_mut().last().map(|period| period.stopped = true));
        self.world.pass(&[0.0; MOTORS]);
        self.hear_usart()?;
        self.line.cut();
        (self.seq, self.unfed) = (0, 0);
        let (asked, start_up_s) = self.answer_start()?;
        self.world.restart(start_up_s);
        self.asked = Some(asked);
        Ok(())
    }

    /// The processor has locked up, which ends the emulator. A real one stands: its PWM timer stops by itself, and the
    /// watchdog resets it.
    fn watchdog_after_lockup(&mut self) -> Result<(), String> {
        self.hear_usart()?;
        (0..WATCHDOG_TICKS).for_each(|_| self.world.pass(&[0.0; MOTORS]));
        self.qemu = Qemu::start(image()).map_err(|error| error.to_string())?;
        self.reset_flags = WATCHDOG;
        match self.qemu.request()?.kind {
            Kind::Start => self.begin_anew(),
            other => Err(format!("{other:?} before a start")),
        }
    }

    /// Answers a transfer of a gyro's set-up.
    fn transfer(&mut self, kind: Kind) -> Result<(), String> {
        let answer = match kind {
            Kind::Spi(sent) => self.spi(&sent),
            Kind::I2c { address, read, written } => self.world.i2c(address, &written, read.into()),
            other => return Err(format!("{other:?} is no transfer")),
        };
        let answer = Answer::from(answer.and_then(|bytes| Transfer::from_slice(&bytes).ok()));
        self.reply(|out| answer.write(out))
    }

    /// A transfer on the SPI.
    fn spi(&self, sent: &[u8]) -> Option<Vec<u8>> {
        if self.ticks < self.gyro1_from_tick { Some(vec![0; sent.len()]) } else { self.world.spi(sent) }
    }

    /// From power-on to the first tick.
    fn start_up(&mut self) -> Result<(Asked, f64), String> {
        match self.qemu.request()?.kind {
            Kind::Start => self.answer_start(),
            other => Err(format!("{other:?} before a start")),
        }
    }

    /// From the start of the processor to its first tick, and how long that takes, s.
    fn answer_start(&mut self) -> Result<(Asked, f64), String> {
        let flags = std::mem::replace(&mut self.reset_flags, SOFTWARE);
        self.with_log(|log| log.starts.push(reset::reason(flags, false)));
        self.reply(|out| Started(flags).write(out))?;
        let mut waited_us = 0;
        loop {
            let Request { t_us, kind } = self.qemu.request()?;
            match kind {
                Kind::Delay { us } => {
                    self.world.clock().pass_ns(1000 * u64::from(us));
                    waited_us += u64::from(us);
                }
                Kind::Stop => {}
                Kind::Spi(_) | Kind::I2c { .. } => self.transfer(kind)?,
                Kind::Tick(tick) => return Ok((Asked { t_us, tick }, waited_us as f64 * 1e-6)),
                Kind::Start => return Err("a second start".to_owned()),
            }
        }
    }

    /// What the pins show in this tick.
    fn sense(&mut self, tick: &Tick, duty: &[f64; MOTORS]) -> Sensors {
        let hardware = self.world.sense(duty);
        let spi = tick.spi.and_then(|sent| self.spi(&sent));
        let i2c = tick
            .i2c
            .and_then(|[address, register]| self.world.i2c(address, &[register], firmware::lockstep::I2C_BURST));
        let n = self.from_host.len().min(MAX_HOST_BYTES);
        let mut sensors = Sensors {
            counters: std::array::from_fn(|motor| hardware[motor]),
            spi: spi.and_then(|answer| answer.try_into().ok()),
            i2c: i2c.and_then(|answer| answer.try_into().ok()),
            ready_us: self.world.ready_us(),
            host: self.from_host.drain(..n).collect(),
            ..Sensors::default()
        };
        if let Some(ticks) = self.motion_ticks() {
            self.faults.inject(ticks, &mut sensors);
        }
        // The first exchange comes before the first tick, which feeds.
        self.unfed = if tick.fed || self.seq == 0 { 0 } else { self.unfed + 1 };
        self.bite |= self.unfed >= WATCHDOG_TICKS;
        if self.bite {
            sensors.injected = InjectedFault::Halt;
        }
        sensors
    }

    /// The noise of a motion depends on nothing that was before it.
    fn begin_noise(&mut self) {
        let begins = match self.start_tick {
            Some(tick) => self.seq == tick,
            None => self.line.motion_seq.is_some(),
        };
        if begins && !self.in_noise {
            self.in_noise = true;
            self.world.begin_motion();
        }
    }

    /// Ticks since the first one of the motion, in the first life of the processor.
    fn motion_ticks(&self) -> Option<u32> {
        let lives = self.with_log(|log| log.starts.len());
        self.line.motion_seq.filter(|_| lives == 1).and_then(|start| self.seq.checked_sub(start))
    }

    fn note(&self, period: Period) {
        let (seq, motion_seq) = (period.seq, self.line.motion_seq);
        self.with_log(|log| {
            log.periods.push(period);
            if log.motion.is_none()
                && let Some(start) = motion_seq
            {
                log.motion = Some(log.periods.len() - 1 - (seq - start) as usize);
            }
        });
    }

    fn hear_usart(&mut self) -> Result<(), String> {
        let mut sent = Vec::new();
        self.qemu.sent(&mut sent)?;
        self.line.device_says(&sent);
        self.with_log(|log| log.sent.extend_from_slice(&sent));
        self.to_host.extend(sent);
        Ok(())
    }

    fn reply(&mut self, write: impl FnOnce(&mut [u8]) -> Result<usize, Malformed>) -> Result<(), String> {
        let mut message = [0; MAX_MESSAGE];
        let n = write(&mut message).map_err(|_| "a reply that does not fit".to_owned())?;
        self.qemu.reply(&message[..n])
    }

    fn with_log<T>(&self, f: impl FnOnce(&mut Log) -> T) -> T {
        f(&mut self.log.lock().unwrap_or_else(|poisoned| poisoned.into_inner()))
    }
}

impl Microcontroller for Machine {
    fn tick(&mut self) -> Result<(), SimulateError> {
        self.run_tick().map_err(|said| SimulateError::Machine { said })
    }

    fn reset(&mut self) -> Result<(), SimulateError> {
        self.bite = true;
        Ok(())
    }

    fn receive(&mut self, bytes: &[u8]) {
        self.line.host_says(bytes);
        self.from_host.extend(bytes);
    }

    fn transmit(&mut self, out: &mut [u8]) -> usize {
        let n = self.to_host.len().min(out.len());
        out.iter_mut().zip(self.to_host.drain(..n)).for_each(|(out, byte)| *out = byte);
        n
    }

    fn state(&self) -> State {
        self.line.state
    }

    fn layout(&self) -> Layout {
        Layout::DOGGY
    }

    fn time_s(&self) -> f64 {
        self.world.clock().now_ns() as f64 * 1e-9
    }
}
