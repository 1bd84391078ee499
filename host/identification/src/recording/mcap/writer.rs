//! Writes a recording so that a reader finds all but the last quarter of a second of it, whatever happens to the writer.

use std::borrow::Cow;
use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::time::{Duration, Instant};

use mcap::records::MessageHeader;
use mcap::write::NoSeek;
use mcap::{Attachment, WriteOptions};

use super::protobuf::{Encoder, MessageType};
use super::schema::{self, SessionFile};
use super::{FORMAT_VERSION, MOTION_FILE, PROFILE, ROBOT_FILE, SESSION_FILE};
use crate::recording::recorder::Order;
use crate::recording::{Event, LogLine, LossBalance, Recording, Row, RowError, Session};

/// Uncompressed size of a chunk.
const CHUNK_BYTES: u64 = 64 * 1024;
/// Device time after which samples that were pushed are handed to the operating system, µs.
const FLUSH_US: u64 = 250_000;
/// Time after which a flush also waits for the disk, so that a power cut loses no more.
const SYNC_PERIOD: Duration = Duration::from_secs(1);

/// Why a recording could not be written.
#[derive(Debug, thiserror::Error)]
pub enum WriteError {
    /// The sample cannot follow the ones before it; nothing of it was written, and the writer goes on.
    #[error("sample refused")]
    Row(#[from] RowError),
    /// The file cannot be written any more.
    #[error("cannot write the recording")]
    File(#[source] mcap::McapError),
}

impl From<mcap::McapError> for WriteError {
    fn from(error: mcap::McapError) -> Self {
        Self::File(error)
    }
}

/// A file that is appended to, and synced to disk once a second when it is flushed.
#[derive(Debug)]
pub struct Disk {
    file: BufWriter<File>,
    synced: Instant,
}

impl Disk {
    /// Takes over an open, empty file.
    pub fn new(file: File) -> Self {
        Self { file: BufWriter::new(file), synced: Instant::now() }
    }

    /// Waits until the disk has everything.
    pub fn sync(&mut self) -> io::Result<()> {
        self.file.flush()?;
        self.file.get_ref().sync_data()?;
        self.synced = Instant::now();
        Ok(())
    }
}

impl Write for Disk {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.file.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        if self.synced.elapsed() < SYNC_PERIOD { self.file.flush() } else { self.sync() }
    }
}

/// Streams a recording into an MCAP file.
///
/// After any prefix of calls, what reached `W` is a readable recording, at most 0.25 s of device time behind
/// [`Writer::push`]. Over [`Disk`], `push` may wait for the disk: call it from a thread that nothing else waits for.
/// Dropped without [`Writer::finish`], the file is closed as well as it can be.
pub struct Writer<W: Write> {
    file: mcap::Writer<NoSeek<W>>,
    order: Order,
    encoder: Encoder,
    /// Of the robot.
    gyros: usize,
    sample: u16,
    event: u16,
    log: u16,
    balance: u16,
    flushed_us: Option<u64>,
    last: (u64, u64),
}

impl<W: Write> Writer<W> {
    /// Writes what must not be lost (robot, session, motion) and flushes it.
    ///
    /// # Errors
    /// [`WriteError::File`].
    pub fn new(file: W, session: &Session) -> Result<Self, WriteError> {
        let mut file = WriteOptions::new()
            .profile(PROFILE)
            .library(concat!("host ", env!("CARGO_PKG_VERSION")))
            .chunk_size(Some(CHUNK_BYTES))
            .compression_threads(0) // chunks are small; a thread more would only make their order in time uncertain
            .disable_seeking(true)
            .create(NoSeek::new(file))?;
        let mut attach = |name: &str, media_type: &str, text: &str| {
            file.attach(&Attachment {
                log_time: 0,
                create_time: 0,
                name: name.to_owned(),
                media_type: media_type.to_owned(),
                data: Cow::Borrowed(text.as_bytes()),
            })
        };
        attach(ROBOT_FILE, "application/toml", session.robot.toml())?;
        if let Some(motion) = &session.motion {
            attach(MOTION_FILE, "application/toml", &motion.toml)?;
        }
        let about = SessionFile {
            format_version: FORMAT_VERSION,
            written_by: env!("CARGO_PKG_VERSION").to_owned(),
            motion: session.motion.as_ref().map(|motion| motion.name.clone()),
            zero_rad: session.zero_rad.clone(),
            firmware: session.firmware.clone(),
            gyro_times: session.gyro_times.clone(),
            imported_from: session.imported_from.clone(),
            period_s: session.period_s,
        };
        let about = serde_json::to_string_pretty(&about).map_err(|error| mcap::McapError::Io(error.into()))?;
        attach(SESSION_FILE, "application/json", &about)?;

        let mut channel = |(topic, name): (&str, &str), message: MessageType| {
            let schema = file.add_schema(name, "protobuf", &message.descriptor())?;
            file.add_channel(schema, topic, "protobuf", &Default::default())
        };
        let sample = channel(schema::SAMPLE, schema::sample_type(&session.robot))?;
        let event = channel(schema::EVENT, schema::event_type())?;
        let log = channel(schema::LOG, schema::log_type())?;
        let balance = channel(schema::BALANCE, schema::balance_type())?;
        file.flush()?;
        Ok(Self {
            file,
            order: Order::new(session.robot.joints.len(), session.robot.channels().len()),
            encoder: Encoder::default(),
            gyros: session.robot.gyros().count(),
            sample,
            event,
            log,
            balance,
            flushed_us: None,
            last: (0, 0),
        })
    }

