//! A motion played in memory under the firmware's whole control loop, with its watches and limits: how it ends, what the joints do,
//! how near each watch comes to its bound. A line there is none; what the host says is handed to the board as bytes.

use firmware::Nearness;
use protocol::frame::{CRC_BYTES, Decoder, MAX_PAYLOAD};
use protocol::message::{MAX_TO_DEVICE_FRAME, MAX_TO_HOST_FRAME, read_to_host, write_to_device};
use protocol::request::Heartbeat;
use protocol::{Command, EventKind, Motion, MotionEnd, MotionId, Report, State, ToDevice, ToHost};

use super::board::wires::Wires;
use super::{Board, Microcontroller, Plant, SimulateError, Truth, World};
use crate::recording::{MotionFile, Recorder, Recording, Row, Session, Source, Tick};
use crate::robot::{Robot, Symbol};

/// What came of a motion.
#[derive(Debug)]
pub struct Rehearsal {
    /// From the first tick of the motion to its last.
    pub recording: Recording,
    /// How it ended.
    pub end: MotionEnd,
    /// What each joint did.
    pub joints: Vec<JointPeaks>,
    /// The nearest that the watches came to their bounds, each as a part of its bound.
    pub nearest: Nearness,
    /// Segments, from 0: the last one played; where a watch came nearest to its bound; where a motor or link went farthest from the middle
    /// of its range.
    pub segments: [u8; 3],
}

/// The largest that a joint did in a motion.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct JointPeaks {
    /// Speed of the motor on the link side of the gear, rad/s or m/s.
    pub speed: f64,
    /// Torque of the motor on the link side of the gear, N m or N.
    pub motor_torque: f64,
    /// Torque of the transmission, N m or N; zero where the joint is rigid.
    pub transmission_torque: f64,
    /// From the lowest to the highest position of motor and link, rad or m.
    pub travel: [f64; 2],
    /// ∫ u² dt with the duty u as a fraction of full, s: what heats a motor.
    pub duty_squared_s: f64,
    /// ∫ θ̇² dt of the motor on the link side of the gear, rad²/s or m²/s.
    pub speed_squared_s: f64,
}

/// Ticks in which the firmware comes to know its sensors before the motion.
const BEFORE: u32 = 300;
/// Ticks from one heartbeat to the next.
const HEARTBEAT: u32 = 20;
/// Ticks within which a request must be answered.
const ANSWER: u32 = 20;
const MOTION: MotionId = MotionId(1);

impl Rehearsal {
    /// Plays `motion` on a robot of this description whose parameters are `truth`. The seed decides the sensors' noise; the plant
    /// is integrated in steps of `step_s` at most.
    ///
    /// # Errors
    /// [`SimulateError`] if the robot cannot be simulated or the firmware refuses the motion. A motion that a watch stops is no error.
    pub fn play(robot: &Robot, truth: &Truth, motion: &Motion, seed: u64, step_s: f64) -> Result<Self, SimulateError> {
        let plant = Plant::new(robot, truth, Vec::new())?.with_step(step_s);
        let board = Board::new(robot, World::new(robot, plant, seed)?)?;
        let wires = Wires::new(robot, &board);
        let toml = toml::to_string(motion).map_err(|error| SimulateError::Motion { said: error.to_string() })?;
        let file = MotionFile { name: motion.name.to_string(), toml };
        let mut recorder = Recorder::new(Session { motion: Some(file), ..Session::of(robot.clone()) });
        let mut hearer = Hearer::new(board);
        for _ in 0..BEFORE {
            hearer.tick()?;
        }
        hearer.ask(Command::SetZero)?;
        hearer.upload(motion)?;
        hearer.ask(Command::Start { motion: MOTION, at_seq: None })?;

        let mut peaks = Peaks::new(robot, truth);
        let mut ticks = 0;
        let end = loop {
            let phase = match hearer.board.state() {
                State::Running { phase } => Some(phase),
                // The first tick of the motion is the one that is waited for.
                State::Waiting { at_seq } if at_seq == hearer.board.control().next_seq() => Some(0),
                _ => None,
            };
            let ended = hearer.tick()?;
            // In the tick that ends it the motion is over.
            if let (Some(phase), None) = (phase, ended) {
                let (inputs, duty) = hearer.board.last_tick();
                let duty = &duty[..robot.joints.len()];
                let (t_us, values) = (1000 * ticks, wires.values(inputs));
                let row = Row { t_us, seq: ticks, phase, tick: Tick::default(), duty, values: &values };
                recorder.push(&row).map_err(|error| SimulateError::Machine { said: error.to_string() })?;
                peaks.take(&hearer.board, phase, duty);
                ticks += 1;
            }
            if let Some(end) = ended {
                break end;
            }
        };
        let source = Source { path: "simulated".into(), sha256: String::new() };
        let segments = [peaks.last_segment, peaks.watched.1, peaks.farthest.1];
        let Peaks { joints, nearest, .. } = peaks;
        Ok(Self { recording: recorder.finish(source), end, joints, nearest, segments })
    }

