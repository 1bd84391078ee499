//! Does safety stop a robot that has nothing? Robots drawn at random play their motion under the firmware's control core,
//! with every watch and limit.

use std::path::{Path, PathBuf};

use firmware::Nearness;
use firmware::motion::preset;
use host::effect::{CATALOGUE, Effect, Size};
use host::link::joint_limits;
use host::robot::Robot;
use host::simulate::{Board, Drawn, EffectChoice, Microcontroller, Options};
use protocol::frame::{CRC_BYTES, Decoder, MAX_PAYLOAD};
use protocol::message::{MAX_TO_DEVICE_FRAME, MAX_TO_HOST_FRAME, read_to_host, write_to_device};
use protocol::request::Heartbeat;
use protocol::{Command, EventKind, Motion, MotionEnd, MotionId, Report, ToDevice, ToHost};
use serde::{Deserialize, Serialize};

/// Ticks after which a motion must have ended.
const LONGEST: u32 = 150_000;
/// Every second robot is shaken as much as the study of intervals shakes.
const PROCESS_NOISE: f64 = 1.0;

/// What is played on which description.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Machine {
    /// The built-in robot, with the calibration.
    Doggy,
    /// One joint with a soft belt, with the validation, which is hard on it.
    OneJoint,
    /// Seven joints whose links are heavier than their motors, with their own motion.
    Arm7,
}

impl Machine {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Doggy, Self::OneJoint, Self::Arm7];

    /// Its name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Doggy => "doggy",
            Self::OneJoint => "one_joint",
            Self::Arm7 => "arm7",
        }
    }

    fn robot(self) -> Robot {
        let given = |name: &str| PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("robots").join(name);
        match self {
            Self::Doggy | Self::OneJoint => Robot::builtin(self.name()),
            Self::Arm7 => Robot::load(&given("arm7.toml").display().to_string()),
        }
        .expect("the description is valid")
    }

    fn motion(self, robot: &Robot) -> Motion {
        let limits = joint_limits(robot);
        match self {
            Self::Doggy => preset::calibration(&limits),
            Self::OneJoint => preset::validation(&limits),
            Self::Arm7 => toml::from_str(include_str!("../robots/arm7_motion.toml")).expect("the motion file is valid"),
        }
    }
}

/// A robot.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Case {
    /// What it is.
    pub machine: Machine,
    /// Draws parameters, mounts and noise.
    pub seed: u64,
    /// What it has besides, and how much of it.
    pub effect: Option<(String, String)>,
}

/// What became of it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Outcome {
    /// Which.
    pub case: Case,
    /// How the motion ended: "finished", or the fault.
    pub end: String,
    /// When, s after its start.
    pub after_s: f64,
    /// Largest parts of their bounds that the watches reached: an encoder that stands, a joint against its duty, a gyro against
    /// the encoders.
    pub nearest: [f32; 3],
}

impl Outcome {
    /// Whether the motion was played to its end.
    pub fn finished(&self) -> bool {
        self.end == "finished"
    }
}

/// Robots with nothing hidden.
pub fn healthy(machine: Machine, first: u64, seeds: u64) -> Vec<Case> {
    (first..first + seeds).map(|seed| Case { machine, seed, effect: None }).collect()
}

/// The built-in robot with each effect of the catalogue, at its medium and its large size.
pub fn with_effects(seed: u64) -> Vec<Case> {
    let case =
        |id: &str, size: &str| Case { machine: Machine::Doggy, seed, effect: Some((id.to_owned(), size.to_owned())) };
    CATALOGUE.iter().flat_map(|effect| ["medium", "large"].map(|size| case(effect.id, size))).collect()
}

