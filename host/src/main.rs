//! The `host` binary: the verbs of the command line.

use std::process::ExitCode;

fn main() -> ExitCode {
    host::command::main()
}
