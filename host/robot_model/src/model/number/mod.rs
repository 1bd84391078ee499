//! Scalars of the equations: numbers with their derivatives, formulas that are written down, and the elementary functions of both.

pub(super) mod elementary;
pub mod expression;
pub(super) mod quantity;
