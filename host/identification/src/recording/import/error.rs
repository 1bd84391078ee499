//! What can be wrong with a table or bag, said with the place and with what to do.

use std::fmt;
use std::io;
use std::path::PathBuf;

use crate::robot::TimeUnit;

/// Where something stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Place {
    /// A line of the (unpacked) table, from 1.
    Line(u64),
    /// A message of the bag's topics that are read, from 1.
    Message(u64),
    /// An element of the arrays, from 0.
    Element(u64),
    /// The names of the arrays.
    Names,
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Line(line) => write!(f, "line {line}"),
            Self::Message(message) => write!(f, "message {message}"),
            Self::Element(element) => write!(f, "element {element}"),
            Self::Names => write!(f, "the arrays"),
        }
    }
}

/// Why a table or bag was refused.
#[derive(Debug, thiserror::Error)]
pub enum TableError {
    /// The file could not be opened or read.
    #[error("cannot read {}", path.display())]
    Open {
        /// The file asked for.
        path: PathBuf,
        /// What the operating system said.
        source: io::Error,
    },
    /// It is gzip, and does not unpack.
    #[error("the compressed table is damaged or cut off")]
    Gzip {
        /// What the decompressor said.
        source: io::Error,
    },
    /// It is gzip, and unpacks to more than any recording.
    #[error("the compressed table unpacks to more than {} MiB", max_bytes >> 20)]
    TooLarge {
        /// The most that is unpacked, bytes.
        max_bytes: u64,
    },
    /// Not a table of text.
    #[error("this is not a table of text but {found}")]
    Foreign {
        /// What it looks like.
        found: &'static str,
        /// What to do with such a file.
        advice: &'static str,
    },
    /// No row of samples.
    #[error("the table has {0}")]
    Empty(
        /// "no line", "a header and no row".
        &'static str,
    ),
    /// The header does not have the robot's columns.
    #[error("{place}: {what}")]
    Header {
        /// Where the header is.
        place: Place,
        /// What is wrong.
        what: String,
        /// What to do.
        advice: String,
    },
    /// A row that cannot be used.
    #[error("{place}{}: {what}", column.as_ref().map_or(String::new(), |name| format!(", column `{name}`")))]
    Row {
        /// Where it stands.
        place: Place,
        /// Name of the column, if one is to blame.
        column: Option<String>,
        /// What is wrong with it.
        what: What,
    },
    /// The rows come at another rate than the robot's tick.
    #[error("the rows are {found_us} µs apart (median, of times read as {}), and the robot's tick is {expected_us} µs{}", read_as.words(), looks_like(*likely))]
    Rate {
        /// Median step between rows, µs.
        found_us: f64,
        /// The robot's period, µs.
        expected_us: f64,
        /// The unit that the column was read in.
        read_as: TimeUnit,
        /// The unit in which the rows come at the robot's rate.
        likely: Option<TimeUnit>,
    },
    /// Inputs and sensors stand in different rows.
    #[error(
        "{place}: inputs and sensors stand in different rows ({inputs_alone} rows with an input and no reading, {sensors_alone} rows without an input): two topics joined by time"
    )]
    Joined {
        /// The first row without an input.
        place: Place,
        /// Rows with an input and no reading.
        inputs_alone: usize,
        /// Rows without an input.
        sensors_alone: usize,
    },
    /// A position jumps, and where the joint is cannot be told.
    #[error("column `{column}` jumps by {turn} between {from} and {to} ({jump:+.4} {unit}), and {why}")]
    Wrapped {
        /// Its name in the table.
        column: String,
        /// The row before the jump.
        from: Place,
        /// The row behind it.
        to: Place,
        /// How far, in `unit`.
        jump: f64,
        /// Unit of the recording.
        unit: &'static str,
        /// What it begins again after.
        turn: String,
        /// What is unclear.
        why: &'static str,
    },
    /// An MCAP file without the joints of a robot.
    #[error("this bag cannot be imported: {what}")]
    Bag {
        /// What is wrong.
        what: String,
        /// What to do.
        advice: String,
    },
}

/// What can be wrong with a row.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum What {
    /// Another number of fields than the header has.
    #[error("{got} fields where the header has {expected}")]
    Width {
        /// In the header.
        expected: usize,
        /// In the row.
        got: usize,
    },
    /// A field that is no number.
    #[error("`{0}` is not a number")]
    Text(
        /// The field.
        String,
    ),
    /// A row of words.
    #[error("there is no number in it (`{0}` …)")]
    Words(
        /// The first field.
        String,
    ),
    /// The header once more.
    #[error("the header stands here again")]
    HeaderAgain,
    /// A date where a time is wanted.
    #[error("`{0}` is a date")]
    Date(
        /// The field.
        String,
    ),
    /// A number with a decimal comma.
    #[error("`{0}` has a decimal comma")]
    Comma(
        /// The field.
        String,
    ),
    /// NaN or infinite.
    #[error("`{0}` is not a finite number")]
    NotFinite(
        /// The field.
        String,
    ),
    /// An empty field in a column that must have a value.
    #[error("the field is empty")]
    Missing,
    /// A time that cannot be one.
    #[error("the time `{0}` is not a whole number of microseconds from 0 on")]
    Time(
        /// The field.
        String,
    ),
    /// Seconds that are no time.
    #[error("the time `{0}` is not a number of seconds from 0 to 9e9")]
    Seconds(
        /// The field.
        String,
    ),
    /// A time in a column that the robot file names.
    #[error("the time `{text}` is not a number of {} from {zero} on", unit.words())]
    Stamp {
        /// The field.
        text: String,
        /// The unit of the column.
        unit: TimeUnit,
        /// What counts as time 0.
        zero: f64,
    },
    /// The same time twice.
    #[error("the time {t_us} µs stands in {before} already")]
    Duplicate {
        /// The time, µs.
        t_us: u64,
        /// The row with the same time.
        before: Place,
    },
    /// Time runs backwards.
    #[error("the time {t_us} µs is before the {before_us} µs of {before}")]
    Backwards {
        /// The time, µs.
        t_us: u64,
        /// The time of the row before, µs.
        before_us: u64,
        /// The row before.
        before: Place,
    },
    /// A duty outside of −1 … 1.
    #[error("the duty {0} is outside of -1 … 1")]
    Duty(
        /// The value.
        f64,
    ),
    /// Not UTF-8.
    #[error("the line is not text (UTF-8)")]
    NotText,
    /// The quoting of a field does not end.
    #[error("the line does not parse: {0}")]
    Syntax(
        /// What the parser said.
        String,
    ),
}

