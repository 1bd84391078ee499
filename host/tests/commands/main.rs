//! Stories of commands as users meet them: files, refusals, exit codes, the documents' worked examples.

mod command_line;
mod observe;
#[path = "../program/mod.rs"]
mod program;
mod recordings;
mod verify;
