//! The world at the pins: a robot's plant, its gyro chips, encoders and noise. Registers in, registers out.
//!
//! ```text
//!   duty ─▶ plant ─┬─▶ encoders ──▶ counters, 16 bit           one tick of the world:
//!                  ├─▶ ICM-42688-P ◀─ SPI ─▶                     sense(duty)    every sensor at its time
//!                  └─▶ BMI323 ◀───── I²C ─▶                      pass(duty)     the rest of the millisecond
//! ```
//!
//! Real gyros ([`GyroChips::Real`]) convert in both halves, whenever their clocks say so, and a board reads what was converted last.
//!
//! Which microcontroller stands at the pins is not the world's business: [`Board`](crate::simulate::Board) runs the firmware's
//! control core on this machine, and an emulator runs the image that is flashed.

pub(super) mod chip;
pub(super) mod describe;
mod encoder;
pub(super) mod gyro_clock;

use embedded_hal::i2c::I2c as _;
use embedded_hal::spi::SpiDevice as _;
use firmware::constants::GYRO_SATURATED_AT;
use firmware::driver::{
    BMI323_RATE_HZ, BMI323_READ_US, FILTER_DELAY_US, GyroRange, ICM42688P_RATE_HZ, ICM42688P_READ_US,
};
use protocol::description::GyroPart;
use protocol::{EncoderInfo, GyroInfo, MAX_ENCODERS, MAX_GYROS, MAX_JOINTS, Side};

use crate::robot::{self, Robot};
use crate::simulate::noise::Noise;
use crate::simulate::plant::Plant;
use crate::simulate::{Mistake, SimulateError, TICK_NS, TICK_S};
use chip::{Bmi323Chip, BoardClock, Icm42688pChip, Shared};
use describe::{encoders, gyro_range, suits, usual_part};
use encoder::EncoderChip;
pub use gyro_clock::GyroChips;
use gyro_clock::GyroClock;

/// A robot and what is soldered to it.
#[derive(Debug)]
pub struct World {
    plant: Plant,
    noise: Noise,
    encoders: Vec<EncoderChip>,
    /// Counts at which each hardware counter was zero.
    counter_starts: Vec<i64>,
    gyros: Vec<GyroChip>,
    /// What the firmware is told of each gyro.
    gyro_infos: Vec<GyroInfo>,
    /// Noise of each gyro before quantisation, rad/s.
    gyro_sigmas: Vec<f64>,
    range: GyroRange,
    clock: BoardClock,
    joints: usize,
    /// Sensors in the order in which a tick reads them, with the time after its start, s.
    schedule: Vec<(f64, Reading)>,
    mistakes: Vec<Mistake>,
    /// How much of the present tick has passed, s.
    elapsed_s: f64,
    /// What real gyros have beside their chips; none of ideal ones.
    real: Vec<RealGyro>,
    /// "Data ready" of real gyros is wired to the capture pins.
    wired: bool,
}

/// The clock of a real gyro, and what it converts.
#[derive(Debug)]
struct RealGyro {
    clock: GyroClock,
    /// Its chip was read in this tick: what it converts now, nobody sees before the next.
    was_read: bool,
    held_back: Vec<(u64, [f64; 3])>,
    /// When the last conversion since the start of the tick before ended, ns.
    edge_ns: Option<f64>,
    /// The same at the start of this tick.
    edge_at_tick_ns: Option<f64>,
}

/// A sensor, by its index.
#[derive(Debug, Clone, Copy)]
enum Reading {
    Encoder(usize),
    Gyro(usize),
}

/// A gyro chip at the bus that it sits on; clones lead to the same chip.
#[derive(Debug, Clone)]
pub enum GyroChip {
    /// An ICM-42688-P.
    Spi(Shared<Icm42688pChip>),
    /// A BMI323.
    I2c(Shared<Bmi323Chip>),
}

