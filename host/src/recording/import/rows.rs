//! Rows as they come, each number in SI, with what each is held against.

use std::path::Path;

use super::header::Header;
use super::{EmptyInputs, Place, TableError, What, join, rate};
use crate::recording::{NO_PHASE, Recorder, Recording, Row, Session, Source, Tick, sha256, wrap};
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
    whole: Vec<bool>,
    /// Rows behind which the drives were switched off.
    off: Vec<bool>,
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

    /// The recording that the rows are; adds to `notes` what was done to them.
    pub(super) fn recording(
        mut self,
        robot: &Robot,
        bytes: &[u8],
        path: &Path,
        empty_inputs: Option<EmptyInputs>,
        notes: &mut Vec<String>,
    ) -> Result<Recording, TableError> {
        if self.len() == 0 {
            return Err(TableError::Empty("a header and no row"));
        }
        self.switch_off(notes);
        join::fill(&mut self, empty_inputs, notes)?;
        let ticks = rate::ticks(&self.t_us, robot.sample_period_s, self.header.clock.unit())?;
        self.leave_out_undriven(&ticks, notes);
        let kept: Vec<usize> = (0..self.len()).filter(|&k| !self.off[k]).collect();
        if kept.is_empty() {
            return Err(TableError::Empty("no row in which the drives are on"));
        }
        notes.extend(ticks.note(robot.sample_period_s));

        let source = Source { path: path.to_owned(), sha256: sha256(bytes) };
        let mut session = Session::of(robot.clone());
        session.period_s = (ticks.period_s != robot.sample_period_s).then_some(ticks.period_s);
        session.imported_from = Some(source.clone());
        let mut recorder = Recorder::new(session);
        let (mut duty, mut values) = (Vec::new(), Vec::new());
        for &k in &kept {
            duty.clear();
            duty.extend(self.inputs.iter().map(|column| column[k]));
            values.clear();
            values.extend(self.values.iter().map(|column| column[k]));
            let (t_us, seq) = (self.t_us[k], ticks.seq[k]);
            let row = Row { t_us, seq, phase: NO_PHASE, tick: Tick::default(), duty: &duty, values: &values };
            // All that the recorder refuses was refused above, with its place.
            recorder.push(&row).map_err(|error| TableError::Row {
                place: self.places[k],
                column: None,
                what: What::Syntax(error.to_string()),
            })?;
        }
        let mut recording = recorder.finish(source);
        self.unwrap(&mut recording, &kept, notes)?;
        Ok(recording)
    }

    /// Where the drives are off, a torque or current is zero, whatever the table says was commanded.
    fn switch_off(&mut self, notes: &mut Vec<String>) {
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

    /// An open circuit has no back-EMF, which no voltage says: such rows are missing ticks.
    fn leave_out_undriven(&self, ticks: &rate::Ticks, notes: &mut Vec<String>) {
        let count = self.off.iter().filter(|off| **off).count();
        if count > 0 {
            let seconds = count as f64 * ticks.period_s;
            notes.push(format!(
                "{count} rows ({seconds:.2} s) with the drives off are left out: an open circuit has no back-EMF, \
                 which no voltage says (with unit = \"ampere\" or \"newton_metre\" they are used)"
            ));
        }
    }

    /// Adds the turns that wrapped positions lack; `kept` are the rows of the samples.
    fn unwrap(&self, recording: &mut Recording, kept: &[usize], notes: &mut Vec<String>) -> Result<(), TableError> {
        let count = |channel: usize| self.whole[channel].then(|| self.header.channels[channel].factor.abs());
        let counts: Vec<Option<f64>> = (0..self.whole.len()).map(count).collect();
        for found in wrap::find(recording, &counts) {
            let field = self.header.channels[found.channel];
            let at = |sample: usize| self.places[kept[sample]];
            let first = found.jumps[0];
            let column = self.header.names[field.index].clone();
            let jump = found.jump(recording, first);
            let unit = recording.channels[found.channel].spec.unit;
            if let Some(doubt) = &found.doubt {
                let (from, to) = (at(doubt.sample - 1), at(doubt.sample));
                let jump = found.jump(recording, doubt.sample);
                let (turn, why) = (found.words(unit), doubt.why);
                return Err(TableError::Wrapped { column, from, to, jump, unit, turn, why });
            }
            notes.push(format!(
                "{column} jumps by {} between {} and {} ({jump:+.4} {unit}){}: it begins again there, and was unwrapped",
                found.words(unit),
                at(first - 1),
                at(first),
                match found.jumps.len() {
                    1 => String::new(),
                    more => format!(", and at {} more places", more - 1),
                },
            ));
            found.unwrap(recording);
        }
        Ok(())
    }
}

/// A product of a finite number and a factor.
fn finite(value: f64) -> Result<f64, What> {
    if value.is_finite() { Ok(value) } else { Err(What::NotFinite(value.to_string())) }
}