    /// How long the motion lasted, s.
    pub fn duration_s(&self) -> f64 {
        self.recording.len() as f64 * 1e-3
    }
}

/// What is kept of a motion as it goes.
struct Peaks {
    joints: Vec<JointPeaks>,
    drives: Vec<Drive>,
    nearest: Nearness,
    /// The largest part of a watch's bound, and its segment.
    watched: (f32, u8),
    /// The largest part of a half range, and its segment.
    farthest: (f64, u8),
    last_segment: u8,
}

/// What makes torques of a joint's duty and state.
struct Drive {
    torque_per_duty: f64,
    torque_per_speed: f64,
    stiffness: f64,
    damping: f64,
    middle: f64,
    half_range: f64,
}

impl Peaks {
    fn new(robot: &Robot, truth: &Truth) -> Self {
        let drives = robot.joints.iter().enumerate().map(|(j, joint)| {
            let value = |symbol| truth.get(robot, symbol, j).unwrap_or(0.0);
            Drive {
                torque_per_duty: value(Symbol::KPwm) * robot.input.scale,
                torque_per_speed: value(Symbol::KMi),
                stiffness: value(Symbol::KS),
                damping: value(Symbol::DS),
                middle: 0.5 * (joint.limits[0] + joint.limits[1]),
                half_range: 0.5 * (joint.limits[1] - joint.limits[0]),
            }
        });
        let unmoved = JointPeaks { travel: [f64::INFINITY, f64::NEG_INFINITY], ..JointPeaks::default() };
        Self {
            joints: vec![unmoved; robot.joints.len()],
            drives: drives.collect(),
            nearest: Nearness::default(),
            watched: (0.0, 0),
            farthest: (0.0, 0),
            last_segment: 0,
        }
    }

    /// The state at the end of a tick of this segment, in which this duty was in force.
    fn take(&mut self, board: &Board, segment: u8, duty: &[f64]) {
        self.last_segment = segment;
        let mut away = 0.0_f64;
        for (j, (peaks, drive)) in self.joints.iter_mut().zip(&self.drives).enumerate() {
            let [q, qd, theta, thetad] = board.world().plant().joint_state(j);
            let motor = drive.torque_per_duty * duty[j] - drive.torque_per_speed * thetad;
            let transmission = drive.stiffness * (q - theta) + drive.damping * (qd - thetad);
            peaks.speed = peaks.speed.max(thetad.abs());
            peaks.motor_torque = peaks.motor_torque.max(motor.abs());
            peaks.transmission_torque = peaks.transmission_torque.max(transmission.abs());
            peaks.travel = [peaks.travel[0].min(q.min(theta)), peaks.travel[1].max(q.max(theta))];
            peaks.duty_squared_s += duty[j] * duty[j] * 1e-3;
            peaks.speed_squared_s += thetad * thetad * 1e-3;
            away = away.max((q - drive.middle).abs().max((theta - drive.middle).abs()) / drive.half_range);
        }
        let Nearness { stuck, wrong_way, rotation } = board.control().nearness();
        self.nearest.stuck = self.nearest.stuck.max(stuck);
        self.nearest.wrong_way = self.nearest.wrong_way.max(wrong_way);
        self.nearest.rotation = self.nearest.rotation.max(rotation);
        let watch = stuck.max(wrong_way).max(rotation);
        if watch > self.watched.0 {
            self.watched = (watch, segment);
        }
        if away > self.farthest.0 {
            self.farthest = (away, segment);
        }
    }
}

