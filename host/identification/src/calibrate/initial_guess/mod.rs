//! Where the search for the estimate starts.

pub(crate) mod equilibrium;
pub(crate) mod own_states;
pub(crate) mod start;
pub(crate) mod torque_start;
