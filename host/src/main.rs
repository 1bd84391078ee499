//! The `host` binary: the verbs of the command line.
fn main() {}
