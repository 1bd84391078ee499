//! Motions: how the player turns uploaded segments into duties, and the presets of the paper.

mod player;
pub mod preset;
pub(crate) mod sine;

pub use player::{Player, Positions, Step};
