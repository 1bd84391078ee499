//! The core as a user meets it: a host at the other end of the line, a robot at its pins.

mod bench;
mod descriptions;
mod faults;
mod jogs;
mod motions;
mod parts;
mod plant;
mod requests;
mod runaway;
