//! The order in which a sweep goes through its stages, a batch at a time, whatever it sums up on the way.

use std::time::{Duration, Instant};

use super::LeastSquares;
use super::shape::{BATCH, Columns};
use super::stage::Stage;
use crate::simd::Simd;

/// Stages that are linearised together.
pub(super) struct Batch {
    pub stages: Vec<Stage>,
    /// Time spent in the problem's own code.
    pub linearise: Duration,
}

impl Batch {
    pub(super) fn new(columns: Columns) -> Self {
        Batch { stages: vec![Stage::new(columns); BATCH], linearise: Duration::ZERO }
    }

    /// Linearises the stages from `first` on.
    pub(super) fn fill<P: LeastSquares>(
        &mut self,
        problem: &P,
        point: &P::Point,
        first: usize,
        scratch: &mut P::Scratch,
    ) {
        let clock = Instant::now();
        let count = BATCH.min(problem.shape().stages - first);
        problem.linearise(point, first, scratch, &mut self.stages[..count]);
        self.linearise += clock.elapsed();
    }

    /// An empty stage for the border's own rows.
    pub(super) fn stage_for_border(&mut self) -> &mut Stage {
        self.stages[0].clear();
        &mut self.stages[0]
    }
}

/// Which of two linked stages is at the front.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Front {
    Source,
    Successor,
}

/// Which way a sweep goes through its batch.
#[derive(Debug, Clone, Copy)]
pub(super) enum Direction {
    /// In order, each stage into its successor.
    Right,
    /// From the last of `count` stages on: each takes in its successor, then its own rows.
    Left { count: usize },
}

/// What a sweep does at a stage; slots are those of the batch. Implementations mark everything `#[inline(always)]`.
pub(super) trait Steps {
    /// Why a stage cannot be eliminated.
    type Failure;
    /// Adds the rows of the stage to the front.
    fn add_rows<S: Simd>(&mut self, simd: S, slot: usize);
    /// Starts the next stage, and adds the transition of `slot` to it and to the front.
    fn add_transition<S: Simd>(&mut self, simd: S, slot: usize, at_front: Front);
    /// Eliminates the front into the next stage, which takes its place; what is kept of it is that of `slot`.
    fn eliminate<S: Simd>(&mut self, simd: S, slot: usize) -> Result<(), Self::Failure>;
}

/// Goes through a batch of which so many stages are eliminated. A failure comes with its slot.
#[inline(always)]
pub(super) fn walk<S: Simd, W: Steps>(
    simd: S,
    work: &mut W,
    direction: Direction,
    eliminated: usize,
) -> Result<(), (usize, W::Failure)> {
    if let Direction::Left { count } = direction {
        for slot in eliminated..count {
            work.add_rows(simd, slot);
        }
    }
    for turn in 0..eliminated {
        let (slot, at_front) = match direction {
            Direction::Right => (turn, Front::Source),
            Direction::Left { .. } => (eliminated - 1 - turn, Front::Successor),
        };
        if at_front == Front::Source {
            work.add_rows(simd, slot);
        }
        work.add_transition(simd, slot, at_front);
        work.eliminate(simd, slot).map_err(|failure| (slot, failure))?;
        if at_front == Front::Successor {
            work.add_rows(simd, slot);
        }
    }
    Ok(())
}
