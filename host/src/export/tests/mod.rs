mod compiled;
mod fixtures;
mod real;
mod traced;
