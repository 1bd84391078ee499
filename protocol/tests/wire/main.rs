//! The wire as both sides see it: golden bytes, round trips, damage, bounds.

mod examples;
mod golden;
mod messages;
