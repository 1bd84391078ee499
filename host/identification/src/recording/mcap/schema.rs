//! The four message types of a recording, and the session as it stands in the file.

use serde::{Deserialize, Serialize};

use super::protobuf::{Encoder, Fields, Kind, MessageType, NoMessage, Value};
use crate::recording::{
    Event, Firmware, GyroTime, LogLevel, LogLine, LossBalance, NO_PHASE, Place, Row, Severity, Source, Tick,
};
use crate::robot::Robot;
use protocol::MAX_GYROS;

pub(super) const SAMPLE: (&str, &str) = ("/sample", "recording.Sample");
pub(super) const EVENT: (&str, &str) = ("/event", "recording.Event");
pub(super) const LOG: (&str, &str) = ("/log", "recording.Log");
pub(super) const BALANCE: (&str, &str) = ("/balance", "recording.Balance");

const TICK_FIELDS: [(&str, Kind); 6] = [
    ("t_us", Kind::Unsigned),
    ("seq", Kind::Unsigned),
    ("phase", Kind::Unsigned),
    ("flags", Kind::Unsigned),
    ("execution_us", Kind::Double),
    ("jitter_us", Kind::Double),
];

const EVENT_FIELDS: [(&str, Kind); 4] =
    [("t_us", Kind::Unsigned), ("seq", Kind::Unsigned), ("severity", Kind::Text), ("text", Kind::Text)];

const LOG_FIELDS: [(&str, Kind); 5] = [
    ("t_us", Kind::Unsigned),
    ("level", Kind::Text),
    ("message", Kind::Text),
    ("file", Kind::Text),
    ("line", Kind::Unsigned),
];

const BALANCE_FIELDS: [&str; 8] =
    ["ticks", "received", "missing", "device_dropped", "host_dropped", "line_lost", "damaged_frames", "closed"];

/// Behind the columns, one for each gyro; files of devices that told no ages have none.
const AGE_FIELDS: [&str; MAX_GYROS] = ["gyro1_age_us", "gyro2_age_us"];

pub(super) fn sample_type(robot: &Robot) -> MessageType {
    let columns = robot.columns();
    let ages = AGE_FIELDS.into_iter().take(robot.gyros().count());
    MessageType::new(
        SAMPLE.1,
        TICK_FIELDS
            .into_iter()
            .chain(columns[1..].iter().map(|name| name.as_str()).chain(ages).map(|name| (name, Kind::Double))),
    )
}

pub(super) fn event_type() -> MessageType {
    MessageType::new(EVENT.1, EVENT_FIELDS)
}

pub(super) fn log_type() -> MessageType {
    MessageType::new(LOG.1, LOG_FIELDS)
}

pub(super) fn balance_type() -> MessageType {
    MessageType::new(BALANCE.1, BALANCE_FIELDS.map(|name| (name, Kind::Unsigned)))
}

/// A row of a robot with so many gyros.
pub(super) fn encode_sample<'a>(encoder: &'a mut Encoder, row: &Row<'_>, gyros: usize) -> &'a [u8] {
    encoder
        .clear()
        .unsigned(1, row.t_us)
        .unsigned(2, row.seq)
        .unsigned(3, row.phase.into())
        .unsigned(4, row.tick.flags.into())
        .double(5, row.tick.execution_us)
        .double(6, row.tick.jitter_us);
    let ages = row.tick.gyro_ages_us.iter().take(gyros);
    for (number, &value) in (TICK_FIELDS.len() as u32 + 1..).zip(row.duty.iter().chain(row.values).chain(ages)) {
        encoder.double(number, value);
    }
    encoder.bytes()
}

pub(super) fn encode_event<'a>(encoder: &'a mut Encoder, event: &Event) -> &'a [u8] {
    encoder
        .clear()
        .unsigned(1, event.t_us)
        .unsigned(2, event.seq)
        .text(3, event.severity.name())
        .text(4, &event.text)
        .bytes()
}

pub(super) fn encode_log<'a>(encoder: &'a mut Encoder, line: &LogLine) -> &'a [u8] {
    encoder.clear().unsigned(1, line.t_us).text(2, line.level.name()).text(3, &line.message);
    if let Some(place) = &line.place {
        encoder.text(4, &place.file).unsigned(5, place.line);
    }
    encoder.bytes()
}

pub(super) fn encode_balance<'a>(encoder: &'a mut Encoder, b: &LossBalance) -> &'a [u8] {
    let values = [
        b.ticks,
        b.received,
        b.missing,
        b.device_dropped,
        b.host_dropped,
        b.line_lost,
        b.damaged_frames,
        b.closed.into(),
    ];
    encoder.clear();
    for (number, value) in (1..).zip(values) {
        encoder.unsigned(number, value);
    }
    encoder.bytes()
}

/// Where a field of a file's sample goes.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Slot {
    Unknown,
    Tick(usize),
    Column(usize),
    Age(usize),
}

/// Decodes samples by the schema that stands in the file: fields may come in another order and there may be more.
#[derive(Debug)]
pub(super) struct SampleDecoder {
    joints: usize,
    slots: Vec<Slot>, // by field number
    /// Ages of a sample in which they are left out.
    ages: [f64; MAX_GYROS],
    columns: Vec<f64>,
}

/// A column of the robot that the file's samples do not have.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct MissingColumn(pub String);

