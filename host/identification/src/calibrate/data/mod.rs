//! The samples of recordings as one chain of stages, with the instants of readings.

pub(crate) mod instants;
pub(crate) mod series;
pub(crate) mod stamps;
