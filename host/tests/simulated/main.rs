//! Stories about simulated robots whose true parameters are known.

mod extensions;
mod gyro_time;
mod link_encoder;
mod measured_inputs;
mod noise;
mod plausibility;
#[path = "../program/mod.rs"]
mod program;
mod rates;
mod verify_recordings;
