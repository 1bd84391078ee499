//! Scores of laws that are not in the model, from the sums of blocks of time, and what they are worth: cross-validation, significance, stability.

pub mod block_scores;
pub mod cross_validation;
pub mod events;
pub mod jackknife;
pub mod significance;
pub mod stability;
