//! Predictions over a window: from a state that the past alone gives, open loop with the recorded input, compared with
//! what was measured at the window's end.
//!
//! ```text
//!        filter ──▶ x_k|k ── open loop, u_k … u_k+m−1 ──▶ x_k+m ──▶ h(x_k+m)   compared with z_k+m
//!   ────────────────●──────────────────────────────────────●─────────────── t
//!                   k          horizon = t_k+m − t_k
//! ```
//!
//! Windows start every [`STRIDE_S`]; those longer than [`LONG_S`] on every fifth start, which is enough for a mean and a
//! fifth of the work. A window that touches a gap is left out and counted: the input inside the gap is not known.

use super::filter::Track;
use super::metrics::Errors;
use super::system::{Columns, System};

/// Time from the start of a window to the start of the next, s.
pub const STRIDE_S: f64 = 0.02;
/// Horizons above this run on every fifth start, s.
pub const LONG_S: f64 = 0.1;
const LONG_EVERY: usize = 5;

/// What the windows of one horizon came to.
#[derive(Debug, Clone)]
pub struct Windows {
    /// From the start of the window to the comparison, s.
    pub horizon_s: f64,
    /// Windows that touch a gap, left out.
    pub touching_gap: usize,
    /// First sample of every window compared.
    pub starts: Vec<usize>,
    /// `[channel][window]`: measured − predicted at the end; NaN where there was no valid reading.
    pub errors: Vec<Vec<f64>>,
    /// `[channel]`: the same as sums.
    pub sums: Vec<Errors>,
}

impl Windows {
    fn new(horizon_s: f64, outputs: usize) -> Self {
        Self {
            horizon_s,
            touching_gap: 0,
            starts: Vec::new(),
            errors: vec![Vec::new(); outputs],
            sums: vec![Errors::default(); outputs],
        }
    }
}

/// Predicts from the states of `track` over each of `horizons_s` (ascending).
pub fn predict<S: System>(system: &S, columns: &Columns<'_>, track: &Track, horizons_s: &[f64]) -> Vec<Windows> {
    let mut results: Vec<Windows> = horizons_s.iter().map(|&h| Windows::new(h, system.outputs())).collect();
    let ends = columns.segment_ends();
    let stride = ((STRIDE_S / columns.period_s).round() as usize).max(1);
    let mut run = Run::new(system, columns);
    for (number, start) in (0..columns.len()).step_by(stride).enumerate() {
        if !track.is_settled(start) {
            continue;
        }
        run.begin(start, track.state(start));
        for result in &mut results {
            if result.horizon_s > LONG_S && number % LONG_EVERY != 0 {
                break;
            }
            let goal_s = columns.t_s[start] + result.horizon_s - 0.5 * columns.period_s;
            match run.advance(goal_s, ends[start]) {
                Reached::Goal => run.compare(start, result),
                Reached::Gap => result.touching_gap += 1,
                Reached::End => break,
            }
        }
    }
    results
}

enum Reached {
    Goal,
    Gap,
    End,
}

/// One open-loop run.
struct Run<'a, S> {
    system: S,
    columns: &'a Columns<'a>,
    at: usize,
    x: Vec<f64>,
    next: Vec<f64>,
    u: Vec<f64>,
    outputs: Vec<f64>,
}

impl<'a, S: System> Run<'a, S> {
    fn new(system: &S, columns: &'a Columns<'_>) -> Self {
        Self {
            system: system.clone(),
            columns,
            at: 0,
            x: vec![0.0; system.states()],
            next: vec![0.0; system.states()],
            u: vec![0.0; columns.duty.len()],
            outputs: vec![0.0; system.outputs()],
        }
    }

    fn begin(&mut self, at: usize, x: &[f64]) {
        self.at = at;
        self.x.copy_from_slice(x);
    }

    fn advance(&mut self, goal_s: f64, segment_end: usize) -> Reached {
        let t_s = self.columns.t_s;
        while t_s[self.at] < goal_s {
            if self.at + 1 >= segment_end {
                // A gap that the window reaches into, or the end of the recording.
                return if t_s.last().is_some_and(|last| *last >= goal_s) { Reached::Gap } else { Reached::End };
            }
            self.columns.input(self.at, &mut self.u);
            self.system.at_time(t_s[self.at]);
            self.system.step(&self.x, &self.u, t_s[self.at + 1] - t_s[self.at], &mut self.next);
            std::mem::swap(&mut self.x, &mut self.next);
            self.at += 1;
        }
        Reached::Goal
    }

    fn compare(&mut self, start: usize, result: &mut Windows) {
        self.columns.input(self.at, &mut self.u);
        self.system.at_time(self.columns.t_s[self.at]);
        self.system.outputs_of(&self.x, &self.u, &mut self.outputs);
        result.starts.push(start);
        for (i, predicted) in self.outputs.iter().enumerate() {
            let measured = self.columns.measured[i][self.at];
            result.errors[i].push(measured - predicted);
            result.sums[i].add(measured, *predicted);
        }
    }
}
