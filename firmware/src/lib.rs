//! The control core of the robot: everything that knows no chip.
#![cfg_attr(not(test), no_std)]

pub mod driver;
