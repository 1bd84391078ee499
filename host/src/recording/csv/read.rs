//! Reads a table into a recording, or says which line is wrong.

use std::borrow::Cow;
use std::io::Read;
use std::path::Path;

use ::csv::{ByteRecord, ReaderBuilder};
use flate2::bufread::MultiGzDecoder;

use super::header::{Clock, Header};
use super::{TableError, What, rate};
use crate::recording::{NO_PHASE, Recorder, Recording, Row, Session, Source, Tick, sha256};
use crate::robot::{Import, InputUnit, Robot};

/// Largest table that is unpacked: 512 MiB, some 50 minutes of Doggy. A plain file may be larger: it is there already.
const MAX_UNPACKED_BYTES: u64 = 512 << 20;
/// Later times than this are refused: their microseconds are not exact in an `f64` (2⁵³ µs, 285 years).
const LATEST_US: f64 = 9_007_199_254_740_992.0;

/// A table as it was read.
#[derive(Debug)]
pub struct Table {
    /// Its samples.
    pub recording: Recording,
    /// Columns that the robot file does not name, and that were passed over.
    pub ignored: Vec<String>,
}

/// Reads the table at `path` (plain or gzip) as a recording of `robot`.
///
/// # Errors
/// [`TableError`] with the line and what to do.
pub fn read(path: &Path, robot: &Robot) -> Result<Table, TableError> {
    let bytes = std::fs::read(path).map_err(|source| TableError::Open { path: path.to_owned(), source })?;
    parse(&bytes, robot, path)
}

/// Reads a table from the bytes of a file; `path` is only noted as its source.
///
/// Where the robot file names columns under `[import]`, these are looked for; a table with exactly the robot's own
/// columns (an export) is read as it stands if they are not there.
///
/// # Errors
/// [`TableError`], but never [`TableError::Open`].
pub fn parse(bytes: &[u8], robot: &Robot, path: &Path) -> Result<Table, TableError> {
    let text = unpack(bytes, MAX_UNPACKED_BYTES)?;
    let text = text.strip_prefix(b"\xef\xbb\xbf").unwrap_or(&text); // the mark that some programs begin UTF-8 with
    let own = |text| {
        let (reader, names, line) = open(text, ',')?;
        Ok((reader, Header::find(names, robot, line)?))
    };
    let named = |import: &Import| {
        let (reader, names, line) = open(text, import.separator)?;
        Ok((reader, Header::named(names, robot, import, line)?))
    };
    let (mut reader, header) = match &robot.import {
        None => own(text)?,
        Some(import) => named(import).or_else(|error: TableError| own(text).map_err(|_: TableError| error))?,
    };

    let source = Source { path: path.to_owned(), sha256: sha256(bytes) };
    let mut session = Session::of(robot.clone());
    session.imported_from = Some(source.clone());
    let mut rows = Rows::new(header, robot, Recorder::new(session));
    let mut fields = ByteRecord::new();
    while next(&mut reader, &mut fields)? {
        rows.push(&fields)?;
    }
    if rows.recorder.is_empty() {
        return Err(TableError::Empty("a header and no row"));
    }
    let Rows { header, recorder, lines, .. } = rows;
    let recording = recorder.finish(source);
    rate::check(&recording, header.clock.unit(), &lines)?;
    Ok(Table { recording, ignored: header.ignored })
}

type Reader<'a> = ::csv::Reader<&'a [u8]>;

