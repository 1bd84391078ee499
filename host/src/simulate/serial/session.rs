//! The board at its line: bytes at the line's rate, faults at their times, and what either side last said.

use protocol::budget::{self, BAUD, BITS_PER_BYTE, FAST_BAUD};
use protocol::frame::Decoder;
use protocol::message::{MAX_TO_DEVICE_FRAME, MAX_TO_HOST_FRAME, read_to_device, read_to_host};
use protocol::{State, ToDevice, ToHost};
use serde::Serialize;

use super::line::{Line, LineCounts};
use crate::simulate::{Fault, Microcontroller, SimulateError};

/// Bytes that wait for the host in the simulation's own hands; a host that takes no more stalls the line.
const ROOM: usize = 4096;
/// Ticks since the last heartbeat until a fast simulation waits for the next: the device's timeout is 100.
const HEARTBEAT_TICKS: u64 = 60;
/// Ticks until what the host sent is taken, answered and on its way back: a long answer takes 5.7 ms of the line.
const ANSWER_TICKS: u64 = 8;
/// Ticks after a jog for which time may run fast: until a robot that was jogged is looked at and jogged again.
const JOG_TICKS: u64 = 3000;
/// Samples that a fast simulation may be ahead of what the host has worked off.
const AHEAD: i32 = 200;
/// The same once a joint was jogged: a host that looks at a jog and ends it early is told in time, as by a real line.
const AHEAD_OF_JOG: i32 = 40;

/// Everything that was injected, and what became of the frames.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
pub struct FaultCounts {
    /// Frames on their way to the host.
    #[serde(flatten)]
    pub line: LineCounts,
    /// Stalls from device to host that began.
    pub stalls_out: u32,
    /// Stalls from host to device that began.
    pub stalls_in: u32,
    /// Resets of the board.
    pub resets: u32,
}

/// A board and its line.
pub(in crate::simulate) struct Session {
    board: Box<dyn Microcontroller>,
    line: Line,
    faults: Vec<Fault>,
    begun: Vec<bool>,
    counts: FaultCounts,
    ticks: u64,
    motion_start_s: Option<f64>,
    /// Last tick in which a joint was jogged.
    jogged_tick: Option<u64>,
    bytes_per_tick: f64,
    out_credit: f64,
    in_credit: f64,
    /// The transmitter: frames that the core has handed over, and how much of them is sent.
    uart: Vec<u8>,
    sent: usize,
    from_host: Vec<u8>,
    /// What is to be written to the port.
    pub to_host: Vec<u8>,
    heard: Decoder<MAX_TO_DEVICE_FRAME>,
    told: Decoder<MAX_TO_HOST_FRAME>,
    heard_tick: Option<u64>,
    /// Tick of the last byte from the host.
    delivered_tick: u64,
    seen_seq: u32,
    told_seq: u32,
}

impl Session {
    pub fn new(board: Box<dyn Microcontroller>, faults: Vec<Fault>, seed: u64) -> Self {
        let rate = |wanted: fn(&Fault) -> Option<f64>| faults.iter().filter_map(wanted).fold(0.0, f64::max);
        let drop = rate(|fault| if let Fault::Drop(rate) = fault { Some(*rate) } else { None });
        let corrupt = rate(|fault| if let Fault::Corrupt(rate) = fault { Some(*rate) } else { None });
        let baud = if budget::carries(&board.layout(), 1000, BAUD) { BAUD } else { FAST_BAUD };
        Self {
            board,
            line: Line::new(drop, corrupt, seed),
            begun: vec![false; faults.len()],
            faults,
            counts: FaultCounts::default(),
            ticks: 0,
            motion_start_s: None,
            jogged_tick: None,
            bytes_per_tick: f64::from(baud) / f64::from(BITS_PER_BYTE) / 1000.0,
            out_credit: 0.0,
            in_credit: 0.0,
            uart: Vec::new(),
            sent: 0,
            from_host: Vec::new(),
            to_host: Vec::new(),
            heard: Decoder::new(),
            told: Decoder::new(),
            heard_tick: None,
            delivered_tick: 0,
            seen_seq: 0,
            told_seq: 0,
        }
    }

    /// One millisecond.
    ///
    /// # Errors
    /// [`SimulateError`] if the microcontroller runs no further.
    pub fn tick(&mut self) -> Result<(), SimulateError> {
        self.inject()?;
        if !self.stalled(|fault| matches!(fault, Fault::StallIn { .. })) {
            self.deliver();
        }
        let start_s = self.board.time_s();
        self.board.tick()?;
        self.ticks += 1;
        match self.board.state() {
            State::Jogging { .. } => self.jogged_tick = Some(self.ticks),
            State::Running { .. } => self.jogged_tick = None,
            _ => {}
        }
        if self.motion_start_s.is_none() && matches!(self.board.state(), State::Running { .. }) {
            self.motion_start_s = Some(start_s);
        }
        if !self.stalled(|fault| matches!(fault, Fault::StallOut { .. })) && self.to_host.len() < ROOM {
            self.send();
        }
        Ok(())
    }

    /// Bytes that came through the port.
    pub fn receive(&mut self, bytes: &mut Vec<u8>) {
        self.from_host.append(bytes);
    }

