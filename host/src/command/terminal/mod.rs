//! How a verb speaks with its user: text, files, Ctrl-C, exit codes.

pub(super) mod exit;
pub(super) mod interrupt;
pub(super) mod output;
pub(super) mod ui;
