//! How much more a planned motion tells of effects that look alike: every pair of the catalogue on the three-joint robot, planned from its description.
//!
//! ```sh
//! cargo run --release -p tests --bin separation                  # one round of search
//! cargo run --release -p tests --bin separation -- --rounds 4    # as `host plan` does
//! ```
//!
//! Appends a line of JSON a pair to a file and leaves out those that it holds already: it may be stopped and started again.

use std::process::ExitCode;

use tests::separation::{Table, study};
use tests::study::Arguments;

const USAGE: &str = "separation [--rounds N] [--workers N] [--out FILE.jsonl]";

fn main() -> ExitCode {
    let mut rounds = 1_usize;
    let understood = Arguments::read(USAGE, "separation.jsonl", |name, value| {
        name == "--rounds" && value.parse().map(|n| rounds = n).is_ok()
    });
    let Some(Arguments { workers, out, .. }) = understood else { return ExitCode::from(2) };
    match study(&out, rounds, workers, |done| eprint!("\r{done} pairs")) {
        Ok(mut outcomes) => {
            eprintln!();
            outcomes.sort_by(|a, b| a.pair.cmp(&b.pair));
            print!("{}", Table(&outcomes));
            ExitCode::SUCCESS
        }
        Err(error) => {
            eprintln!("{}: {error}", out.display());
            ExitCode::from(3)
        }
    }
}
