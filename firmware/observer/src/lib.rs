//! The state of a calibrated robot from its readings, tick by tick: an extended Kalman filter, `no_std`, without allocation, and the same code on the
//! chip and on a PC.
//!
//! ```text
//!   readings z_k ─▶ update  (factor) ─▶ x_k|k, NIS ─▶ watchdog ─▶ event
//!   input    u_k ─▶ predict (flow, factor) ─▶ x_k+1|k
//!                      ▲
//!                    Model: ẋ = f(x, u, t), y = h(x, u, t) and their derivatives by x; a Table of numbers is one
//! ```
//!
//! **State.** x holds the components that move (q, q̇, θ, θ̇ and what effects add), then constants (the biases of gyros).
//!
//! **Covariance.** P = U D Uᵀ, see [`factor`](Factor). P has no negative variance however numbers round, and single precision is enough.
//!
//! **Step.** Exponential Rosenbrock steps, see [`Observer::predict`]: exact for what is linear, stable where friction is steep.
//!
//! **Numbers.** Everything is generic over [`Real`]: `f32` on the robot, `f64` as its reference in tests. Additions and multiplications are those of
//! IEEE 754 and are never contracted, and [`Real`] computes its own sines; so the same readings give the same bytes on every machine.
#![no_std]
#![forbid(unsafe_code)]

#[cfg(test)]
extern crate std;

mod factor;
mod flow;
mod model;
mod observer;
mod real;
mod tape;
#[cfg(test)]
mod tests;
mod watchdog;

pub use factor::Factor;
pub use model::{Input, Model};
pub use observer::{Innovation, Observer, ObserverError, Sensors, Settings, Start};
pub use real::Real;
pub use tape::{Instruction, Operation, Output, Table, TableError, TableModel, Tape};
pub use watchdog::Watchdog;

/// The text of [`Real`]'s module, which generated programs carry along.
pub const REAL_SOURCE: &str = include_str!("real.rs");