/// A board, and a host that says what it must and hears what is answered.
struct Hearer {
    board: Board,
    decoder: Decoder<{ MAX_PAYLOAD + CRC_BYTES }>,
    ticks: u32,
    id: u8,
    answer: Option<Result<(), String>>,
}

impl Hearer {
    fn new(board: Board) -> Self {
        Self { board, decoder: Decoder::new(), ticks: 0, id: 0, answer: None }
    }

    /// A millisecond; how the motion ended, if it did.
    fn tick(&mut self) -> Result<Option<MotionEnd>, SimulateError> {
        if self.ticks.is_multiple_of(HEARTBEAT) {
            self.send(&ToDevice::Heartbeat(Heartbeat { count: self.ticks as u16, seen_seq: self.ticks }))?;
        }
        self.board.tick()?;
        self.ticks += 1;
        let mut ended = None;
        let mut line = [0; MAX_TO_HOST_FRAME];
        loop {
            let n = self.board.transmit(&mut line);
            if n == 0 {
                return Ok(ended);
            }
            for byte in &line[..n] {
                let Some(payload) = self.decoder.feed(*byte) else { continue };
                let layout = self.board.layout();
                let payload = payload.map_err(|error| said(&error))?;
                match read_to_host(payload, Some(&layout)).map_err(|error| said(&error))? {
                    ToHost::Report(Report::Accepted { id }) if id == self.id => self.answer = Some(Ok(())),
                    ToHost::Report(Report::Refused { id, refusal }) if id == self.id => {
                        self.answer = Some(Err(refusal.to_string()));
                    }
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

    fn send(&mut self, message: &ToDevice) -> Result<(), SimulateError> {
        let mut frame = [0; MAX_TO_DEVICE_FRAME];
        let n = write_to_device(message, &mut frame).map_err(|error| said(&error))?;
        self.board.receive(&frame[..n]);
        Ok(())
    }

    fn ask(&mut self, command: Command) -> Result<(), SimulateError> {
        self.id = self.id.wrapping_add(1);
        self.answer = None;
        self.send(&ToDevice::Request { id: self.id, command })?;
        for _ in 0..ANSWER {
            self.tick()?;
            match self.answer.take() {
                Some(Ok(())) => return Ok(()),
                Some(Err(said)) => return Err(SimulateError::Motion { said }),
                None => {}
            }
        }
        Err(SimulateError::Machine { said: format!("no answer within {ANSWER} ticks") })
    }

    fn upload(&mut self, motion: &Motion) -> Result<(), SimulateError> {
        // A motion has at most MAX_SEGMENTS segments: their number fits a byte.
        let segments = motion.segments.len() as u8;
        self.ask(Command::UploadBegin { motion: MOTION, header: motion.header(), segments })?;
        for (index, segment) in (0..).zip(&motion.segments) {
            self.ask(Command::UploadSegment { index, segment: segment.clone() })?;
        }
        self.ask(Command::UploadEnd { checksum: motion.checksum() })
    }
}

fn said(error: &dyn std::fmt::Debug) -> SimulateError {
    SimulateError::Machine { said: format!("{error:?}") }
}
