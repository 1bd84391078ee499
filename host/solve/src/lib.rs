//! Nonlinear least squares on a chain of stages with a border of shared unknowns. Knows numbers only.
//!
//! ```text
//!   stage 0 ── stage 1 ── stage 2 ─┐ break ┌─ stage 3 ── stage 4        n unknowns each
//!      └──────────┴──────────┴─────┴───────┴─────┴──────────┘
//!                          border: m shared unknowns
//! ```
//!
//! Residuals touch one stage and the border, or carry a stage into the next one, `x[k+1] = φ(x[k], p)`: a problem fills them into [`Stage`]s.
//! The Gauss–Newton matrix is then block tridiagonal with a dense border, and one elimination sweep costs O(N):
//! [`factor`] runs it from both ends inwards on two threads, [`border`] holds what is left for the shared unknowns (the Schur
//! complement, which is their information matrix), [`levenberg`] iterates, near the end by an old factor (`renew`), [`kernel`] has the small
//! dense loops. From the finished factor,
//! [`columns`] eliminates the states from further columns beside the Jacobian, and [`inverse`] has the log-determinant and the blocks of
//! the inverse. [`simd`] is the vector that the loops are written in, [`threads`] runs two halves at once.
#![forbid(unsafe_code)]

pub mod border;
pub mod columns;
pub mod error;
pub mod factor;
pub mod inverse;
pub mod kernel;
pub mod levenberg;
mod problem;
mod renew;
mod shape;
pub mod simd;
mod stage;
mod store;
mod sweep;
#[cfg(test)]
mod tests;
pub mod threads;
mod walk;

pub use problem::{LeastSquares, Step};
pub use shape::{BATCH, Shape};
pub use stage::{Row, RowAt, Stage};
pub use store::Precision;
