//! What can be wrong with a table, said with the line and with what to do.

use std::io;
use std::path::PathBuf;

use crate::robot::TimeUnit;

/// Why a table was refused.
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
    #[error("line {line}: {what}")]
    Header {
        /// Line of the header, from 1.
        line: u64,
        /// What is wrong.
        what: String,
        /// What to do.
        advice: String,
    },
    /// A row that cannot be used.
    #[error("line {line}{}: {what}", column.as_ref().map_or(String::new(), |name| format!(", column `{name}`")))]
    Row {
        /// Line in the (unpacked) file, from 1.
        line: u64,
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
    /// A part of the table has another rate.
    #[error(
        "from line {line} on {rows} rows are {found_us} µs apart, the others {expected_us} µs: the table has two rates"
    )]
    MixedRates {
        /// Where they begin.
        line: u64,
        /// How many of them follow one another.
        rows: usize,
        /// Their step, µs.
        found_us: f64,
        /// The robot's period, µs.
        expected_us: f64,
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
    #[error("the time {t_us} µs stands in line {before_line} already")]
    Duplicate {
        /// The time, µs.
        t_us: u64,
        /// The line with the same time.
        before_line: u64,
    },
    /// Time runs backwards.
    #[error("the time {t_us} µs is before the {before_us} µs of line {before_line}")]
    Backwards {
        /// The time, µs.
        t_us: u64,
        /// The time of the row before, µs.
        before_us: u64,
        /// The row before.
        before_line: u64,
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
            Self::MixedRates { .. } => {
                "import the parts with one rate each by itself, with a robot file of that sample_period_s; nothing is resampled".to_owned()
            }
            Self::Rate { read_as, likely: Some(likely), .. } => format!(
                "give the times in {}, or write time = {{ column = …, unit = \"{}\" }} under [import] in the robot file",
                read_as.words(),
                likely.name()
            ),
            Self::Rate { .. } => {
                "set sample_period_s in the robot file to the rate of the table (host robot show prints the file), or check the unit of the time column: t_us is microseconds, t_s seconds".to_owned()
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
            Self::Text(_) => "numbers have a decimal point and no unit (0.0255, -1.2e-3); lines of text begin with #",
            Self::NotFinite(_) => {
                "leave the field empty if the sensor had no valid reading, or leave out the whole row if the tick is missing; nothing is interpolated"
            }
            Self::Missing => {
                "time and inputs must be there in every row; leave out the whole row if the tick is missing"
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
