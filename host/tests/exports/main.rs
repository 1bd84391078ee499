//! Stories about calibrated models in other tools.

mod casadi;
mod command;
mod fmu;
#[path = "../program/mod.rs"]
mod program;
