//! The header row: which column is what.

use crate::robot::Robot;

use super::TableError;

/// How time is told.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Clock {
    /// `t_us`, whole microseconds.
    Microseconds,
    /// `t_s`, seconds.
    Seconds,
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
    pub duty: Vec<usize>,
    /// Field with each of the robot's channels.
    pub channels: Vec<usize>,
}

impl Header {
    /// Finds the robot's columns among `names`. Each must be there once, and no other.
    pub(super) fn find(names: Vec<String>, robot: &Robot, line: u64) -> Result<Self, TableError> {
        let expected = expected_columns(robot);
        let refuse = |what: String, advice: String| TableError::Header { line, what, advice };
        let columns_of = |robot: &Robot| {
            format!(
                "for the robot `{}` the header is: {} (give another robot with --robot)",
                robot.name,
                expected_columns(robot).join(",")
            )
        };
        if let [only] = names.as_slice()
            && let Some(separator) = [';', '\t', '|'].into_iter().find(|&separator| only.contains(separator))
        {
            return Err(refuse(
                format!("the columns are separated by {separator:?}"),
                "separate the columns by commas, and write numbers with a decimal point".to_owned(),
            ));
        }
        if names.iter().all(|name| name.parse::<f64>().is_ok()) {
            return Err(refuse("there is no header, the first line holds numbers".to_owned(), columns_of(robot)));
        }
        for (index, name) in names.iter().enumerate() {
            if names[..index].contains(name) {
                return Err(refuse(format!("the column `{name}` is there twice"), "rename or delete one".to_owned()));
            }
            if name != "t_s" && !expected.contains(name) {
                let nearest =
                    nearest(name, &expected).map_or(String::new(), |best| format!(" (did you mean `{best}`?)"));
                return Err(refuse(format!("unknown column `{name}`{nearest}"), columns_of(robot)));
            }
        }
        let place = |wanted: &str| names.iter().position(|name| name == wanted);
        let (clock, time) = match (place("t_us"), place("t_s")) {
            (Some(time), None) => (Clock::Microseconds, time),
            (None, Some(time)) => (Clock::Seconds, time),
            (Some(_), Some(_)) => {
                return Err(refuse("there are both t_us and t_s".to_owned(), "delete one of them".to_owned()));
            }
            (None, None) => {
                return Err(refuse("the column `t_us` (or `t_s`) is missing".to_owned(), columns_of(robot)));
            }
        };
        let missing: Vec<&str> =
            expected[1..].iter().filter(|name| place(name).is_none()).map(String::as_str).collect();
        if !missing.is_empty() {
            let what = match missing.as_slice() {
                [one] => format!("the column `{one}` is missing"),
                more => format!("the columns `{}` are missing", more.join("`, `")),
            };
            return Err(refuse(what, columns_of(robot)));
        }
        let places: Vec<usize> = expected[1..].iter().filter_map(|name| place(name)).collect();
        let (duty, channels) = places.split_at(robot.joints.len());
        Ok(Self { clock, time, duty: duty.to_vec(), channels: channels.to_vec(), names })
    }
}

/// The header of a table for this robot: `t_us,u1…`, then the channels in their order.
pub(super) fn expected_columns(robot: &Robot) -> Vec<String> {
    let inputs = (1..=robot.joints.len()).map(|joint| format!("u{joint}"));
    let channels = robot.channels().into_iter().map(|channel| channel.column);
    std::iter::once("t_us".to_owned()).chain(inputs).chain(channels).collect()
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
