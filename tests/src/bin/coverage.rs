//! How often 95 % intervals hold the truth: many simulated recordings, calibrated, counted.
//!
//! ```sh
//! cargo run --release -p tests --bin coverage                          # 200 recordings with process noise
//! cargo run --release -p tests --bin coverage -- --process-noise 0     # without
//! ```
//!
//! Appends a line of JSON a recording to a file and leaves out those that it holds already: it may be stopped and started again.

use std::path::PathBuf;
use std::process::ExitCode;

use tests::coverage::{Table, study};

const USAGE: &str = "coverage [--runs N] [--first SEED] [--process-noise SCALE] [--workers N] [--out FILE.jsonl]";

fn main() -> ExitCode {
    let (mut runs, mut first, mut process_noise, mut workers) = (200_u64, 1_u64, 1.0_f64, 2_usize);
    let mut out = PathBuf::from("coverage.jsonl");
    let mut arguments = std::env::args().skip(1);
    while let Some(name) = arguments.next() {
        let value = arguments.next().unwrap_or_default();
        let understood = match name.as_str() {
            "--runs" => value.parse().map(|n| runs = n).is_ok(),
            "--first" => value.parse().map(|n| first = n).is_ok(),
            "--process-noise" => value.parse().map(|n| process_noise = n).is_ok() && process_noise >= 0.0,
            "--workers" => value.parse().map(|n| workers = n).is_ok(),
            "--out" => {
                !value.is_empty() && {
                    out = PathBuf::from(&value);
                    true
                }
            }
            _ => false,
        };
        if !understood {
            eprintln!("`{name} {value}` is not understood\nusage: {USAGE}");
            return ExitCode::from(2);
        }
    }
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