    /// Appends a sample.
    ///
    /// # Errors
    /// [`WriteError::Row`] if it cannot follow the ones before it (it is left out), [`WriteError::File`].
    pub fn push(&mut self, row: &Row<'_>) -> Result<(), WriteError> {
        self.order.accept(row)?;
        self.last = (row.t_us, row.seq);
        let header = header(self.sample, row.t_us, row.seq);
        self.file.write_to_known_channel(&header, schema::encode_sample(&mut self.encoder, row, self.gyros))?;
        if row.t_us.saturating_sub(*self.flushed_us.get_or_insert(row.t_us)) >= FLUSH_US {
            self.flush()?;
        }
        Ok(())
    }

    /// Appends an event and flushes: what happened last is what one wants to know afterwards.
    ///
    /// # Errors
    /// [`WriteError::File`].
    pub fn event(&mut self, event: &Event) -> Result<(), WriteError> {
        let header = header(self.event, event.t_us, event.seq);
        self.file.write_to_known_channel(&header, schema::encode_event(&mut self.encoder, event))?;
        self.flush()
    }

    /// Appends a line of the firmware's log.
    ///
    /// # Errors
    /// [`WriteError::File`].
    pub fn log(&mut self, line: &LogLine) -> Result<(), WriteError> {
        let header = header(self.log, line.t_us, self.last.1);
        self.file.write_to_known_channel(&header, schema::encode_log(&mut self.encoder, line))?;
        Ok(())
    }

    /// Appends the loss balance as it is now; the last one in the file counts.
    ///
    /// # Errors
    /// [`WriteError::File`].
    pub fn balance(&mut self, balance: &LossBalance) -> Result<(), WriteError> {
        let header = header(self.balance, self.last.0, self.last.1);
        self.file.write_to_known_channel(&header, schema::encode_balance(&mut self.encoder, balance))?;
        Ok(())
    }

    /// Hands everything to the operating system. `push` does it every 0.25 s of device time; call it too when samples
    /// stay away.
    ///
    /// # Errors
    /// [`WriteError::File`].
    pub fn flush(&mut self) -> Result<(), WriteError> {
        self.flushed_us = Some(self.last.0);
        Ok(self.file.flush()?)
    }

    /// Closes the file with its summary and gives back what is under it (a [`Disk`] is still to be synced).
    ///
    /// # Errors
    /// [`WriteError::File`].
    pub fn finish(mut self) -> Result<W, WriteError> {
        self.file.finish()?;
        let mut file = self.file.into_inner().into_inner();
        file.flush().map_err(mcap::McapError::Io)?;
        Ok(file)
    }
}

fn header(channel_id: u16, t_us: u64, seq: u64) -> MessageHeader {
    // Nanoseconds of an absurd time stay at the end of the range; the message has the exact microseconds.
    let time = t_us.saturating_mul(1000);
    MessageHeader { channel_id, sequence: seq as u32, log_time: time, publish_time: time }
}

/// Writes a whole recording.
///
/// # Errors
/// [`WriteError`].
pub fn write<W: Write>(file: W, recording: &Recording) -> Result<W, WriteError> {
    let mut writer = Writer::new(file, &recording.session())?;
    let (mut duty, mut values) = (Vec::new(), Vec::new());
    let mut events = recording.events.iter().peekable();
    let mut log = recording.log.iter().peekable();
    for k in 0..recording.len() {
        while let Some(event) = events.next_if(|event| event.seq <= recording.seq[k]) {
            writer.event(event)?;
        }
        while let Some(line) = log.next_if(|line| line.t_us <= recording.t_us[k]) {
            writer.log(line)?;
        }
        duty.clear();
        duty.extend(recording.duty.iter().map(|column| column[k]));
        values.clear();
        values.extend(recording.channels.iter().map(|channel| channel.values[k]));
        writer.push(&Row {
            t_us: recording.t_us[k],
            seq: recording.seq[k],
            phase: recording.phase[k],
            tick: recording.ticks[k],
            duty: &duty,
            values: &values,
        })?;
    }
    for event in events {
        writer.event(event)?;
    }
    for line in log {
        writer.log(line)?;
    }
    if let Some(balance) = &recording.balance {
        writer.balance(balance)?;
    }
    writer.finish()
}