impl World {
    /// A robot switched on in its marked pose. Its first gyro is on SPI, the second on I²C.
    ///
    /// # Errors
    /// [`SimulateError::Unsuited`] if the firmware's boards have no place for such a robot.
    pub fn new(robot: &Robot, plant: Plant, seed: u64) -> Result<Self, SimulateError> {
        suits(robot)?;
        let encoders = encoders(robot)?;
        let range = gyro_range(robot)?;
        let clock = BoardClock::default();
        let mut world = Self {
            plant: plant.held(),
            noise: Noise::new(seed),
            counter_starts: Vec::new(),
            gyros: (0..robot.gyros().count()).map(|gyro| GyroChip::new(gyro, &clock)).collect(),
            gyro_infos: robot
                .gyros()
                .map(|gyro| GyroInfo {
                    body: gyro.body as u8,
                    rad_s_per_lsb: range.lsb_rad_s(),
                    saturated_at: GYRO_SATURATED_AT,
                    offset_us: (gyro.offset_s * 1e6).round() as u16,
                    filter_delay_us: None,
                    output_rate_hz: None,
                })
                .collect(),
            // sigma² = noise² + step²/12
            gyro_sigmas: robot
                .gyros()
                .map(|gyro| (gyro.sigma_rad_s.powi(2) - range.lsb_rad_s().powi(2) / 12.0).max(0.0).sqrt())
                .collect(),
            schedule: reading_order(robot, &encoders),
            encoders,
            range,
            clock,
            joints: robot.joints.len(),
            mistakes: Vec::new(),
            elapsed_s: 0.0,
            real: Vec::new(),
            wired: false,
        };
        world.clear_counters();
        Ok(world)
    }

    /// The same world with real gyros, whose clocks the seed draws; their filters are the plant's. Whether "data ready" is wired.
    #[must_use]
    pub fn with_real_gyros(mut self, robot: &Robot, seed: u64, wired: bool) -> Self {
        self.wired = wired;
        let real =
            |clock| RealGyro { clock, was_read: false, held_back: Vec::new(), edge_ns: None, edge_at_tick_ns: None };
        self.real = GyroClock::drawn(robot, seed).into_iter().map(real).collect();
        for (offset_s, reading) in &mut self.schedule {
            if let Reading::Gyro(gyro) = reading {
                *offset_s += 1e-6 * f64::from(self.gyros[*gyro].read_us());
            }
        }
        self.schedule.sort_by(|a, b| a.0.total_cmp(&b.0));
        for (info, chip) in self.gyro_infos.iter_mut().zip(&self.gyros) {
            info.filter_delay_us = Some(FILTER_DELAY_US);
            info.output_rate_hz = Some(chip.output_rate_hz() as u16);
        }
        self
    }

    /// The same world with these mistakes in it, of which the firmware is not told.
    ///
    /// # Errors
    /// [`SimulateError::Unsuited`] if a mistake is about a part that the robot does not have.
    pub fn with_mistakes(mut self, robot: &Robot, mistakes: &[Mistake]) -> Result<Self, SimulateError> {
        for mistake in mistakes {
            mistake.suits(robot, self.encoders.len())?;
            for (index, encoder) in self.encoders.iter_mut().enumerate() {
                encoder.count_more(mistake.counts_factor(index));
            }
        }
        self.mistakes = mistakes.to_vec();
        self.clear_counters();
        Ok(self)
    }

    /// The duty that each motor gets.
    fn at_motors(&self, duty: &[f64]) -> [f64; MAX_JOINTS] {
        let mut driven = [0.0; MAX_JOINTS];
        driven.iter_mut().zip(&duty[..self.joints]).for_each(|(driven, duty)| *driven = *duty);
        self.mistakes.iter().for_each(|mistake| mistake.drives(&mut driven));
        driven
    }

    /// The first half of a tick: every sensor is read at its time, under this duty (a fraction of full) of each joint.
    /// Returns the hardware counters; the gyros' words stand in their chips.
    pub fn sense(&mut self, duty: &[f64]) -> [u16; MAX_ENCODERS] {
        let mut counters = [0; MAX_ENCODERS];
        let duty = self.at_motors(duty);
        self.elapsed_s = 0.0;
        for gyro in &mut self.real {
            gyro.edge_at_tick_ns = gyro.edge_ns.take();
        }
        for i in 0..self.schedule.len() {
            let (offset_s, reading) = self.schedule[i];
            self.advance(&duty, offset_s);
            match reading {
                Reading::Encoder(i) => {
                    let position = self.position(i);
                    counters[i] = self.encoders[i].counter(position, self.counter_starts[i], &mut self.noise);
                }
                Reading::Gyro(i) => match self.real.get_mut(i) {
                    Some(real) => real.was_read = true,
                    None => {
                        let rate = self.gyro_reading(i);
                        self.gyros[i].sense(rate);
                    }
                },
            }
        }
        self.mistakes.iter().for_each(|mistake| mistake.counts(&mut counters));
        counters
    }

