//! The control core of the robot: everything that knows no chip.
//!
//! A sample's way, from the sensors to the line, and a command's way back to the motors:
//!
//! ```text
//!   bus words ─▶ driver ─▶ Inputs ─▶ ┌──────────────────────────────────────┐ ─▶ Sample ─▶ Telemetry ─▶ bytes
//!   counters ──────────────────────▶ │ ControlLoop::tick, every millisecond │
//!   stop pin ──────────────────────▶ │ watch · messages · play · lower      │ ◀─ ToDevice ◀─ Receiver ◀─ bytes
//!                                    └──────────────────┬───────────────────┘
//!                                                       ▼ Outputs: duties for the next tick, or stop at once
//! ```
//!
//! Principles:
//! * Time is an argument. Nothing here reads a clock, a pin or a bus but the drivers, and those through `embedded-hal`.
//! * The tick allocates nothing, waits for nothing and loops over joints and sensors only; see
//!   [`ControlLoop::tick`] for its contract.
//! * Safety stands last before the pin and can only lower a duty; every stop is zero duty and a reason.
//! * Integer arithmetic in the tick: the same inputs give the same outputs on every machine, bit for bit.
//!
//! Navigating: [`control`] is the tick and what it does with requests, [`motion`] the player and the presets,
//! [`safety`] the watches and limits, [`driver`] the gyroscopes and counters, [`queues`] what connects the tasks,
//! [`config`] and [`robot`] a robot's figures, [`description`] and [`store`] those that a host sends and the flash keeps,
//! [`constants`] every other number with its derivation, [`wiring`] what a
//! board provides, with the parts of a board that need no chip. The boards and the image are the binary of this crate.
//!
//! ```
//! use firmware::safety::Axis;
//! use firmware::{Config, ControlCore, Inputs, JointSetup};
//! use protocol::{EncoderInfo, Side, motion::Limits};
//!
//! let joint = JointSetup::new(Limits { min: -1.0, max: 1.0 }, Axis::Turns([0.0, 0.0, 1.0]));
//! let encoder = EncoderInfo { joint: 0, side: Side::Motor, counts_per_turn: 4096, gear: 50.0, offset_us: 0 };
//! let mut core = ControlCore::new(&Config::new("one_joint", &[joint], &[encoder], &[]).unwrap());
//! let mut inputs = Inputs::default();
//! inputs.encoders[0] = Some(0);
//! for k in 0..10 {
//!     let outputs = core.tick(1000 * k, &inputs);
//!     assert!(!outputs.stop && outputs.duty[0] == protocol::Duty::ZERO);
//! }
//! let mut line = [0; protocol::message::MAX_TO_HOST_FRAME];
//! assert!(core.transmit(&mut line) > 0, "the device tells that it started");
//! ```
#![cfg_attr(not(test), no_std)]
#![forbid(unsafe_code)]

mod app;
mod check;
pub mod config;
pub mod constants;
pub mod control;
pub mod description;
pub mod driver;
pub mod lockstep;
pub mod motion;
pub mod queues;
mod receive;
pub mod robot;
pub mod safety;
mod speed;
pub mod store;
mod telemetry;
pub mod wiring;

pub use app::{ControlCore, RAM_BUDGET};
pub use check::check;
pub use config::{Config, ConfigError, GyroSetup, JointSetup};
pub use control::{ControlLoop, Inputs, Nearness, Outputs};
pub use description::Hardware;
pub use receive::{ReceiveCounts, Receiver};
pub use safety::GyroInput;
pub use telemetry::Telemetry;
