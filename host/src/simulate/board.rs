//! The simulated board: the firmware's control core, its drivers on simulated chips, and the plant they move.
//!
//! ```text
//!        ┌─ counters, 16 bit ── QuadratureCounter ─┐
//! plant ─┼─ ICM-42688-P ─ SPI ─ driver ────────────┼─▶ ControlCore::tick ─▶ duty of the next tick ─▶ plant
//!        └─ BMI323 ────── I²C ─ driver ────────────┘          │ ▲
//!                                                     bytes out ▼ │ bytes in
//! ```

use firmware::driver::{Bmi323, Gyro, GyroRange, Icm42688p, QuadratureCounter};
use firmware::{Config, ControlCore, GyroInput, Inputs, JointSetup};
use protocol::motion::Limits;
use protocol::{GyroInfo, MAX_JOINTS, ResetReason, Side, State};

use super::chip::{Bmi323Chip, BoardClock, Icm42688pChip, Shared};
use super::encoder::EncoderChip;
use super::noise::Noise;
use super::plant::Plant;
use super::{SimulateError, Truth};
use crate::robot::{InputUnit, Robot, Sensor, Symbol};

/// How long the simulated processor needs for a tick, µs. It reports this and has no other influence.
const EXECUTION_US: u32 = 20;
const TICK_NS: u64 = 1_000_000;
const TICK_S: f64 = 1e-3;

/// Robot and microcontroller.
pub struct Board {
    robot: Robot,
    config: Config,
    core: ControlCore,
    plant: Plant,
    noise: Noise,
    encoders: Vec<EncoderChip>,
    /// Counts at which each hardware counter was zero, and its extension.
    counters: Vec<(i64, QuadratureCounter)>,
    gyros: Vec<GyroPart>,
    /// Noise of each gyro before quantisation, rad/s.
    gyro_sigmas: Vec<f64>,
    clock: BoardClock,
    /// Clock at the start of the firmware, ns: device time counts from here.
    started_ns: u64,
    preloaded: [f64; MAX_JOINTS],
    joints: usize,
    /// Sensors in the order in which a tick reads them, with the time after its start, s.
    schedule: Vec<(f64, Reading)>,
}

/// A sensor, by its index.
#[derive(Debug, Clone, Copy)]
enum Reading {
    Encoder(usize),
    Gyro(usize),
}

/// A gyro chip and the firmware's driver for it.
enum GyroPart {
    Spi(Shared<Icm42688pChip>, Icm42688p<Shared<Icm42688pChip>>),
    I2c(Shared<Bmi323Chip>, Bmi323<Shared<Bmi323Chip>>),
}

impl Board {
    /// Powers a robot on in its marked pose. The first gyro is on SPI, the second on I²C.
    ///
    /// # Errors
    /// [`SimulateError`] if the firmware cannot run such a robot.
    pub fn new(robot: &Robot, plant: Plant, seed: u64) -> Result<Self, SimulateError> {
        let unsuited = |reason: &str| SimulateError::Unsuited { reason: reason.to_owned() };
        if robot.input.unit != InputUnit::Duty {
            return Err(unsuited("the firmware drives motors by duty, the description has another input"));
        }
        if (robot.sample_period_s - 1e-3).abs() > 1e-9 {
            return Err(unsuited("the firmware samples every 0.001 s, the description says otherwise"));
        }
        if robot.sensors.iter().any(|sensor| matches!(sensor, Sensor::Tachometer(_))) {
            return Err(unsuited("the firmware reads no tachometers"));
        }
        let encoders = EncoderChip::of_robot(robot)
            .map_err(|joint| unsuited(&format!("the encoder of joint {joint} needs its counts_per_turn")))?;
        let range = gyro_range(robot)?;
        let config = config(robot, &encoders, range)?;
        let clock = BoardClock::default();
        let gyros =
            (0..robot.gyros().count()).map(|gyro| GyroPart::new(gyro, range, &clock)).collect::<Result<_, _>>()?;
        let mut board = Self {
            robot: robot.clone(),
            core: ControlCore::new(&config.clone().started_by(ResetReason::PowerOn, None)),
            config,
            plant,
            noise: Noise::new(seed),
            counters: Vec::new(),
            encoders,
            gyros,
            // sigma² = noise² + step²/12
            gyro_sigmas: robot
                .gyros()
                .map(|gyro| (gyro.sigma_rad_s.powi(2) - range.lsb_rad_s().powi(2) / 12.0).max(0.0).sqrt())
                .collect(),
            started_ns: clock.now_ns(),
            clock,
            preloaded: [0.0; MAX_JOINTS],
            joints: robot.joints.len(),
            schedule: Vec::new(),
        };
        board.schedule = board.reading_order();
        board.clear_counters();
        Ok(board)
    }

