mod compiled;
mod files;
mod fixtures;
mod mujoco;
mod real;
mod traced;
