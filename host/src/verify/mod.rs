//! How well a calibrated model predicts a recording: the free run of the paper's section 5.2 and windowed predictions.

pub mod filter;
pub mod free_run;
pub mod metrics;
pub mod stage;
pub mod system;
pub mod window;

#[cfg(test)]
mod tests;
