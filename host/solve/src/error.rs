//! Why a problem cannot be solved.

use super::kernel::{MAX_STAGE_SIZE, Pivot};

/// Why an elimination failed: a stage that its residuals do not determine.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Singular {
    /// The stage.
    pub stage: usize,
    /// The pivot that was not positive.
    pub pivot: Pivot,
}

/// Why a problem cannot be solved at all.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum SolveError {
    /// A stage is larger than what the solver is made for.
    #[error("a stage has {stage} unknowns, the solver is made for at most {MAX_STAGE_SIZE}")]
    StageTooLarge {
        /// Unknowns of a stage.
        stage: usize,
    },
    /// A stage stays undetermined however strongly its states are damped: a residual there is not finite.
    #[error("stage {stage}: unknown {unknown} is not determined by its residuals (pivot {pivot:e})")]
    Undetermined {
        /// The stage.
        stage: usize,
        /// Index of the unknown in the stage.
        unknown: usize,
        /// The pivot that was not positive.
        pivot: f64,
    },
    /// [`Settings::stop`](crate::levenberg::Settings::stop) was set.
    #[error("the search was stopped")]
    Stopped,
}

impl From<Singular> for SolveError {
    fn from(Singular { stage, pivot }: Singular) -> Self {
        SolveError::Undetermined { stage, unknown: pivot.index, pivot: pivot.value }
    }
}
