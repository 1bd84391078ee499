//! Arguments of several verbs.

mod choices;
pub mod fitness;
