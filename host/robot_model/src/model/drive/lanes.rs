//! The local variables that one drive with its laws depends on, each a lane of its derivatives.
//!
//! ```text
//! lanes of joint i   | q q̇ θ θ̇ | seven coefficients | supply voltage | parameters of laws | own states of laws | error of the input |
//! ```

use super::{Action, Coefficients};
use crate::model::Input;
use crate::model::law::{FEW, MANY, SOME};
use crate::robot::chain::Lanes;

/// Lanes: four sides of a transmission and its seven coefficients are all that the base law of one drive depends on …
pub(in crate::model) const COEFFICIENTS: usize = 4;
pub(in crate::model) const BASE: usize = COEFFICIENTS + Coefficients::<f64>::COUNT;
/// … laws depend on the supply and on their own.
pub(in crate::model) const VOLTS: usize = BASE;
pub(in crate::model) const OWN: usize = VOLTS + 1;

/// Most parameters and states of laws at one joint.
pub(in crate::model) const MOST_VARIABLES: usize = MANY - OWN;
/// As many of them need few lanes, or some.
pub(in crate::model) const FEW_VARIABLES: usize = FEW - OWN;
/// See there.
pub(in crate::model) const SOME_VARIABLES: usize = SOME - OWN;

/// The action of one drive with derivatives by so many lanes.
pub(in crate::model) trait Drives<const N: usize, const V: usize> {
    fn drive(&self, i: usize, x: &[f64], input: &Input<'_>, volts: f64, rates: &mut [Lanes<N>; V]) -> Action<Lanes<N>>;
}

/// A result of a drive.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::model) enum Output {
    /// The torque on the link.
    Torque,
    /// What stands beside it in an [`Action`].
    Motor,
    /// The rate of one of the laws' own states at the joint, by its number there.
    Rate(usize),
}
