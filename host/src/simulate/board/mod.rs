//! The simulated board: the firmware's control core and its drivers on this machine, at the pins of a [`World`].
//!
//! ```text
//!        ┌─ counters, 16 bit ── QuadratureCounter ─┐
//! World ─┼─ ICM-42688-P ─ SPI ─ driver ────────────┼─▶ ControlCore::tick ─▶ duty of the next tick ─▶ World
//!        └─ BMI323 ────── I²C ─ driver ────────────┘          │ ▲
//!                                                     bytes out ▼ │ bytes in
//! ```

mod flash;
mod microcontroller;
pub(super) mod wires;

use std::path::Path;

use firmware::description::{EncoderPlace, GyroPlace, Hardware};
use firmware::driver::{Bmi323, Gyro, GyroRange, Icm42688p, QuadratureCounter};
use firmware::store::Bytes;
use firmware::wiring::data_ready::DataReady;
use firmware::{Config, ControlCore, ControlLoop, GyroInput, Inputs};
use protocol::{Duty, EncoderInfo, GyroInfo, MAX_JOINTS, ResetReason, State};

use crate::robot::Robot;
use crate::simulate::SimulateError;
use crate::simulate::world::chip::{Bmi323Chip, BoardClock, Icm42688pChip, Shared};
use crate::simulate::world::describe::description;
use crate::simulate::world::{GyroChip, World};
use flash::Flash;
pub use microcontroller::Microcontroller;

/// How long the simulated processor needs for a tick, µs. It reports this and has no other influence.
const EXECUTION_US: u32 = 20;

/// Robot and microcontroller.
pub struct Board {
    world: World,
    /// What the firmware runs since its start.
    running: Config,
    built_in: Config,
    places: Places,
    flash: Flash,
    core: ControlCore,
    /// What extends each hardware counter.
    counters: Vec<QuadratureCounter>,
    gyros: Vec<GyroDriver>,
    /// What tells the ages of the gyros' words.
    data_ready: Vec<DataReady>,
    /// Clock at the start of the firmware, ns: device time counts from here.
    started_ns: u64,
    preloaded: [f64; MAX_JOINTS],
    /// What the last tick read, and the duty in force in it.
    last: (Inputs, [f64; MAX_JOINTS]),
    /// How far each joint was from its marked pose at most, rad or m.
    farthest: Vec<f64>,
}

/// What the board reads.
struct Places {
    motors: usize,
    encoders: Vec<EncoderPlace>,
    gyros: Vec<GyroPlace>,
}

impl Places {
    fn of(world: &World) -> Self {
        let encoder = |EncoderInfo { joint, side, offset_us, .. }: EncoderInfo| EncoderPlace { joint, side, offset_us };
        let range_dps = world.range().full_scale_dps();
        let gyro = |(chip, info): (&GyroChip, &GyroInfo)| GyroPlace { part: chip.part(), range_dps, info: *info };
        Self {
            motors: world.joints(),
            encoders: world.encoder_infos().into_iter().map(encoder).collect(),
            gyros: world.gyros().iter().zip(world.gyro_infos()).map(gyro).collect(),
        }
    }

    fn hardware(&self) -> Hardware<'_> {
        Hardware { motors: self.motors, encoders: &self.encoders, gyros: &self.gyros }
    }
}

/// The firmware's driver of a gyro chip.
enum GyroDriver {
    Spi(Icm42688p<Shared<Icm42688pChip>>),
    I2c(Bmi323<Shared<Bmi323Chip>>),
}

