//! Robot, core and a small host on one bench, joined by bytes.

use firmware::robot::HARDWARE;
use firmware::safety::Axis;
use firmware::store::RamFlash;
use firmware::{Config, ControlCore, GyroInput, GyroSetup, Inputs, JointSetup, Outputs};
use protocol::frame::{CRC_BYTES, Decoder, MAX_PAYLOAD};
use protocol::hello::Greeting;
use protocol::message::{self, MAX_TO_DEVICE_FRAME, MAX_TO_HOST_FRAME};
use protocol::motion::Limits;
use protocol::request::Heartbeat;
use protocol::sample::Layout;
use protocol::{
    Command, Duty, EncoderInfo, Event, EventKind, GyroInfo, Hello, MAX_JOINTS, Motion, MotionId, Refusal, Report,
    Sample, Side, State, Status, ToDevice, ToHost,
};

use crate::plant::{ALONG, AXES, Plant, RAD_S_PER_LSB};

pub const MOTION: MotionId = MotionId(7);

/// Something that changes the inputs of a tick.
pub type Change = Box<dyn FnMut(&mut Inputs)>;

/// What to disturb in the coming ticks.
#[derive(Default)]
pub struct Disturbance {
    pub no_heartbeat: bool,
    pub not_reading: bool,
    pub clock_us: u32,
    /// Changes the inputs of a tick.
    pub inputs: Option<Change>,
}

/// Which motor each driver turns, and which way.
#[derive(Clone, Copy)]
pub struct Wires {
    pub motors: [usize; 3],
    pub leads: [f64; 3],
}

impl Wires {
    pub const RIGHT: Wires = Wires { motors: [0, 1, 2], leads: [1.0; 3] };
}

pub struct Bench {
    pub core: ControlCore,
    pub wires: Wires,
    pub plant: Plant,
    pub limits: Vec<Limits>,
    pub disturb: Disturbance,
    /// Everything that the host received.
    pub samples: Vec<Sample>,
    pub reports: Vec<Report>,
    /// The last tick's decision, and what the pins have in force.
    pub outputs: Outputs,
    pub in_force: [Duty; MAX_JOINTS],
    pub now_us: u32,
    pub ticks: u32,
    /// Where descriptions are stored, if the board has a place for them.
    pub flash: Option<RamFlash<Vec<u8>>>,
    layout: Layout,
    decoder: Decoder<{ MAX_PAYLOAD + CRC_BYTES }>,
    id: u8,
}

impl Bench {
    pub fn new(plant: Plant) -> Self {
        Self::with(plant, false)
    }

    /// Doggy on a board whose emergency stop must be tested.
    pub fn untested() -> Self {
        Self::with(Plant::doggy(3, 1), true)
    }

    fn with(plant: Plant, stop_test: bool) -> Self {
        let n = plant.joints.len();
        let limits: Vec<_> = [1.0, 0.6, 0.6][..n].iter().map(|max| Limits { min: -max, max: *max }).collect();
        let setup = |(joint, limits): (usize, &Limits)| {
            let mut setup = JointSetup::new(*limits, Axis::Turns(AXES[joint]));
            let described = &plant.described[joint];
            (setup.coast_s, setup.held_s) = (described.coast_s(), described.held_s());
            setup.carried_s2[joint] = described.carried_s2();
            setup
        };
        let setups: Vec<_> = limits.iter().enumerate().map(setup).collect();
        let encoder =
            |joint| EncoderInfo { joint, side: Side::Motor, counts_per_turn: 1024, gear: 42.092, offset_us: 0 };
        let encoders: Vec<_> = (0..n as u8).map(encoder).collect();
        let gyro = |body| {
            let info = GyroInfo {
                body,
                rad_s_per_lsb: RAD_S_PER_LSB,
                saturated_at: 32_767,
                offset_us: 20,
                filter_delay_us: None,
                output_rate_hz: None,
            };
            // The axes are at right angles.
            let give_rad =
                plant.described[..=usize::from(body)].iter().map(|joint| joint.give_rad().powi(2)).sum::<f32>().sqrt();
            GyroSetup { info, mount: ALONG, give_rad, sag_rad: 0.0 }
        };
        let mut config = Config::new("bench", &setups, &encoders, &[gyro(0), gyro(n as u8 - 1)]).unwrap();
        config.stop_test(stop_test);
        Bench {
            layout: config.layout(),
            core: ControlCore::new(&config),
            wires: Wires::RIGHT,
            plant,
            limits,
            disturb: Disturbance::default(),
            samples: Vec::new(),
            reports: Vec::new(),
            outputs: Outputs::default(),
            in_force: Default::default(),
            now_us: u32::MAX - 5_000_000, // the clock wraps after five seconds
            ticks: 0,
            flash: None,
            decoder: Decoder::new(),
            id: 0,
        }
    }

