//! The catalogue of effects that a robot may have beyond the base model: one file each.
