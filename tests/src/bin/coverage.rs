//! How often 95 % intervals hold the truth: many simulated recordings, calibrated, counted.
//!
//! ```sh
//! cargo run --release -p tests --bin coverage                          # 200 recordings with process noise
//! cargo run --release -p tests --bin coverage -- --process-noise 0     # without
//! ```
//!
//! Appends a line of JSON a recording to a file and leaves out those that it holds already: it may be stopped and started again.

use std::process::ExitCode;

use tests::coverage::{Table, study};
use tests::study::Arguments;

const USAGE: &str = "coverage [--runs N] [--first SEED] [--process-noise SCALE] [--workers N] [--out FILE.jsonl]";

fn main() -> ExitCode {
    let (mut runs, mut process_noise) = (200_u64, 1.0_f64);
    let understood = Arguments::read(USAGE, "coverage.jsonl", |name, value| match name {
        "--runs" => value.parse().map(|n| runs = n).is_ok(),
        "--process-noise" => value.parse().map(|n| process_noise = n).is_ok() && process_noise >= 0.0,
        _ => false,
    });
    let Some(Arguments { first, workers, out }) = understood else { return ExitCode::from(2) };
    let outcomes = study(&out, first, runs, process_noise, workers, |done| eprint!("\r{done} of {runs}"));
    eprintln!();
    match outcomes {
        Ok(outcomes) => {
            let converged = outcomes.iter().filter(|outcome| outcome.status == "converged").count();
            println!("{} recordings, process noise {process_noise}, {converged} converged\n", outcomes.len());
            print!("{}", Table::of(&outcomes));
            ExitCode::SUCCESS
        }
        Err(error) => {
            eprintln!("{}: {error}", out.display());
            ExitCode::from(3)
        }
    }
}
