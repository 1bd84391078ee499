//! A device at the other end of a line: handshake, requests, stream.

use std::sync::Arc;
use std::sync::atomic::Ordering::Relaxed;
use std::sync::mpsc::{Receiver, sync_channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use protocol::request::HEARTBEAT_PERIOD_MS;
use protocol::{Command, Duty, Fault, Hello, Motion, MotionId, Refusal, State, Status, ToDevice, budget};

use super::exchange::{ATTEMPT, send, shake_hands, wait};
use super::heartbeat::Pulse;
use super::inbox::Arrival;
use super::outgoing::Outgoing;
use super::reader::{self, Answer, Shared};
use super::{LinkError, port};
use crate::recording::LossBalance;

/// Attempts of a request.
const ATTEMPTS: u32 = 10;
/// Samples that the queue holds: 4 s at 1 kHz, for a disk that sleeps.
const QUEUE: usize = 4096;
/// After the stream's end, how long nothing may come until nothing more is expected.
const STRAGGLERS: Duration = Duration::from_millis(200);

/// How to open a device.
#[derive(Debug, Clone, Copy)]
pub struct Options {
    /// Bits per second on the line.
    pub baud: u32,
    /// Samples that may wait to be taken.
    pub queue: usize,
    /// Attempts at the handshake, 0.2 s each: a board that resets when its port is opened takes a second or two.
    pub greetings: u32,
}

impl Default for Options {
    fn default() -> Self {
        Self { baud: budget::BAUD, queue: QUEUE, greetings: 15 }
    }
}

/// A device that answered the handshake. Dropped, it is told to stop unless it is known to be at rest.
pub struct Device {
    shared: Arc<Shared>,
    outgoing: Arc<Outgoing>,
    answers: Receiver<Answer>,
    reader: Option<JoinHandle<()>>,
    pulse: Option<Pulse>,
    hello: Hello,
    /// The device said that nothing moves, and was not started since.
    at_rest: bool,
}

/// Stops the device from another thread, without waiting for anything: for Ctrl-C.
#[derive(Clone)]
pub struct Stopper(Arc<Outgoing>);

impl Stopper {
    /// Sends the stop; nothing that could set the robot in motion follows it.
    pub fn stop(&self) {
        // A line that is gone cannot be told; the device stops by itself when the heartbeats stay away.
        if let Err(error) = self.0.stop() {
            tracing::warn!("the stop could not be sent: {error}");
        }
    }
}

/// Asks who is at the other end of a port, and nothing else: a robot that moves goes on moving.
///
/// # Errors
/// [`LinkError`], above all [`LinkError::NoAnswer`] and [`LinkError::Version`].
pub fn probe(port: &str, options: &Options) -> Result<Hello, LinkError> {
    let (closing, outgoing, answers) = open(port, options)?;
    shake_hands(&closing.shared, &outgoing, &answers, options.greetings)
}

/// Opens a port and starts its reader.
fn open(port: &str, options: &Options) -> Result<(Closing, Arc<Outgoing>, Receiver<Answer>), LinkError> {
    let opened = |error: serialport::Error| LinkError::Open { port: port.to_owned(), source: error };
    let line = port::open(port, options.baud)?;
    let incoming = line.try_clone().map_err(opened)?;
    let shared = Arc::new(Shared::new(port, options.queue));
    let (answers_in, answers) = sync_channel(64);
    let theirs = Arc::clone(&shared);
    let reader = std::thread::Builder::new()
        .name("serial reader".to_owned())
        .spawn(move || reader::run(incoming, theirs, answers_in))
        .map_err(|error| opened(error.into()))?;
    Ok((Closing { shared, reader: Some(reader) }, Arc::new(Outgoing::new(line)), answers))
}

impl Device {
    /// Opens the port and shakes hands.
    ///
    /// # Errors
    /// [`LinkError`], which knows what to do ([`LinkError::advice`]).
    pub fn open(port: &str, options: &Options) -> Result<Self, LinkError> {
        let (closing, outgoing, answers) = open(port, options)?;
        let hello = shake_hands(&closing.shared, &outgoing, &answers, options.greetings)?;
        hello.validate()?;
        let (shared, reader) = closing.keep();
        Ok(Self { shared, outgoing, answers, reader, pulse: None, hello, at_rest: false })
    }

    /// The handshake.
    pub fn hello(&self) -> &Hello {
        &self.hello
    }

    /// Brings the device to rest whatever it did before: stops a motion, ends a stream. A fault stays.
    ///
    /// # Errors
    /// [`LinkError`] if it does not answer.
    pub fn halt(&mut self) -> Result<Status, LinkError> {
        let mut status = self.status()?;
        if matches!(status.state, State::Running { .. } | State::Waiting { .. } | State::Jogging { .. }) {
            self.ask("stop", Command::Stop)?;
            status = self.status()?;
        }
        if status.streaming {
            self.ask("end its stream", Command::Stream { on: false })?;
            // Samples of that stream may still be under way; their numbers tell.
            status = self.status()?;
            self.shared.stream().from_seq = Some(status.end_seq);
        }
        self.shared.established.store(true, Relaxed);
        Ok(status)
    }

    /// Makes the device ready whatever it did before: [halts](Device::halt) it and clears a fault. An emergency stop is
    /// cleared by [`Device::clear_stop`] only.
    ///
    /// # Errors
    /// [`LinkError::Refused`] if the cause of a fault lasts, [`LinkError::EmergencyStop`] if that is the fault.
    pub fn settle(&mut self) -> Result<(), LinkError> {
        let status = self.halt()?;
        if let State::Fault(fault) = status.state {
            if fault == Fault::EmergencyStop {
                return Err(LinkError::EmergencyStop);
            }
            tracing::warn!("the device had a latched fault: {fault}");
            // The device clears nothing while it hears no heartbeats.
            self.beat()?;
            self.insist("clear its fault", || Command::ClearFault)?;
        }
        Ok(())
    }

    /// Clears the latched fault, if there is one. That of an emergency stop is cleared by a person only
    /// ([`Device::clear_stop`]).
    ///
    /// # Errors
    /// [`LinkError::Refused`] if its cause lasts, [`LinkError::EmergencyStop`] if that is the fault.
    pub fn clear_fault(&mut self) -> Result<(), LinkError> {
        if let State::Fault(fault) = self.status()?.state {
            if fault == Fault::EmergencyStop {
                return Err(LinkError::EmergencyStop);
            }
            self.beat()?;
            self.insist("clear its fault", || Command::ClearFault)?;
        }
        Ok(())
    }

    /// Clears the fault of an emergency stop, because a person at the robot says so. Any other fault is left to
    /// [`Device::settle`].
    ///
    /// # Errors
    /// [`LinkError::Refused`] if the stop is still pressed.
    pub fn clear_stop(&mut self) -> Result<(), LinkError> {
        if self.status()?.state == State::Fault(Fault::EmergencyStop) {
            self.beat()?;
            self.insist("clear the emergency stop", || Command::ClearFault)?;
        }
        Ok(())
    }

    /// Takes the present pose as zero and reads the handshake anew, which then has the zero positions.
    ///
    /// # Errors
    /// [`LinkError::Refused`] if the robot moves.
    pub fn set_zero(&mut self) -> Result<(), LinkError> {
        self.ask("set zero", Command::SetZero)?;
        self.greet()
    }

    /// Reads the handshake anew.
    ///
    /// # Errors
    /// [`LinkError`] if none comes, or one that contradicts itself.
    pub(super) fn greet(&mut self) -> Result<(), LinkError> {
        self.hello = shake_hands(&self.shared, &self.outgoing, &self.answers, ATTEMPTS)?;
        self.hello.validate()?;
        Ok(())
    }

    /// Uploads a motion, segment by segment.
    ///
    /// # Errors
    /// [`LinkError::Refused`] with the rule that it breaks.
    pub fn upload(&mut self, id: MotionId, motion: &Motion) -> Result<(), LinkError> {
        // At most MAX_SEGMENTS, which fits a byte.
        let segments = motion.segments.len() as u8;
        self.ask("take a motion", Command::UploadBegin { motion: id, header: motion.header(), segments })?;
        for (index, segment) in (0u8..).zip(&motion.segments) {
            self.ask("take a segment", Command::UploadSegment { index, segment: segment.clone() })?;
        }
        self.ask("accept the motion", Command::UploadEnd { checksum: motion.checksum() })
    }

    /// Switches the stream of samples on; [`Device::next`] gives them. From now on heartbeats are sent.
    ///
    /// # Errors
    /// [`LinkError`].
    pub fn stream(&mut self) -> Result<(), LinkError> {
        self.shared.inbox.forget_samples();
        {
            let mut stream = self.shared.stream();
            stream.on = true;
            stream.ledger = Default::default();
        }
        self.beat()?;
        self.ask("send samples", Command::Stream { on: true })
    }

    /// Sends heartbeats from now on.
    fn beat(&mut self) -> Result<(), LinkError> {
        if self.pulse.is_none() {
            let pulse = Pulse::start(Arc::clone(&self.outgoing), self.hello.tick_us);
            self.pulse = Some(pulse.map_err(|source| LinkError::Gone { port: self.shared.port.clone(), source })?);
        }
        Ok(())
    }

    /// Asks again where the device refuses because it missed heartbeats: the next ones are under way.
    fn insist(&mut self, wish: &'static str, command: impl Fn() -> Command) -> Result<(), LinkError> {
        let mut attempts = 0;
        loop {
            let outcome = self.ask(wish, command());
            match &outcome {
                Err(LinkError::Refused { refusal, .. })
                    if **refusal == Refusal::Fault(Fault::HeartbeatLost) && attempts < ATTEMPTS =>
                {
                    attempts += 1;
                    std::thread::sleep(Duration::from_millis(2 * HEARTBEAT_PERIOD_MS));
                }
                _ => return outcome,
            }
        }
    }

    /// Plays the uploaded motion from the tick `at_seq` of the device on, or from its next one.
    ///
    /// # Errors
    /// [`LinkError::Refused`] with the reason; [`Refusal::Late`] if that tick is past.
    pub fn start(&mut self, motion: MotionId, at_seq: Option<u32>) -> Result<(), LinkError> {
        self.at_rest = false;
        self.insist("start the motion", || Command::Start { motion, at_seq })
    }

    /// Drives one joint (from 0) by a duty for so long, ms.
    ///
    /// # Errors
    /// [`LinkError::Refused`] with the reason.
    pub fn jog(&mut self, joint: u8, duty: Duty, duration_ms: u8) -> Result<(), LinkError> {
        self.at_rest = false;
        self.insist("jog a joint", || Command::Jog { joint, duty, duration_ms })
    }

    /// The next thing that the device sent, or `None` if nothing came in time. Call it often: heartbeats tell the
    /// device how far this side has come.
    ///
    /// # Errors
    /// Why nothing follows, once everything that came before was given: [`LinkError::Gone`],
    /// [`LinkError::Restarted`].
    pub fn next(&self, patience: Duration) -> Result<Option<Arrival>, LinkError> {
        let arrival = self.shared.inbox.next(patience)?;
        if let (Some(Arrival::Sample { sample, .. }), Some(pulse)) = (&arrival, &self.pulse) {
            pulse.seen(sample.seq);
        }
        Ok(arrival)
    }

    /// A handle to stop the device from another thread.
    pub fn stopper(&self) -> Stopper {
        Stopper(Arc::clone(&self.outgoing))
    }

    /// Zero duty, and waits for the acknowledgement.
    ///
    /// # Errors
    /// [`LinkError`] if it does not come.
    pub fn stop(&mut self) -> Result<(), LinkError> {
        self.ask("stop", Command::Stop)
    }

    /// Where the device stands.
    ///
    /// # Errors
    /// [`LinkError::Unanswered`].
    pub fn status(&mut self) -> Result<Status, LinkError> {
        // Status and acknowledgement are two frames, and a repeated request is only acknowledged: a fresh id each time.
        for _ in 0..ATTEMPTS {
            let id = self.outgoing.fresh_id();
            self.send("tell its status", &ToDevice::Request { id, command: Command::Status })?;
            let status = self.wait(|answer| match answer {
                Answer::Status(status) => Some(status),
                _ => None,
            })?;
            if let Some(status) = status {
                return Ok(status);
            }
        }
        Err(LinkError::Unanswered { what: "tell its status", attempts: ATTEMPTS, waited: ATTEMPTS * ATTEMPT })
    }

    /// Device time, unwrapped, µs, of a raw time not far from the last sample's.
    pub fn near_us(&self, t_us: u32) -> u64 {
        self.shared.stream().ledger.near(0, t_us).1
    }

    /// Where the missing samples went, so far.
    pub fn balance(&self) -> LossBalance {
        self.shared.stream().ledger.balance(self.shared.damaged.load(Relaxed))
    }

    /// Ends the stream, and heartbeats with it, and closes its balance with the device's own count. Take what [`Device::next`] still gives
    /// before asking for the balance.
    ///
    /// # Errors
    /// [`LinkError`] if the device does not answer; the balance then stays open.
    pub fn end_stream(&mut self) -> Result<Status, LinkError> {
        // Its answers would be among the frames that are counted.
        self.pulse = None;
        self.ask("end its stream", Command::Stream { on: false })?;
        let status = self.status()?;
        self.at_rest = matches!(status.state, State::Idle | State::Fault(_));
        self.shared.stream().ledger.close(&status);
        // Answers overtake samples in the device: wait for the last ones, or until nothing comes any more.
        let (mut arrived, mut since) = (0, Instant::now());
        loop {
            let stream = self.shared.stream();
            if stream.ledger.is_whole() {
                break;
            }
            if stream.ledger.arrived() > arrived {
                (arrived, since) = (stream.ledger.arrived(), Instant::now());
            } else if since.elapsed() > STRAGGLERS {
                break;
            }
            drop(stream);
            std::thread::sleep(Duration::from_millis(5));
        }
        self.shared.stream().on = false;
        Ok(status)
    }

    /// Asks until it is answered.
    pub(super) fn ask(&mut self, what: &'static str, command: Command) -> Result<(), LinkError> {
        let id = self.outgoing.fresh_id();
        let request = ToDevice::Request { id, command };
        for _ in 0..ATTEMPTS {
            self.send(what, &request)?;
            let answer = self.wait(|answer| match answer {
                Answer::Done { id: answered, outcome } if answered == id => Some(outcome),
                _ => None,
            })?;
            if let Some(outcome) = answer {
                return outcome.map_err(|refusal: Box<Refusal>| LinkError::Refused { what, refusal });
            }
        }
        Err(LinkError::Unanswered { what, attempts: ATTEMPTS, waited: ATTEMPTS * ATTEMPT })
    }

    fn send(&self, what: &'static str, message: &ToDevice) -> Result<(), LinkError> {
        send(&self.shared, &self.outgoing, what, message)
    }

    fn wait<T>(&self, wanted: impl FnMut(Answer) -> Option<T>) -> Result<Option<T>, LinkError> {
        wait(&self.shared, &self.answers, wanted)
    }
}

impl Drop for Device {
    fn drop(&mut self) {
        // While heartbeats still go: the stop is what ends a motion, not their absence.
        if !self.at_rest {
            self.stopper().stop();
        }
        self.pulse = None;
        drop(Closing { shared: Arc::clone(&self.shared), reader: self.reader.take() });
    }
}

/// Ends the reader when dropped.
struct Closing {
    shared: Arc<Shared>,
    reader: Option<JoinHandle<()>>,
}

impl Closing {
    /// Leaves the reader running.
    fn keep(mut self) -> (Arc<Shared>, Option<JoinHandle<()>>) {
        (Arc::clone(&self.shared), self.reader.take())
    }
}

impl Drop for Closing {
    fn drop(&mut self) {
        if let Some(reader) = self.reader.take() {
            self.shared.closing.store(true, Relaxed);
            // It looks at least every 50 ms; a panic in it was printed already.
            let _ = reader.join();
        }
    }
}
