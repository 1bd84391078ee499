//! The noise of sensors and of the model's steps from the recording, and readings that no noise explains.

pub(crate) mod floor;
pub(crate) mod outliers;
mod pushes;
pub(crate) mod reml;
pub(crate) mod windows;
