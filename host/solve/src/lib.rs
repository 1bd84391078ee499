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
//!
//! # A pendulum
//!
//! Its angle is read every 10 ms with an error of 1 mrad. All its angles and speeds, g/l and its damping are estimated together:
//!
//! ```
//! use solve::levenberg::{Settings, minimise};
//! use solve::{LeastSquares, Shape, Stage, Step};
//!
//! const T_S: f64 = 0.01;
//! const SIGMA_RAD: f64 = 1e-3;
//! /// What a step may miss: rad and rad/s.
//! const PROCESS: [f64; 2] = [1e-6, 1e-4];
//!
//! struct Pendulum {
//!     read_rad: Vec<f64>,
//! }
//!
//! #[derive(Clone)]
//! struct Point {
//!     states: Vec<[f64; 2]>,
//!     shared: [f64; 2],
//! }
//!
//! fn step([angle, speed]: [f64; 2], [stiffness, damping]: [f64; 2]) -> [f64; 2] {
//!     let next = speed - T_S * (stiffness * angle.sin() + damping * speed);
//!     [angle + T_S * next, next]
//! }
//!
//! impl LeastSquares for Pendulum {
//!     type Point = Point;
//!     type Scratch = ();
//!
//!     fn scratch(&self) {}
//!
//!     fn shape(&self) -> Shape {
//!         Shape { stages: self.read_rad.len(), stage: 2, border: 2, leading: 2, sensed: 1 }
//!     }
//!
//!     fn linearise(&self, at: &Point, first: usize, _: &mut (), batch: &mut [Stage]) {
//!         for (k, stage) in (first..).zip(batch) {
//!             stage.clear();
//!             let [angle, speed] = at.states[k];
//!             stage.unit_row(0, 1.0 / SIGMA_RAD, (angle - self.read_rad[k]) / SIGMA_RAD);
//!             let Some(next) = at.states.get(k + 1) else { continue };
//!             let [stiffness, damping] = at.shared;
//!             let reached = step(at.states[k], at.shared);
//!             let slopes = [-T_S * stiffness * angle.cos(), 1.0 - T_S * damping, -T_S * angle.sin(), -T_S * speed];
//!             for i in [0, 1] {
//!                 let w = 1.0 / PROCESS[i];
//!                 // The angle follows from the new speed.
//!                 let of = |slope: f64| if i == 0 { w * T_S * slope } else { w * slope };
//!                 let mut row = stage.transition_row(i, w, w * (reached[i] - next[i]));
//!                 row.add_state(0, of(slopes[0]) + if i == 0 { w } else { 0.0 });
//!                 row.add_state(1, of(slopes[1]));
//!                 row.add_shared(0, of(slopes[2]));
//!                 row.add_shared(1, of(slopes[3]));
//!             }
//!         }
//!     }
//!
//!     fn cost(&self, at: &Point, stages: std::ops::Range<usize>, _: &mut ()) -> f64 {
//!         let of_stage = |k: usize| {
//!             let read = (at.states[k][0] - self.read_rad[k]) / SIGMA_RAD;
//!             let missed = at.states.get(k + 1).map_or(0.0, |next| {
//!                 let reached = step(at.states[k], at.shared);
//!                 (0..2).map(|i| ((reached[i] - next[i]) / PROCESS[i]).powi(2)).sum()
//!             });
//!             0.5 * (read * read + missed)
//!         };
//!         stages.map(of_stage).sum()
//!     }
//!
//!     fn retract(&self, from: &Point, step: &Step, to: &mut Point) {
//!         for (k, state) in to.states.iter_mut().enumerate() {
//!             *state = [0, 1].map(|i| from.states[k][i] + step.states[2 * k + i]);
//!         }
//!         to.shared = [0, 1].map(|j| from.shared[j] + step.border[j]);
//!     }
//! }
//!
//! let truth = [9.81 / 0.7, 0.2];
//! let mut state = [1.0, 0.0];
//! let read_rad: Vec<f64> = (0..1000)
//!     .map(|k| {
//!         state = step(state, truth);
//!         state[0] + SIGMA_RAD * f64::from(k * 37 % 11 - 5) / 3.2
//!     })
//!     .collect();
//! let states = read_rad.iter().map(|angle| [*angle, 0.0]).collect();
//! let start = Point { states, shared: [5.0, 1.0] };
//! let solution = minimise(&Pendulum { read_rad }, start, &[], &Settings::default(), |_, _| {})?;
//! let [stiffness, damping] = solution.point.shared;
//! assert!((stiffness / truth[0] - 1.0).abs() < 1e-3 && (damping - truth[1]).abs() < 1e-3);
//! // The information of the shared unknowns, whose inverse is their covariance.
//! assert_eq!(solution.information.len(), 4);
//! # Ok::<(), solve::error::SolveError>(())
//! ```
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
