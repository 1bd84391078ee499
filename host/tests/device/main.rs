//! Stories of the commands that speak to a device: the binary against a scripted one, or against simulated robots.

mod bringup;
#[path = "../../src/link/tests/peer.rs"]
#[allow(dead_code, reason = "the link's own tests use the rest of it")]
mod peer;
#[path = "../program/mod.rs"]
#[allow(dead_code, reason = "other tests read results, too")]
mod program;
mod push;
mod watch;
