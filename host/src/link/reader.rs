//! The thread that reads the line: bytes → frames → answers for whoever asked, the rest into the inbox.
//!
//! It never waits for anything but the line: a queue that is full costs samples, which are counted.

use std::cell::RefCell;
use std::io::{self, Read};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering::Relaxed};
use std::sync::mpsc::SyncSender;
use std::sync::{Arc, Mutex, MutexGuard};

use protocol::frame::{CRC_BYTES, Decoder, MAX_PAYLOAD};
use protocol::hello::{Greeting, Identity};
use protocol::message::{peek_identity, read_to_host};
use protocol::{Event, EventKind, Hello, Layout, Refusal, Report, Sample, Status, ToHost, sample};
use serialport::SerialPort;

use super::LinkError;
use super::inbox::{Arrival, Inbox};
use super::ledger::Ledger;
use super::repeats::Repeats;

/// What the device answered.
#[derive(Debug)]
pub(super) enum Answer {
    Hello(Box<Hello>),
    /// A handshake in another version.
    Stranger(Box<Identity>),
    Done {
        id: u8,
        outcome: Result<(), Box<Refusal>>,
    },
    Status(Status),
}

/// What the reader shares with the rest of the link.
#[derive(Debug)]
pub(super) struct Shared {
    pub(super) port: String,
    pub(super) inbox: Inbox,
    ledger: Mutex<Stream>,
    /// The handshake is done: a restart from now on is one too many.
    pub(super) established: AtomicBool,
    pub(super) closing: AtomicBool,
    pub(super) bytes: AtomicU64,
    pub(super) frames: AtomicU64,
    pub(super) damaged: AtomicU64,
}

/// The stream under way.
#[derive(Debug, Default)]
pub(super) struct Stream {
    /// Whether samples are wanted.
    pub(super) on: bool,
    /// Samples before this number are left over from an earlier stream.
    pub(super) from_seq: Option<u32>,
    pub(super) ledger: Ledger,
}

impl Shared {
    pub(super) fn new(port: &str, capacity: usize) -> Self {
        Self {
            port: port.to_owned(),
            inbox: Inbox::new(capacity),
            ledger: Mutex::default(),
            established: AtomicBool::new(false),
            closing: AtomicBool::new(false),
            bytes: AtomicU64::new(0),
            frames: AtomicU64::new(0),
            damaged: AtomicU64::new(0),
        }
    }

    /// The stream's counts; held for a few instructions by whoever takes it.
    pub(super) fn stream(&self) -> MutexGuard<'_, Stream> {
        self.ledger.lock().unwrap_or_else(|e| e.into_inner())
    }
}

/// Reads until the line is gone or the link closes.
pub(super) fn run(mut port: Box<dyn SerialPort>, shared: Arc<Shared>, answers: SyncSender<Answer>) {
    let mut reader = Reader { shared, answers, layout: None, warnings: RefCell::default() };
    let mut decoder = Decoder::<{ MAX_PAYLOAD + CRC_BYTES }>::new();
    let mut buffer = [0; 4096];
    while !reader.shared.closing.load(Relaxed) {
        match port.read(&mut buffer) {
            // End of file: the other end of a pseudo-terminal closed.
            Ok(0) => return reader.gone(io::ErrorKind::UnexpectedEof.into()),
            Ok(n) => {
                reader.shared.bytes.fetch_add(n as u64, Relaxed);
                for byte in &buffer[..n] {
                    match decoder.feed(*byte) {
                        Some(Ok(payload)) => reader.frame(payload),
                        Some(Err(error)) => reader.damaged(&error),
                        None => {}
                    }
                }
            }
            Err(error) if matches!(error.kind(), io::ErrorKind::TimedOut | io::ErrorKind::Interrupted) => {}
            Err(error) => return reader.gone(error),
        }
    }
}

struct Reader {
    shared: Arc<Shared>,
    answers: SyncSender<Answer>,
    layout: Option<Layout>,
    warnings: RefCell<Repeats>,
}

impl Reader {
    fn gone(&self, source: io::Error) {
        self.shared.inbox.end(LinkError::Gone { port: self.shared.port.clone(), source });
    }

    fn damaged(&self, error: &dyn std::fmt::Display) {
        tracing::debug!("damaged frame: {error}");
        self.shared.damaged.fetch_add(1, Relaxed);
    }

    fn frame(&mut self, payload: &[u8]) {
        if payload.first() == Some(&sample::TAG) && self.layout.is_none() {
            self.shared.frames.fetch_add(1, Relaxed);
            return; // left over from an earlier session
        }
        if let Some(identity) = peek_identity(payload)
            && !identity.agrees(&Greeting::OURS)
        {
            self.shared.frames.fetch_add(1, Relaxed);
            return self.answer(Answer::Stranger(Box::new(identity)));
        }
        match read_to_host(payload, self.layout.as_ref()) {
            Ok(message) => {
                self.shared.frames.fetch_add(1, Relaxed);
                match message {
                    ToHost::Sample(sample) => self.sample(sample),
                    ToHost::Report(report) => self.report(report),
                }
            }
            // Its checksum agrees, its content does not: as good as damaged.
            Err(error) => self.damaged(&error),
        }
    }

    fn sample(&self, sample: Sample) {
        let mut stream = self.shared.stream();
        let left_over = stream.from_seq.is_some_and(|from| sample.seq.wrapping_sub(from) >= 1 << 31);
        if !stream.on || left_over {
            return;
        }
        match stream.ledger.sample(sample.seq, sample.t_us) {
            Ok((seq, t_us)) => {
                if !self.shared.inbox.push(Arrival::Sample { seq, t_us, sample: Box::new(sample) }) {
                    stream.ledger.host_dropped();
                }
            }
            Err(backwards) => {
                tracing::warn!("{backwards}");
                stream.on = false;
                self.shared.inbox.end(LinkError::Restarted { reason: None });
            }
        }
    }

    fn report(&mut self, report: Report) {
        match report {
            Report::Hello(hello) => {
                self.layout = Some(hello.layout);
                self.answer(Answer::Hello(Box::new(hello)));
            }
            Report::Accepted { id } => self.answer(Answer::Done { id, outcome: Ok(()) }),
            Report::Refused { id, refusal } => self.answer(Answer::Done { id, outcome: Err(Box::new(refusal)) }),
            Report::HeartbeatSeen { .. } => {}
            Report::Status(status) => self.answer(Answer::Status(status)),
            Report::Loss(loss) => {
                self.shared.stream().ledger.loss(&loss);
                self.keep(Arrival::Loss(loss));
            }
            Report::Event(event) => self.event(event),
            Report::Log { level, text } => self.keep(Arrival::Log { level, text: text.as_str().to_owned() }),
            Report::Defmt { at, bytes } => self.keep(Arrival::Defmt { at, bytes: bytes.to_vec() }),
        }
    }

    fn event(&self, event: Event) {
        let (seq, t_us) = self.shared.stream().ledger.near(event.seq, event.t_us);
        self.keep(Arrival::Event { seq, t_us, kind: event.kind });
        if let EventKind::Started(reason) = event.kind
            && self.shared.established.load(Relaxed)
        {
            self.shared.stream().on = false;
            self.shared.inbox.end(LinkError::Restarted { reason: Some(reason) });
        }
    }

    fn keep(&self, arrival: Arrival) {
        if !self.shared.inbox.push(arrival) {
            self.warnings.borrow_mut().warn("a report of the device was dropped: nobody takes them");
        }
    }

    fn answer(&self, answer: Answer) {
        // Full or closed: nobody waits for it.
        let _ = self.answers.try_send(answer);
    }
}
