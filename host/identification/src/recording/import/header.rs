//! The header row: which column is what.

use crate::robot::{Import, ImportColumn, Robot, TimeUnit};

use super::{Place, TableError};

/// How time is told.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Clock {
    /// `t_us`, whole microseconds.
    Microseconds,
    /// `t_s`, seconds.
    Seconds,
    /// A column that the robot file names.
    Named {
        /// Its unit.
        unit: TimeUnit,
        /// The number that becomes 0.
        zero: f64,
    },
}

impl Clock {
    /// The unit of the column.
    pub(super) fn unit(self) -> TimeUnit {
        match self {
            Self::Microseconds => TimeUnit::Microseconds,
            Self::Seconds => TimeUnit::Seconds,
            Self::Named { unit, .. } => unit,
        }
    }
}

/// Where a column of the recording stands in a row, and how its numbers are to be taken.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Field {
    pub index: usize,
    pub zero: f64,
    pub factor: f64,
}

impl Field {
    /// The value of the recording.
    pub(super) fn value(self, number: f64) -> f64 {
        (number - self.zero) * self.factor
    }
}

/// Where the robot's columns stand in a row.
#[derive(Debug)]
pub(super) struct Header {
    pub clock: Clock,
    /// Name of every column, in the order of the file.
    pub names: Vec<String>,
    /// Field with the time.
    pub time: usize,
    /// Field with the input of each joint.
    pub duty: Vec<Field>,
    /// Field that is 0 where the drives are off.
    pub torque_on: Option<usize>,
    /// Field with each of the robot's channels.
    pub channels: Vec<Field>,
    /// Columns that nothing is read from.
    pub ignored: Vec<String>,
    /// What separates whole numbers from fractions.
    pub decimal: char,
    /// Fields without a reading, beside the empty one.
    pub missing: Vec<String>,
}

impl Header {
    /// Finds the robot's own columns among `names`. Each must be there once, and no other.
    pub(super) fn find(names: Vec<String>, robot: &Robot, place: Place) -> Result<Self, TableError> {
        let expected = robot.columns();
        let refuse = |what: String, advice: String| TableError::Header { place, what, advice };
        let columns_of = |robot: &Robot| {
            format!(
                "for the robot `{}` the header is: {} (give another robot with --robot, or name your columns under [import] in its file)",
                robot.name,
                robot.columns().join(",")
            )
        };
        readable(&names, ',', place, || columns_of(robot))?;
        for name in &names {
            if name != "t_s" && !expected.contains(name) {
                let nearest =
                    nearest(name, &expected).map_or(String::new(), |best| format!(" (did you mean `{best}`?)"));
                return Err(refuse(format!("unknown column `{name}`{nearest}"), columns_of(robot)));
            }
        }
        let find = |wanted: &str| names.iter().position(|name| name == wanted);
        let (clock, time) = own_clock(&names, place)?
            .ok_or_else(|| refuse("the column `t_us` (or `t_s`) is missing".to_owned(), columns_of(robot)))?;
        let missing: Vec<&str> = expected[1..].iter().filter(|name| find(name).is_none()).map(String::as_str).collect();
        if !missing.is_empty() {
            let what = match missing.as_slice() {
                [one] => format!("the column `{one}` is missing"),
                more => format!("the columns `{}` are missing", more.join("`, `")),
            };
            return Err(refuse(what, columns_of(robot)));
        }
        let fields: Vec<Field> = expected[1..]
            .iter()
            .filter_map(|name| Some(Field { index: find(name)?, zero: 0.0, factor: 1.0 }))
            .collect();
        let (duty, channels) = fields.split_at(robot.joints.len());
        let (duty, channels) = (duty.to_vec(), channels.to_vec());
        Ok(Self {
            clock,
            time,
            duty,
            torque_on: None,
            channels,
            names,
            ignored: Vec::new(),
            decimal: '.',
            missing: Vec::new(),
        })
    }

