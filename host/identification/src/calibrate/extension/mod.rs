//! Models extended by laws of effects: where they start, trials of them on one frozen noise, and scores of laws that are not in the model.

pub(crate) mod bench;
pub(crate) mod blocks;
#[cfg(test)]
mod fixture;
pub(crate) mod laws;
pub(crate) mod others;
pub(crate) mod scores;
pub(crate) mod trial;
pub(crate) mod trimmed;
pub(crate) mod warm_start;
pub(crate) mod worst;
