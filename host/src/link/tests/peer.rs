//! A scripted device behind a pseudo-terminal: what it answers and sends is the test's to say.

use std::io::{Read, Write};
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use protocol::frame::Decoder;
use protocol::message::{MAX_TO_HOST_FRAME, read_to_device, write_report, write_sample};
use protocol::sample::NO_PHASE;
use protocol::{
    Command, Duty, EncoderInfo, Event, EventKind, Flags, GyroInfo, Hello, Identity, Layout, MotionEnd, MotionId,
    Refusal, Report, ResetReason, Sample, Side, State, Status, ToDevice,
};
use serialport::{SerialPort, TTYPort};

/// A tick of the device.
const TICK: Duration = Duration::from_millis(1);
/// Most ticks between two looks at the port.
const MOST_TICKS: u32 = 100;
/// Looks at the port in a row, of a millisecond each, that find nothing: nothing is under way. Heartbeats come every 20 ms.
const LAST_LOOKS: u32 = 5;
/// Bytes that wait for the host until the device waits too.
const ROOM: usize = 4096;

/// A peer that runs until dropped.
pub struct Peer {
    pub path: String,
    pub heard: Receiver<ToDevice>,
    over: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

/// What the peer does with a message: bytes to send back.
pub trait Script: Send + 'static {
    fn hear(&mut self, message: &ToDevice, out: &mut Wire);
    /// Called every millisecond or so.
    fn tick(&mut self, _out: &mut Wire) {}
}

/// Bytes on their way to the host.
#[derive(Default)]
pub struct Wire(pub Vec<u8>);

impl Wire {
    pub fn report(&mut self, report: &Report) {
        let mut frame = [0; MAX_TO_HOST_FRAME];
        let n = write_report(report, &mut frame).unwrap();
        self.0.extend(&frame[..n]);
    }

    pub fn sample(&mut self, sample: &Sample) {
        let mut frame = [0; MAX_TO_HOST_FRAME];
        let n = write_sample(sample, &Layout::DOGGY, &mut frame).unwrap();
        self.0.extend(&frame[..n]);
    }
}

impl Peer {
    pub fn start(mut script: impl Script) -> Self {
        let (mut port, slave) = TTYPort::pair().unwrap();
        let path = slave.name().unwrap();
        port.set_timeout(Duration::from_millis(1)).unwrap();
        let over = Arc::new(AtomicBool::new(false));
        let (hears, heard): (Sender<ToDevice>, _) = channel();
        let end = Arc::clone(&over);
        let thread = std::thread::spawn(move || {
            let _slave = slave; // keeps the terminal alive until the host has opened it
            let mut decoder = Decoder::<256>::new();
            let mut bytes = [0; 512];
            let mut out = Wire::default();
            let mut last = Instant::now();
            let mut silent = 0;
            // What was sent before the end is heard.
            while !end.load(Relaxed) || silent < LAST_LOOKS {
                let n = port.read(&mut bytes).unwrap_or(0);
                silent = if n == 0 { silent + 1 } else { 0 };
                for byte in &bytes[..n] {
                    if let Some(Ok(payload)) = decoder.feed(*byte) {
                        let message = read_to_device(payload).unwrap();
                        script.hear(&message, &mut out);
                        let _ = hears.send(message);
                    }
                }
                // On a busy machine a look at the port takes long: ticks are caught up with. A host that is late makes the device
                // late; nothing is lost for it.
                let passed = last.elapsed().as_millis() as u32;
                last += TICK * passed;
                for _ in 0..passed.min(MOST_TICKS) {
                    if out.0.len() < ROOM {
                        script.tick(&mut out);
                    }
                }
                if !out.0.is_empty() {
                    let written = port.write(&out.0).unwrap_or(0);
                    out.0.drain(..written);
                }
            }
        });
        Self { path, heard, over, thread: Some(thread) }
    }

