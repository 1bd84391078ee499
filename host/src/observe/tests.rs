//! The observer on simulated robots.