impl SampleDecoder {
    /// The decoder for samples of `written` type and the columns of `robot`.
    pub(super) fn new(written: &MessageType, robot: &Robot) -> Result<Self, MissingColumn> {
        let names = &robot.columns()[1..];
        let mut slots = Vec::new();
        let mut place = |name: &str, kind: Kind, slot: Slot| {
            let found = written.fields.iter().find(|field| field.name == name && field.kind == kind);
            let number = found.ok_or_else(|| MissingColumn(name.to_owned()))?.number as usize;
            if number >= 1 << 16 {
                return Err(MissingColumn(name.to_owned()));
            }
            if slots.len() <= number {
                slots.resize(number + 1, Slot::Unknown);
            }
            slots[number] = slot;
            Ok(())
        };
        for (index, (name, kind)) in TICK_FIELDS.into_iter().enumerate() {
            place(name, kind, Slot::Tick(index))?;
        }
        for (index, name) in names.iter().enumerate() {
            place(name, Kind::Double, Slot::Column(index))?;
        }
        for (index, name) in AGE_FIELDS.into_iter().enumerate().take(robot.gyros().count()) {
            // Older files do not have it.
            let _ = place(name, Kind::Double, Slot::Age(index));
        }
        // Of a file that has ages, one that is left out is zero.
        let has = |index: usize| slots.contains(&Slot::Age(index));
        let ages = std::array::from_fn(|index| if has(index) { 0.0 } else { f64::NAN });
        Ok(Self { joints: robot.joints.len(), ages, slots, columns: vec![0.0; names.len()] })
    }

    /// The sample in `bytes`. A field that is left out is zero, as protobuf has it.
    pub(super) fn decode(&mut self, bytes: &[u8]) -> Result<Row<'_>, NoMessage> {
        let (mut whole, mut real) = ([0, 0, NO_PHASE.into(), 0], [0.0; 2]);
        let mut gyro_ages_us = self.ages;
        self.columns.fill(0.0);
        for field in Fields::of(bytes) {
            let (number, value) = field?;
            match (self.slots.get(number as usize), value) {
                (Some(&Slot::Tick(index @ 0..4)), Value::Unsigned(value)) => whole[index] = value,
                (Some(&Slot::Tick(index @ 4..)), Value::Double(value)) => real[index - 4] = value,
                (Some(&Slot::Age(index)), Value::Double(value)) => gyro_ages_us[index] = value,
                (Some(&Slot::Column(index)), Value::Double(value)) => self.columns[index] = value,
                (Some(Slot::Unknown) | None, _) => {}
                _ => return Err(NoMessage),
            }
        }
        let [t_us, seq, phase, flags] = whole;
        let (duty, values) = self.columns.split_at(self.joints);
        Ok(Row {
            t_us,
            seq,
            phase: u8::try_from(phase).map_err(|_| NoMessage)?,
            tick: Tick {
                flags: u16::try_from(flags).map_err(|_| NoMessage)?,
                execution_us: real[0],
                jitter_us: real[1],
                gyro_ages_us,
            },
            duty,
            values,
        })
    }
}

pub(super) fn decode_event(bytes: &[u8]) -> Result<Event, NoMessage> {
    let mut event = Event { t_us: 0, seq: 0, severity: Severity::Note, text: String::new() };
    let text = |bytes| std::str::from_utf8(bytes).map_err(|_| NoMessage);
    for field in Fields::of(bytes) {
        match field? {
            (1, Value::Unsigned(value)) => event.t_us = value,
            (2, Value::Unsigned(value)) => event.seq = value,
            (3, Value::Bytes(value)) => event.severity = Severity::of_name(text(value)?).ok_or(NoMessage)?,
            (4, Value::Bytes(value)) => event.text = text(value)?.to_owned(),
            (1..=4, _) => return Err(NoMessage),
            _ => {}
        }
    }
    Ok(event)
}

pub(super) fn decode_log(bytes: &[u8]) -> Result<LogLine, NoMessage> {
    let mut log = LogLine { t_us: 0, level: LogLevel::Info, message: String::new(), place: None };
    let mut place = Place { file: String::new(), line: 0 };
    let text = |bytes| std::str::from_utf8(bytes).map_err(|_| NoMessage);
    for field in Fields::of(bytes) {
        match field? {
            (1, Value::Unsigned(value)) => log.t_us = value,
            (2, Value::Bytes(value)) => log.level = LogLevel::of_name(text(value)?).ok_or(NoMessage)?,
            (3, Value::Bytes(value)) => log.message = text(value)?.to_owned(),
            (4, Value::Bytes(value)) => place.file = text(value)?.to_owned(),
            (5, Value::Unsigned(value)) => place.line = value,
            (1..=5, _) => return Err(NoMessage),
            _ => {}
        }
    }
    log.place = (!place.file.is_empty()).then_some(place);
    Ok(log)
}

pub(super) fn decode_balance(bytes: &[u8]) -> Result<LossBalance, NoMessage> {
    let mut values = [0; BALANCE_FIELDS.len()];
    for field in Fields::of(bytes) {
        match field? {
            (number @ 1..=8, Value::Unsigned(value)) => values[number as usize - 1] = value,
            (1..=8, _) => return Err(NoMessage),
            _ => {}
        }
    }
    let [ticks, received, missing, device_dropped, host_dropped, line_lost, damaged_frames, closed] = values;
    Ok(LossBalance {
        ticks,
        received,
        missing,
        device_dropped,
        host_dropped,
        line_lost,
        damaged_frames,
        closed: closed != 0,
    })
}

/// `session.json`: what is known before the first sample, beside the robot's and the motion's own files.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct SessionFile {
    pub format_version: u32,
    /// Version of the program that wrote the file.
    pub written_by: String,
    pub motion: Option<String>,
    pub zero_rad: Vec<f64>,
    pub firmware: Option<Firmware>,
    /// Empty in files of devices that told nothing of their gyros' clocks.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub gyro_times: Vec<GyroTime>,
    pub imported_from: Option<Source>,
    /// The recording's own period, s; the robot's if left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub period_s: Option<f64>,
}
