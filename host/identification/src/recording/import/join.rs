//! Rows without an input: two topics joined by time have inputs and sensors in different rows.
//!
//! ```text
//!   t       u     theta                       what is asked of a sample is the mean input until the next one
//!   0.0000  0.2   –            hold           ────╮0.5╭──────        the input of a command
//!   0.0007  –     1.031        interpolate    ───╱    ╲──────        the samples of a torque that was measured
//!   0.0020  0.5   –
//!   0.0027  –     1.034        the sample at 0.0007: 0.2 for 1.3 ms, 0.5 for 0.7 ms
//! ```

use super::rows::Rows;
use super::{TableError, What};

/// What an input is in rows that have none.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum EmptyInputs {
    /// The last one.
    Hold,
    /// On a straight line from the last to the next.
    Interpolate,
}

/// Gives every row its input, and leaves out rows without any reading; without `choice`, no row may be without an input.
pub(super) fn fill(rows: &mut Rows, choice: Option<EmptyInputs>, notes: &mut Vec<String>) -> Result<(), TableError> {
    let lacking = |k: &usize| rows.inputs.iter().any(|column| column[*k].is_nan());
    let without_input: Vec<usize> = (0..rows.len()).filter(lacking).collect();
    let Some(&first) = without_input.first() else { return Ok(()) };
    let read: Vec<bool> = (0..rows.len()).map(|k| rows.values.iter().any(|column| !column[k].is_nan())).collect();
    let inputs_alone = read.iter().filter(|read| !**read).count();
    let Some(choice) = choice else {
        if inputs_alone > 0 {
            let sensors_alone = without_input.len();
            return Err(TableError::Joined { place: rows.places[first], inputs_alone, sensors_alone });
        }
        let empty = |joint: &usize| rows.inputs[*joint][first].is_nan();
        let joint = (0..rows.inputs.len()).find(empty).unwrap_or(0);
        let column = rows.header.names[rows.header.duty[joint].index].clone();
        return Err(TableError::Row { place: rows.places[first], column: Some(column), what: What::Missing });
    };
    let signals: Vec<Signal> = rows.inputs.iter().map(|column| Signal::of(&rows.t_us, column, choice)).collect();
    let begin_us = signals.iter().map(|signal| signal.t_us.first().copied()).collect::<Option<Vec<_>>>();
    let Some(begin_us) = begin_us.and_then(|begin| begin.into_iter().max()) else {
        return Err(TableError::Empty("no input in any row"));
    };
    let keep: Vec<bool> = (0..rows.len()).map(|k| read[k] && rows.t_us[k] >= begin_us).collect();
    let early = (0..rows.len()).filter(|&k| read[k] && !keep[k]).count();
    let given = rows.len() - without_input.len();
    rows.retain(&keep);
    if rows.len() == 0 {
        return Err(TableError::Empty("no row with a reading behind the first input"));
    }
    for (column, signal) in rows.inputs.iter_mut().zip(&signals) {
        for k in 0..column.len() {
            column[k] = match rows.t_us.get(k + 1) {
                Some(&next_us) => signal.mean(rows.t_us[k], next_us),
                None => signal.at(rows.t_us[k]),
            };
        }
    }
    let how = match choice {
        EmptyInputs::Hold => "held from one to the next",
        EmptyInputs::Interpolate => "interpolated on straight lines",
    };
    let early = if early > 0 { format!("; {early} rows before the first input are left out") } else { String::new() };
    notes.push(format!(
        "inputs of {given} rows are {how}, each sample has their mean until the next one; {inputs_alone} rows without \
         a reading are no samples{early}"
    ));
    Ok(())
}

/// An input over time, and its integral.
struct Signal {
    t_us: Vec<u64>,
    values: Vec<f64>,
    integral: Vec<f64>,
    choice: EmptyInputs,
}

impl Signal {
    fn of(t_us: &[u64], column: &[f64], choice: EmptyInputs) -> Self {
        let given = (0..column.len()).filter(|&k| !column[k].is_nan());
        let (t_us, values): (Vec<u64>, Vec<f64>) = given.map(|k| (t_us[k], column[k])).unzip();
        let mut signal = Self { t_us, values, integral: vec![0.0], choice };
        for k in 1..signal.values.len() {
            let whole = signal.integral[k - 1] + signal.part(k - 1, signal.t_us[k]);
            signal.integral.push(whole);
        }
        signal
    }

    /// The last place at or before `t_us`, which is not before the first.
    fn place(&self, t_us: u64) -> usize {
        self.t_us.partition_point(|t| *t <= t_us) - 1
    }

    fn at(&self, t_us: u64) -> f64 {
        self.behind(self.place(t_us), t_us)
    }

    /// The input at `t_us`, which lies between place k and the next.
    fn behind(&self, k: usize, t_us: u64) -> f64 {
        match (self.choice, self.values.get(k + 1)) {
            (EmptyInputs::Interpolate, Some(next)) => {
                let share = (t_us - self.t_us[k]) as f64 / (self.t_us[k + 1] - self.t_us[k]) as f64;
                self.values[k] + share * (next - self.values[k])
            }
            _ => self.values[k],
        }
    }

    /// Integral from place k to `t_us`, which is not behind the next place.
    fn part(&self, k: usize, t_us: u64) -> f64 {
        0.5 * (self.values[k] + self.behind(k, t_us)) * (t_us - self.t_us[k]) as f64
    }

    fn mean(&self, from_us: u64, to_us: u64) -> f64 {
        let (from, to) = (self.place(from_us), self.place(to_us));
        if from == to && self.choice == EmptyInputs::Hold {
            return self.values[from]; // nothing is rounded that does not change
        }
        let until = |place: usize, t_us: u64| self.integral[place] + self.part(place, t_us);
        (until(to, to_us) - until(from, from_us)) / (to_us - from_us) as f64
    }
}