    /// What a gyro puts out at this moment, rad/s in the axes of its chip.
    fn gyro_reading(&mut self, gyro: usize) -> [f64; 3] {
        let sigma = self.gyro_sigmas[gyro];
        let noise = [0.0; 3].map(|_: f64| self.noise.draw(sigma));
        let mut rate = self.plant.gyro_reading(gyro, noise);
        self.mistakes.iter().for_each(|mistake| mistake.measures(gyro, &mut rate));
        rate
    }

    /// Time of the board's clock, ns.
    fn now_ns(&self) -> f64 {
        self.clock.now_ns() as f64 + 1e9 * self.elapsed_s
    }

    /// Lets the tick go on until `to_s` after its start, with what real gyros convert meanwhile.
    fn advance(&mut self, duty: &[f64; MAX_JOINTS], to_s: f64) {
        let begin_ns = self.clock.now_ns() as f64;
        loop {
            let now_ns = self.now_ns();
            let next = self.real.iter().zip(&self.gyros).enumerate().filter_map(|(i, (real, chip))| {
                let nominal_ns = chip.converts_every_ns(now_ns as u64)?;
                Some((i, real.clock.next_ns(now_ns, nominal_ns)))
            });
            let next = next.min_by(|a, b| a.1.total_cmp(&b.1)).filter(|(_, at_ns)| *at_ns <= begin_ns + 1e9 * to_s);
            let until_s = next.map_or(to_s, |(_, at_ns)| 1e-9 * (at_ns - begin_ns));
            if until_s > self.elapsed_s {
                self.plant.advance(&duty[..self.joints], until_s - self.elapsed_s);
                self.elapsed_s = until_s;
            }
            let Some((i, at_ns)) = next else { return };
            let rate = self.gyro_reading(i);
            let real = &mut self.real[i];
            real.edge_ns = Some(at_ns);
            if real.was_read {
                real.held_back.push((at_ns as u64, rate));
            } else {
                self.gyros[i].convert(at_ns as u64, rate);
            }
        }
    }

    /// How long before this tick's time each gyro's "data ready" rose last, µs, as a capture in whole µs of the device's time shows it;
    /// none if it did not since the tick before. Ideal gyros have no such edge.
    pub fn ready_us(&self) -> [Option<u16>; MAX_GYROS] {
        let now_us = self.clock.now_ns() / 1000;
        let ready = |gyro: usize| {
            let real = self.real.get(gyro).filter(|_| self.wired)?;
            let edge_us = (real.edge_at_tick_ns? / 1000.0).floor();
            u16::try_from((now_us as f64 - edge_us) as i64).ok()
        };
        std::array::from_fn(ready)
    }

    /// The robot itself.
    pub fn plant(&self) -> &Plant {
        &self.plant
    }

    /// The second half: what is left of the millisecond, under this duty.
    pub fn pass(&mut self, duty: &[f64]) {
        let duty = self.at_motors(duty);
        for (real, chip) in self.real.iter_mut().zip(&self.gyros) {
            real.was_read = false;
            real.held_back.drain(..).for_each(|(at_ns, rate)| chip.convert(at_ns, rate));
        }
        self.advance(&duty, TICK_S);
        self.clock.pass_ns(TICK_NS);
        self.elapsed_s = 0.0;
    }

    /// A microcontroller that starts anew lets the robot run out for so long, s. Its counters then begin at zero
    /// wherever the joints stand. The chips' clock is the caller's to advance.
    pub fn restart(&mut self, duration_s: f64) {
        let off = vec![0.0; self.joints];
        self.plant.advance(&off, duration_s);
        self.clear_counters();
    }

    /// A motion begins: the robot is let go, effects count their time from here, and the noise depends on nothing that
    /// was before.
    pub fn begin_motion(&mut self) {
        self.plant.begin_motion();
        let now_ns = self.clock.now_ns() as f64;
        self.real.iter_mut().for_each(|gyro| gyro.clock.begin_motion(now_ns));
        self.noise.begin_motion();
    }

    /// A transfer with chip select to the first part on SPI: the bytes that come back while these are sent.
    pub fn spi(&self, sent: &[u8]) -> Option<Vec<u8>> {
        let mut answer = vec![0; sent.len()];
        self.gyros
            .iter()
            .find_map(|gyro| match gyro {
                GyroChip::Spi(chip) => Some(chip.clone().transfer(&mut answer, sent)),
                GyroChip::I2c(_) => None,
            })?
            .ok()?;
        Some(answer)
    }