impl TableError {
    /// What the user can do.
    pub fn advice(&self) -> String {
        match self {
            Self::Open { .. } => "check the path and that you may read the file".to_owned(),
            Self::Gzip { .. } => "copy the file again from where it was made; `gzip -t FILE` tells whether it is whole".to_owned(),
            Self::TooLarge { .. } => "unpack it yourself (gunzip -k FILE) if it really is a table, and import parts of it".to_owned(),
            Self::Foreign { advice, .. } => (*advice).to_owned(),
            Self::Empty(_) => "the first line names the columns, each line after it is one tick".to_owned(),
            Self::Header { advice, .. } => advice.clone(),
            Self::Joined { .. } => "add --inputs hold if the input is a command, which lasts until the next one, or --inputs interpolate if it is a \
                 torque, current or voltage that was measured; each row with readings then gets its input, and nothing else is interpolated"
                .to_owned(),
            Self::Wrapped { column, .. } => format!(
                "record {column} with its turns counted, or unwrap it before the import (it is unwrapped here where each jump is one \
                 whole turn, the counts per turn of the robot file's or of a counter of 8 to 32 bit, and goes on as before)"
            ),
            Self::Bag { advice, .. } => advice.clone(),
            Self::Rate { read_as, likely: Some(likely), .. } => format!(
                "give the times in {}, or write time = {{ column = …, unit = \"{}\" }} under [import] in the robot file",
                read_as.words(),
                likely.name()
            ),
            Self::Rate { .. } => {
                "check the unit of the time column (t_us is microseconds, t_s seconds), and sample_period_s in the robot file: a recording is used at its own rate if that is within a factor of 30".to_owned()
            }
            Self::Row { what, .. } => what.advice().to_owned(),
        }
    }

    /// Whether the operating system refused, rather than the content being unusable.
    pub fn is_io(&self) -> bool {
        matches!(self, Self::Open { .. })
    }
}

impl What {
    fn advice(&self) -> &'static str {
        match self {
            Self::Width { .. } => {
                "if it is the last line, the file was cut off: delete that line; else a comma too many or too few (a decimal comma?)"
            }
            Self::Words(_) => {
                "if it tells units, begin the line with # and name the units under [import] in the robot file; else delete it"
            }
            Self::HeaderAgain => {
                "two tables stand in one file: delete this line if the rows after it go on in time, else import the parts one by one"
            }
            Self::Date(_) => {
                "give the time as a number that counts from any start: t_s in seconds or t_us in microseconds \
                 (pandas: (t - t.iloc[0]).dt.total_seconds())"
            }
            Self::Comma(_) => "write a decimal point, or decimal = \",\" under [import] in the robot file",
            Self::Text(_) => "numbers have a decimal point and no unit (0.0255, -1.2e-3); lines of text begin with #",
            Self::NotFinite(_) => {
                "leave the field empty if the sensor had no valid reading, or leave out the whole row if the tick is missing; nothing is interpolated"
            }
            Self::Missing => {
                "time and inputs must be there in every row; leave out the whole row if the tick is missing, or say what such inputs are with --inputs hold or --inputs interpolate"
            }
            Self::Time(_) => {
                "t_us is whole microseconds of any clock that does not run backwards; name the column t_s for seconds"
            }
            Self::Seconds(_) => {
                "t_s is seconds of any clock that does not run backwards; subtract the start if it is negative"
            }
            Self::Stamp { .. } => {
                "times must not be before the `zero` of import.time in the robot file (0 if it is left out); set it to the first one if that is negative"
            }
            Self::Duplicate { .. } => "one row a tick: delete the repeated row, or give the times with more digits",
            Self::Backwards { .. } => {
                "sort the rows by time, or import the parts before and after a restart of the clock one by one"
            }
            Self::Duty(_) => {
                "if these are percent, divide by 100 or write unit = \"percent\" under import.columns in the robot file; if volts or amperes, declare that unit under [input]"
            }
            Self::NotText => "save the table as plain text in UTF-8",
            Self::Syntax(_) => "fields need no quotes; an opened quote must be closed in the same field",
        }
    }
}

fn looks_like(likely: Option<TimeUnit>) -> String {
    likely.map_or(String::new(), |unit| format!("; the times look like {}", unit.words()))
}