    /// Ends it; what it heard and nobody has taken yet, whole.
    pub fn finish(mut self) -> Vec<ToDevice> {
        self.end();
        self.heard.try_iter().collect()
    }

    fn end(&mut self) {
        self.over.store(true, Relaxed);
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

impl Drop for Peer {
    fn drop(&mut self) {
        self.end();
    }
}

/// A handshake of Doggy.
pub fn doggy() -> Hello {
    let encoder = |joint| EncoderInfo { joint, side: Side::Motor, counts_per_turn: 1024, gear: 42.092, offset_us: 0 };
    let gyro = |body| GyroInfo {
        body,
        rad_s_per_lsb: 0.001,
        saturated_at: 32_767,
        offset_us: 0,
        filter_delay_us: None,
        output_rate_hz: None,
    };
    Hello {
        identity: Identity::ours("0.1.0", "doggy"),
        layout: Layout::DOGGY,
        tick_us: 1000,
        encoders: (0..3).map(encoder).collect(),
        gyros: [gyro(0), gyro(2)].into_iter().collect(),
        zero: Some([-5, 0, 70_000].into_iter().collect()),
        reset: ResetReason::PowerOn,
        panic: None,
        description: Default::default(),
        code_crc: None,
    }
}

/// What becomes of the frame of a sample, by its number; `false` for "never sent by the device".
pub type Fate = Box<dyn FnMut(u32, &mut Vec<u8>) -> bool + Send>;

/// A well-behaved device that keeps its counts, with faults to order.
pub struct Doggy {
    pub hello: Hello,
    pub seq: u32,
    pub streaming: bool,
    pub first_seq: u32,
    pub end_seq: u32,
    pub dropped: u32,
    pub fate: Fate,
    /// Answers to requests that are lost before one gets through.
    pub deaf: u32,
    pub lost_answers: u32,
    /// What was done, each once however often it was asked for.
    pub acted: Arc<Mutex<Vec<Command>>>,
    pub memory: protocol::request::Memory,
    pub samples_per_tick: u32,
    /// How many ticks it may be ahead of what the host has worked off, and that none passes before the stream: a busy machine makes it
    /// slower and changes nothing else.
    pub leash: Option<u32>,
    /// The last tick that the host has worked off, or the first of the stream.
    pub worked_off: u32,
    /// How long a motion is played, ticks, and how it ends then.
    pub motion_ticks: u32,
    pub motion_end: MotionEnd,
    /// Sent one a tick while the stream is on.
    pub reports: Vec<Report>,
    /// The tick in which the motion is to start.
    pub waiting: Option<u32>,
    /// First tick of the motion that is played.
    pub playing: Option<u32>,
    pub last_end: Option<(MotionId, MotionEnd)>,
    /// Latched until it is cleared.
    pub fault: Option<protocol::Fault>,
}

impl Default for Doggy {
    fn default() -> Self {
        Self {
            hello: doggy(),
            seq: u32::MAX - 100,
            streaming: false,
            first_seq: 0,
            end_seq: 0,
            dropped: 0,
            fate: Box::new(|_, _| true),
            deaf: 0,
            lost_answers: 0,
            acted: Arc::default(),
            memory: protocol::request::Memory::new(),
            samples_per_tick: 1,
            leash: None,
            worked_off: 0,
            motion_ticks: 500,
            motion_end: MotionEnd::Finished,
            reports: Vec::new(),
            waiting: None,
            playing: None,
            last_end: None,
            fault: None,
        }
    }
}

impl Doggy {
    fn status(&self) -> Status {
        Status {
            state: self.fault.map_or(State::Idle, State::Fault),
            streaming: self.streaming,
            first_seq: self.first_seq,
            end_seq: if self.streaming { self.seq } else { self.end_seq },
            dropped: self.dropped,
            motion: MotionId::NONE,
            last_end: self.last_end,
        }
    }

    fn end(&mut self, end: MotionEnd, out: &mut Wire) {
        self.playing = None;
        self.last_end = Some((MotionId(1), end));
        let kind = EventKind::MotionEnded { motion: MotionId(1), end };
        out.report(&Report::Event(Event { seq: self.seq, t_us: self.seq.wrapping_mul(1000), kind }));
    }

    fn act(&mut self, command: &Command, out: &mut Wire) -> Result<(), Refusal> {
        match command {
            Command::Stream { on: true } => {
                (self.streaming, self.first_seq, self.dropped) = (true, self.seq, 0);
                self.worked_off = self.seq;
            }
            Command::Stream { on: false } => (self.streaming, self.end_seq) = (false, self.seq),
            Command::Start { .. } if self.hello.zero.is_none() => return Err(Refusal::NotZeroed),
            Command::Start { at_seq: Some(at), .. } if (at.wrapping_sub(self.seq) as i32) <= 0 => {
                return Err(Refusal::Late { asked: *at, now: self.seq });
            }
            Command::Start { at_seq: Some(at), .. } => self.waiting = Some(*at),
            Command::Start { at_seq: None, .. } => self.playing = Some(self.seq),
            Command::Stop if self.playing.is_some() => self.end(MotionEnd::Stopped, out),
            Command::SetZero => self.hello.zero = Some([0; 3].into_iter().collect()),
            Command::ClearFault => self.fault = None,
            Command::Status => out.report(&Report::Status(self.status())),
            _ => {}
        }
        Ok(())
    }
}

impl Script for Doggy {
    fn hear(&mut self, message: &ToDevice, out: &mut Wire) {
        match message {
            ToDevice::Hello(_) => {
                self.memory.forget();
                out.report(&Report::Hello(self.hello.clone()));
            }
            ToDevice::Heartbeat(beat) => {
                if (beat.seen_seq.wrapping_sub(self.worked_off) as i32) > 0 {
                    self.worked_off = beat.seen_seq;
                }
                out.report(&Report::HeartbeatSeen { count: beat.count, t_us: 0 });
            }
            ToDevice::Request { id, command } => {
                let answer = match self.memory.recall(*id, command) {
                    Some(answer) => answer,
                    None => {
                        self.acted.lock().unwrap().push(command.clone());
                        let answer = self.act(command, out);
                        self.memory.keep(*id, command, answer);
                        answer
                    }
                };
                if self.deaf < self.lost_answers {
                    self.deaf += 1;
                    return;
                }
                self.deaf = 0;
                out.report(&match answer {
                    Ok(()) => Report::Accepted { id: *id },
                    Err(refusal) => Report::Refused { id: *id, refusal },
                });
            }
        }
    }

    fn tick(&mut self, out: &mut Wire) {
        for _ in 0..self.samples_per_tick {
            let ahead = self.seq.wrapping_sub(self.worked_off) as i32;
            if self.leash.is_some_and(|leash| !self.streaming || ahead > leash as i32) {
                return;
            }
            if self.waiting.take_if(|at| *at == self.seq).is_some() {
                self.playing = Some(self.seq);
            }
            if self.playing.is_some_and(|first| self.seq.wrapping_sub(first) >= self.motion_ticks) {
                self.end(self.motion_end, out);
            }
            if self.streaming {
                if !self.reports.is_empty() {
                    out.report(&self.reports.remove(0));
                }
                let mut duty = [Duty::ZERO; 7];
                duty[0] = Duty(1500);
                let t_us = self.seq.wrapping_mul(1000);
                let (phase, flags) = match self.playing {
                    Some(_) => (0, Flags::ZEROED | Flags::RUNNING),
                    None => (NO_PHASE, Flags::ZEROED),
                };
                let sample = Sample { seq: self.seq, t_us, duty, phase, flags, ..Sample::default() };
                let mut one = Wire::default();
                one.sample(&sample);
                match (self.fate)(self.seq, &mut one.0) {
                    true => out.0.extend(one.0),
                    false => self.dropped += 1,
                }
            }
            self.seq = self.seq.wrapping_add(1);
        }
    }
}