    /// A transfer on the I²C bus: bytes written to a part, then so many read; `None` if nobody acknowledges.
    pub fn i2c(&self, address: u8, written: &[u8], read: usize) -> Option<Vec<u8>> {
        let mut answer = vec![0; read];
        self.gyros
            .iter()
            .find_map(|gyro| match gyro {
                GyroChip::I2c(chip) if read == 0 => Some(chip.clone().write(address, written)),
                GyroChip::I2c(chip) => Some(chip.clone().write_read(address, written, &mut answer)),
                GyroChip::Spi(_) => None,
            })?
            .ok()?;
        Some(answer)
    }

    /// The clock that chips and delays share.
    pub fn clock(&self) -> &BoardClock {
        &self.clock
    }

    /// The gyro chips, in the sample's order.
    pub fn gyros(&self) -> &[GyroChip] {
        &self.gyros
    }

    /// The range that the description's gyros have.
    pub fn range(&self) -> GyroRange {
        self.range
    }

    /// What the firmware is told of each gyro.
    pub fn gyro_infos(&self) -> &[GyroInfo] {
        &self.gyro_infos
    }

    /// What the firmware is told of each encoder.
    pub fn encoder_infos(&self) -> Vec<EncoderInfo> {
        self.encoders.iter().map(|encoder| encoder.info).collect()
    }

    /// Motors of the robot.
    pub fn joints(&self) -> usize {
        self.joints
    }

    fn position(&self, encoder: usize) -> f64 {
        let EncoderInfo { joint, side, .. } = self.encoders[encoder].info;
        let side = match side {
            Side::Motor => robot::Side::Motor,
            Side::Link => robot::Side::Link,
        };
        self.plant.encoder(side, joint.into())
    }

    /// The hardware counters start at zero wherever the joints stand.
    fn clear_counters(&mut self) {
        self.counter_starts = (0..self.encoders.len()).map(|i| self.encoders[i].counts(self.position(i))).collect();
    }
}

impl GyroChip {
    fn new(index: usize, clock: &BoardClock) -> Self {
        match usual_part(index) {
            GyroPart::Icm42688p => Self::Spi(Shared::new(Icm42688pChip::new(clock.clone()))),
            GyroPart::Bmi323 => Self::I2c(Shared::new(Bmi323Chip::new(clock.clone()))),
        }
    }

    /// Which part it is.
    pub fn part(&self) -> GyroPart {
        match self {
            Self::Spi(_) => GyroPart::Icm42688p,
            Self::I2c(_) => GyroPart::Bmi323,
        }
    }

    /// Nominal conversions per second, as the firmware's driver sets the part up.
    pub fn output_rate_hz(&self) -> u32 {
        match self {
            Self::Spi(_) => ICM42688P_RATE_HZ,
            Self::I2c(_) => BMI323_RATE_HZ,
        }
    }

    /// From the start of a burst to the moment at which the part hands its words out, µs.
    pub fn read_us(&self) -> i32 {
        match self {
            Self::Spi(_) => ICM42688P_READ_US,
            Self::I2c(_) => BMI323_READ_US,
        }
    }

    fn converts_every_ns(&self, at_ns: u64) -> Option<u64> {
        match self {
            Self::Spi(chip) => chip.chip().converts_every_ns(at_ns),
            Self::I2c(chip) => chip.chip().converts_every_ns(at_ns),
        }
    }

    fn convert(&self, at_ns: u64, rate_rad_s: [f64; 3]) {
        match self {
            Self::Spi(chip) => chip.chip().convert(at_ns, rate_rad_s),
            Self::I2c(chip) => chip.chip().convert(at_ns, rate_rad_s),
        }
    }

    fn sense(&self, rate_rad_s: [f64; 3]) {
        match self {
            Self::Spi(chip) => chip.chip().sense(rate_rad_s),
            Self::I2c(chip) => chip.chip().sense(rate_rad_s),
        }
    }
}

fn reading_order(robot: &Robot, encoders: &[EncoderChip]) -> Vec<(f64, Reading)> {
    let encoders = encoders.iter().enumerate();
    let encoders = encoders.map(|(i, encoder)| (f64::from(encoder.info.offset_us) * 1e-6, Reading::Encoder(i)));
    let gyros = robot.gyros().enumerate().map(|(i, gyro)| (gyro.offset_s, Reading::Gyro(i)));
    let mut order: Vec<_> = encoders.chain(gyros).collect();
    order.sort_by(|a, b| a.0.total_cmp(&b.0));
    order
}
