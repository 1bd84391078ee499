//! The serial line of a simulated robot: a pseudo-terminal, the bytes at the line's rate, and what is lost on the way.

pub(super) mod line;
pub(super) mod pty;
pub(super) mod session;