impl Board {
    /// Powers a robot on.
    ///
    /// # Errors
    /// [`SimulateError`] if the firmware cannot run such a robot.
    pub fn new(robot: &Robot, world: World) -> Result<Self, SimulateError> {
        let places = Places::of(&world);
        let built_in = places
            .hardware()
            .config(&description(robot)?)
            .map_err(|error| SimulateError::Unsuited { reason: format!("the firmware cannot run it: {error}") })?;
        let mut board = Self {
            core: ControlCore::new(&built_in),
            running: built_in.clone(),
            built_in,
            places,
            flash: Flash::erased(),
            counters: Vec::new(),
            gyros: Vec::new(),
            data_ready: Vec::new(),
            started_ns: 0,
            preloaded: [0.0; MAX_JOINTS],
            last: Default::default(),
            farthest: vec![0.0; robot.joints.len()],
            world,
        };
        board.set_up()?;
        board.start_core(ResetReason::PowerOn);
        Ok(board)
    }

    /// The same board with a flash in this file: what was stored there runs, if it can.
    ///
    /// # Errors
    /// [`SimulateError::Flash`] if the file cannot be read or is no such flash.
    pub fn with_flash(mut self, path: &Path) -> Result<Self, SimulateError> {
        self.flash = Flash::open(path).map_err(SimulateError::Flash)?;
        self.start_core(ResetReason::PowerOn);
        Ok(self)
    }

    /// What its firmware was built with.
    pub fn config(&self) -> &Config {
        &self.built_in
    }

    /// The firmware starts: with the description that is stored, or with the one that is built in.
    fn start_core(&mut self, reset: ResetReason) {
        let hardware = self.places.hardware();
        let mut config = self.built_in.clone();
        hardware.start(&mut config, &mut self.flash.memory, &mut Bytes::new());
        self.core = ControlCore::new(config.started_by(reset, None));
        self.running = config;
    }

    /// The firmware's control loop, to look at.
    pub fn control(&self) -> &ControlLoop {
        self.core.control()
    }

    /// What the last tick read, and the duty in force from it to the next one, as fractions of full.
    pub(super) fn last_tick(&self) -> (&Inputs, &[f64; MAX_JOINTS]) {
        (&self.last.0, &self.last.1)
    }

    /// What the firmware does before its first tick: sets the gyros up, starts its clock.
    fn set_up(&mut self) -> Result<(), SimulateError> {
        let (range, clock) = (self.world.range(), self.world.clock());
        self.gyros =
            self.world.gyros().iter().map(|chip| GyroDriver::new(chip, range, clock)).collect::<Result<_, _>>()?;
        let ready = |chip: &GyroChip| DataReady::new(chip.output_rate_hz(), chip.read_us());
        self.data_ready = self.world.gyros().iter().map(ready).collect();
        self.counters = self.world.encoder_infos().iter().map(|_| QuadratureCounter::new(0)).collect();
        self.started_ns = self.world.clock().now_ns();
        Ok(())
    }

    /// The next tick begins a motion: the robot is let go.
    pub(super) fn begin_motion(&mut self) {
        self.world.begin_motion();
    }

    /// What the firmware is told of its sensors.
    pub(super) fn world(&self) -> &World {
        &self.world
    }

    /// One tick under another mind than the core's, with the same timing: `decide` makes of the readings the duty that is in
    /// force from the next tick on. Returns the readings and the duty in force in this tick.
    pub(super) fn tick_with(
        &mut self,
        decide: impl FnOnce(&Inputs) -> [Duty; MAX_JOINTS],
    ) -> (Inputs, [f64; MAX_JOINTS]) {
        let inputs = self.read_sensors();
        let in_force = self.preloaded;
        self.world.pass(&in_force);
        self.preloaded = fractions(decide(&inputs));
        (inputs, in_force)
    }

    fn read_sensors(&mut self) -> Inputs {
        let mut inputs = Inputs { last_execution_us: EXECUTION_US, ..Inputs::default() };
        let hardware = self.world.sense(&self.preloaded);
        for (i, counter) in self.counters.iter_mut().enumerate() {
            inputs.encoders[i] = Some(counter.update(hardware[i]));
        }
        for (input, gyro) in inputs.gyros.iter_mut().zip(&mut self.gyros) {
            *input = gyro.read();
        }
        let now_us = (self.world.clock().now_ns() - self.started_ns) / 1000;
        let ages = inputs.gyro_ages.iter_mut().zip(&mut self.data_ready);
        for ((age, ready), since_us) in ages.zip(self.world.ready_us()) {
            // The device's clock wraps, as its 32 bits do.
            *age = ready.age(now_us as u32, since_us.map(|since| (now_us as u32).wrapping_sub(since.into())));
        }
        inputs
    }
}

