//! The true states of a simulated robot, to hold estimates against.
//!
//! A table like that of a recording: a header row, `t_us` and any of the states by their names in the exported model (`q1`, `qd1`, `theta1`, `thetad1`,
//! `phi1`, `bias1[x]` …), a row a tick; `#` begins a comment.

use std::collections::HashMap;
use std::io::Read;

use crate::recording::Recording;

/// Why a table is no truth of a recording.
#[derive(Debug, thiserror::Error)]
pub enum TruthError {
    /// No table.
    #[error("the table of true states cannot be read: {0}")]
    Csv(#[from] csv::Error),
    /// A number that is none.
    #[error("the table of true states has `{text}` in column `{column}`, row {row}: give a number")]
    Number {
        /// What is there.
        text: String,
        /// Its column.
        column: String,
        /// Its row, the header is row 1.
        row: usize,
    },
    /// No time.
    #[error("the table of true states has no column `t_us`: give the device's time of each row in µs")]
    NoTime,
    /// No state.
    #[error("the table of true states has none of the states {known}: name its columns so")]
    NoState {
        /// Names of the states.
        known: String,
    },
    /// No row.
    #[error("no row of the table of true states has the time of a sample: give the truth of this recording")]
    OtherTimes,
}

/// A table of true states.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Truth {
    /// Time of each row, µs.
    pub t_us: Vec<u64>,
    /// Columns by their names.
    pub columns: Vec<(String, Vec<f64>)>,
}

/// The truth at the samples of a recording.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct TrueStates {
    /// States whose truth is known.
    pub places: Vec<usize>,
    /// `[state of places][k]`; NaN where it is not known.
    pub values: Vec<Vec<f64>>,
}

impl Truth {
    /// Reads a table.
    ///
    /// # Errors
    /// [`TruthError`].
    pub fn read(from: impl Read) -> Result<Self, TruthError> {
        let mut reader = csv::ReaderBuilder::new().comment(Some(b'#')).trim(csv::Trim::All).from_reader(from);
        let header = reader.headers()?.clone();
        let time = header.iter().position(|name| name == "t_us").ok_or(TruthError::NoTime)?;
        let mut truth =
            Truth { t_us: Vec::new(), columns: header.iter().map(|name| (name.to_owned(), Vec::new())).collect() };
        for (row, record) in reader.records().enumerate() {
            let record = record?;
            for (text, (name, values)) in record.iter().zip(&mut truth.columns) {
                let wrong = || TruthError::Number { text: text.to_owned(), column: name.clone(), row: row + 2 };
                values.push(text.parse::<f64>().map_err(|_| wrong())?);
            }
        }
        let (_, times) = truth.columns.remove(time);
        truth.t_us = times.into_iter().map(|t| t as u64).collect();
        Ok(truth)
    }

    /// The truth of the states of these names at the samples of a recording.
    pub(super) fn of(&self, recording: &Recording, names: &[(String, String)]) -> Result<TrueStates, TruthError> {
        let place = |name: &str| names.iter().position(|(known, _)| known == name);
        let mut columns: Vec<_> =
            self.columns.iter().filter_map(|(name, values)| Some((place(name)?, values))).collect();
        columns.sort_by_key(|(place, _)| *place);
        if columns.is_empty() {
            let known = names.iter().map(|(name, _)| name.as_str()).collect::<Vec<_>>().join(", ");
            return Err(TruthError::NoState { known });
        }
        let rows: HashMap<u64, usize> = self.t_us.iter().copied().zip(0..).collect();
        let at: Vec<Option<usize>> = recording.t_us.iter().map(|t_us| rows.get(t_us).copied()).collect();
        if at.iter().all(Option::is_none) {
            return Err(TruthError::OtherTimes);
        }
        let value =
            |values: &[f64], row: &Option<usize>| row.and_then(|row| values.get(row).copied()).unwrap_or(f64::NAN);
        Ok(TrueStates {
            places: columns.iter().map(|(place, _)| *place).collect(),
            values: columns.iter().map(|(_, values)| at.iter().map(|row| value(values, row)).collect()).collect(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_is_read_and_a_broken_one_is_not() {
        let truth = Truth::read("# simulated\nt_us, q1, qd1\n0, 0.5, 1e-3\n1000, 0.6, 2e-3\n".as_bytes()).unwrap();
        assert_eq!(truth.t_us, [0, 1000]);
        assert_eq!(truth.columns[1], ("qd1".to_owned(), vec![1e-3, 2e-3]));
        assert!(matches!(Truth::read("t_s,q1\n0,1\n".as_bytes()), Err(TruthError::NoTime)));
        let error = Truth::read("t_us,q1\n0,one\n".as_bytes()).unwrap_err();
        assert_eq!(error.to_string(), "the table of true states has `one` in column `q1`, row 2: give a number");
        assert!(matches!(Truth::read("t_us,q1\n0\n".as_bytes()), Err(TruthError::Csv(_))));
    }
}
