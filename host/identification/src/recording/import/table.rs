//! Text tables: fields of a line, numbers of a field, and which line is wrong.

use std::borrow::Cow;
use std::io::Read;

use ::csv::{ByteRecord, ReaderBuilder};
use flate2::bufread::MultiGzDecoder;

use super::header::{Clock, Header};
use super::rows::Rows;
use super::{Place, TableError, What};
use crate::robot::{Import, Robot};

/// Largest table that is unpacked: 512 MiB, some 50 minutes of Doggy. A plain file may be larger: it is there already.
const MAX_UNPACKED_BYTES: u64 = 512 << 20;
/// Later times than this are refused: their microseconds are not exact in an `f64` (2⁵³ µs, 285 years).
const LATEST_US: f64 = 9_007_199_254_740_992.0;

/// The rows of a table from the bytes of its file, and the columns that are passed over.
pub(super) fn rows(bytes: &[u8], robot: &Robot) -> Result<(Rows, Vec<String>), TableError> {
    let text = unpack(bytes, MAX_UNPACKED_BYTES)?;
    let text = text.strip_prefix(b"\xef\xbb\xbf").unwrap_or(&text); // the mark that some programs begin UTF-8 with
    let own = |text| {
        let (reader, names, place) = open(text, ',')?;
        Ok((reader, Header::find(names, robot, place)?))
    };
    let named = |import: &Import| {
        let (reader, names, place) = open(text, import.separator)?;
        Ok((reader, Header::named(names, robot, import, place)?))
    };
    let (mut reader, header) = match &robot.import {
        None => own(text)?,
        Some(import) => named(import).or_else(|error: TableError| own(text).map_err(|_: TableError| error))?,
    };
    let ignored = header.ignored.clone();
    let numbers = Numbers::of(&header);
    let mut rows = Rows::new(header, robot);
    let mut fields = ByteRecord::new();
    while next(&mut reader, &mut fields)? {
        let place = line_of(&fields);
        numbers.whole(&fields, &rows.header.names, place)?;
        let at = |what| TableError::Row { place, column: Some(rows.header.names[rows.header.time].clone()), what };
        let t_us = numbers.time_us(&fields[rows.header.time], rows.header.clock).map_err(at)?;
        rows.push(place, t_us, |field| numbers.number(&fields[field]))?;
    }
    Ok((rows, ignored))
}

type Reader<'a> = ::csv::Reader<&'a [u8]>;

