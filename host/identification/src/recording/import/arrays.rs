//! Arrays in memory as a table: the robot's own columns by their names, in SI.

use std::path::Path;

use super::header::{Clock, Header};
use super::rows::Rows;
use super::table::microseconds;
use super::{EmptyInputs, Imported, Place, TableError, What, samples};
use crate::robot::Robot;

/// A recording of `robot` from columns of equal length, named as in tables (`t_s` or `t_us`, `u1`, `theta1`, …; [`Robot::columns`]), each in the unit
/// of its column. NaN is a sensor without a reading. `name` is noted as the source, and its checksum is that of the columns' names and bytes.
///
/// # Errors
/// [`TableError`] with the array, the element and what to do.
pub fn from_arrays(
    columns: &[(String, Vec<f64>)],
    robot: &Robot,
    name: &Path,
    empty_inputs: Option<EmptyInputs>,
) -> Result<Imported, TableError> {
    let header = Header::find(columns.iter().map(|(name, _)| name.clone()).collect(), robot, Place::Names)?;
    let (time, clock) = (&columns[header.time], header.clock);
    if let Some((name, values)) = columns.iter().find(|(_, values)| values.len() != time.1.len()) {
        return Err(TableError::Header {
            place: Place::Names,
            what: format!("`{name}` has {} elements, `{}` {}", values.len(), time.0, time.1.len()),
            advice: "give one element a tick in every array".to_owned(),
        });
    }
    let mut rows = Rows::new(header, robot);
    for (k, &t) in time.1.iter().enumerate() {
        let place = Place::Element(k as u64);
        let t_us = match clock {
            Clock::Microseconds => {
                Some(t).filter(|t| t.fract() == 0.0).and_then(microseconds).ok_or_else(|| What::Time(t.to_string()))
            }
            Clock::Seconds | Clock::Named { .. } => microseconds(t * 1e6).ok_or_else(|| What::Seconds(t.to_string())),
        };
        let t_us = t_us.map_err(|what| TableError::Row { place, column: Some(time.0.clone()), what })?;
        rows.push(place, t_us, |column| match columns[column].1[k] {
            value if value.is_nan() => Ok(None),
            value if value.is_infinite() => Err(What::NotFinite(value.to_string())),
            value => Ok(Some(value)),
        })?;
    }
    let bytes: Vec<u8> = columns
        .iter()
        .flat_map(|(name, values)| name.bytes().chain(values.iter().flat_map(|value| value.to_le_bytes())))
        .collect();
    let mut notes = Vec::new();
    let recording = samples::recording(rows, robot, &bytes, name, empty_inputs, &mut notes)?;
    Ok(Imported { recording, ignored: Vec::new(), notes })
}