impl Microcontroller for Board {
    fn tick(&mut self) -> Result<(), SimulateError> {
        let control = self.core.control();
        if control.state() == (State::Waiting { at_seq: control.next_seq() }) {
            self.world.begin_motion();
        }
        let was_jogging = matches!(control.state(), State::Jogging { .. });
        let now_us = (self.world.clock().now_ns() - self.started_ns) / 1000;
        let inputs = self.read_sensors();
        // The device's clock wraps, as its 32 bits do.
        let outputs = self.core.tick(now_us as u32, &inputs);
        if outputs.store {
            self.core.store(&self.places.hardware(), &mut self.flash.memory);
            self.flash.keep().map_err(SimulateError::Flash)?;
        }

        if !was_jogging && matches!(self.core.control().state(), State::Jogging { .. }) {
            self.world.begin_motion();
        }
        let in_force = if outputs.stop { [0.0; MAX_JOINTS] } else { self.preloaded };
        self.world.pass(&in_force);
        self.preloaded = fractions(outputs.duty);
        self.last = (inputs, in_force);
        for (joint, farthest) in self.farthest.iter_mut().enumerate() {
            let [link, _, motor, _] = self.world.plant().joint_state(joint);
            *farthest = farthest.max(link.abs()).max(motor.abs());
        }
        Ok(())
    }

    fn farthest(&self) -> Vec<f64> {
        self.farthest.clone()
    }

    fn reset(&mut self) -> Result<(), SimulateError> {
        let before = self.world.clock().now_ns();
        self.set_up()?;
        let start_up_s = (self.world.clock().now_ns() - before) as f64 * 1e-9;
        self.preloaded = [0.0; MAX_JOINTS];
        self.world.restart(start_up_s.max(1e-3));
        self.start_core(ResetReason::Watchdog);
        Ok(())
    }

    fn receive(&mut self, bytes: &[u8]) {
        self.core.receive(bytes);
    }

    fn transmit(&mut self, out: &mut [u8]) -> usize {
        self.core.transmit(out)
    }

    fn state(&self) -> State {
        self.core.control().state()
    }

    fn layout(&self) -> protocol::Layout {
        self.running.layout()
    }

    fn time_s(&self) -> f64 {
        self.world.clock().now_ns() as f64 * 1e-9
    }
}

fn fractions(duty: [Duty; MAX_JOINTS]) -> [f64; MAX_JOINTS] {
    duty.map(|duty| f64::from(duty.0) / f64::from(Duty::FULL))
}

impl GyroDriver {
    /// The driver's set-up. A chip that was not switched off is reset by it.
    fn new(chip: &GyroChip, range: GyroRange, clock: &BoardClock) -> Result<Self, SimulateError> {
        let mut delay = clock.clone();
        match chip {
            GyroChip::Spi(chip) => Icm42688p::new(chip.clone(), range, &mut delay).map(Self::Spi).map_err(away),
            GyroChip::I2c(chip) => {
                let address = Bmi323::<Shared<Bmi323Chip>>::ADDRESS_SDO_LOW;
                Bmi323::new(chip.clone(), address, range, &mut delay).map(Self::I2c).map_err(away)
            }
        }
    }

    fn read(&mut self) -> GyroInput {
        match self {
            Self::Spi(driver) => driver.read().into(),
            Self::I2c(driver) => driver.read().into(),
        }
    }
}

fn away(error: impl std::fmt::Debug) -> SimulateError {
    SimulateError::Gyro { said: format!("{error:?}") }
}
