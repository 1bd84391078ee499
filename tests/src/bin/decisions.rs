//! What half and twice of the constants of a diagnosis would have decided otherwise.
//!
//! ```sh
//! cargo run --release -p tests --bin hidden -- --workers 1 --log debug 2> hidden.log
//! cargo run --release -p tests --bin decisions -- hidden.log
//! ```
//!
//! Reads logs of one diagnosis after the other (`--workers 1`, or `host -vv diagnose`).

use std::process::ExitCode;

use tests::decisions::Decisions;

fn main() -> ExitCode {
    let mut log = String::new();
    for path in std::env::args().skip(1) {
        match std::fs::read_to_string(&path) {
            Ok(text) => log.push_str(&text),
            Err(error) => {
                eprintln!("{path}: {error}");
                return ExitCode::from(3);
            }
        }
    }
    print!("{}", Decisions::of(&log));
    ExitCode::SUCCESS
}