    /// Doggy on a board that has stored this, and starts.
    pub fn storing(flash: RamFlash<Vec<u8>>) -> Self {
        let mut bench = Bench::new(Plant::doggy(3, 1));
        bench.restart(flash);
        bench
    }

    /// The board starts anew, with this in its flash.
    pub fn restart(&mut self, mut flash: RamFlash<Vec<u8>>) {
        let mut config = firmware::robot::doggy();
        HARDWARE.start(&mut config, &mut flash, &mut Default::default());
        self.layout = config.layout();
        self.core = ControlCore::new(&config);
        self.flash = Some(flash);
        self.reports.clear();
    }

    /// The device's answer to a greeting.
    pub fn hello(&mut self) -> Hello {
        self.send(&ToDevice::Hello(Greeting::OURS));
        self.run(3);
        let hello = |report: &Report| if let Report::Hello(hello) = report { Some(hello.clone()) } else { None };
        self.reports.iter().rev().find_map(hello).unwrap()
    }

    /// Doggy, streaming, zeroed, with the motion uploaded.
    pub fn ready(motion: &Motion) -> Self {
        let mut bench = Bench::new(Plant::doggy(motion.gain.len(), 1));
        bench.prepare(motion);
        bench
    }

    pub fn prepare(&mut self, motion: &Motion) {
        self.run(20);
        self.ask(Command::Stream { on: true }).unwrap();
        self.ask(Command::SetZero).unwrap();
        self.upload(motion).unwrap();
    }

    /// One millisecond of everything.
    pub fn tick(&mut self) {
        if !self.disturb.no_heartbeat && self.ticks.is_multiple_of(20) {
            let seen_seq = self.samples.last().map_or(0, |s| s.seq);
            self.send(&ToDevice::Heartbeat(Heartbeat { count: self.ticks as u16, seen_seq }));
        }
        // The duty preloaded in the last tick becomes active.
        self.in_force = self.outputs.duty;
        let mut inputs = Inputs { last_execution_us: 40, ..Inputs::default() };
        for joint in 0..self.plant.joints.len() {
            inputs.encoders[joint] = Some(self.plant.counts(joint));
        }
        inputs.gyros = core::array::from_fn(|gyro| GyroInput::Words(self.plant.words(gyro)));
        if let Some(change) = &mut self.disturb.inputs {
            change(&mut inputs);
        }
        self.now_us = self.now_us.wrapping_add(1000).wrapping_add(std::mem::take(&mut self.disturb.clock_us));
        self.outputs = self.core.tick(self.now_us, &inputs);
        if self.outputs.store {
            assert!(!self.outputs.armed, "nothing is stored while the drivers are enabled");
            let flash = self.flash.as_mut().expect("asked only where there is a place");
            self.core.store(&HARDWARE, flash);
        }
        if self.outputs.stop {
            self.in_force = [Duty::ZERO; MAX_JOINTS];
        }
        let Wires { motors, leads } = self.wires;
        for (driver, (motor, lead)) in motors.into_iter().zip(leads).enumerate() {
            if let Some(joint) = self.plant.joints.get_mut(motor) {
                joint.advance(lead * f64::from(self.in_force[driver].fraction()));
            }
        }
        self.ticks += 1;
        if !self.disturb.not_reading {
            self.read();
        }
    }

