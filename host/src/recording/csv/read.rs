//! Reads a table into a recording, or says which line is wrong.

use std::borrow::Cow;
use std::io::Read;
use std::path::Path;

use ::csv::{ByteRecord, ReaderBuilder};
use flate2::bufread::MultiGzDecoder;

use super::header::{Clock, Header};
use super::{TableError, What};
use crate::recording::{NO_PHASE, Recorder, Recording, Row, Session, Source, Tick, sha256};
use crate::robot::{InputUnit, Robot};

/// The median step may differ from the robot's period by this factor (a clock that is off by 2 % is another rate).
const RATE_TOLERANCE: f64 = 0.02;
/// Largest table that is unpacked: 512 MiB, some 50 minutes of Doggy. A plain file may be larger: it is there already.
const MAX_UNPACKED_BYTES: u64 = 512 << 20;
/// Later times than this are refused: their microseconds are not exact in an `f64` (2⁵³ µs, 285 years).
const LATEST_US: f64 = 9_007_199_254_740_992.0;

/// Reads the table at `path` (plain or gzip) as a recording of `robot`.
///
/// # Errors
/// [`TableError`] with the line and what to do.
pub fn read(path: &Path, robot: &Robot) -> Result<Recording, TableError> {
    let bytes = std::fs::read(path).map_err(|source| TableError::Open { path: path.to_owned(), source })?;
    parse(&bytes, robot, path)
}

/// Reads a table from the bytes of a file; `path` is only noted as its source.
///
/// # Errors
/// [`TableError`], but never [`TableError::Open`].
pub fn parse(bytes: &[u8], robot: &Robot, path: &Path) -> Result<Recording, TableError> {
    let text = unpack(bytes, MAX_UNPACKED_BYTES)?;
    let mut reader = ReaderBuilder::new()
        .has_headers(false)
        .flexible(true)
        .comment(Some(b'#'))
        .trim(::csv::Trim::All)
        .from_reader(text.as_ref());
    let mut fields = ByteRecord::new();
    if !next(&mut reader, &mut fields)? {
        return Err(TableError::Empty("no line"));
    }
    let names = fields
        .iter()
        .map(|name| std::str::from_utf8(name).map(str::to_owned))
        .collect::<Result<_, _>>()
        .map_err(|_| row_error(line_of(&fields), None, What::NotText))?;
    let header = Header::find(names, robot, line_of(&fields))?;

    let source = Source { path: path.to_owned(), sha256: sha256(bytes) };
    let mut session = Session::of(robot.clone());
    session.imported_from = Some(source.clone());
    let mut rows = Rows::new(header, robot, Recorder::new(session));
    while next(&mut reader, &mut fields)? {
        rows.push(&fields)?;
    }
    if rows.recorder.is_empty() {
        return Err(TableError::Empty("a header and no row"));
    }
    let recording = rows.recorder.finish(source);
    check_rate(&recording)?;
    Ok(recording)
}

/// Gzip or plain, by the first bytes; what cannot be a table is told at once.
pub(super) fn unpack(bytes: &[u8], max_bytes: u64) -> Result<Cow<'_, [u8]>, TableError> {
    let text = if bytes.starts_with(&[0x1f, 0x8b]) {
        let mut text = Vec::new();
        let mut unpacked = MultiGzDecoder::new(bytes).take(max_bytes + 1);
        unpacked.read_to_end(&mut text).map_err(|source| TableError::Gzip { source })?;
        if text.len() as u64 > max_bytes {
            return Err(TableError::TooLarge { max_bytes });
        }
        Cow::Owned(text)
    } else {
        Cow::Borrowed(bytes)
    };
    let foreign = |found, advice| Err(TableError::Foreign { found, advice });
    let start = &text[..text.len().min(4096)];
    if start.starts_with(mcap::MAGIC) {
        return foreign("an MCAP file", "a recording (RUN.mcap) needs no import: give it to `host check` as it is");
    }
    if start.starts_with(b"PK\x03\x04") {
        return foreign("a zip file or a spreadsheet", "save the spreadsheet as CSV, or unpack the file first");
    }
    if start.starts_with(&[0xff, 0xfe]) || start.starts_with(&[0xfe, 0xff]) {
        return foreign("text in UTF-16", "save the table as plain text in UTF-8");
    }
    if start.contains(&0) {
        return foreign("a binary file", "give a CSV table: a header row, then one row a tick");
    }
    Ok(text)
}

fn next(reader: &mut ::csv::Reader<&[u8]>, fields: &mut ByteRecord) -> Result<bool, TableError> {
    let line = reader.position().line();
    reader.read_byte_record(fields).map_err(|error| row_error(line, None, What::Syntax(error.to_string())))
}

fn line_of(fields: &ByteRecord) -> u64 {
    fields.position().map_or(0, ::csv::Position::line)
}