/// A reader behind the header, the names in the header, and its line.
fn open(text: &[u8], separator: char) -> Result<(Reader<'_>, Vec<String>, u64), TableError> {
    let mut reader = ReaderBuilder::new()
        .has_headers(false)
        .flexible(true)
        .comment(Some(b'#'))
        .trim(::csv::Trim::All)
        .delimiter(separator as u8) // one of four ASCII characters
        .from_reader(text);
    let mut fields = ByteRecord::new();
    if !next(&mut reader, &mut fields)? {
        return Err(TableError::Empty("no line"));
    }
    let line = line_of(&fields);
    let names = fields
        .iter()
        .map(|name| std::str::from_utf8(name).map(str::to_owned))
        .collect::<Result<_, _>>()
        .map_err(|_| row_error(line, None, What::NotText))?;
    Ok((reader, names, line))
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
    lines: Vec<u64>,                 // of each row
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
            lines: Vec::new(),
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
        let header = &self.header;
        let at = |field: usize| move |what| row_error(line, Some(&names[field]), what);
        let t_us = header.time_us(&fields[header.time]).map_err(at(header.time))?;
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
                return Err(at(header.time)(what));
            }
        };
        self.before = Some((t_us, seq, line));
        for (duty, field) in self.duty.iter_mut().zip(&header.duty) {
            let number = header.number(&fields[field.index]).and_then(|value| value.ok_or(What::Missing));
            *duty = finite(field.value(number.map_err(at(field.index))?)).map_err(at(field.index))?;
            if self.unit == InputUnit::Duty && duty.abs() > 1.0 {
                return Err(at(field.index)(What::Duty(*duty)));
            }
        }
        for (value, field) in self.values.iter_mut().zip(&header.channels) {
            *value = match header.number(&fields[field.index]).map_err(at(field.index))? {
                Some(number) => finite(field.value(number)).map_err(at(field.index))?,
                None => f64::NAN,
            };
        }
        self.lines.push(line);
        let row = Row { t_us, seq, phase: NO_PHASE, tick: Tick::default(), duty: &self.duty, values: &self.values };
        // All that the recorder refuses was refused above, with its line.
        self.recorder.push(&row).map_err(|error| row_error(line, None, What::Syntax(error.to_string())))
    }
}

/// A product of a finite number and a factor.
fn finite(value: f64) -> Result<f64, What> {
    if value.is_finite() { Ok(value) } else { Err(What::NotFinite(value.to_string())) }
}

impl Header {
    /// A field as text with a decimal point; nothing if it is empty or says that there is no reading.
    fn text<'a>(&self, field: &'a [u8]) -> Result<Option<Cow<'a, str>>, What> {
        let text = std::str::from_utf8(field).map_err(|_| What::NotText)?;
        if text.is_empty() || self.missing.iter().any(|missing| missing == text) {
            return Ok(None);
        }
        Ok(Some(if self.decimal == '.' { Cow::Borrowed(text) } else { Cow::Owned(text.replace(self.decimal, ".")) }))
    }

    /// A finite number, or nothing for a field without one.
    fn number(&self, field: &[u8]) -> Result<Option<f64>, What> {
        let Some(text) = self.text(field)? else { return Ok(None) };
        match text.parse::<f64>() {
            Ok(value) if value.is_finite() => Ok(Some(value)),
            Ok(_) => Err(What::NotFinite(text.into_owned())),
            Err(_) => Err(What::Text(text.into_owned())),
        }
    }

    /// The time of a row in µs.
    fn time_us(&self, field: &[u8]) -> Result<u64, What> {
        let text = self.text(field)?.ok_or(What::Missing)?;
        let number = text.parse::<f64>();
        let microseconds = |us: f64| (0.0..LATEST_US).contains(&us).then(|| us.round() as u64);
        match self.clock {
            Clock::Microseconds => match text.parse::<u64>() {
                Ok(t_us) => Some(t_us),
                // Some programs write whole numbers as 1790148.0.
                Err(_) => number.ok().filter(|us| us.fract() == 0.0).and_then(microseconds),
            }
            .ok_or_else(|| What::Time(text.into_owned())),
            Clock::Seconds => {
                number.ok().and_then(|s| microseconds(s * 1e6)).ok_or_else(|| What::Seconds(text.into_owned()))
            }
            Clock::Named { unit, zero } => number
                .ok()
                .and_then(|number| microseconds((number - zero) * unit.us()))
                .ok_or_else(|| What::Stamp { text: text.into_owned(), unit, zero }),
        }
    }
}
