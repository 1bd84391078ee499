mod compiled;
mod files;
pub(crate) mod fixtures;
mod mujoco;
mod real;
mod traced;