fn row_error(line: u64, column: Option<&str>, what: What) -> TableError {
    TableError::Row { line, column: column.map(str::to_owned), what }
}

/// Rows as they come, with what each is held against.
struct Rows {
    header: Header,
    recorder: Recorder,
    unit: InputUnit,
    period_us: f64,
    before: Option<(u64, u64, u64)>, // time, number, line
    duty: Vec<f64>,
    values: Vec<f64>,
}

impl Rows {
    fn new(header: Header, robot: &Robot, recorder: Recorder) -> Self {
        Self {
            duty: vec![0.0; header.duty.len()],
            values: vec![0.0; header.channels.len()],
            unit: robot.input.unit,
            period_us: robot.sample_period_s * 1e6,
            before: None,
            header,
            recorder,
        }
    }

    fn push(&mut self, fields: &ByteRecord) -> Result<(), TableError> {
        let line = line_of(fields);
        let names = &self.header.names;
        if fields.len() != names.len() {
            return Err(row_error(line, None, What::Width { expected: names.len(), got: fields.len() }));
        }
        let at = |field: usize| move |what| row_error(line, Some(&names[field]), what);
        let t_us = time(&fields[self.header.time], self.header.clock).map_err(at(self.header.time))?;
        let seq = match self.before {
            None => 0,
            Some((before_us, seq, _)) if t_us > before_us => {
                // The number of periods that passed; a step of less than half a period is a late or early tick.
                seq + ((t_us - before_us) as f64 / self.period_us).round().max(1.0) as u64
            }
            Some((before_us, _, before_line)) => {
                let what = match t_us == before_us {
                    true => What::Duplicate { t_us, before_line },
                    false => What::Backwards { t_us, before_us, before_line },
                };
                return Err(at(self.header.time)(what));
            }
        };
        self.before = Some((t_us, seq, line));
        for (duty, &field) in self.duty.iter_mut().zip(&self.header.duty) {
            *duty = number(&fields[field]).and_then(|value| value.ok_or(What::Missing)).map_err(at(field))?;
            if self.unit == InputUnit::Duty && duty.abs() > 1.0 {
                return Err(at(field)(What::Duty(*duty)));
            }
        }
        for (value, &field) in self.values.iter_mut().zip(&self.header.channels) {
            *value = number(&fields[field]).map_err(at(field))?.unwrap_or(f64::NAN);
        }
        let row = Row { t_us, seq, phase: NO_PHASE, tick: Tick::default(), duty: &self.duty, values: &self.values };
        // All that the recorder refuses was refused above, with its line.
        self.recorder.push(&row).map_err(|error| row_error(line, None, What::Syntax(error.to_string())))
    }
}

fn text(field: &[u8]) -> Result<&str, What> {
    std::str::from_utf8(field).map_err(|_| What::NotText)
}

/// A finite number, or nothing for an empty field.
fn number(field: &[u8]) -> Result<Option<f64>, What> {
    if field.is_empty() {
        return Ok(None);
    }
    let text = text(field)?;
    match text.parse::<f64>() {
        Ok(value) if value.is_finite() => Ok(Some(value)),
        Ok(_) => Err(What::NotFinite(text.to_owned())),
        Err(_) => Err(What::Text(text.to_owned())),
    }
}

/// The time of a row in µs.
fn time(field: &[u8], clock: Clock) -> Result<u64, What> {
    if field.is_empty() {
        return Err(What::Missing);
    }
    let text = text(field)?;
    match clock {
        Clock::Microseconds => match text.parse::<u64>() {
            Ok(t_us) => Ok(t_us),
            // Some programs write whole numbers as 1790148.0.
            Err(_) => match text.parse::<f64>() {
                Ok(value) if value >= 0.0 && value.fract() == 0.0 && value < LATEST_US => Ok(value as u64),
                _ => Err(What::Time(text.to_owned())),
            },
        },
        Clock::Seconds => match text.parse::<f64>() {
            Ok(value) if (0.0..LATEST_US).contains(&(value * 1e6)) => Ok((value * 1e6).round() as u64),
            _ => Err(What::Seconds(text.to_owned())),
        },
    }
}

/// Rows at another rate than the robot's tick would be read as gaps everywhere, or as no gap where there is one.
fn check_rate(recording: &Recording) -> Result<(), TableError> {
    let mut steps: Vec<u64> = recording.t_us.windows(2).map(|pair| pair[1] - pair[0]).collect();
    if steps.is_empty() {
        return Ok(());
    }
    let middle = steps.len() / 2;
    let found_us = *steps.select_nth_unstable(middle).1 as f64;
    let expected_us = recording.period_s * 1e6;
    match (found_us / expected_us - 1.0).abs() <= RATE_TOLERANCE {
        true => Ok(()),
        false => Err(TableError::Rate { found_us, expected_us }),
    }
}
