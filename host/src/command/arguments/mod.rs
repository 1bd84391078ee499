//! Arguments of several verbs.

mod choices;
pub use choices::Choice;

pub mod fitness;
