//! The robots that an image can be built for.

mod doggy;

pub use doggy::{GYRO_RANGE, GYROS, HARDWARE, JOINTS, doggy};
