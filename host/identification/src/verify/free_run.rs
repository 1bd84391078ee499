//! The paper's 5.2: the calibrated dynamics called again and again from the first state, with the recorded input.
//!
//! Friction decides where a robot stops, so positions drift in open loop even under the right model; velocities should
//! not. Across a gap the input is not known: the run starts again after it, from what the filter knows there.

use std::ops::Range;

use super::filter::Track;
use super::system::{Columns, System};

/// A free run over a whole recording.
#[derive(Debug, Clone)]
pub struct FreeRun {
    /// The samples that were predicted, piece by piece.
    pub pieces: Vec<Range<usize>>,
    /// `[channel][k]`: predicted, NaN outside the pieces.
    pub outputs: Vec<Vec<f64>>,
    /// `[state][k]`, likewise.
    pub states: Vec<Vec<f64>>,
    /// Samples between a start or a gap and the first one predicted.
    pub left_out: usize,
}

/// Runs from `first` at sample 0, and after each gap from the state of `track`: at once if the filter bridged the gap,
/// else as soon as it has settled. Without `first` the run begins as after a long gap.
pub fn run<S: System>(system: &S, columns: &Columns<'_>, first: Option<&[f64]>, track: &Track) -> FreeRun {
    let n = columns.len();
    let mut system = system.clone();
    let mut run = FreeRun {
        pieces: Vec::new(),
        outputs: vec![vec![f64::NAN; n]; system.outputs()],
        states: vec![vec![f64::NAN; n]; system.states()],
        left_out: 0,
    };
    let mut x = vec![0.0; system.states()];
    let mut next = vec![0.0; system.states()];
    let mut outputs = vec![0.0; system.outputs()];
    let mut u = vec![0.0; columns.duty.len()];
    for (number, segment) in columns.segments.iter().enumerate() {
        let mut from = segment.start;
        match first {
            Some(first) if number == 0 => x.copy_from_slice(first),
            _ => {
                from = segment.clone().find(|&k| track.has_started(k)).unwrap_or(segment.end);
                run.left_out += from - segment.start;
                if from == segment.end {
                    continue;
                }
                x.copy_from_slice(track.state(from));
            }
        }
        run.pieces.push(from..segment.end);
        for k in from..segment.end {
            columns.input(k, &mut u);
            system.at_time(columns.t_s[k]);
            system.outputs_of(&x, &u, &mut outputs);
            for (column, value) in run.outputs.iter_mut().zip(&outputs) {
                column[k] = *value;
            }
            for (column, value) in run.states.iter_mut().zip(&x) {
                column[k] = *value;
            }
            if k + 1 < segment.end {
                system.step(&x, &u, columns.t_s[k + 1] - columns.t_s[k], &mut next);
                std::mem::swap(&mut x, &mut next);
            }
        }
    }
    run
}
