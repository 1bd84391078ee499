//! What can be wrong with a robot description, said so that its writer can mend it.

use std::path::PathBuf;

/// Why a robot description was refused.
#[derive(Debug, thiserror::Error)]
pub enum RobotError {
    /// The file could not be read.
    #[error("cannot read the robot file {}: {source}", path.display())]
    Read {
        /// The file asked for.
        path: PathBuf,
        /// What the operating system said.
        source: std::io::Error,
    },
    /// Neither a built-in robot nor a file.
    #[error("no robot `{name}`: it is neither built in ({known}) nor a file{suggestion}")]
    UnknownRobot {
        /// What was asked for.
        name: String,
        /// The built-in names.
        known: String,
        /// "; did you mean …?" or nothing.
        suggestion: String,
    },
    /// Not TOML, an unknown or missing field, or a value of the wrong type.
    #[error("{message}{suggestion}")]
    Syntax {
        /// The parser's message with line and column.
        message: String,
        /// "did you mean …?" or nothing.
        suggestion: String,
    },
    /// A field whose value makes no sense.
    #[error("{field} = {value}: {advice}")]
    Invalid {
        /// Where, as `joint[2].limits_rad` (1-based).
        field: String,
        /// What stands there.
        value: String,
        /// What is wrong with it and what to do.
        advice: String,
    },
    /// More joints than the chain can hold.
    #[error("{got} joints (passive ones included), but a chain holds at most {max}")]
    TooManyJoints {
        /// Joints asked for.
        got: usize,
        /// Capacity, [`MAX_JOINTS`](super::chain::MAX_JOINTS).
        max: usize,
    },
}

impl RobotError {
    pub(super) fn invalid(field: impl Into<String>, value: impl ToString, advice: impl Into<String>) -> Self {
        Self::Invalid { field: field.into(), value: value.to_string(), advice: advice.into() }
    }

    /// Wraps a parser's error; an unknown name gets the nearest of the expected ones as a suggestion.
    pub(super) fn syntax(error: &toml::de::Error) -> Self {
        let suggestion = unknown_name(error.message())
            .and_then(|(name, expected)| nearest(name, expected.iter().copied()))
            .map_or(String::new(), |best| format!("\ndid you mean `{best}`?"));
        Self::Syntax { message: error.to_string().trim_end().to_owned(), suggestion }
    }

    pub(super) fn unknown_robot(name: &str, known: &[&str]) -> Self {
        let suggestion =
            nearest(name, known.iter().copied()).map_or(String::new(), |best| format!("; did you mean `{best}`?"));
        Self::UnknownRobot { name: name.to_owned(), known: known.join(", "), suggestion }
    }
}

/// Takes serde's "unknown field `x`, expected one of `a`, `b`" apart: the name and what was expected.
fn unknown_name(message: &str) -> Option<(&str, Vec<&str>)> {
    if !message.starts_with("unknown ") {
        return None;
    }
    let mut quoted = message.split('`').skip(1).step_by(2);
    let name = quoted.next()?;
    Some((name, quoted.collect()))
}

/// The candidate most like `name`, if any is like it at all.
fn nearest<'a>(name: &str, candidates: impl Iterator<Item = &'a str>) -> Option<&'a str> {
    candidates
        .map(|candidate| (strsim::jaro_winkler(name, candidate), candidate))
        .filter(|(likeness, _)| *likeness > 0.8)
        .max_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, candidate)| candidate)
}