/// A reader behind the header, the names in the header, and its line.
fn open(text: &[u8], separator: char) -> Result<(Reader<'_>, Vec<String>, Place), TableError> {
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
    let place = line_of(&fields);
    let names = fields
        .iter()
        .map(|name| std::str::from_utf8(name).map(str::to_owned))
        .collect::<Result<_, _>>()
        .map_err(|_| TableError::Row { place, column: None, what: What::NotText })?;
    Ok((reader, names, place))
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
    if start.starts_with(b"SQLite format 3\0") {
        return foreign(
            "an SQLite file, as ROS 2 records bags",
            "convert it to MCAP: `ros2 bag convert`, with storage_id: mcap for its output",
        );
    }
    if start.starts_with(b"#ROSBAG V2.0") {
        return foreign(
            "a bag of ROS 1",
            "convert it with `mcap convert IN.bag OUT.mcap`, or export its topics as CSV",
        );
    }
    if start.starts_with(&[0x28, 0xb5, 0x2f, 0xfd]) {
        return foreign("a file packed as zstd", "unpack it first: zstd -d FILE");
    }
    if start.starts_with(b"MATLAB 5.0 MAT-file") || start.starts_with(b"\x89HDF\r\n") {
        return foreign("a MATLAB or HDF5 file", "write its columns as CSV with a header row (writetable in MATLAB)");
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
    let place = Place::Line(reader.position().line());
    reader.read_byte_record(fields).map_err(|error| TableError::Row {
        place,
        column: None,
        what: What::Syntax(error.to_string()),
    })
}

fn line_of(fields: &ByteRecord) -> Place {
    Place::Line(fields.position().map_or(0, ::csv::Position::line))
}

/// How fields of a table are numbers.
struct Numbers {
    /// What separates whole numbers from fractions.
    decimal: char,
    /// Fields without a reading, beside the empty one.
    missing: Vec<String>,
}

impl Numbers {
    fn of(header: &Header) -> Self {
        Self { decimal: header.decimal, missing: header.missing.clone() }
    }

    /// Refuses a line that is no row of numbers.
    fn whole(&self, fields: &ByteRecord, names: &[String], place: Place) -> Result<(), TableError> {
        let refuse = |what| Err(TableError::Row { place, column: None, what });
        if fields.len() == names.len() && fields.iter().zip(names).all(|(field, name)| field == name.as_bytes()) {
            return refuse(What::HeaderAgain);
        }
        // A date in its first field is not a row of words yet.
        let is_word = |field: &[u8]| !field.is_empty() && !field.iter().any(u8::is_ascii_digit);
        let given = || fields.iter().filter(|field| !self.is_missing(field));
        if given().count() > 1 && given().all(is_word) && given().all(|field| self.finite_or_none(field).is_none()) {
            let first = String::from_utf8_lossy(fields.get(0).unwrap_or_default()).into_owned();
            return refuse(What::Words(first));
        }
        match fields.len() == names.len() {
            true => Ok(()),
            false => refuse(What::Width { expected: names.len(), got: fields.len() }),
        }
    }

    fn is_missing(&self, field: &[u8]) -> bool {
        field.is_empty() || self.missing.iter().any(|missing| missing.as_bytes() == field)
    }

    fn finite_or_none(&self, field: &[u8]) -> Option<f64> {
        std::str::from_utf8(field).ok()?.parse().ok()
    }

    /// A field as text with a decimal point; nothing if it is empty or says that there is no reading.
    fn text<'a>(&self, field: &'a [u8]) -> Result<Option<Cow<'a, str>>, What> {
        let text = std::str::from_utf8(field).map_err(|_| What::NotText)?;
        if self.is_missing(field) {
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
            Err(_) => Err(no_number(&text, What::Text)),
        }
    }

    /// The time of a row in µs.
    fn time_us(&self, field: &[u8], clock: Clock) -> Result<u64, What> {
        let text = self.text(field)?.ok_or(What::Missing)?;
        let number = text.parse::<f64>();
        match clock {
            Clock::Microseconds => match text.parse::<u64>() {
                Ok(t_us) => Some(t_us),
                // Some programs write whole numbers as 1790148.0.
                Err(_) => number.ok().filter(|us| us.fract() == 0.0).and_then(microseconds),
            }
            .ok_or_else(|| no_number(&text, What::Time)),
            Clock::Seconds => {
                number.ok().and_then(|s| microseconds(s * 1e6)).ok_or_else(|| no_number(&text, What::Seconds))
            }
            Clock::Named { unit, zero } => number
                .ok()
                .and_then(|number| microseconds((number - zero) * unit.us()))
                .ok_or_else(|| no_number(&text, |text| What::Stamp { text, unit, zero })),
        }
    }
}

/// A time in µs, rounded; none where it is negative or too late to be exact.
pub(super) fn microseconds(us: f64) -> Option<u64> {
    (0.0..LATEST_US).contains(&us).then(|| us.round() as u64)
}

/// What is wrong with a field: a kind of its own where it is known, else `otherwise`.
fn no_number(text: &str, otherwise: impl FnOnce(String) -> What) -> What {
    let digits = |part: &str| !part.is_empty() && part.bytes().all(|byte| byte.is_ascii_digit());
    // 2024-05-01, 01.05.2024, 5/1/24, with or without a time; 12:30:01.5.
    let date = text.split([' ', 'T', 't']).next().unwrap_or("");
    let is_date = ['-', '.', '/'].iter().any(|&between| {
        let parts: Vec<&str> = date.split(between).collect();
        parts.len() == 3 && parts.iter().all(|part| digits(part))
    });
    let is_clock = text.split(':').count() >= 2 && text.bytes().next().is_some_and(|byte| byte.is_ascii_digit());
    let comma =
        text.split_once(',').is_some_and(|(whole, part)| digits(whole.trim_start_matches(['-', '+'])) && digits(part));
    match () {
        () if is_date || is_clock => What::Date(text.to_owned()),
        () if comma => What::Comma(text.to_owned()),
        () => otherwise(text.to_owned()),
    }
}