    /// Until no motion is under way any more; panics after `most` ticks.
    pub fn until_idle(&mut self, most: u32) {
        let idle = |bench: &Bench| !matches!(bench.core.control().state(), State::Running { .. });
        assert!(
            (0..most).any(|_| idle(self) || {
                self.tick();
                idle(self)
            }),
            "it still runs"
        );
    }

    pub fn run(&mut self, ticks: u32) {
        (0..ticks).for_each(|_| self.tick());
    }

    /// Ticks until the event is told; panics after `most` ticks.
    pub fn until(&mut self, most: u32, wanted: impl Fn(&EventKind) -> bool) -> Event {
        let told = self.reports.len();
        for _ in 0..most {
            self.tick();
            let event = |report: &Report| if let Report::Event(event) = report { Some(*event) } else { None };
            if let Some(event) = self.reports[told..].iter().filter_map(event).find(|event| wanted(&event.kind)) {
                return event;
            }
        }
        panic!("not told within {most} ticks; told was {:?}", &self.reports[told..]);
    }

    pub fn send(&mut self, message: &ToDevice) {
        let mut frame = [0; MAX_TO_DEVICE_FRAME];
        let n = message::write_to_device(message, &mut frame).unwrap();
        self.core.receive(&frame[..n]);
    }

    /// Sends a request under a new id and waits for its answer.
    pub fn ask(&mut self, command: Command) -> Result<(), Refusal> {
        self.id = self.id.wrapping_add(1);
        self.ask_as(self.id, command)
    }

    pub fn ask_as(&mut self, wanted: u8, command: Command) -> Result<(), Refusal> {
        let told = self.reports.len();
        self.send(&ToDevice::Request { id: wanted, command });
        for _ in 0..20 {
            self.tick();
            for report in &self.reports[told..] {
                match report {
                    Report::Accepted { id } if *id == wanted => return Ok(()),
                    Report::Refused { id, refusal } if *id == wanted => return Err(*refusal),
                    _ => {}
                }
            }
        }
        panic!("no answer within 20 ticks");
    }

    pub fn upload(&mut self, motion: &Motion) -> Result<(), Refusal> {
        let segments = motion.segments.len() as u8;
        self.ask(Command::UploadBegin { motion: MOTION, header: motion.header(), segments })?;
        for (index, segment) in (0..).zip(&motion.segments) {
            self.ask(Command::UploadSegment { index, segment: segment.clone() })?;
        }
        self.ask(Command::UploadEnd { checksum: motion.checksum() })
    }

    pub fn start(&mut self) -> Result<(), Refusal> {
        self.ask(Command::Start { motion: MOTION, at_seq: None })
    }

    pub fn status(&mut self) -> Status {
        self.ask(Command::Status).unwrap();
        let status = |report: &Report| if let Report::Status(status) = report { Some(*status) } else { None };
        self.reports.iter().rev().find_map(status).unwrap()
    }

    pub fn events(&self) -> Vec<EventKind> {
        let kind = |report: &Report| if let Report::Event(event) = report { Some(event.kind) } else { None };
        self.reports.iter().filter_map(kind).collect()
    }

    /// Reads the line until the device has no more to send.
    pub fn read(&mut self) {
        let mut line = [0; MAX_TO_HOST_FRAME];
        loop {
            let n = self.core.transmit(&mut line);
            if n == 0 {
                return;
            }
            for byte in &line[..n] {
                let Some(payload) = self.decoder.feed(*byte) else { continue };
                match message::read_to_host(payload.unwrap(), Some(&self.layout)).unwrap() {
                    ToHost::Sample(sample) => self.samples.push(sample),
                    ToHost::Report(report) => self.reports.push(report),
                }
            }
        }
    }
}
