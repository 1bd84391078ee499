//! What the robot's build and the motion let the sensors see.

pub(crate) mod identify;
pub(crate) mod noise_free;
pub(crate) mod observability;
