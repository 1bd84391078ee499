//! Sizes of a problem, and the columns that its unknowns get.

use super::error::SolveError;
use super::kernel::{MAX_STAGE_SIZE, groups};
use crate::simd::LANES;

/// Stages that are linearised together.
pub const BATCH: usize = LANES;

/// Sizes of the blocks.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Shape {
    /// Number of stages N.
    pub stages: usize,
    /// Unknowns of a stage, n.
    pub stage: usize,
    /// Shared unknowns, m.
    pub border: usize,
    /// How many of the shared unknowns, the first ones, transitions depend on.
    pub leading: usize,
    /// How many of a stage's unknowns, the first ones, its sensor rows depend on.
    pub sensed: usize,
}

/// The columns that the solver gives them.
#[derive(Debug, Clone, Copy)]
pub(super) struct Columns {
    pub shape: Shape,
    /// The unknowns of a stage, rounded up to whole groups, and these groups.
    pub padded_stage: usize,
    pub stage_groups: usize,
    /// Groups of the shared unknowns.
    pub border_groups: usize,
    /// Groups of them that transitions touch.
    pub leading_groups: usize,
    /// The first of them that sensor rows touch.
    pub sensor_group: usize,
    /// Groups of the stage that sensor rows touch.
    pub sensed_groups: usize,
}

impl Columns {
    pub(super) fn of(shape: Shape) -> Result<Self, SolveError> {
        let stage = shape.stage;
        if stage > MAX_STAGE_SIZE {
            return Err(SolveError::StageTooLarge { stage });
        }
        let padded_stage = stage.next_multiple_of(LANES);
        Ok(Columns {
            shape,
            padded_stage,
            stage_groups: groups(padded_stage),
            border_groups: groups(shape.border),
            leading_groups: groups(shape.leading),
            sensor_group: shape.leading / LANES,
            sensed_groups: groups(shape.sensed),
        })
    }

    /// Groups of the shared unknowns with the right-hand side as the column behind them.
    pub(super) fn groups_with_right(&self) -> usize {
        groups(self.shape.border + 1)
    }

    /// Groups of a front: the stage, the one it is eliminated into, the border.
    #[inline(always)]
    pub(super) fn front(&self) -> usize {
        2 * self.stage_groups + self.border_groups
    }
}
