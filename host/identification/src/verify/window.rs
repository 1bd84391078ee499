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
//! Four windows run side by side, as models step four states nearly as fast as one.

use solve::simd::{LANES, Quad};
use solve::threads::both;

use super::filter::Track;
use super::metrics::Errors;
use super::system::{Columns, Four, System, lane_of, set_lane};

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

/// Predicts from the states of `track` over each of `horizons_s` (ascending), on two threads where `threads` is more than one.
pub fn predict<S: System>(
    system: &S,
    columns: &Columns<'_>,
    track: &Track,
    horizons_s: &[f64],
    threads: usize,
) -> Vec<Windows> {
    let ends = columns.segment_ends();
    let stride = ((STRIDE_S / columns.period_s).round() as usize).max(1);
    let starts = (0..columns.len()).step_by(stride).enumerate().filter(|(_, start)| track.is_settled(*start));
    let (long, short): (Vec<_>, Vec<_>) = starts.partition(|(number, _)| number % LONG_EVERY == 0);
    let shorter = horizons_s.iter().take_while(|horizon_s| **horizon_s <= LONG_S).count();
    // Windows do not know of each other: each thread has every other four.
    let of_thread = |mut run: Run<'_, S>, first: usize| {
        let mut found: Vec<Found> = horizons_s.iter().map(|_| Found::default()).collect();
        for (starts, horizons_s) in [(&long, horizons_s), (&short, &horizons_s[..shorter])] {
            for starts in starts.chunks(LANES).skip(first).step_by(2) {
                run.begin(starts.iter().map(|(_, start)| (*start, track.state(*start), ends[*start])));
                for (&horizon_s, found) in horizons_s.iter().zip(&mut found) {
                    run.predict(horizon_s, found);
                }
            }
        }
        found
    };
    let (left, right) = (Run::new(system, columns), Run::new(system, columns));
    let (mut found, others) = both(threads, || of_thread(left, 0), || of_thread(right, 1));
    found.iter_mut().zip(others).for_each(|(found, others)| found.join(others));
    let windows = |(&horizon_s, found): (&f64, Found)| found.in_order(columns, horizon_s, system.outputs());
    horizons_s.iter().zip(found).map(windows).collect()
}

/// The windows of one horizon, in the order in which they were predicted.
#[derive(Debug, Default)]
struct Found {
    touching_gap: usize,
    /// First and last sample, and the outputs predicted there.
    windows: Vec<(usize, usize, Vec<f64>)>,
}

impl Found {
    fn join(&mut self, mut other: Found) {
        self.touching_gap += other.touching_gap;
        self.windows.append(&mut other.windows);
    }

    fn in_order(mut self, columns: &Columns<'_>, horizon_s: f64, outputs: usize) -> Windows {
        self.windows.sort_by_key(|(start, ..)| *start);
        let mut windows = Windows::new(horizon_s, outputs);
        windows.touching_gap = self.touching_gap;
        for (start, end, predicted) in self.windows {
            windows.starts.push(start);
            for (i, predicted) in predicted.into_iter().enumerate() {
                let measured = columns.measured[i][end];
                windows.errors[i].push(measured - predicted);
                windows.sums[i].add(measured, predicted);
            }
        }
        windows
    }
}

/// One of four open-loop runs.
#[derive(Debug, Clone, Copy)]
struct Lane {
    start: usize,
    at: usize,
    segment_end: usize,
    state: OnItsWay,
}

/// How far a run has come.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum OnItsWay {
    Running,
    /// At the end of the current horizon.
    There,
    /// At a gap, or the end of the recording: no horizon is reached any more.
    AtGap,
    AtEnd,
}

/// Four open-loop runs, side by side.
struct Run<'a, S> {
    system: S,
    columns: &'a Columns<'a>,
    lanes: Vec<Lane>,
    four: Four,
    next: Vec<Quad>,
    outputs: Vec<f64>,
    u: Vec<f64>,
}

impl<'a, S: System> Run<'a, S> {
    fn new(system: &S, columns: &'a Columns<'_>) -> Self {
        let (states, inputs) = (system.states(), columns.duty.len());
        Self {
            system: system.clone(),
            columns,
            lanes: Vec::with_capacity(LANES),
            four: Four::new(states, inputs),
            next: vec![Quad::default(); states],
            outputs: vec![0.0; system.outputs()],
            u: vec![0.0; inputs],
        }
    }

    /// From these samples and states, at most four, in segments that end there.
    fn begin<'x>(&mut self, starts: impl Iterator<Item = (usize, &'x [f64], usize)>) {
        self.lanes.clear();
        // Lanes that nobody runs in stand still.
        self.four.dt_s = Quad::default();
        for (lane, (start, x, segment_end)) in starts.enumerate() {
            self.lanes.push(Lane { start, at: start, segment_end, state: OnItsWay::Running });
            set_lane(&mut self.four.x, lane, x);
        }
    }

    /// Runs on to where windows of this horizon end, and notes what is predicted there.
    fn predict(&mut self, horizon_s: f64, found: &mut Found) {
        let t_s = self.columns.t_s;
        for lane in self.lanes.iter_mut().filter(|lane| lane.state == OnItsWay::There) {
            lane.state = OnItsWay::Running;
        }
        loop {
            let mut running = 0;
            for (i, lane) in self.lanes.iter_mut().enumerate() {
                self.four.dt_s.0[i] = 0.0;
                let goal_s = t_s[lane.start] + horizon_s - 0.5 * self.columns.period_s;
                // A gap that the window reaches into, or the end of the recording.
                let is_inside = t_s.last().is_some_and(|last| *last >= goal_s);
                let beyond = if is_inside { OnItsWay::AtGap } else { OnItsWay::AtEnd };
                lane.state = match lane.state {
                    OnItsWay::Running if t_s[lane.at] >= goal_s => OnItsWay::There,
                    OnItsWay::Running | OnItsWay::AtGap if lane.at + 1 >= lane.segment_end => beyond,
                    other => other,
                };
                if lane.state == OnItsWay::Running {
                    running += 1;
                    self.columns.input(lane.at, &mut self.u);
                    set_lane(&mut self.four.u, i, &self.u);
                    self.four.time_s.0[i] = t_s[lane.at];
                    self.four.dt_s.0[i] = t_s[lane.at + 1] - t_s[lane.at];
                }
            }
            if running == 0 {
                break;
            }
            self.system.step_four(&self.four, &mut self.next);
            if running == LANES {
                std::mem::swap(&mut self.four.x, &mut self.next);
            }
            for (i, lane) in self.lanes.iter_mut().enumerate().filter(|(_, lane)| lane.state == OnItsWay::Running) {
                lane.at += 1;
                if running < LANES {
                    for (x, next) in self.four.x.iter_mut().zip(&self.next) {
                        x.0[i] = next.0[i];
                    }
                }
            }
        }
        for (i, lane) in self.lanes.iter().enumerate() {
            match lane.state {
                OnItsWay::There => {
                    self.columns.input(lane.at, &mut self.u);
                    self.system.at_time(t_s[lane.at]);
                    self.system.outputs_of(&lane_of(&self.four.x, i), &self.u, &mut self.outputs);
                    found.windows.push((lane.start, lane.at, self.outputs.clone()));
                }
                OnItsWay::AtGap => found.touching_gap += 1,
                OnItsWay::AtEnd | OnItsWay::Running => {}
            }
        }
    }
}
