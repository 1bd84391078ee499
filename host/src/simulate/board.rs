//! The simulated board: the firmware's control core and its drivers on this machine, at the pins of a [`World`].
//!
//! ```text
//!        ┌─ counters, 16 bit ── QuadratureCounter ─┐
//! World ─┼─ ICM-42688-P ─ SPI ─ driver ────────────┼─▶ ControlCore::tick ─▶ duty of the next tick ─▶ World
//!        └─ BMI323 ────── I²C ─ driver ────────────┘          │ ▲
//!                                                     bytes out ▼ │ bytes in
//! ```

use firmware::driver::{Bmi323, Gyro, GyroRange, Icm42688p, QuadratureCounter};
use firmware::safety::Axis;
use firmware::wiring::data_ready::DataReady;
use firmware::{Config, ControlCore, ControlLoop, GyroInput, GyroSetup, Inputs, JointSetup};
use protocol::motion::Limits;
use protocol::{Duty, MAX_JOINTS, ResetReason, State};

use super::chip::{Bmi323Chip, BoardClock, Icm42688pChip, Shared};
use super::loads::Loads;
use super::microcontroller::Microcontroller;
use super::world::{GyroChip, World};
use super::{SimulateError, Truth};
use crate::robot::{Joint, JointKind, Robot, Symbol};

/// How long the simulated processor needs for a tick, µs. It reports this and has no other influence.
const EXECUTION_US: u32 = 20;

/// Robot and microcontroller.
pub struct Board {
    world: World,
    config: Config,
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
        let config = config(robot, &world)?;
        let mut board = Self {
            core: ControlCore::new(config.clone().started_by(ResetReason::PowerOn, None)),
            config,
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
        Ok(board)
    }

    /// What its firmware was built with.
    pub fn config(&self) -> &Config {
        &self.config
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
        self.core = ControlCore::new(self.config.clone().started_by(ResetReason::Watchdog, None));
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
        self.config.layout()
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

/// What the firmware is built with for this robot.
fn config(robot: &Robot, world: &World) -> Result<Config, SimulateError> {
    let nominal = Truth::nominal(robot);
    let n = robot.joints.len();
    let mut mass = vec![0.0; n * n];
    robot.chain().mass_matrix(&vec![0.0; n], &mut mass);
    let loads = Loads::of(robot, &nominal);
    let joints: Vec<JointSetup> = robot
        .joints
        .iter()
        .enumerate()
        .map(|(j, joint)| {
            let value = |symbol| nominal.get(robot, symbol, j).unwrap_or(0.0);
            let limits = Limits { min: joint.limits[0] as f32, max: joint.limits[1] as f32 };
            let axis = match joint.kind {
                JointKind::Revolute => Axis::Turns(in_base(robot, j, joint.axis)),
                JointKind::Prismatic => Axis::Slides,
            };
            // (motor + link inertia) / back-EMF
            let coast_s = (value(Symbol::B) + mass[j * n + j]) / value(Symbol::KMi);
            // What no motor can hold stands at no duty.
            let standing = (loads.standing[j] * f64::from(Duty::FULL)).min(f64::from(Duty::FULL)) as i16;
            let mut carried_s2 = [0.0; MAX_JOINTS];
            for (carried, s2) in carried_s2.iter_mut().zip(&loads.carried_s2[j]) {
                *carried = *s2 as f32;
            }
            let usual = JointSetup::new(limits, axis);
            let standing_duty = usual.standing_duty.max(Duty(standing));
            JointSetup { coast_s: coast_s as f32, standing_duty, held_s: loads.held_s[j] as f32, carried_s2, ..usual }
        })
        .collect();
    let gyros: Vec<GyroSetup> = robot
        .gyros()
        .zip(world.gyro_infos())
        .enumerate()
        .map(|(index, (gyro, info))| GyroSetup {
            info: *info,
            mount: gyro.rotation.map(|row| in_base(robot, gyro.body, row)),
            give_rad: loads.give_rad[index] as f32,
            sag_rad: loads.sag_rad[index] as f32,
        })
        .collect();
    Config::new(&robot.name, &joints, &world.encoder_infos(), &gyros)
        .map_err(|error| SimulateError::Unsuited { reason: format!("the firmware cannot run this robot: {error:?}") })
}

/// A vector in axes of a joint, in axes of the base, all joints at zero.
fn in_base(robot: &Robot, joint: usize, vector: [f64; 3]) -> [f32; 3] {
    let carriers = robot.joints[..=joint].iter().rev();
    // Each rotation takes vectors from the body before to the joint: backwards by its transpose.
    let back = |vector: [f64; 3], carrier: &Joint| -> [f64; 3] {
        std::array::from_fn(|i| (0..3).map(|k| carrier.rotation[k][i] * vector[k]).sum())
    };
    carriers.fold(vector, back).map(|part| part as f32)
}
