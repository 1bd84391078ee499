//! The `host` binary: the verbs of the command line.
#![forbid(unsafe_code)]

use std::process::ExitCode;

fn main() -> ExitCode {
    host::command::main()
}