    /// Finds the columns that `import` names among `names`; others are ignored.
    pub(super) fn named(names: Vec<String>, robot: &Robot, import: &Import, place: Place) -> Result<Self, TableError> {
        let refuse = |what: String, advice: String| TableError::Header { place, what, advice };
        let columns = || format!("the table has the columns {}", names.join(", "));
        readable(&names, import.separator, place, || "the first line must name the columns".to_owned())?;
        let find = |wanted: &str| names.iter().position(|name| name == wanted);
        let (clock, time) = match &import.time {
            Some(time) => {
                let clock = Clock::Named { unit: time.unit, zero: time.zero };
                let index = find(&time.column).ok_or_else(|| {
                    let what = format!("the column `{}` with the time is missing", time.column);
                    refuse(what, format!("correct import.time.column in the robot file; {}", columns()))
                })?;
                (clock, index)
            }
            None => own_clock(&names, place)?.ok_or_else(|| {
                let what = "there is neither `t_us` nor `t_s`".to_owned();
                refuse(
                    what,
                    format!("name the column with the time under import.time in the robot file; {}", columns()),
                )
            })?,
        };
        let field = |column: &ImportColumn| match find(&column.column) {
            Some(index) => Ok(Field { index, zero: column.zero, factor: column.factor }),
            None => {
                let ImportColumn { name, column, .. } = column;
                let nearest =
                    nearest(column, &names).map_or(String::new(), |best| format!(" (did you mean `{best}`?)"));
                let what =
                    format!("the column `{column}` for {name} of the robot `{}` is missing{nearest}", robot.name);
                let advice = format!(
                    "correct import.columns.{name} in the robot file, or give the robot with --robot; {}",
                    columns()
                );
                Err(refuse(what, advice))
            }
        };
        let fields = import.columns.iter().map(field).collect::<Result<Vec<Field>, _>>()?;
        let (duty, channels) = fields.split_at(robot.joints.len());
        let torque_on = import.torque_on.as_ref().map(|column| {
            find(column).ok_or_else(|| {
                let what = format!("the column `{column}` that says where the drives are on is missing");
                refuse(what, format!("correct import.torque_on in the robot file; {}", columns()))
            })
        });
        let torque_on = torque_on.transpose()?;
        let used =
            |index: usize| index == time || torque_on == Some(index) || fields.iter().any(|field| field.index == index);
        let ignored = (0..names.len()).filter(|&index| !used(index)).map(|index| names[index].clone()).collect();
        let (duty, channels) = (duty.to_vec(), channels.to_vec());
        let (decimal, missing) = (import.decimal, import.missing.clone());
        Ok(Self { clock, time, duty, torque_on, channels, ignored, decimal, missing, names })
    }
}

/// Refuses a line that is not cut into columns, that is no header (`wanted` says what it should hold), and columns of one name.
fn readable(names: &[String], separator: char, place: Place, wanted: impl Fn() -> String) -> Result<(), TableError> {
    let refuse = |what: String, advice: String| Err(TableError::Header { place, what, advice });
    if let [only] = names
        && let Some(found) = [',', ';', '\t', '|', ' '].into_iter().find(|found| only.contains(*found))
    {
        let advice = match found {
            ' ' => "separate the columns by commas".to_owned(),
            _ => format!(
                "separate the columns by {separator:?}, or write separator = {:?} (and decimal = \",\" if numbers have a comma) under [import] in the robot file",
                found.to_string()
            ),
        };
        return refuse(format!("the columns are separated by {found:?}"), advice);
    }
    if names.iter().all(|name| name.parse::<f64>().is_ok()) {
        let advice = format!("{}; a header that begins with # is read as a comment: take the # away", wanted());
        return refuse("there is no header, the first line holds numbers".to_owned(), advice);
    }
    match (1..names.len()).find(|&index| names[..index].contains(&names[index])) {
        Some(index) => {
            refuse(format!("the column `{}` is there twice", names[index]), "rename or delete one".to_owned())
        }
        None => Ok(()),
    }
}

/// The column `t_us` or `t_s`.
fn own_clock(names: &[String], place: Place) -> Result<Option<(Clock, usize)>, TableError> {
    let find = |wanted: &str| names.iter().position(|name| name == wanted);
    match (find("t_us"), find("t_s")) {
        (Some(time), None) => Ok(Some((Clock::Microseconds, time))),
        (None, Some(time)) => Ok(Some((Clock::Seconds, time))),
        (None, None) => Ok(None),
        (Some(_), Some(_)) => Err(TableError::Header {
            place,
            what: "there are both t_us and t_s".to_owned(),
            advice: "delete one of them, or name one under import.time in the robot file".to_owned(),
        }),
    }
}

/// The expected name that is the same but for case, underscores and brackets (`Theta_1`, `g1[x]`).
fn nearest<'a>(name: &str, expected: &'a [String]) -> Option<&'a str> {
    let plain =
        |name: &str| name.chars().filter(|c| c.is_alphanumeric()).flat_map(char::to_lowercase).collect::<String>();
    let aliases = [
        ("time", "t_us"),
        ("timestamp", "t_us"),
        ("pwm", "u"),
        ("duty", "u"),
        ("gyro", "g"),
        ("enc", "theta"),
        ("encoder", "theta"),
    ];
    if let Some(same) = expected.iter().find(|expected| plain(expected) == plain(name)) {
        return Some(same);
    }
    let mut wanted = plain(name);
    for (alias, short) in aliases {
        if let Some(rest) = wanted.strip_prefix(alias)
            && (rest.is_empty() || rest.starts_with(|c: char| c.is_ascii_digit()))
        {
            wanted = plain(short) + rest;
        }
    }
    expected.iter().map(String::as_str).find(|expected| plain(expected) == wanted)
}
