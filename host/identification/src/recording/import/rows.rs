//! Rows as they come, each number in SI, with what each is held against.

use super::header::Header;
use super::{Place, TableError, What};
use crate::robot::{InputUnit, Robot};

/// The rows of a table or bag.
pub(super) struct Rows {
    pub header: Header,
    pub t_us: Vec<u64>,
    /// Where each row stands.
    pub places: Vec<Place>,
    /// `[joint][row]`, NaN where the field is empty.
    pub inputs: Vec<Vec<f64>>,
    /// `[channel][row]`, NaN where there is no reading.
    pub values: Vec<Vec<f64>>,
    /// Of each channel, whether all its numbers were whole before their unit was applied.
    pub whole: Vec<bool>,
    /// Rows behind which the drives were switched off.
    pub off: Vec<bool>,
    unit: InputUnit,
}

impl Rows {
    pub(super) fn new(header: Header, robot: &Robot) -> Self {
        Self {
            t_us: Vec::new(),
            places: Vec::new(),
            inputs: vec![Vec::new(); header.duty.len()],
            values: vec![Vec::new(); header.channels.len()],
            whole: vec![true; header.channels.len()],
            off: Vec::new(),
            unit: robot.input.unit,
            header,
        }
    }

    pub(super) fn len(&self) -> usize {
        self.t_us.len()
    }

    /// Appends a row; `number` gives a field by its column in the header, nothing for an empty one.
    pub(super) fn push(
        &mut self,
        place: Place,
        t_us: u64,
        number: impl Fn(usize) -> Result<Option<f64>, What>,
    ) -> Result<(), TableError> {
        let header = &self.header;
        let at = |field: usize| move |what| TableError::Row { place, column: Some(header.names[field].clone()), what };
        if let (Some(&before_us), Some(&before)) = (self.t_us.last(), self.places.last())
            && t_us <= before_us
        {
            return Err(at(header.time)(match t_us == before_us {
                true => What::Duplicate { t_us, before },
                false => What::Backwards { t_us, before_us, before },
            }));
        }
        let off = match header.torque_on {
            Some(index) => number(index).map_err(at(index))? == Some(0.0),
            None => false,
        };
        for (column, field) in self.inputs.iter_mut().zip(&header.duty) {
            let duty = match number(field.index).map_err(at(field.index))? {
                Some(number) => finite(field.value(number)).map_err(at(field.index))?,
                None => f64::NAN,
            };
            if self.unit == InputUnit::Duty && duty.abs() > 1.0 {
                return Err(at(field.index)(What::Duty(duty)));
            }
            column.push(duty);
        }
        for ((column, whole), field) in self.values.iter_mut().zip(&mut self.whole).zip(&header.channels) {
            column.push(match number(field.index).map_err(at(field.index))? {
                Some(number) => {
                    *whole &= number.fract() == 0.0;
                    finite(field.value(number)).map_err(at(field.index))?
                }
                None => f64::NAN,
            });
        }
        self.t_us.push(t_us);
        self.places.push(place);
        self.off.push(off);
        Ok(())
    }

    /// Leaves out the rows for which `keep` does not say so.
    pub(super) fn retain(&mut self, keep: &[bool]) {
        fn only<V>(column: &mut Vec<V>, keep: &[bool]) {
            let mut keep = keep.iter();
            column.retain(|_| *keep.next().expect("one for each row"));
        }
        only(&mut self.t_us, keep);
        only(&mut self.places, keep);
        only(&mut self.off, keep);
        self.inputs.iter_mut().chain(&mut self.values).for_each(|column| only(column, keep));
    }

    /// Where the drives are off, a torque or current is zero, whatever the table says was commanded.
    pub(super) fn switch_off(&mut self, notes: &mut Vec<String>) {
        let count = self.off.iter().filter(|off| **off).count();
        if count == 0 || matches!(self.unit, InputUnit::Duty | InputUnit::Volt) {
            return;
        }
        for column in &mut self.inputs {
            column.iter_mut().zip(&self.off).filter(|(_, off)| **off).for_each(|(input, _)| *input = 0.0);
        }
        self.off.fill(false);
        notes.push(format!("the drives are off in {count} rows: their inputs are taken as 0"));
    }
}

/// A product of a finite number and a factor.
fn finite(value: f64) -> Result<f64, What> {
    if value.is_finite() { Ok(value) } else { Err(What::NotFinite(value.to_string())) }
}