    /// One tick of the firmware and the millisecond that follows it.
    pub fn tick(&mut self) {
        let control = self.core.control();
        if control.state() == (State::Waiting { at_seq: control.next_seq() }) {
            self.noise.begin_motion();
        }
        let now_us = (self.clock.now_ns() - self.started_ns) / 1000;
        let (inputs, elapsed_s) = self.read_sensors();
        // The device's clock wraps, as its 32 bits do.
        let outputs = self.core.tick(now_us as u32, &inputs);

        let in_force = if outputs.stop { [0.0; MAX_JOINTS] } else { self.preloaded };
        self.plant.advance(&in_force[..self.joints], TICK_S - elapsed_s);
        self.clock.pass_ns(TICK_NS);
        self.preloaded = outputs.duty.map(|duty| f64::from(duty.0) / f64::from(protocol::Duty::FULL));
    }

    /// The watchdog bites: motors off, the firmware starts anew, counters at zero. What the robot did meanwhile it did.
    ///
    /// # Errors
    /// [`SimulateError::Gyro`] if a driver does not find its part again.
    pub fn reset(&mut self) -> Result<(), SimulateError> {
        let before = self.clock.now_ns();
        let range = gyro_range(&self.robot)?;
        for gyro in &mut self.gyros {
            gyro.start_again(range, &self.clock)?;
        }
        let start_up_s = (self.clock.now_ns() - before) as f64 * 1e-9;
        self.preloaded = [0.0; MAX_JOINTS];
        self.plant.advance(&self.preloaded[..self.joints], start_up_s.max(1e-3));
        self.core = ControlCore::new(&self.config.clone().started_by(ResetReason::Watchdog, None));
        self.started_ns = self.clock.now_ns();
        self.clear_counters();
        Ok(())
    }

    /// Bytes from the host.
    pub fn receive(&mut self, bytes: &[u8]) {
        self.core.receive(bytes);
    }

    /// Bytes for the host, whole frames.
    pub fn transmit(&mut self, out: &mut [u8]) -> usize {
        self.core.transmit(out)
    }

    /// What the control loop is doing.
    pub fn state(&self) -> State {
        self.core.control().state()
    }

    /// The numbers of the handshake.
    pub fn config(&self) -> &Config {
        &self.config
    }

    /// Simulated time since power-on, s.
    pub fn time_s(&self) -> f64 {
        self.clock.now_ns() as f64 * 1e-9
    }

    /// Reads every sensor at its time within the tick; also returns how far the plant has come by then, s.
    fn read_sensors(&mut self) -> (Inputs, f64) {
        let mut inputs = Inputs { last_execution_us: EXECUTION_US, ..Inputs::default() };
        let mut elapsed_s = 0.0;
        for (offset_s, reading) in &self.schedule {
            if *offset_s > elapsed_s {
                self.plant.advance(&self.preloaded[..self.joints], offset_s - elapsed_s);
                elapsed_s = *offset_s;
            }
            match *reading {
                Reading::Encoder(i) => {
                    let (start, counter) = &mut self.counters[i];
                    let position = position(&self.plant, &self.encoders[i]);
                    let hardware = self.encoders[i].counter(position, *start, &mut self.noise);
                    inputs.encoders[i] = Some(counter.update(hardware));
                }
                Reading::Gyro(i) => {
                    let sigma = self.gyro_sigmas[i];
                    let rate = self.plant.gyro_rate(i).map(|rate| rate + self.noise.draw(sigma));
                    inputs.gyros[i] = self.gyros[i].read(rate);
                }
            }
        }
        (inputs, elapsed_s)
    }

    fn reading_order(&self) -> Vec<(f64, Reading)> {
        let encoders = self.encoders.iter().enumerate();
        let encoders = encoders.map(|(i, encoder)| (f64::from(encoder.info.offset_us) * 1e-6, Reading::Encoder(i)));
        let gyros = self.robot.gyros().enumerate().map(|(i, gyro)| (gyro.offset_s, Reading::Gyro(i)));
        let mut order: Vec<_> = encoders.chain(gyros).collect();
        order.sort_by(|a, b| a.0.total_cmp(&b.0));
        order
    }

    /// The hardware counters start at zero wherever the joints stand.
    fn clear_counters(&mut self) {
        let start = |encoder: &EncoderChip| encoder.counts(position(&self.plant, encoder));
        self.counters = self.encoders.iter().map(|encoder| (start(encoder), QuadratureCounter::new(0))).collect();
    }
}

