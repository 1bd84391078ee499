//! What a search is asked for, and what it answers.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::time::Instant;

use crate::Precision;
use crate::factor::Factor;

/// A search that costs too much is not given up while steps like its last one would bring it low enough within so many more.
const SOON: i32 = 3;

/// When to stop, how much to damp, how many threads to use.
#[derive(Debug, Clone)]
pub struct Settings {
    /// Most iterations. Default 60.
    pub max_iterations: usize,
    /// Most of them while the cost still falls by a fiftieth with each. Default 60, which is none beyond the others.
    pub most_while_falling: usize,
    /// A search that costs more than this after so many iterations ends there, unless it falls so fast that it soon will not. Default none.
    pub hopeless: Option<Hopeless>,
    /// A search whose steps save little beside what it has saved so far ends there. Default none.
    pub enough: Option<Enough>,
    /// Most steps of the states alone in all, after steps that lead to more than they started from. Default none.
    pub inner_iterations: usize,
    /// Converged when an accepted step changes the cost by less than this share. Default 1e-9.
    pub relative_cost_change: f64,
    /// First damping of the border, relative to its diagonal. Default 1e-4.
    pub initial_damping: f64,
    /// Threads, 1 or 2. Default: 2 where the machine has them.
    pub threads: usize,
    /// How the factor keeps what steps are made of. Default: single precision, whose error in a step the next one mends.
    pub precision: Precision,
    /// Ends every search with [`SolveError::Stopped`](crate::error::SolveError::Stopped) before its next step once it is set. Default none.
    pub stop: Option<Arc<AtomicBool>>,
}

impl Settings {
    /// Whether nobody waits for the search any more.
    pub(super) fn is_stopped(&self) -> bool {
        self.stop.as_ref().is_some_and(|stop| stop.load(Relaxed))
    }
}

/// What a search has to reach, or to be about to reach, after how many iterations to be worth going on with.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hopeless {
    /// Iterations.
    pub after: usize,
    /// ½ Σ r².
    pub above: f64,
}

impl Hopeless {
    /// Whether a search ends here whose last step, number `iterations`, made `cost` of `before`: as many more as [`SOON`] says would each make it
    /// less by the same factor.
    pub(super) fn gives_up(&self, iterations: usize, before: f64, cost: f64) -> bool {
        iterations >= self.after && cost * (cost / before).powi(SOON) > self.above
    }
}

/// What a search has to save with each step to be worth going on with, where it is asked what it saves and not where it ends.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Enough {
    /// Savings count from this ½ Σ r² on.
    pub below: f64,
    /// A step that saves less than this share of them is the last one.
    pub share: f64,
}

impl Enough {
    /// Whether a search ends here whose last step made `cost` of `before`.
    pub(super) fn is_reached(&self, before: f64, cost: f64) -> bool {
        before - cost < self.share * (self.below - cost)
    }
}

impl Default for Settings {
    fn default() -> Self {
        Settings {
            max_iterations: 60,
            most_while_falling: 60,
            hopeless: None,
            enough: None,
            inner_iterations: 0,
            relative_cost_change: 1e-9,
            initial_damping: 1e-4,
            threads: std::thread::available_parallelism().map_or(1, |n| n.get().min(2)),
            precision: Precision::Single,
            stop: None,
        }
    }
}

/// How a solve ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Status {
    /// The last accepted step changed the cost by less than asked.
    Converged,
    /// No step reduces the cost any further, or steps creep, and what the quadratic model still promises is below a thousand times the
    /// tolerance.
    Almost,
    /// No step reduces the cost, though the quadratic model promises that one should.
    NoProgress,
    /// The iterations were used up, or the search was [`Hopeless`].
    IterationLimit,
}

/// One iteration, for the log.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Iteration {
    /// Cost ½ Σ r² after it.
    pub cost: f64,
    /// Damping of the border that was accepted.
    pub damping: f64,
    /// Trial steps, the accepted one included.
    pub trials: usize,
    /// Whether the step went by the factor of an earlier iteration.
    pub by_old_factor: bool,
}

/// Seconds spent in the parts of a solve.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Seconds {
    /// Residuals with their derivatives (the slower of the two sweeps).
    pub linearise: f64,
    /// Eliminating the states, or their gradient by an old factor.
    pub factor: f64,
    /// Border solves, back-substitutions, retractions and trial costs.
    pub solve: f64,
    /// All of it.
    pub total: f64,
}

impl Seconds {
    /// Adds the two parts of a factorisation that began at `clock`.
    pub(super) fn add(&mut self, clock: &Instant, factor: &Factor) {
        self.linearise += factor.linearise_s();
        self.factor += (clock.elapsed().as_secs_f64() - factor.linearise_s()).max(0.0);
    }
}

/// The end of a solve.
#[derive(Debug)]
pub struct Solution<P> {
    /// The best point.
    pub point: P,
    /// ½ Σ r² there.
    pub cost: f64,
    /// How it ended.
    pub status: Status,
    /// One entry a step.
    pub iterations: Vec<Iteration>,
    /// Where the time went.
    pub seconds: Seconds,
    /// The information matrix of the shared unknowns, row-major m × m, as [`Factor::schur`] gives it: without damping, at the final point
    /// (or so near before it that all unknowns together moved by some two standard deviations at most since).
    pub information: Vec<f64>,
    /// The gradient of the last iteration, m.
    pub gradient: Vec<f64>,
}

impl<P> Solution<P> {
    /// Counts what came before this search, from whose end it started.
    pub fn add_before(&mut self, mut iterations: Vec<Iteration>, seconds: Seconds) {
        iterations.append(&mut self.iterations);
        self.iterations = iterations;
        self.seconds.linearise += seconds.linearise;
        self.seconds.factor += seconds.factor;
        self.seconds.solve += seconds.solve;
        self.seconds.total += seconds.total;
    }
}