/// Plays its motion.
///
/// # Panics
/// If the robot cannot be simulated, or the firmware refuses the motion: then there is nothing to measure.
pub fn outcome(case: &Case) -> Outcome {
    let robot = case.machine.robot();
    let motion = case.machine.motion(&robot);
    let mut options = Options { seed: case.seed, ..Options::new(robot.clone()) };
    options.process_noise = if case.seed.is_multiple_of(2) { PROCESS_NOISE } else { 0.0 };
    if let Some((id, size)) = &case.effect {
        let effect = Effect::by_id(id).expect("cases are made of the catalogue");
        let size = Size::parse(effect.id, size).expect("sizes have names");
        options.effects.push(EffectChoice { effect, size });
    }
    let Drawn { world, .. } = Drawn::new(&options).expect("the robot can be simulated");
    let mut session = Session::new(Board::new(&robot, world).expect("the firmware runs the robot"));
    session.run(300);
    session.ask(Command::SetZero);
    session.upload(&motion);
    session.ask(Command::Start { motion: MOTION, at_seq: None });
    let started = session.ticks;
    let mut nearest = [0.0f32; 3];
    let end = loop {
        if let Some(end) = session.tick() {
            break end;
        }
        let Nearness { stuck, wrong_way, rotation } = session.board.control().nearness();
        for (nearest, now) in nearest.iter_mut().zip([stuck, wrong_way, rotation]) {
            *nearest = nearest.max(now);
        }
        assert!(session.ticks - started < LONGEST, "{case:?}: the motion does not end");
    };
    let end = match end {
        MotionEnd::Finished => "finished".to_owned(),
        MotionEnd::Stopped => "stopped".to_owned(),
        MotionEnd::Fault(fault) => fault.to_string(),
    };
    Outcome { case: case.clone(), end, after_s: f64::from(session.ticks - started) * 1e-3, nearest }
}

/// Makes what `file` does not hold yet of `cases`.
///
/// # Errors
/// If the file cannot be read or written.
pub fn study(
    file: &Path,
    cases: &[Case],
    workers: usize,
    progress: impl Fn(u64) + Sync,
) -> std::io::Result<Vec<Outcome>> {
    crate::study::resume(file, cases, |case, outcome: &Outcome| outcome.case == *case, workers, outcome, progress)
}

const MOTION: MotionId = MotionId(1);

/// A board and a host that says what it must and hears how the motion ended.
struct Session {
    board: Board,
    decoder: Decoder<{ MAX_PAYLOAD + CRC_BYTES }>,
    ticks: u32,
    id: u8,
    answered: bool,
}

impl Session {
    fn new(board: Board) -> Self {
        Self { board, decoder: Decoder::new(), ticks: 0, id: 0, answered: false }
    }

    /// A millisecond; how the motion ended, if it did.
    fn tick(&mut self) -> Option<MotionEnd> {
        if self.ticks.is_multiple_of(20) {
            self.send(&ToDevice::Heartbeat(Heartbeat { count: self.ticks as u16, seen_seq: self.ticks }));
        }
        self.board.tick().expect("the simulated board runs on");
        self.ticks += 1;
        let mut ended = None;
        let mut line = [0; MAX_TO_HOST_FRAME];
        loop {
            let n = self.board.transmit(&mut line);
            if n == 0 {
                return ended;
            }
            for byte in &line[..n] {
                let Some(payload) = self.decoder.feed(*byte) else { continue };
                let layout = self.board.layout();
                match read_to_host(payload.expect("a line without faults"), Some(&layout)).expect("our own version") {
                    ToHost::Report(Report::Accepted { id }) if id == self.id => self.answered = true,
                    ToHost::Report(Report::Refused { refusal, .. }) => panic!("{refusal}"),
                    ToHost::Report(Report::Event(event)) => {
                        if let EventKind::MotionEnded { end, .. } = event.kind {
                            ended = Some(end);
                        }
                    }
                    _ => {}
                }
            }
        }
    }

    fn run(&mut self, ticks: u32) {
        (0..ticks).for_each(|_| {
            self.tick();
        });
    }

    fn send(&mut self, message: &ToDevice) {
        let mut frame = [0; MAX_TO_DEVICE_FRAME];
        let n = write_to_device(message, &mut frame).expect("a frame has room for every message");
        self.board.receive(&frame[..n]);
    }

    fn ask(&mut self, command: Command) {
        self.id = self.id.wrapping_add(1);
        self.answered = false;
        self.send(&ToDevice::Request { id: self.id, command });
        for _ in 0..20 {
            self.tick();
            if self.answered {
                return;
            }
        }
        panic!("no answer within 20 ticks");
    }

    fn upload(&mut self, motion: &Motion) {
        let segments = motion.segments.len() as u8;
        self.ask(Command::UploadBegin { motion: MOTION, header: motion.header(), segments });
        for (index, segment) in (0..).zip(&motion.segments) {
            self.ask(Command::UploadSegment { index, segment: segment.clone() });
        }
        self.ask(Command::UploadEnd { checksum: motion.checksum() });
    }
}
