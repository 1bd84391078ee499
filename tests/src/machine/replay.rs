//! What the machine's pins showed, shown to the control core of this PC: both must do the same, byte for byte.

use firmware::driver::{
    BMI323_RATE_HZ, BMI323_READ_US, Bmi323, ICM42688P_RATE_HZ, ICM42688P_READ_US, Icm42688p, QuadratureCounter,
};
use firmware::lockstep::{MOTORS, PINS_BROWN_OUT, PINS_EMERGENCY_STOP, Sensors};
use firmware::wiring::data_ready::DataReady;
use firmware::{Config, ControlCore, GyroInput, Inputs, Outputs};
use host::simulate::{Bmi323Chip, Icm42688pChip, Shared};
use protocol::Duty;
use protocol::frame::Decoder;
use protocol::message::{MAX_TO_HOST_FRAME, read_to_host};
use protocol::{Layout, Report, ToHost};

use super::Log;

/// What a core said: payloads of samples, and of everything else but the log, each in order.
#[derive(Debug, Default, PartialEq)]
pub struct Said {
    /// Of the samples.
    pub samples: Vec<Vec<u8>>,
    /// Of answers, status and events.
    pub answers: Vec<Vec<u8>>,
}

impl Said {
    /// From the bytes on the line.
    ///
    /// # Panics
    /// If one of them is damaged.
    pub fn of(line: &[u8]) -> Self {
        let (mut said, mut decoder) = (Self::default(), Decoder::<MAX_TO_HOST_FRAME>::new());
        for byte in line {
            let Some(payload) = decoder.feed(*byte) else { continue };
            let payload = payload.expect("the machine's line is a good one");
            match read_to_host(payload, Some(&Layout::DOGGY)).expect("both have the same version") {
                ToHost::Sample(_) => said.samples.push(payload.to_vec()),
                ToHost::Report(Report::Defmt { .. } | Report::Log { .. }) => {}
                ToHost::Report(_) => said.answers.push(payload.to_vec()),
            }
        }
        said
    }
}

/// The control core of this PC on what the machine's pins showed.
pub struct Replay {
    /// What it said.
    pub said: Said,
    /// Duties at the pins, and whether they fell to zero within the period: to be compared with those of the log.
    pub duty: Vec<([Duty; MOTORS], bool)>,
}

impl Replay {
    /// Plays the log of a machine that was not reset to a core of this robot.
    pub fn of(log: &Log, config: &Config) -> Self {
        let mut core = ControlCore::new(config);
        let mut counters = [const { QuadratureCounter::new(0) }; MOTORS];
        let mut data_ready =
            [DataReady::new(ICM42688P_RATE_HZ, ICM42688P_READ_US), DataReady::new(BMI323_RATE_HZ, BMI323_READ_US)];
        let (mut line, mut duty) = (Vec::new(), Vec::new());
        let mut preloaded = [Duty::ZERO; MOTORS];
        for period in &log.periods {
            let mut inputs = inputs(&period.sensors, &mut counters);
            for (index, ready) in data_ready.iter_mut().enumerate() {
                let edge_us = period.sensors.ready_us[index].map(|since_us| period.t_us.wrapping_sub(since_us.into()));
                inputs.gyro_ages[index] = ready.age(period.t_us, edge_us);
            }
            let outputs: Outputs = core.tick(period.t_us, &inputs);
            duty.push((preloaded, outputs.stop));
            preloaded = std::array::from_fn(|motor| outputs.duty[motor]);
            let mut out = [0; MAX_TO_HOST_FRAME];
            let n = core.transmit(&mut out);
            line.extend_from_slice(&out[..n]);
            core.receive(&period.sensors.host);
        }
        Self { said: Said::of(&line), duty }
    }
}

/// What the tick reads from these registers.
fn inputs(sensors: &Sensors, counters: &mut [QuadratureCounter; MOTORS]) -> Inputs {
    let mut inputs = Inputs {
        emergency_stop: sensors.pins & PINS_EMERGENCY_STOP != 0,
        brown_out: sensors.pins & PINS_BROWN_OUT != 0,
        ..Inputs::default()
    };
    for (motor, counter) in counters.iter_mut().enumerate() {
        inputs.encoders[motor] = Some(counter.update(sensors.counters[motor]));
    }
    let spi = sensors.spi.map(|answer| Icm42688p::<Shared<Icm42688pChip>>::decode(&answer));
    let i2c = sensors.i2c.map(|answer| Bmi323::<Shared<Bmi323Chip>>::decode(&answer));
    inputs.gyros = [
        spi.map_or(GyroInput::BusError, |read| Ok::<_, ()>(read).into()),
        i2c.map_or(GyroInput::BusError, |read| Ok::<_, ()>(read).into()),
    ];
    inputs
}
