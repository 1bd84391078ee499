mod compiled;
mod files;
pub(crate) mod fixtures;
mod fmu;
mod mujoco;
mod real;
mod traced;
