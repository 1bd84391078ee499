//! What a problem hands to the solver: its sizes, its [`Stage`]s, what they cost, and a retraction.

use std::ops::Range;

use super::shape::Shape;
use super::stage::Stage;

/// A step in tangent space: `states[k·n + i]` and `border[j]`.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Step {
    /// Change of every stage's unknowns, `stages × n`, row-major.
    pub states: Vec<f64>,
    /// Change of the shared unknowns, m.
    pub border: Vec<f64>,
}

impl Step {
    /// Multiplies all of it.
    pub(super) fn scale(&mut self, factor: f64) {
        for value in self.states.iter_mut().chain(&mut self.border) {
            *value *= factor;
        }
    }
}

/// A least-squares problem on a chain with a border: minimise ½ Σ r² over all stages and the shared unknowns.
pub trait LeastSquares: Sync {
    /// A point of the search space (states and shared unknowns, manifolds included).
    type Point: Clone + Send + Sync;
    /// Room for intermediate values: one a thread.
    type Scratch;

    /// Makes a scratch space.
    fn scratch(&self) -> Self::Scratch;

    /// Sizes.
    fn shape(&self) -> Shape;

    /// Fills `batch` with the stages from `first` on: their rows, and their transitions where they are linked to the next stage (not at
    /// a gap, nor at the last stage). The stages come as they were used last: [`Stage::clear`] them. `first` is a multiple of [`BATCH`](crate::BATCH).
    fn linearise(&self, point: &Self::Point, first: usize, scratch: &mut Self::Scratch, batch: &mut [Stage]);

    /// Adds whitened residual rows of the border alone (priors on shared unknowns) to `stage`, and no transition; no rows by default.
    fn border_rows(&self, _point: &Self::Point, _stage: &mut Stage) {}

    /// ½ Σ r² of the residuals that start at `stages` (their rows and their transitions). `stages` starts at a multiple of [`BATCH`](crate::BATCH).
    fn cost(&self, point: &Self::Point, stages: Range<usize>, scratch: &mut Self::Scratch) -> f64;

    /// ½ Σ r² of the border's own rows.
    fn border_cost(&self, _point: &Self::Point) -> f64 {
        0.0
    }

    /// Makes `to` the point reached from `point` by `step`, x ⊞ δ.
    fn retract(&self, point: &Self::Point, step: &Step, to: &mut Self::Point);
}