impl GyroPart {
    fn new(index: usize, range: GyroRange, clock: &BoardClock) -> Result<Self, SimulateError> {
        if index.is_multiple_of(2) {
            let chip = Shared::new(Icm42688pChip::new(clock.clone()));
            let driver = spi_driver(&chip, range, clock)?;
            Ok(Self::Spi(chip, driver))
        } else {
            let chip = Shared::new(Bmi323Chip::new(clock.clone()));
            let driver = i2c_driver(&chip, range, clock)?;
            Ok(Self::I2c(chip, driver))
        }
    }

    /// The firmware starts again; the chip was not switched off.
    fn start_again(&mut self, range: GyroRange, clock: &BoardClock) -> Result<(), SimulateError> {
        match self {
            Self::Spi(chip, driver) => *driver = spi_driver(chip, range, clock)?,
            Self::I2c(chip, driver) => *driver = i2c_driver(chip, range, clock)?,
        }
        Ok(())
    }

    fn read(&mut self, rate: [f64; 3]) -> GyroInput {
        match self {
            Self::Spi(chip, driver) => {
                chip.chip().sense(rate);
                driver.read().into()
            }
            Self::I2c(chip, driver) => {
                chip.chip().sense(rate);
                driver.read().into()
            }
        }
    }
}

fn spi_driver(
    chip: &Shared<Icm42688pChip>,
    range: GyroRange,
    clock: &BoardClock,
) -> Result<Icm42688p<Shared<Icm42688pChip>>, SimulateError> {
    Icm42688p::new(chip.clone(), range, &mut clock.clone())
        .map_err(|error| SimulateError::Gyro { said: format!("{error:?}") })
}

fn i2c_driver(
    chip: &Shared<Bmi323Chip>,
    range: GyroRange,
    clock: &BoardClock,
) -> Result<Bmi323<Shared<Bmi323Chip>>, SimulateError> {
    let address = Bmi323::<Shared<Bmi323Chip>>::ADDRESS_SDO_LOW;
    Bmi323::new(chip.clone(), address, range, &mut clock.clone())
        .map_err(|error| SimulateError::Gyro { said: format!("{error:?}") })
}

fn position(plant: &Plant, encoder: &EncoderChip) -> f64 {
    let joint = usize::from(encoder.info.joint);
    match encoder.info.side {
        Side::Motor => plant.motor_position(joint),
        Side::Link => plant.link_position(joint),
    }
}

/// The range that the description names, which must be one that the firmware knows and the same for all gyros.
fn gyro_range(robot: &Robot) -> Result<GyroRange, SimulateError> {
    let mut ranges = robot.gyros().filter_map(|gyro| gyro.range_rad_s);
    let Some(wanted) = ranges.next() else { return Ok(GyroRange::default()) };
    let dps = wanted.to_degrees();
    let known = [GyroRange::Dps500, GyroRange::Dps1000, GyroRange::Dps2000];
    let fitting = known.into_iter().find(|range| (f64::from(range.full_scale_dps()) / dps - 1.0).abs() < 1e-3);
    match fitting {
        Some(range) if ranges.all(|other| (other / wanted - 1.0).abs() < 1e-3) => Ok(range),
        _ => Err(SimulateError::Unsuited {
            reason: format!("the firmware's gyros have a range of 500, 1000 or 2000 deg/s, the description {dps:.1}"),
        }),
    }
}

/// What the firmware is built with for this robot.
fn config(robot: &Robot, encoders: &[EncoderChip], range: GyroRange) -> Result<Config, SimulateError> {
    let nominal = Truth::nominal(robot);
    let n = robot.joints.len();
    let mut mass = vec![0.0; n * n];
    robot.chain().mass_matrix(&vec![0.0; n], &mut mass);
    let joints: Vec<JointSetup> = robot
        .joints
        .iter()
        .enumerate()
        .map(|(j, joint)| {
            let value = |symbol| nominal.get(robot, symbol, j).unwrap_or(0.0);
            let limits = Limits { min: joint.limits[0] as f32, max: joint.limits[1] as f32 };
            // (motor + link inertia) / back-EMF
            let coast_s = (value(Symbol::B) + mass[j * n + j]) / value(Symbol::KMi);
            JointSetup { coast_s: coast_s as f32, ..JointSetup::new(limits) }
        })
        .collect();
    let encoders: Vec<_> = encoders.iter().map(|encoder| encoder.info).collect();
    let gyros: Vec<GyroInfo> = robot
        .gyros()
        .map(|gyro| GyroInfo {
            body: gyro.body as u8,
            rad_s_per_lsb: range.lsb_rad_s(),
            saturated_at: i16::MAX as u16,
            offset_us: (gyro.offset_s * 1e6).round() as u16,
        })
        .collect();
    Config::new(&robot.name, &joints, &encoders, &gyros)
        .map_err(|error| SimulateError::Unsuited { reason: format!("the firmware cannot run this robot: {error:?}") })
}
