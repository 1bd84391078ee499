//! The recording that the rows of a table are.

use std::path::Path;

use super::rows::Rows;
use super::{EmptyInputs, TableError, What, join, rate};
use crate::recording::{NO_PHASE, Recorder, Recording, Row, Session, Source, Tick, sha256, wrap};
use crate::robot::Robot;

/// The recording that the rows are; adds to `notes` what was done to them.
pub(super) fn recording(
    mut rows: Rows,
    robot: &Robot,
    bytes: &[u8],
    path: &Path,
    empty_inputs: Option<EmptyInputs>,
    notes: &mut Vec<String>,
) -> Result<Recording, TableError> {
    if rows.len() == 0 {
        return Err(TableError::Empty("a header and no row"));
    }
    rows.switch_off(notes);
    join::fill(&mut rows, empty_inputs, notes)?;
    let ticks = rate::ticks(&rows.t_us, robot.sample_period_s, rows.header.clock.unit())?;
    leave_out_undriven(&rows, &ticks, notes);
    let kept: Vec<usize> = (0..rows.len()).filter(|&k| !rows.off[k]).collect();
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
        duty.extend(rows.inputs.iter().map(|column| column[k]));
        values.clear();
        values.extend(rows.values.iter().map(|column| column[k]));
        let (t_us, seq) = (rows.t_us[k], ticks.seq[k]);
        let row = Row { t_us, seq, phase: NO_PHASE, tick: Tick::default(), duty: &duty, values: &values };
        // All that the recorder refuses was refused above, with its place.
        recorder.push(&row).map_err(|error| TableError::Row {
            place: rows.places[k],
            column: None,
            what: What::Syntax(error.to_string()),
        })?;
    }
    let mut recording = recorder.finish(source);
    unwrap(&rows, &mut recording, &kept, notes)?;
    Ok(recording)
}

/// An open circuit has no back-EMF, which no voltage says: such rows are missing ticks.
fn leave_out_undriven(rows: &Rows, ticks: &rate::Ticks, notes: &mut Vec<String>) {
    let count = rows.off.iter().filter(|off| **off).count();
    if count > 0 {
        // Each until the next row, since rows may come unevenly.
        let until_next = |k: usize| {
            let next = rows.t_us.get(k + 1)?;
            Some(next.saturating_sub(rows.t_us[k]) as f64 * 1e-6)
        };
        let off = (0..rows.len()).filter(|k| rows.off[*k]);
        let seconds: f64 = off.map(|k| until_next(k).unwrap_or(ticks.period_s)).sum();
        notes.push(format!(
            "{count} rows ({seconds:.2} s) with the drives off are left out: an open circuit has no back-EMF, \
             which no voltage says (with unit = \"ampere\" or \"newton_metre\" they are used)"
        ));
    }
}

/// Adds the turns that wrapped positions lack; `kept` are the rows of the samples.
fn unwrap(rows: &Rows, recording: &mut Recording, kept: &[usize], notes: &mut Vec<String>) -> Result<(), TableError> {
    let count = |channel: usize| rows.whole[channel].then(|| rows.header.channels[channel].factor.abs());
    let counts: Vec<Option<f64>> = (0..rows.whole.len()).map(count).collect();
    for found in wrap::find(recording, &counts) {
        let field = rows.header.channels[found.channel];
        let at = |sample: usize| rows.places[kept[sample]];
        let first = found.jumps[0];
        let column = rows.header.names[field.index].clone();
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
