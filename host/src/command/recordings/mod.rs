//! Verbs that read and write tables and recordings.

pub(super) mod check;
pub(super) mod import;
pub(super) mod repair;
pub(super) mod table;