    /// A motion is played or about to begin, or a jog has not died out: time may run fast.
    pub fn in_motion(&self) -> bool {
        let jogged = self.jogged_tick.is_some_and(|tick| self.ticks - tick < JOG_TICKS);
        jogged || matches!(self.board.state(), State::Running { .. } | State::Waiting { .. })
    }

    /// Whether a tick is due for what the host has sent; the first ones are due in any case.
    pub fn is_due(&self) -> bool {
        !self.from_host.is_empty() || self.ticks <= self.delivered_tick + ANSWER_TICKS
    }

    /// Whether the host is not heard because of a stall: its length is told in device time, which must not wait for the host then.
    pub fn is_deaf(&self) -> bool {
        self.stalled(|fault| matches!(fault, Fault::StallIn { .. }))
    }

    /// The host is gone; the next one speaks for itself.
    pub fn forget_host(&mut self) {
        self.heard_tick = None;
    }

    /// Whether the host that is there has sent heartbeats.
    pub fn was_heard(&self) -> bool {
        self.heard_tick.is_some()
    }

    /// Whether a fast simulation may take another tick: the host was heard lately, and has worked off what it was told.
    pub fn host_keeps_up(&self) -> bool {
        let heard = self.heard_tick.is_some_and(|tick| self.ticks - tick < HEARTBEAT_TICKS);
        let ahead = self.told_seq.wrapping_sub(self.seen_seq) as i32;
        let leash = if self.jogged_tick.is_some() { AHEAD_OF_JOG } else { AHEAD };
        heard && ahead < leash && self.to_host.len() < ROOM
    }

    pub fn counts(&self) -> FaultCounts {
        FaultCounts { line: self.line.counts(), ..self.counts }
    }

    pub fn ticks(&self) -> u64 {
        self.ticks
    }

    /// How far each joint was from its marked pose at most, as far as the board knows; rad or m.
    pub fn farthest(&self) -> Vec<f64> {
        self.board.farthest()
    }

    /// Time since the motion began, s.
    fn motion_s(&self) -> Option<f64> {
        self.motion_start_s.map(|start| self.board.time_s() - start)
    }

    fn stalled(&self, kind: impl Fn(&Fault) -> bool) -> bool {
        let Some(now) = self.motion_s() else { return false };
        self.faults.iter().filter(|fault| kind(fault)).any(|fault| match fault {
            Fault::StallOut { duration_s, at_s } | Fault::StallIn { duration_s, at_s } => {
                (*at_s..at_s + duration_s).contains(&now)
            }
            _ => false,
        })
    }

    /// Counts stalls as they begin, and resets the board when it is time.
    fn inject(&mut self) -> Result<(), SimulateError> {
        let Some(now) = self.motion_s() else { return Ok(()) };
        for i in 0..self.faults.len() {
            let (Fault::StallOut { at_s, .. } | Fault::StallIn { at_s, .. } | Fault::Reset { at_s }) = self.faults[i]
            else {
                continue;
            };
            if self.begun[i] || now < at_s {
                continue;
            }
            self.begun[i] = true;
            match self.faults[i] {
                Fault::StallOut { .. } => self.counts.stalls_out += 1,
                Fault::StallIn { .. } => self.counts.stalls_in += 1,
                _ => {
                    self.counts.resets += 1;
                    // What stood in the transmitter is gone with the rest of its memory.
                    self.uart.clear();
                    self.sent = 0;
                    self.line.cut(&mut self.to_host);
                    self.board.reset()?;
                }
            }
        }
        Ok(())
    }

    /// From the port to the firmware, as fast as the line is.
    fn deliver(&mut self) {
        self.in_credit = (self.in_credit + self.bytes_per_tick).min(2.0 * self.bytes_per_tick);
        let n = (self.in_credit as usize).min(self.from_host.len());
        if n == 0 {
            return;
        }
        self.in_credit -= n as f64;
        self.delivered_tick = self.ticks;
        let bytes: Vec<u8> = self.from_host.drain(..n).collect();
        for byte in &bytes {
            if let Some(Ok(payload)) = self.heard.feed(*byte)
                && let Ok(ToDevice::Heartbeat(heartbeat)) = read_to_device(payload)
            {
                self.heard_tick = Some(self.ticks);
                self.seen_seq = heartbeat.seen_seq;
            }
        }
        self.board.receive(&bytes);
    }

    /// From the firmware to the port, as fast as the line is.
    fn send(&mut self) {
        self.out_credit += self.bytes_per_tick;
        loop {
            if self.sent == self.uart.len() {
                self.uart.resize(MAX_TO_HOST_FRAME, 0);
                let n = self.board.transmit(&mut self.uart);
                self.uart.truncate(n);
                self.sent = 0;
                if n == 0 {
                    // An idle line saves nothing up.
                    self.out_credit = 0.0;
                    return;
                }
            }
            let n = (self.out_credit as usize).min(self.uart.len() - self.sent);
            if n == 0 {
                return;
            }
            let bytes = &self.uart[self.sent..self.sent + n];
            for byte in bytes {
                if let Some(Ok(payload)) = self.told.feed(*byte)
                    && let Ok(ToHost::Sample(sample)) = read_to_host(payload, Some(&self.board.layout()))
                {
                    self.told_seq = sample.seq;
                }
            }
            self.line.carry(bytes, &mut self.to_host);
            self.sent += n;
            self.out_credit -= n as f64;
        }
    }
}
