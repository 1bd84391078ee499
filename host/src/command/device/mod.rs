//! Verbs that speak to a device over a serial line, real or simulated.

pub(super) mod bringup;
mod connection;
pub(super) mod ports;
pub(super) mod push;
pub(super) mod record;
pub(super) mod simulate;
pub(super) mod watch;
