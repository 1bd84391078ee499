//! Robots with elastic joints: what a description file says, the equations with exact derivatives, and what a robot may have beyond them.
//!
//! ```text
//! robot file, URDF ─▶ robot::Robot ─▶ model::Model ─▶ model::Dynamics (at parameters z) ─▶ model::Stepper ─▶ the next state, its slopes
//!                                          ▲                                              model::SensorFrame ─▶ readings
//!                     effect::CATALOGUE ───┘ laws that extend the model, and their physics for a plant
//! ```
//!
//! * [`robot`]: the description, its chain and inertia, its sensors and parameters. Numbers are SI, on the link side of gears.
//! * [`model`]: equations (6) to (12) of *Dynamics Calibration of a Redundant Flexible Joint Robot based on Gyroscopes and Encoders* over any serial chain.
//!   The state is x = (q, q̇, θ, θ̇); z are the coordinates that a calibration estimates.
//! * [`effect`]: the catalogue of what a robot may have beyond the base model, one file an effect.
//!
//! # A second of motion
//!
//! ```
//! use robot_model::effect::Effect;
//! use robot_model::model::{Integrator, Model, Stepper};
//! use robot_model::robot::Robot;
//!
//! let robot = Robot::builtin("one_joint")?;
//! let play = |model: &Model, z: &[f64]| {
//!     let dynamics = model.at(z);
//!     let mut stepper = Stepper::new(Integrator::RungeKutta4);
//!     let mut x = vec![0.0; model.layout().size()];
//!     let mut next = x.clone();
//!     for _ in 0..1000 {
//!         // A fifth of the supply, for a millisecond.
//!         stepper.step(&dynamics, &x, &[0.2][..], robot.sample_period_s, &mut next);
//!         std::mem::swap(&mut x, &mut next);
//!     }
//!     x[model.layout().q(0)]
//! };
//! let base = Model::new(&robot);
//! let turned_rad = play(&base, &base.coordinates().start());
//!
//! // The same robot with a drag of 2 N m s²/rad². A law's own coordinates are the last ones.
//! let mut laws = Effect::by_id("quadratic_drag")?.laws(&robot)?;
//! let extended = Model::extended(&robot, vec![laws.swap_remove(0)])?;
//! let mut z = extended.coordinates().start();
//! z[extended.coordinates().first_of_law(0)] = 2.0;
//! assert!(turned_rad > 1.0 && play(&extended, &z) < 0.8 * turned_rad);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! [`Stepper::step_slopes`](model::Stepper::step_slopes) gives the derivatives of a step by x and z, exact to rounding.
#![forbid(unsafe_code)]

pub mod effect;
pub mod model;

pub mod robot;
